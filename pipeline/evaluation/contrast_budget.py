"""Where the error of `contrast` comes from: the same shots with one source of error after the other taken away.

`python -m pipeline.evaluation.contrast_budget` prints the tables of docs/contrast.md and, with `--figure FILE.png`,
draws its curve of error against coverage. A few minutes on one core; seeds are fixed and belong to this module.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..chain import Chain, EventsInMemory
from ..registry import STAGES, Parameters
from ..results import MethodResult, SpinEstimate, frozen
from ..simulator import flight, human_shot, spinner, thrown
from ..simulator.scene import Scene
from ..simulator.sensor import Sensor
from ..simulator.simulation import SimulatedRecording, simulate
from ..stages.track import BallTrack

Floats = NDArray[np.float64]

SEED = 61_000
FLIGHTS, SPINNERS = 16, 14
CENTRE_STD_PX = 0.3  # of a mounted ball's measured circle, as in the suite `spinner`
RATES_RPS = (10.0, 20.0, 35.0, 50.0, 75.0, 100.0)
CASES = ("as it is", "started at the truth", "true place", "and no latency", "and an ideal sensor")
GROSS_RPS, GROSS_DEG = 10.0, 20.0


@dataclass(frozen=True)
class Outcome:
    """Errors of one shot's last estimate in one case; stds are NaN and `answered` is False where it refused."""

    shot: str
    case: str
    answered: bool
    magnitude_rps: float
    axis_deg: float
    magnitude_std_rps: float
    axis_std_deg: float

    @property
    def doubt(self) -> float:
        """The stated error as a part of what counts as gross."""
        return math.hypot(self.magnitude_std_rps / GROSS_RPS, self.axis_std_deg / GROSS_DEG)


def scenes() -> Iterator[tuple[str, Scene, int]]:
    """Name, scene and seed: thrown, human and mixed flights, then spinners of all balls and kinds."""
    for number in range(FLIGHTS):
        seed = SEED + number
        random = np.random.default_rng(seed)
        if number % 4 < 2:
            velocity, spin = int(random.choice([10, 15, 20, 25])), int(random.integers(-5, 6))
            yield f"flight {number}", thrown(velocity, spin, side=False, seed=seed), seed
        elif number % 4 == 2:
            yield f"flight {number}", human_shot(seed=seed), seed
        else:
            magnitude, speed = float(random.uniform(10, 120)), float(random.uniform(4, 14))
            yield f"flight {number}", flight(kind="mixed", magnitude_rps=magnitude, speed_m_s=speed, seed=seed), seed
    for number in range(SPINNERS):
        seed = SEED + 500 + number
        kind, rps = ("top", "back", "side")[number % 3], float(np.random.default_rng(seed).choice(RATES_RPS))
        yield f"spinner {number}", spinner(ball=number % 7 + 1, kind=kind, magnitude_rps=rps, seed=seed), seed


def outcomes(name: str, scene: Scene, seed: int) -> list[Outcome]:
    """Every case of one shot; none where the tracker finds no ball."""
    usual = Sensor.of()
    # Pixels that report at once, with the noise of the usual ones.
    prompt = replace(usual, delay_us=0.0, jitter_us=0.0, cutoff_hz=1e6, dark_tau_us=0.0, off_after_on_us=0.0)
    seen, at_once, ideal = (simulate(scene, sensor=sensor, seed=seed) for sensor in (usual, prompt, Sensor.ideal()))
    recordings = (seen, seen, seen, at_once, ideal)
    found = [_outcome(name, case, recording, seed) for case, recording in zip(CASES, recordings, strict=True)]
    return [one for one in found if one is not None]


def _outcome(name: str, case: str, recording: SimulatedRecording, seed: int) -> Outcome | None:
    truth, parameters = recording.truth, Parameters()
    if name.startswith("spinner"):
        x, y, radius = CENTRE_STD_PX * np.random.default_rng([seed, 7]).standard_normal(3)
        circle = {"fixed_x_px": truth.x_px[0] + x, "fixed_y_px": truth.y_px[0] + y}
        circle |= {"fixed_radius_px": truth.radius_px[0] + radius, "fixed_std_px": CENTRE_STD_PX}
        values = {"ball": "fixed", **{key: float(value) for key, value in circle.items()}}
        parameters = parameters.with_values({"track": values})
    source = EventsInMemory(name, recording.events, recording.width_px, recording.height_px, 0, int(truth.t_us[-1]))
    chain = Chain(source)
    stage, mask_stage = STAGES["contrast"], STAGES["logo"]
    state, last, end_us = chain.start(parameters, stage), None, 0
    for tick in chain.run(parameters, ("logo", "normal_flow"), forget=("surface",)):
        ball, events, normal_flow = tick.track.ball, tick.logo, tick.normal_flow
        if ball is None:
            continue
        if case == CASES[1]:
            known = SpinEstimate("normal_flow", frozen(truth.spin_rps[0].copy()), np.eye(3), None)
            normal_flow = MethodResult(known)
        elif case != CASES[0]:
            late = case == CASES[2]
            ball = _true_ball(ball, tick.packet.end_us, recording, ball.latency_us if late else 0.0)
            mask = parameters.logo if late else replace(parameters.logo, delay_us=0.0)
            events = mask_stage.step(mask, chain.start(parameters, mask_stage), tick.packet, tick.filter, ball)
        last = stage.step(parameters.contrast, state, tick.packet, ball, events, normal_flow)
        end_us = tick.packet.end_us
    if last is None:
        return None
    true = np.array([np.interp(end_us, truth.t_us, truth.spin_rps[:, axis]) for axis in range(3)])
    best, estimate = last.best_rps, last.estimate
    lengths = float(np.linalg.norm(best)), float(np.linalg.norm(true))
    cosine = float(best @ true) / max(lengths[0] * lengths[1], 1e-12)
    magnitude_std, axis_std = estimate.magnitude_std_rps, estimate.axis_std_deg
    return Outcome(
        name,
        case,
        estimate.status == "ok",
        abs(lengths[0] - lengths[1]),
        math.degrees(math.acos(min(max(cosine, -1.0), 1.0))) if math.isfinite(cosine) else math.nan,
        math.nan if magnitude_std is None else magnitude_std,
        math.nan if axis_std is None else axis_std,
    )


