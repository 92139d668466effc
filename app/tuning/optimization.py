"""Optimization of a few parameters for an objective, by Optuna's tree-structured Parzen estimator."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from spinscope.pipeline.errors import ParameterError
from spinscope.pipeline.metrics import RunMetrics
from spinscope.pipeline.parameters import Tunable
from spinscope.pipeline.registry import Parameters
from spinscope.pipeline.session import Session

from .clip_run import MOST_FRAMES_BYTES, run_clip
from .parameter_sweep import Value, declaration, scale_of

# Name and label of each objective; both are minimised.
OBJECTIVES = {"truth": "error against the truth", "stated": "stated uncertainty and track residual"}
SUGGESTED = ("logo.pad_px", "flow.reach_px", "rate.ema_us")  # the parameters that the page offers first
MOST_TRIALS, MOST_PARAMETERS = 300, 8
# No answer is as bad as one that is wrong by all of the spin.
REFUSED = 1.0
# 0.1 px of residual counts as much as 1 % of uncertainty: on a ball of 20 px both move the axis by half a degree.
RESIDUAL_WEIGHT = 0.1


@dataclass(frozen=True, slots=True)
class Optimization:
    """The trials of an optimization so far.

    Attributes
    ----------
    total : int
        Number of trials when it is complete.
    trials : list of float
        Cost of each trial; the first one is that of the starting values.
    best : float or None
        Lowest cost so far.
    values : dict
        Parameter values with the lowest cost, by name.
    """

    objective: str
    total: int
    trials: list[float]
    best: float | None
    values: dict[str, Value | None]


def check_request(session: Session, parameters: Parameters, names: Sequence[str], objective: str, trials: int) -> None:
    """Raise ParameterError for an optimization that cannot be run."""
    if not 1 <= len(set(names)) <= MOST_PARAMETERS:
        raise ParameterError(f"choose 1 to {MOST_PARAMETERS} parameters to optimize, not {len(set(names))}")
    for name in names:
        declared = declaration(parameters, name)
        if declared.kind in ("number", "whole number") and (declared.low is None or declared.high is None):
            raise ParameterError(f"{name} has no range to search in: choose another parameter")
    if objective not in OBJECTIVES:
        raise ParameterError(f"objective {objective!r} is none of {', '.join(OBJECTIVES)}")
    if objective == "truth" and session.truth is None:
        raise ParameterError("the recording carries no truth: choose the objective `stated`")
    if not 1 <= trials <= MOST_TRIALS:
        raise ParameterError(f"{trials} trials are out of range: 1 to {MOST_TRIALS}")


def optimize(
    session: Session,
    parameters: Parameters,
    names: Sequence[str],
    objective: str,
    trials: int,
    report: Callable[[Optimization], None],
    check: Callable[[], None],
) -> Optimization:
    """Minimise an objective, starting from the present values; see `sweep` for `report` and `check`."""
    best_values = {name: _value(parameters, name) for name in names}
    found = Optimization(objective, trials, [], None, best_values)
    report(found)
    import optuna  # takes a second to load

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    study = optuna.create_study(sampler=optuna.samplers.TPESampler(seed=0))
    declared = {name: declaration(parameters, name) for name in names}
    study.enqueue_trial({name: value for name, value in best_values.items() if value is not None})
    costs: list[float] = []
    for _ in range(trials):
        check()
        trial = study.ask()
        values = {name: _suggestion(trial, name, one) for name, one in declared.items()}
        cost = _trial_cost(session, parameters, values, objective, check)
        study.tell(trial, cost)
        if cost < min(costs, default=math.inf):
            best_values = values
        costs.append(cost)
        found = Optimization(objective, trials, list(costs), min(costs), best_values)
        report(found)
    return found


def cost_of(metrics: RunMetrics, objective: str) -> float:
    """Cost of a run; a refusal costs REFUSED.

    Parameters
    ----------
    objective : {"truth", "stated"}
        truth: |spin - truth| / |truth| of the trusted method. stated: the relative 1 sigma of the spin vector that
        the trusted method states, plus 0.1 for each pixel of the circle's residual.
    """
    shot = metrics.main_shot
    if shot is None or shot.best is None:
        return REFUSED
    estimate = shot.spin[shot.best]
    if objective == "truth":
        return REFUSED if estimate.error_share is None else estimate.error_share
    magnitude, std, axis_std = estimate.magnitude_rps, estimate.magnitude_std_rps, estimate.axis_std_deg
    if not magnitude or std is None or axis_std is None:
        return REFUSED
    return math.hypot(std / magnitude, math.radians(axis_std)) + RESIDUAL_WEIGHT * (metrics.residual_px or 0.0)


def _trial_cost(
    session: Session, parameters: Parameters, values: dict[str, Value], objective: str, check: Callable[[], None]
) -> float:
    changes: dict[str, dict[str, Any]] = {}
    for name, value in values.items():
        stage, _, field = name.partition(".")
        changes.setdefault(stage, {})[field] = value
    try:
        tried = parameters.with_values(changes)
        session.chain.check(tried, MOST_FRAMES_BYTES)
    except ParameterError:
        return 2 * REFUSED  # values that do not go together, like a smallest radius above the largest
    return cost_of(RunMetrics.of(run_clip(session, tried, check)), objective)


def _suggestion(trial: Any, name: str, declared: Tunable) -> Any:
    if declared.kind == "choice":
        return trial.suggest_categorical(name, list(declared.choices))
    if declared.kind == "switch":
        return trial.suggest_categorical(name, [False, True])
    logarithmic = scale_of(declared) == "logarithmic"
    if declared.kind == "whole number":
        return trial.suggest_int(name, int(declared.low or 0), int(declared.high or 0), log=logarithmic)
    value: float = trial.suggest_float(name, float(declared.low or 0.0), float(declared.high or 0.0), log=logarithmic)
    return value if trial.number == 0 else float(f"{value:.4g}")  # what people would type; the start stays exact


def _value(parameters: Parameters, name: str) -> Value | None:
    stage, _, field = name.partition(".")
    value: Value | None = getattr(parameters.group(stage), field)
    return value
