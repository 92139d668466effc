"""The tuning curve: one parameter over its range, everything else as it is."""

from __future__ import annotations

from typing import Any

import numpy as np

from spinscope.pipeline.errors import ParameterError
from spinscope.pipeline.parameters import Tunable
from spinscope.pipeline.registry import Parameters

from .bench import Clip
from .controls import scale_of
from .jobs import Job
from .measures import main_shot, measures
from .runs import finish

MOST_POINTS = 101


def declared(parameters: Parameters, name: str) -> Tunable:
    """The declaration of `stage.field`; raises ParameterError when there is none or it is no single value."""
    stage, _, field = name.partition(".")
    found = parameters.group(stage).tunables().get(field)
    if found is None:
        raise ParameterError(f"{name} is unknown: choose a parameter of the page")
    if found.kind == "numbers":
        raise ParameterError(f"{name} is a list of numbers: choose a parameter with one value")
    return found


def values_over(tunable: Tunable, name: str, low: float | None, high: float | None, points: int) -> list[Any]:
    """The values of a curve, spread as on the slider; raises ParameterError for a range that is none."""
    if tunable.kind == "choice":
        return list(tunable.choices)
    if tunable.kind == "switch":
        return [False, True]
    first = tunable.low if low is None else tunable.checked(name, low)
    last = tunable.high if high is None else tunable.checked(name, high)
    if first is None or last is None or first >= last:
        raise ParameterError(f"{name} from {first} to {last} is no range: {tunable.allowed}")
    if not 2 <= points <= MOST_POINTS:
        raise ParameterError(f"{points} points are out of range: 2 to {MOST_POINTS}")
    spread = scale_of(tunable) if low is None and high is None else "linear"
    if spread == "logarithmic" or (first > 0 and last / first >= 100):
        found = np.geomspace(first, last, points)
    elif spread == "cubic":
        found = first + (last - first) * np.linspace(0, 1, points) ** 3
    else:
        found = np.linspace(first, last, points)
    if tunable.kind == "whole number":
        return sorted({int(value) for value in np.rint(found)})
    return [float(f"{value:.6g}") for value in found]


def curve(job: Job, clip: Clip, parameters: Parameters, name: str, values: list[Any]) -> dict[str, Any]:
    """Run the clip with every value and tell the page after each; the points in order of the values."""
    stage, _, field = name.partition(".")
    points: list[dict[str, Any]] = []
    content = {"name": name, "total": len(values), "points": points}
    job.tell(**content)
    for value in values:
        points.append({"value": value, **_point(job, clip, parameters, {stage: {field: value}})})
        job.tell(**{**content, "points": list(points)})
    return content


def _point(job: Job, clip: Clip, parameters: Parameters, change: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """What the curve shows of one value; the error where the value is not possible with the others."""
    try:
        tried = parameters.with_values(change)
        clip.check(tried)
    except ParameterError as error:
        return {"error": str(error)}
    finished = finish(clip, tried, job.check)
    found = measures(finished)
    shot = main_shot(found)
    kept = ("tracked_share", "residual_px", "jitter_px", "logo_events")
    return {**{key: found[key] for key in kept}, "best": shot and shot["best"], "spin": shot["spin"] if shot else {}}
