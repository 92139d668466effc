"""Parameter sweep: one parameter over its range, all others fixed."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from spinscope.pipeline.errors import ParameterError
from spinscope.pipeline.metrics import EstimateMetrics, RunMetrics
from spinscope.pipeline.parameters import Tunable
from spinscope.pipeline.registry import Parameters
from spinscope.pipeline.session import Session

from .clip_run import MOST_FRAMES_BYTES, run_clip

MOST_POINTS = 101
# From this ratio of the ends on, a range is spread by equal ratios; from 0, by the cube, which is as fine near 0.
LOGARITHMIC_FROM = 100

# Distances from the outline inwards: beyond the radius nothing of the ball is left.
INSIDE_THE_BALL = ("logo.pad_px", "logo.fixed_pad_px", "logo.rim_pad_px", "logo.fixed_rim_pad_px")

Value = bool | int | float | str
Scale = Literal["linear", "logarithmic", "cubic", "none"]


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepPoint:
    """Metrics of a run with one value; only `error` where the value does not go with the others."""

    value: Value
    error: str | None = None
    tracked_share: float | None = None
    residual_px: float | None = None
    jitter_px: float | None = None
    logo_events: int | None = None
    best: str | None = None
    spin: dict[str, EstimateMetrics] = dataclasses.field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class ParameterSweep:
    """The points of a sweep so far.

    Attributes
    ----------
    name : str
        Name of the parameter, stage.field.
    total : int
        Number of points when the sweep is complete.
    """

    name: str
    total: int
    points: list[SweepPoint]


def declaration(parameters: Parameters, name: str) -> Tunable:
    """Declaration of the parameter `stage.field`; raises ParameterError for an unknown name or a list of numbers."""
    stage, _, field = name.partition(".")
    found = parameters.group(stage).tunables().get(field)
    if found is None:
        raise ParameterError(f"{name} is unknown: choose a parameter of the page")
    if found.kind == "numbers":
        raise ParameterError(f"{name} is a list of numbers: choose a parameter with one value")
    return found


def sensible_highs(metrics: RunMetrics) -> dict[str, float]:
    """Upper ends, below the declared ones, of ranges that make sense for the ball that a run saw."""
    shot = metrics.main_shot
    if shot is None or shot.radius_px is None:
        return {}
    return dict.fromkeys(INSIDE_THE_BALL, max(math.floor(shot.radius_px) - 1.0, 0.0))


def scale_of(declared: Tunable) -> Scale:
    """Scale of a parameter's range: linear, logarithmic or cubic; none where the range is open."""
    low, high = declared.low, declared.high
    if declared.kind not in ("number", "whole number") or low is None or high is None:
        return "none"
    if low > 0 and high / low >= LOGARITHMIC_FROM:
        return "logarithmic"
    if low == 0 and declared.step and high / declared.step > LOGARITHMIC_FROM:
        return "cubic"
    return "linear"


def sweep_values(declared: Tunable, name: str, low: float | None, high: float | None, points: int) -> list[Value]:
    """Values of a sweep, rising.

    Parameters
    ----------
    declared : Tunable
        Declaration of the parameter.
    name : str
        Name of the parameter, for messages.
    low, high : float or None
        Ends of the range; None for the declared ones.
    points : int
        Number of values of a number; choices and switches take all of theirs.

    Raises
    ------
    ParameterError
        For an empty range or too many points.
    """
    if declared.kind == "choice":
        return list(declared.choices)
    if declared.kind == "switch":
        return [False, True]
    first = declared.low if low is None else declared.checked(name, low)
    last = declared.high if high is None else declared.checked(name, high)
    if first is None or last is None or first >= last:
        raise ParameterError(f"{name} from {first} to {last} is no range: {declared.allowed}")
    if not 2 <= points <= MOST_POINTS:
        raise ParameterError(f"{points} points are out of range: 2 to {MOST_POINTS}")
    spread = scale_of(declared) if low is None and high is None else "linear"
    if spread == "logarithmic" or (first > 0 and last / first >= LOGARITHMIC_FROM):
        found = np.geomspace(first, last, points)
    elif spread == "cubic":
        found = first + (last - first) * np.linspace(0, 1, points) ** 3
    else:
        found = np.linspace(first, last, points)
    if declared.kind == "whole number":
        return sorted({int(value) for value in np.rint(found)})
    return [float(f"{value:.6g}") for value in found]


def sweep(
    session: Session,
    parameters: Parameters,
    name: str,
    values: list[Value],
    report: Callable[[ParameterSweep], None],
    check: Callable[[], None],
) -> ParameterSweep:
    """Run a clip with every value.

    Parameters
    ----------
    report : callable
        Called with the sweep so far, first without points.
    check : callable
        Called between two ticks; may raise to abandon the sweep.
    """
    points: list[SweepPoint] = []
    report(ParameterSweep(name, len(values), []))
    for value in values:
        points.append(_point(session, parameters, name, value, check))
        report(ParameterSweep(name, len(values), list(points)))
    return ParameterSweep(name, len(values), points)


def _point(session: Session, parameters: Parameters, name: str, value: Value, check: Callable[[], None]) -> SweepPoint:
    stage, _, field = name.partition(".")
    try:
        tried = parameters.with_values({stage: {field: value}})
        session.chain.check(tried, MOST_FRAMES_BYTES)
    except ParameterError as error:
        return SweepPoint(value=value, error=str(error))
    metrics = RunMetrics.of(run_clip(session, tried, check))
    shot = metrics.main_shot
    return SweepPoint(
        value=value,
        tracked_share=metrics.tracked_share,
        residual_px=metrics.residual_px,
        jitter_px=metrics.jitter_px,
        logo_events=metrics.logo_events,
        best=shot.best if shot else None,
        spin=shot.spin if shot else {},
    )
