"""Optimization of a few parameters for an objective, by Optuna's tree-structured Parzen estimator.

One setting for several clips at once; some of them are held out and say how the proposal does where it was not tuned.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from spinscope.pipeline.errors import ParameterError
from spinscope.pipeline.metrics import RunMetrics
from spinscope.pipeline.parameters import Tunable
from spinscope.pipeline.registry import Parameters
from spinscope.pipeline.session import Session

from .clip_run import MOST_FRAMES_BYTES, run_clip
from .parameter_sweep import Value, declaration, scale_of, sensible_highs

# Name and label of each objective; both are minimised.
OBJECTIVES = {"truth": "error against the truth", "stated": "stated uncertainty and track residual"}
SUGGESTED = ("logo.pad_px", "flow.reach_px", "rate.ema_us")  # the parameters that the page offers first
MOST_TRIALS, MOST_PARAMETERS, MOST_CLIPS = 300, 8, 12
# No answer is as bad as one that is wrong by all of the spin.
REFUSED = 1.0
# 0.1 px of residual counts as much as 1 % of uncertainty: on a ball of 20 px both move the axis by half a degree.
RESIDUAL_WEIGHT = 0.1
# Half of the events: the stated uncertainty of methods that count events grows by 1.4, of the order of what is gained.
LEAST_EVIDENCE = 0.5
HELD_OUT_EVERY = 3  # clip; of two clips the second


@dataclass(frozen=True, slots=True)
class TunedClip:
    """A clip with the parameters from which its trials start."""

    session: Session
    parameters: Parameters


@dataclass(frozen=True, slots=True)
class Trial:
    """One setting, over all clips that are tuned on.

    Attributes
    ----------
    cost : float
        Mean of the clips' costs.
    answers : float
        Answers of all methods on all clips, as a share of those that there could be.
    logo_events : int
        Logo events of all clips.
    objection : str or None
        Why these values are not proposed, however low their cost.
    """

    cost: float
    answers: float
    logo_events: int
    objection: str | None


@dataclass(frozen=True, slots=True)
class HeldOut:
    """Result of the proposal on clips that it was not tuned on.

    Attributes
    ----------
    before, after : float
        Mean cost with the starting values and with the proposed ones.
    objection : str or None
        What gets lost there; then nothing is proposed.
    """

    clips: int
    before: float
    after: float
    objection: str | None


@dataclass(frozen=True, slots=True)
class Optimization:
    """The trials of an optimization so far.

    Attributes
    ----------
    total : int
        Number of trials when it is complete.
    clips : int
        Clips that are tuned on.
    trials : list of Trial
        The first one is that of the starting values.
    best : float or None
        Lowest cost of values that may be proposed; None before the first trial.
    values : dict
        Those values by name; the starting ones while nothing better is found.
    held_out : HeldOut or None
        At the end, where clips are held out.
    skipped : sequence of str
        Recordings that were asked for and cannot be tuned on, with the reason.
    """

    objective: str
    total: int
    clips: int
    trials: list[Trial]
    best: float | None
    values: dict[str, Value | None]
    held_out: HeldOut | None = None
    skipped: Sequence[str] = ()


def check_request(clip: TunedClip, names: Sequence[str], objective: str, trials: int) -> None:
    """Raise ParameterError for an optimization that cannot be run."""
    if not 1 <= len(set(names)) <= MOST_PARAMETERS:
        raise ParameterError(f"choose 1 to {MOST_PARAMETERS} parameters to optimize, not {len(set(names))}")
    for name in names:
        declared = declaration(clip.parameters, name)
        if declared.kind in ("number", "whole number") and (declared.low is None or declared.high is None):
            raise ParameterError(f"{name} has no range to search in: choose another parameter")
    if objective not in OBJECTIVES:
        raise ParameterError(f"objective {objective!r} is none of {', '.join(OBJECTIVES)}")
    if objective == "truth" and clip.session.truth is None:
        raise ParameterError("the recording carries no truth: choose the objective `stated`")
    if not 1 <= trials <= MOST_TRIALS:
        raise ParameterError(f"{trials} trials are out of range: 1 to {MOST_TRIALS}")


def optimize(
    clips: Sequence[TunedClip],
    names: Sequence[str],
    objective: str,
    trials: int,
    report: Callable[[Optimization], None],
    check: Callable[[], None],
) -> Optimization:
    """Minimise an objective, starting from the present values; see `sweep` for `report` and `check`.

    Values with which a method stops answering on a clip, or which leave less than half of the logo events, count as
    trials and are never proposed.
    """
    held = clips[1:] if len(clips) == 2 else clips[HELD_OUT_EVERY - 1 :: HELD_OUT_EVERY]
    tuned = [clip for clip in clips if not any(clip is one for one in held)]
    start: dict[str, Any] = {name: _value(clips[0].parameters, name) for name in names}
    proposed: dict[str, Any] = start
    report(Optimization(objective, trials, len(tuned), [], None, start))
    import optuna  # takes a second to load

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    study = optuna.create_study(sampler=optuna.samplers.TPESampler(seed=0))
    before = _runs(tuned, {}, check)
    highs = [sensible_highs(metrics) for metrics in before if metrics is not None]
    declared = {name: declaration(clips[0].parameters, name) for name in names}
    high = {name: min([one.get(name, math.inf) for one in highs], default=math.inf) for name in names}

    def suggested(trial: Any) -> dict[str, Any]:
        return {name: _suggestion(trial, name, one, high[name]) for name, one in declared.items()}

    done = [_trial(before, before, objective)]
    best = done[0].cost
    if all(isinstance(value, str) or (value is not None and value <= high[name]) for name, value in start.items()):
        study.enqueue_trial(start)
        trial = study.ask()
        suggested(trial)
        study.tell(trial, best)
    while len(done) < trials:
        check()
        report(Optimization(objective, trials, len(tuned), list(done), best, proposed))
        trial = study.ask()
        values = suggested(trial)
        made = _trial(_runs(tuned, values, check), before, objective)
        study.tell(trial, made.cost + (REFUSED if made.objection else 0.0))
        if made.objection is None and made.cost < best:
            best, proposed = made.cost, values
        done.append(made)
    kept = None
    if held and proposed != start:
        held_before = _runs(held, {}, check)
        after = _trial(_runs(held, proposed, check), held_before, objective)
        kept = HeldOut(len(held), _trial(held_before, held_before, objective).cost, after.cost, after.objection)
        if after.objection:
            best, proposed = done[0].cost, start
    return Optimization(objective, trials, len(tuned), done, best, proposed, kept)


def cost_of(metrics: RunMetrics | None, objective: str) -> float:
    """Cost of a run; a refusal costs REFUSED, values that do not go together twice that.

    Parameters
    ----------
    metrics : RunMetrics or None
        None for values that do not go together.
    objective : {"truth", "stated"}
        truth: |spin - truth| / |truth| of the trusted method. stated: the relative 1 sigma of the spin vector that
        the trusted method states, plus 0.1 for each pixel of the circle's residual.
    """
    if metrics is None:
        return 2 * REFUSED
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


def objection_to(runs: Sequence[RunMetrics | None], before: Sequence[RunMetrics | None]) -> str | None:
    """Reason not to propose the values of some runs, one a clip, in place of those of the runs before."""
    lost: set[str] = set()
    for now, then in zip(runs, before, strict=True):
        if now is None:
            return "these values do not go together"
        lost |= _answers(then) - _answers(now)
        if then is not None and now.logo_events < LEAST_EVIDENCE * then.logo_events:
            return f"{now.logo_events} logo events are left of {then.logo_events}"
    return f"no longer answered: {', '.join(sorted(lost))}" if lost else None


def _answers(metrics: RunMetrics | None) -> set[str]:
    """Methods that answer on the main shot."""
    shot = None if metrics is None else metrics.main_shot
    return set() if shot is None else {name for name, one in shot.spin.items() if one.magnitude_rps is not None}


def _trial(runs: Sequence[RunMetrics | None], before: Sequence[RunMetrics | None], objective: str) -> Trial:
    possible = sum(len(one.main_shot.spin) for one in runs if one is not None and one.main_shot is not None)
    return Trial(
        cost=float(np.mean([cost_of(one, objective) for one in runs])),
        answers=sum(len(_answers(one)) for one in runs) / max(possible, 1),
        logo_events=sum(one.logo_events for one in runs if one is not None),
        objection=objection_to(runs, before),
    )


def _runs(clips: Sequence[TunedClip], values: dict[str, Any], check: Callable[[], None]) -> list[RunMetrics | None]:
    """Metrics of each clip with these values; None where they do not go together, like a radius limit above another."""
    changes: dict[str, dict[str, Any]] = {}
    for name, value in values.items():
        stage, _, field = name.partition(".")
        changes.setdefault(stage, {})[field] = value
    made: list[RunMetrics | None] = []
    for clip in clips:
        try:
            tried = clip.parameters.with_values(changes)
            clip.session.chain.check(tried, MOST_FRAMES_BYTES)
        except ParameterError:
            made.append(None)
            continue
        made.append(RunMetrics.of(run_clip(clip.session, tried, check)))
    return made


def _suggestion(trial: Any, name: str, declared: Tunable, sensible_high: float) -> Any:
    if declared.kind == "choice":
        return trial.suggest_categorical(name, list(declared.choices))
    if declared.kind == "switch":
        return trial.suggest_categorical(name, [False, True])
    logarithmic = scale_of(declared) == "logarithmic"
    low, high = float(declared.low or 0.0), min(float(declared.high or 0.0), sensible_high)
    if declared.kind == "whole number":
        return trial.suggest_int(name, int(low), int(high), log=logarithmic)
    value: float = trial.suggest_float(name, low, max(high, low), log=logarithmic)
    return float(f"{value:.4g}")  # what people would type


def _value(parameters: Parameters, name: str) -> Value | None:
    stage, _, field = name.partition(".")
    value: Value | None = getattr(parameters.group(stage), field)
    return value
