"""The controls of the page, made from the parameters' declarations, in the order of the flow."""

from __future__ import annotations

from typing import Any

from pipeline.chain import Parameters
from pipeline.parameters import Tunable

# (title, group, its fields or None for all that no other section names)
SECTIONS: tuple[tuple[str, str, tuple[str, ...] | None], ...] = (
    ("Filter", "filter", None),
    ("Surface (EROS)", "surface", None),
    ("Cleaning", "surface", ("cleaning",)),
    ("Tracker", "track", None),
    ("Logo: pad", "logo", None),
    ("Event rate", "rate", None),
    ("t_acc and flow", "flow", None),
    ("Spin", "spin", None),
    ("Camera", "camera", None),
    ("Ball", "ball", None),
)
# What belongs to the set-up and not to the method: a preset leaves it alone unless it names it itself.
SETUP = {
    "camera": None,
    "ball": None,
    "track": ("ball", "fixed_x_px", "fixed_y_px", "fixed_radius_px", "fixed_std_px"),
}
# From this ratio of the ends on a slider goes by equal ratios; from 0, by the cube, which is as fine near the start.
LOGARITHMIC_FROM = 100


def sections() -> list[dict[str, Any]]:
    """The page's groups of controls with everything that a control needs to know."""
    named = {(group, field) for _, group, fields in SECTIONS for field in fields or ()}
    parameters = Parameters()
    made = []
    for title, group, fields in SECTIONS:
        declared = parameters.group(group).tunables()
        chosen = fields or tuple(field for field in declared if (group, field) not in named)
        controls = [_control(group, field, declared[field]) for field in chosen]
        made.append({"title": title, "controls": controls})
    return made


def setup_of(parameters: Parameters) -> dict[str, dict[str, Any]]:
    """The values of the set-up: camera, ball, and where a fixed ball is."""
    values = parameters.as_dict()
    return {
        group: {name: value for name, value in values[group].items() if fields is None or name in fields}
        for group, fields in SETUP.items()
    }


def _control(group: str, field: str, declared: Tunable) -> dict[str, Any]:
    default = list(declared.default) if isinstance(declared.default, tuple) else declared.default
    return {
        "name": f"{group}.{field}",
        "label": field.removesuffix(_suffix(declared.unit)).replace("_", " "),
        "kind": declared.kind,
        "default": default,
        "optional": declared.default is None,
        "unit": declared.unit,
        "low": declared.low,
        "high": declared.high,
        "step": declared.step,
        "choices": list(declared.choices),
        "help": declared.help,
        "allowed": declared.allowed,
        "scale": scale_of(declared),
    }


def _suffix(unit: str) -> str:
    """How a field's name says its unit: m/s^2 is _m_s2."""
    return "_" + unit.replace("/", "_").replace("^", "").lower()


def scale_of(declared: Tunable) -> str:
    """How a slider's way is spread over the range: linear, logarithmic or cubic; none where it has no end."""
    low, high = declared.low, declared.high
    if declared.kind not in ("number", "whole number") or low is None or high is None:
        return "none"
    if low > 0 and high / low >= LOGARITHMIC_FROM:
        return "logarithmic"
    if low == 0 and declared.step and high / declared.step > LOGARITHMIC_FROM:
        return "cubic"
    return "linear"
