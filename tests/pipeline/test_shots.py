"""Shots: ticks gathered by the track's number, speed from silhouettes, honest when there is none."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from spinscope.pipeline.camera import Camera, CameraParameters
from spinscope.pipeline.results import SpinEstimate, Truth
from spinscope.pipeline.shots import Shot, ShotLog

CAMERA = Camera.of(CameraParameters(), 1280, 720)


def tick(number: int, *shots: int, x_px: float = 100.0, reason: str | None = None) -> Any:
    """A tick with these shots in flight, and with what a shot needs of it."""
    packet = SimpleNamespace(start_us=5000 * number, end_us=5000 * (number + 1))
    balls = [
        SimpleNamespace(
            track=SimpleNamespace(
                shot=shot,
                t_us=5000.0 * (number + 1) - 100,
                mean=np.array([x_px, 50.0, 1000.0, 0.0, 16.0]),
                covariance=np.eye(5),
                measured=None if number % 2 else object(),
            ),
            results={"logo": SimpleNamespace(events=[0] * number)},
            estimates={"triplet": SpinEstimate.refused("triplet", f"tick {number}")},
        )
        for shot in shots
    ]
    return SimpleNamespace(packet=packet, track=SimpleNamespace(reason=reason), balls=balls)


def gathered(*ticks: Any) -> ShotLog:
    return ShotLog.of(ticks)


def test_ticks_of_one_number_are_one_shot() -> None:
    log = gathered(tick(0), tick(1, 0), tick(2, 0), tick(3), tick(4, 1), tick(5, 1), tick(6, 2), tick(7, 2))
    assert [(shot.start_us, shot.end_us) for shot in log.shots] == [(5000, 15000), (20000, 30000), (30000, 40000)]
    assert [shot.logo_events for shot in log.shots] == [3, 9, 13]
    assert log.shots[0].estimates["triplet"].reason == "tick 2", "the last tick's estimate is the whole shot's"
    assert log.shots[1].measured.tolist() == [True, False]
    assert log.no_shot_reason is None


def test_shots_overlap_and_are_listed_by_their_start() -> None:
    log = gathered(tick(0, 7), tick(1, 7, 3), tick(2, 3, 7), tick(3, 3), tick(4))
    assert [(shot.start_us, shot.end_us) for shot in log.shots] == [(0, 15000), (5000, 20000)]
    assert [shot.logo_events for shot in log.shots] == [3, 6]
    within = gathered(tick(0, 7), tick(1, 7, 3), tick(2, 3, 7), tick(3, 7), tick(4))
    assert [(shot.start_us, shot.end_us) for shot in within.shots] == [(0, 20000), (5000, 15000)]


def test_a_single_tick_of_several_is_no_shot() -> None:
    assert [shot.start_us for shot in gathered(tick(0, 0), tick(1, 1), tick(2, 1)).shots] == [5000]
    assert "single tick" in str(gathered(tick(0, 0), tick(1)).no_shot_reason)
    assert len(gathered(tick(0, 0)).shots) == 1


def test_the_last_reason_is_told_where_there_is_no_ball() -> None:
    assert gathered(tick(0, reason="dark"), tick(1, reason="darker")).no_shot_reason == "darker"
    assert "no events" in str(gathered().no_shot_reason)


def flight(velocity_m_s: tuple[float, float, float]) -> Shot:
    """A straight flight seen through the true camera."""
    t_us = np.arange(0, 100_000, 5000.0)
    places = np.array([0.1, -0.2, 1.9]) + t_us[:, None] * 1e-6 * np.array(velocity_m_s)
    x, y, radius = CAMERA.silhouette(places, 0.02)
    state = np.stack([x, y, 0 * x, 0 * x, radius], axis=1)
    estimate = SpinEstimate("triplet", np.array([0.0, 40.0, 0.0]), np.eye(3), None)
    return Shot(0, 100_000, t_us, state, 0 * state, t_us >= 0, 0, {"triplet": estimate}, "triplet")


def test_a_shot_keeps_each_ticks_state_and_its_standard_deviations() -> None:
    ticks = [tick(number, 4, x_px=100.0 + number) for number in range(3)]
    for row in ticks:
        row.balls[0].track.covariance = np.diag([0.01, 0.04, 100.0, 400.0, 0.25])
    (shot,) = gathered(*ticks).shots
    assert shot.state[:, 0].tolist() == [100.0, 101.0, 102.0]
    assert shot.std == pytest.approx(np.tile([0.1, 0.2, 10.0, 20.0, 0.5], (3, 1)))
    assert shot.measured.tolist() == [True, False, True]
    assert shot.t_us.tolist() == [4900.0, 9900.0, 14_900.0]


def test_velocity_is_the_flights() -> None:
    assert flight((1.0, 6.0, -0.5)).velocity_m_s(CAMERA, 0.02) == pytest.approx([1.0, 6.0, -0.5], abs=1e-6)


def test_errors_against_truth_keep_the_axis_signed() -> None:
    def truth(*spin: float) -> Truth:
        many = np.tile(spin, (2, 1))
        return Truth(np.array([0, 10**6]), *np.zeros((3, 2)), many, many, many, np.zeros(0, np.uint8))

    assert flight((0, 5, 0)).error_against(truth(0, 50, 0), "triplet") == pytest.approx((10, 0))
    assert flight((0, 5, 0)).error_against(truth(0, -50, 0), "triplet") == pytest.approx((10, 180))
    assert flight((0, 5, 0)).error_against(truth(50, 0, 0), "triplet") == pytest.approx((10, 90))