def _true_ball(ball: BallTrack, end_us: int, recording: SimulatedRecording, latency_us: float) -> BallTrack:
    """The tick's ball with the true circle and speed, known to a hundredth of a pixel."""
    truth, t_us = recording.truth, end_us - latency_us
    before, now = (
        np.array([np.interp(at, truth.t_us, column) for column in (truth.x_px, truth.y_px, truth.radius_px)])
        for at in (t_us - 5000.0, t_us)
    )
    mean = np.array([*now[:2], *((now[:2] - before[:2]) / 5e-3), now[2]])
    covariance = np.diag([1e-4, 1e-4, 1.0, 1.0, 1e-4])
    return replace(ball, t_us=t_us, latency_us=latency_us, mean=frozen(mean), covariance=frozen(covariance))


def budget_table(found: Sequence[Outcome], kind: str) -> str:
    """Markdown: errors of the shots that are answered, and not grossly wrong, in every case."""
    cases = {case: {one.shot: one for one in found if one.case == case and one.shot.startswith(kind)} for case in CASES}

    def usable(one: Outcome | None) -> bool:
        return one is not None and one.answered and one.magnitude_rps < GROSS_RPS and one.axis_deg < GROSS_DEG

    shots = [shot for shot in cases[CASES[0]] if all(usable(cases[case].get(shot)) for case in CASES)]
    lines = [
        f"| {kind}s ({len(shots)} shots) | magnitude, mean (median) [rps] | axis, mean (median) [degrees] |",
        "|---|---|---|",
    ]
    for case in CASES:
        rps = np.array([cases[case][shot].magnitude_rps for shot in shots])
        deg = np.array([cases[case][shot].axis_deg for shot in shots])
        means = f"{rps.mean():.3f} ({np.median(rps):.3f}) | {deg.mean():.2f} ({np.median(deg):.2f})"
        lines.append(f"| {case} | {means} |")
    return "\n".join(lines)


def honesty_table(found: Sequence[Outcome]) -> str:
    """Markdown: answers within 1 and 2 stated sigma, as it is."""
    lines = ["| | shots | answered | magnitude within 1, 2 sigma | axis within 1, 2 sigma |", "|---|---|---|---|---|"]
    for kind in ("flight", "spinner"):
        all_of = [one for one in found if one.case == CASES[0] and one.shot.startswith(kind)]
        own = [one for one in all_of if one.answered]
        parts = [
            np.array([one.magnitude_rps / one.magnitude_std_rps for one in own]),
            np.array([one.axis_deg / one.axis_std_deg for one in own]),
        ]
        within = " | ".join(", ".join(f"{100 * np.mean(part < sigmas):.0f} %" for sigmas in (1, 2)) for part in parts)
        lines.append(f"| {kind}s | {len(all_of)} | {len(own)} | {within} |")
    return "\n".join(lines)


def draw_coverage(found: Sequence[Outcome], path: Path) -> None:
    """Mean error of the most certain answers against the share of all shots that they are."""
    from matplotlib.figure import Figure  # drawing is the exception, and loading it takes longer than a table

    figure = Figure(figsize=(8.0, 3.2), dpi=120, layout="constrained")
    panels = figure.subplots(1, 2)
    for kind in ("flight", "spinner"):
        every = [one for one in found if one.case == CASES[0] and one.shot.startswith(kind)]
        own = sorted((one for one in every if one.answered), key=lambda one: one.doubt)
        share = np.arange(1, len(own) + 1) / len(every)
        for panel, errors in zip(panels, ([o.magnitude_rps for o in own], [o.axis_deg for o in own]), strict=True):
            panel.plot(share, np.cumsum(errors) / np.arange(1, len(own) + 1), label=f"{kind}s")
    for panel, label in zip(panels, ("magnitude error [rps]", "axis error [degrees]"), strict=True):
        panel.set(xlabel="share of the shots answered", ylabel=f"mean {label}", xlim=(0, 1), ylim=(0, None))
        panel.legend()
    figure.savefig(path)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description="where the error of contrast comes from")
    parser.add_argument("--figure", type=Path, help="where to draw error against coverage (PNG)")
    options = parser.parse_args(arguments)
    found = [one for name, scene, seed in scenes() for one in outcomes(name, scene, seed)]
    tables = [budget_table(found, "flight"), budget_table(found, "spinner"), honesty_table(found)]
    sys.stdout.write("\n\n".join(tables) + "\n")
    if options.figure is not None:
        draw_coverage(found, options.figure)


if __name__ == "__main__":
    main()
