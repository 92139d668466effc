"""Controls of the page, made from the declarations of the parameters: the essential ones, then stage by stage."""

from __future__ import annotations

from typing import Any

from spinscope.app.tuning.parameter_sweep import scale_of
from spinscope.pipeline.parameters import Tunable
from spinscope.pipeline.registry import STAGES, Parameters

from .schemas import ControlInfo, SectionInfo

# What the paper tunes (its sections 3.1 to 3.3), and the tick that all times are cut to.
ESSENTIALS = (
    "filter.threshold_us",
    "surface.k_px",
    "logo.pad_px",
    "flow.t_acc_from",
    "flow.t_acc_us",
    "flow.expected_spin_rps",
    "track.tick_us",
)
# Entries of the glossary (static/glossary.md) that explain a section, by its group or title.
TERMS = {
    "Essentials": ("STC", "TRAIL", "EROS", "pad", "t_acc", "tick"),
    "filter": ("STC", "TRAIL", "STC-cut-TRAIL", "flicker"),
    "surface": ("EROS", "TOS", "time surface", "accumulated frame"),
    "Cleaning": ("cleaning",),
    "track": ("track", "Hough circle", "Kalman filter", "fixed ball", "shot"),
    "logo": ("logo", "pad", "ball frame"),
    "rate": ("event rate", "t_acc"),
    "flow": ("t_acc", "triplet", "Triplet Matching", "normal flow", "aperture problem"),
    "spin": ("spin axis", "Triplet Matching", "normal flow", "trusted", "refused"),
    "contrast": ("contrast maximisation", "derotated"),
    "trajectory": ("trajectory",),
    "combined": ("combined", "witness", "trusted"),
    "camera": ("camera", "camera frame"),
    "ball": ("logo", "fixed ball"),
}
# Fields that have a section of their own, after their group's.
OWN_SECTIONS = {"surface": {"Cleaning": ("cleaning",)}}
# Parameters of the set-up and not of the method: a preset leaves it alone unless it names it itself.
SETUP = {
    "camera": None,
    "ball": None,
    "track": ("ball", "fixed_x_px", "fixed_y_px", "fixed_radius_px", "fixed_std_px"),
}


def sections() -> list[SectionInfo]:
    """Groups of controls: the essentials, all others stage by stage, and then the set-up."""
    parameters, of_stages = Parameters(), {stage.group for stage in STAGES}
    made = [SectionInfo(title="Essentials", terms=TERMS["Essentials"], is_open=True, controls=_essentials(parameters))]
    for group in sorted(parameters.as_dict(), key=lambda name: name not in of_stages):
        declared, own = parameters.group(group).tunables(), OWN_SECTIONS.get(group, {})
        named = {field for fields in own.values() for field in fields}
        named |= {name.partition(".")[2] for name in ESSENTIALS if name.startswith(f"{group}.")}
        rest = tuple(field for field in declared if field not in named)
        title = STAGES[group].label if group in STAGES else group.capitalize()
        for heading, fields in {title: rest, **own}.items():
            controls = [_control(group, field, declared[field]) for field in fields]
            terms = TERMS.get(heading) or TERMS.get(group, ())
            made.append(SectionInfo(title=heading, terms=terms, is_open=False, controls=controls))
    return made


def _essentials(parameters: Parameters) -> list[ControlInfo]:
    """Controls of the essential parameters, labelled with their group, too."""
    names = [name.split(".") for name in ESSENTIALS]
    controls = [_control(group, field, parameters.group(group).tunables()[field]) for group, field in names]
    return [
        control.model_copy(update={"label": f"{group} {control.label}"})
        for (group, _), control in zip(names, controls, strict=True)
    ]


def setup_of(parameters: Parameters) -> dict[str, dict[str, Any]]:
    """Values of the set-up: camera, ball, and where a fixed ball is."""
    values = parameters.as_dict()
    return {
        group: {name: value for name, value in values[group].items() if fields is None or name in fields}
        for group, fields in SETUP.items()
    }


def _control(group: str, field: str, declared: Tunable) -> ControlInfo:
    setup = SETUP.get(group, ())
    return ControlInfo(
        name=f"{group}.{field}",
        label=field.removesuffix(_suffix(declared.unit)).replace("_", " "),
        kind=declared.kind,
        default=list(declared.default) if isinstance(declared.default, tuple) else declared.default,
        optional=declared.default is None,
        unit=declared.unit,
        low=declared.low,
        high=declared.high,
        step=declared.step,
        choices=list(declared.choices),
        help=declared.help,
        allowed=declared.allowed,
        scale=scale_of(declared),
        is_setup=setup is None or field in setup,
    )


def _suffix(unit: str) -> str:
    """Suffix of a field's name for a unit: m/s^2 is _m_s2."""
    return "_" + unit.replace("/", "_").replace("^", "").lower()
