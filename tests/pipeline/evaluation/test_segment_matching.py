"""Shots beside true flights: whose they are, and what their answers are called."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from spinscope.pipeline.evaluation.segment_matching import matches, segment_rows
from spinscope.pipeline.evaluation.tables import where
from spinscope.pipeline.results import SpinEstimate
from spinscope.pipeline.shots import Shot
from spinscope.pipeline.simulator import SimulatedRecording
from spinscope.pipeline.simulator.real_scenes import real_scene
from spinscope.pipeline.simulator.segments import Segment
from spinscope.pipeline.simulator.simulation import truth_of
from spinscope.pipeline.spin.combined.result import CombinedResult


class ResultOf:
    """What the rows need of a result."""

    no_shot_reason = None

    def __init__(self, *shots: Shot) -> None:
        self.shots = list(shots)


@pytest.fixture(scope="module")
def two_balls() -> SimulatedRecording:
    """Two balls of one speed, before a sensor that nobody reads: the truth alone."""
    made = real_scene("same_speed", 3)
    recording = replace(made, scene=replace(made.scene, duration_s=0.001)).simulate()
    return _with_scene(recording, made.scene)


@pytest.fixture(scope="module")
def bounce() -> SimulatedRecording:
    made = real_scene("bounce", 3)
    recording = replace(made, scene=replace(made.scene, duration_s=0.001)).simulate()
    return _with_scene(recording, made.scene)


def _with_scene(recording: SimulatedRecording, scene: Any) -> SimulatedRecording:
    from dataclasses import asdict

    from spinscope.pipeline.simulator.segments import segments_of

    found = segments_of(scene, recording.camera, [np.empty(0, np.int64)] * len(scene.balls))
    description = recording.description | {"segments": [asdict(segment) for segment in found]}
    truth = truth_of(scene, recording.camera, recording.truth.label)
    return replace(recording, scene=scene, description=description, truth=truth)


def shot_of(recording: SimulatedRecording, segment: Segment, spin_rps: Any, **changes: Any) -> Shot:
    """The shot that a perfect tracker finds of a segment, with a trusted answer (None = none)."""
    start_us, end_us = changes.get("start_us", segment.start_us), changes.get("end_us", segment.end_us)
    path = truth_of(recording.scene, recording.camera, recording.truth.label, segment.ball)
    t_us = np.arange(start_us + 5000, end_us + 1, 5000, dtype=np.float64)
    columns = (path.x_px, path.y_px, 0 * path.x_px, 0 * path.x_px, path.radius_px)
    state = np.stack([np.interp(t_us, path.t_us, column) for column in columns], axis=1) + changes.get("off", 0.0)
    if spin_rps is None:
        estimate = SpinEstimate.refused("contrast", "too dark")
    else:
        estimate = SpinEstimate("contrast", np.array(spin_rps, np.float64), 0.01 * np.eye(3), None, 100)
    best = None if spin_rps is None else "contrast"
    there = np.ones(t_us.size, bool)
    return Shot(start_us, end_us, t_us, state, np.ones_like(state), there, 100, {"contrast": estimate}, best)


def outcomes(recording: SimulatedRecording, *shots: Shot) -> list[Any]:
    return [row["outcome"] for row in where(segment_rows(recording, ResultOf(*shots), {}), method="best")]  # type: ignore[arg-type]


def test_each_shot_is_its_own_balls(two_balls):
    first, second = two_balls.segments
    shots = [shot_of(two_balls, segment, segment.spin_rps) for segment in (second, first)]
    found, nobody = matches(two_balls, shots)
    assert [match.shots for match in found] == [[shots[1]], [shots[0]]]
    assert not nobody
    assert outcomes(two_balls, *shots) == ["right", "right"]
    swapped = shot_of(two_balls, first, second.spin_rps), shot_of(two_balls, second, first.spin_rps)
    assert outcomes(two_balls, *swapped) == ["wrong", "wrong"]
    assert outcomes(two_balls, shots[0]) == ["missed", "right"]
    assert outcomes(two_balls, shot_of(two_balls, first, None), shots[0]) == ["refused", "right"]


def test_a_trusted_answer_far_from_every_ball_is_of_no_flight(two_balls):
    first, _ = two_balls.segments
    ghost = shot_of(two_balls, first, (1.0, 2.0, 3.0), off=150.0)
    assert outcomes(two_balls, ghost) == ["missed", "missed", "of no flight"]
    assert outcomes(two_balls, shot_of(two_balls, first, None, off=150.0)) == ["missed", "missed"]


def test_an_answer_from_both_sides_of_a_bounce_is_two_spins_for_one(bounce):
    before, after = bounce.segments
    contact_us = before.end_us
    both = shot_of(bounce, before, before.spin_rps, end_us=after.end_us)
    assert sorted(outcomes(bounce, both)) == ["missed", "two spins for one"]
    late = shot_of(bounce, before, before.spin_rps, end_us=contact_us + 2000)
    early = shot_of(bounce, after, after.spin_rps, start_us=contact_us + 1000)
    rows = where(segment_rows(bounce, ResultOf(late, early), {}), method="best")  # type: ignore[arg-type]
    assert [row["outcome"] for row in rows] == ["right", "right"]
    assert [row["end_ms"] for row in rows] == [2.0, None]
    assert [row["begin_ms"] for row in rows] == [None, 1.0]
    assert all(row["found_ms"] in (0.0, 1.0) for row in rows)


def test_right_means_ten_percent_and_twenty_degrees(bounce):
    before, _ = bounce.segments
    spin = np.array(before.spin_rps)
    across = np.cross(spin, [0.0, 0.0, 1.0])
    across *= np.linalg.norm(spin) / np.linalg.norm(across)
    for answer, outcome in (
        (1.09 * spin, "right"),
        (1.11 * spin, "wrong"),
        (np.cos(np.radians(19)) * spin + np.sin(np.radians(19)) * across, "right"),
        (np.cos(np.radians(21)) * spin + np.sin(np.radians(21)) * across, "wrong"),
    ):
        assert outcomes(bounce, shot_of(bounce, before, answer))[0] == outcome


def test_a_flights_own_answer_is_right_within_its_stated_errors(bounce):
    before, _ = bounce.segments
    spin = np.array(before.spin_rps)
    magnitude = float(np.linalg.norm(spin))
    for share, factor, outcome in ((0.3, 1.5, "right"), (0.3, 2.6, "wrong"), (0.36, 1.1, "wrong")):
        answer = factor * spin
        covariance = (share * factor) ** 2 * np.outer(spin, spin) + 0.01 * magnitude**2 * factor**2 * np.eye(3) / 9
        estimate = SpinEstimate("combined", answer, covariance, None, 0)
        combined = CombinedResult(estimate, basis="flight")
        shot = replace(
            shot_of(bounce, before, None), estimates={"combined": estimate}, best="combined", combined=combined
        )
        assert outcomes(bounce, shot)[0] == outcome
        by_logo = replace(shot, combined=replace(combined, basis="pattern"))
        assert outcomes(bounce, by_logo)[0] == "wrong", "no other witness is asked for less"
