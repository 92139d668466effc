"""Tune for me: a few parameters, an objective, and Optuna underneath."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from spinscope.pipeline.errors import ParameterError
from spinscope.pipeline.parameters import Tunable
from spinscope.pipeline.registry import Parameters

from .bench import Clip
from .controls import scale_of
from .curve import declared
from .jobs import Job
from .measures import main_shot, measures
from .runs import finish

OBJECTIVES = ("truth", "stated")
MOST_TRIALS, MOST_PARAMETERS = 300, 8
# No answer is as bad as one that is wrong by all of the spin.
REFUSED = 1.0
# 0.1 px of residual counts as much as 1 % of uncertainty: on a ball of 20 px both move the axis by half a degree.
RESIDUAL_WEIGHT = 0.1


def check(clip: Clip, parameters: Parameters, names: Sequence[str], objective: str, trials: int) -> None:
    """Raise ParameterError for a search that makes no sense."""
    if not 1 <= len(set(names)) <= MOST_PARAMETERS:
        raise ParameterError(f"choose 1 to {MOST_PARAMETERS} parameters to tune, not {len(set(names))}")
    for name in names:
        tunable = declared(parameters, name)
        if tunable.kind in ("number", "whole number") and (tunable.low is None or tunable.high is None):
            raise ParameterError(f"{name} has no range to search in: choose another parameter")
    if objective not in OBJECTIVES:
        raise ParameterError(f"objective {objective!r} is none of {', '.join(OBJECTIVES)}")
    if objective == "truth" and clip.session.truth is None:
        raise ParameterError("the recording carries no truth: choose the objective `stated`")
    if not 1 <= trials <= MOST_TRIALS:
        raise ParameterError(f"{trials} trials are out of range: 1 to {MOST_TRIALS}")


def search(
    job: Job, clip: Clip, parameters: Parameters, names: Sequence[str], objective: str, trials: int
) -> dict[str, Any]:
    """Look for better values, starting from the present ones; the page is told of every trial."""
    job.tell(objective=objective, total=trials, trials=[], best=None, values=None)
    import optuna  # takes a second to load

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    study = optuna.create_study(sampler=optuna.samplers.TPESampler(seed=0))
    tunables = {name: declared(parameters, name) for name in names}
    study.enqueue_trial({name: _value(parameters, name) for name in names if _value(parameters, name) is not None})
    done: list[float] = []
    content: dict[str, Any] = {}
    best, best_values = math.inf, {name: _value(parameters, name) for name in names}
    for _ in range(trials):
        job.check()
        trial = study.ask()
        values = {name: _suggested(trial, name, tunable) for name, tunable in tunables.items()}
        cost = _cost(job, clip, parameters, values, objective)
        study.tell(trial, cost)
        done.append(cost)
        if cost < best:
            best, best_values = cost, values
        content = {"objective": objective, "total": trials, "trials": list(done), "best": best, "values": best_values}
        job.tell(**content)
    return content


def cost_of(found: dict[str, Any], objective: str) -> float:
    """What is to be made small: see `app.web.measures` for what was found.

    truth : |spin - truth| / |truth| of the trusted method
    stated : relative 1 sigma of the spin vector that the trusted method states, and 0.1 / px of the circle's residual
    A refusal costs REFUSED in either.
    """
    shot = main_shot(found)
    if shot is None or shot["best"] is None:
        return REFUSED
    estimate = shot["spin"][shot["best"]]
    if objective == "truth":
        return REFUSED if estimate["error_share"] is None else float(estimate["error_share"])
    magnitude, std, axis_std = (estimate[key] for key in ("magnitude_rps", "magnitude_std_rps", "axis_std_deg"))
    if not magnitude or std is None or axis_std is None:
        return REFUSED
    residual_px = found["residual_px"] or 0.0
    return math.hypot(std / magnitude, math.radians(axis_std)) + RESIDUAL_WEIGHT * residual_px


def _cost(job: Job, clip: Clip, parameters: Parameters, values: dict[str, Any], objective: str) -> float:
    changes: dict[str, dict[str, Any]] = {}
    for name, value in values.items():
        stage, _, field = name.partition(".")
        changes.setdefault(stage, {})[field] = value
    try:
        tried = parameters.with_values(changes)
        clip.check(tried)
    except ParameterError:
        return 2 * REFUSED  # values that do not go together, like a smallest radius above the largest
    finished = finish(clip, tried, job.check)
    return cost_of(measures(finished), objective)


def _suggested(trial: Any, name: str, tunable: Tunable) -> Any:
    if tunable.kind == "choice":
        return trial.suggest_categorical(name, list(tunable.choices))
    if tunable.kind == "switch":
        return trial.suggest_categorical(name, [False, True])
    logarithmic = scale_of(tunable) == "logarithmic"
    if tunable.kind == "whole number":
        return trial.suggest_int(name, int(tunable.low or 0), int(tunable.high or 0), log=logarithmic)
    value: float = trial.suggest_float(name, float(tunable.low or 0.0), float(tunable.high or 0.0), log=logarithmic)
    return value if trial.number == 0 else float(f"{value:.4g}")  # what people would type; the start stays exact


def _value(parameters: Parameters, name: str) -> Any:
    stage, _, field = name.partition(".")
    return getattr(parameters.group(stage), field)
