"""Suite `contrast_budget`: the error of `contrast` with one source of error after the other taken away."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...registry import STAGES, Parameters
from ...results import MethodResult, SpinEstimate, spin_errors
from ...simulator import Scene, SensorModel, SimulatedRecording, flight, human_shot, simulate_scene, spinner, thrown
from ...stages.track_result import BallTrack
from ..estimation import chain_over
from ..plots import Figures, coverage_figure
from ..tables import Cell, ResultTable, Row, distinct, summary, where
from ..tasks import Task, TaskContext
from ..uncertainty_calibration import ERRORS, STATED, calibration_table, is_answer, is_gross
from .spinner import known_circle

LABEL = "Error budget of contrast"
HELP = "Errors of `contrast` with one source of error after the other taken away."

SEED = 61_000  # of this suite alone
COUNTS = {"flight": 16, "spinner": 14}
METHOD = "contrast"
RATES_RPS = (10.0, 20.0, 35.0, 50.0, 75.0, 100.0)
CASES = ("as it is", "started at the truth", "true place", "and no latency", "and an ideal sensor")


def tasks(quick: bool) -> list[Task]:
    """One shot a task, in every case."""
    return [
        Task(measure, {"kind": kind, "number": number})
        for kind, count in COUNTS.items()
        for number in range(1 if quick else count)
    ]


def scene_of(kind: str, number: int) -> tuple[Scene, int]:
    """Scene and seed: thrown, human and mixed flights in turn; spinners of all balls and kinds of spin."""
    if kind == "spinner":
        seed = SEED + 500 + number
        turn, rps = ("top", "back", "side")[number % 3], float(np.random.default_rng(seed).choice(RATES_RPS))
        return spinner(ball=number % 7 + 1, kind=turn, magnitude_rps=rps, seed=seed), seed
    seed = SEED + number
    random = np.random.default_rng(seed)
    if number % 4 < 2:
        velocity, spin = int(random.choice([10, 15, 20, 25])), int(random.integers(-5, 6))
        return thrown(velocity, spin, side=False, seed=seed), seed
    if number % 4 == 2:
        return human_shot(seed=seed), seed
    magnitude, speed = float(random.uniform(10, 120)), float(random.uniform(4, 14))
    return flight(kind="mixed", magnitude_rps=magnitude, speed_m_s=speed, seed=seed), seed


def measure(context: TaskContext, kind: str, number: int) -> list[Row]:
    """Errors of the last estimate of one shot in every case, None where there is no ball or no answer."""
    scene, seed = scene_of(kind, number)
    usual = SensorModel.of()
    # Pixels that report at once, with the noise of the usual ones.
    prompt = replace(usual, delay_us=0.0, jitter_us=0.0, cutoff_hz=1e6, dark_tau_us=0.0, off_after_on_us=0.0)
    sensors = (usual, prompt, SensorModel.ideal())
    seen, at_once, ideal = (simulate_scene(scene, sensor=sensor, seed=seed) for sensor in sensors)
    rows: list[Row] = []
    for case, recording in zip(CASES, (seen, seen, seen, at_once, ideal), strict=True):
        parameters = context.parameters
        if kind == "spinner":
            parameters = parameters.with_values({"track": known_circle(recording.truth, seed)})
        row: Row = {"kind": kind, "number": number, "seed": seed, "case": case, "method": METHOD}
        row |= dict.fromkeys((*ERRORS, *STATED))
        estimate, end_us = _last_estimate(case, recording, parameters)
        if estimate is not None and estimate.vector_rps is not None:
            truth = recording.truth
            true = np.array([np.interp(end_us, truth.t_us, truth.spin_rps[:, axis]) for axis in range(3)])
            row |= zip(ERRORS, spin_errors(estimate.vector_rps, true), strict=True)
            row |= zip(STATED, (estimate.magnitude_std_rps, estimate.axis_std_deg), strict=True)
        rows.append(row)
    return rows


def _last_estimate(case: str, recording: SimulatedRecording, parameters: Parameters) -> tuple[SpinEstimate | None, int]:
    """The estimate of `contrast` in the last tick with a ball, None without one, and that tick's end."""
    truth = recording.truth
    chain = chain_over(recording, int(truth.t_us[-1]))
    stage, mask_stage = STAGES[METHOD], STAGES["logo"]
    state = chain.start(parameters, stage)
    estimate, end_us = None, 0
    for tick in chain.run(parameters, ("logo", "normal_flow"), forget=("surface",)):
        ball, events, normal_flow = tick.track.ball, tick.logo, tick.normal_flow
        if ball is None:
            continue
        if case == CASES[1]:
            known = SpinEstimate("normal_flow", truth.spin_rps[0].copy(), np.eye(3), None)
            normal_flow = MethodResult(known)
        elif case != CASES[0]:
            late = case == CASES[2]
            ball = _true_ball(ball, tick.packet.end_us, recording, ball.latency_us if late else 0.0)
            mask = parameters.logo if late else replace(parameters.logo, delay_us=0.0)
            events = mask_stage.step(mask, chain.start(parameters, mask_stage), tick.packet, tick.filter, ball)
        inputs = (tick.packet, ball, tick.rate, events, normal_flow)
        estimate = stage.step(parameters.contrast, state, *inputs).estimate
        end_us = tick.packet.end_us
    return estimate, end_us


def _true_ball(ball: BallTrack, end_us: int, recording: SimulatedRecording, latency_us: float) -> BallTrack:
    """The tick's ball with the true circle and speed, known to a hundredth of a pixel."""
    truth, t_us = recording.truth, end_us - latency_us
    before, now = (
        np.array([np.interp(at, truth.t_us, column) for column in (truth.x_px, truth.y_px, truth.radius_px)])
        for at in (t_us - 5000.0, t_us)
    )
    mean = np.array([*now[:2], *((now[:2] - before[:2]) / 5e-3), now[2]])
    covariance = np.diag([1e-4, 1e-4, 1.0, 1.0, 1e-4])
    return replace(ball, t_us=t_us, latency_us=latency_us, mean=mean, covariance=covariance)


def tables(rows: Sequence[Row]) -> list[ResultTable]:
    """Errors in every case over the shots that all cases answer without a gross error; calibration as it is."""
    result = []
    for kind in distinct(rows, "kind"):
        own = where(rows, kind=kind)
        bad = {row["number"] for row in own if not is_answer(row) or is_gross(row)}
        part = [row for row in own if row["number"] not in bad]
        lines: list[tuple[Cell, ...]] = [
            (case, *(summary(where(part, case=case), name) for name in ERRORS)) for case in CASES
        ]
        title = f"Error of `contrast`: {len(distinct(part, 'number'))} {kind}s"
        result.append(ResultTable(title, ("case", "magnitude error [rps]", "axis error [deg]"), lines))
    return [*result, calibration_table(_as_it_is(rows), [METHOD])]


def figures(rows: Sequence[Row]) -> Figures:
    """Error against coverage, as it is."""
    return {"coverage": coverage_figure(_as_it_is(rows))}


def _as_it_is(rows: Sequence[Row]) -> list[tuple[str, list[Row]]]:
    return [(f"{kind}s", where(rows, kind=kind, case=CASES[0])) for kind in distinct(rows, "kind")]
