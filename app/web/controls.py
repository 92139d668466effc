"""The controls of the page, made from the parameters' declarations, in the order of the flow."""

from __future__ import annotations

from typing import Any

from spinscope.pipeline.parameters import Tunable
from spinscope.pipeline.registry import Parameters

# How a group of parameters is called where its own name says too little.
TITLES = {
    "surface": "Surface (EROS)",
    "track": "Tracker",
    "logo": "Logo: pad",
    "rate": "Event rate",
    "flow": "t_acc and flow",
}
# Fields that have a section of their own, after their group's.
OWN_SECTIONS = {"surface": {"Cleaning": ("cleaning",)}}
# What belongs to the set-up and not to the method: a preset leaves it alone unless it names it itself.
SETUP_GROUPS = ("camera", "ball")
SETUP = {
    "camera": None,
    "ball": None,
    "track": ("ball", "fixed_x_px", "fixed_y_px", "fixed_radius_px", "fixed_std_px"),
}
# From this ratio of the ends on a slider goes by equal ratios; from 0, by the cube, which is as fine near the start.
LOGARITHMIC_FROM = 100


def sections() -> list[dict[str, Any]]:
    """The page's groups of controls, stage by stage and then the set-up, with all that a control needs to know."""
    parameters = Parameters()
    groups = sorted(parameters.as_dict(), key=lambda name: name in SETUP_GROUPS)
    made = []
    for group in groups:
        declared, own = parameters.group(group).tunables(), OWN_SECTIONS.get(group, {})
        named = {field for fields in own.values() for field in fields}
        rest = tuple(field for field in declared if field not in named)
        for title, fields in {TITLES.get(group, group.capitalize()): rest, **own}.items():
            controls = [_control(group, field, declared[field]) for field in fields]
            made.append({"title": title, "is_setup": group in SETUP_GROUPS, "controls": controls})
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
