"""Shots: ticks gathered by the track's number, speed from silhouettes, honest when there is none."""

from __future__ import annotations

import gc
import weakref
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from spinscope.pipeline.camera import Camera, CameraParameters
from spinscope.pipeline.chain import EARLIER_US
from spinscope.pipeline.results import SpinEstimate, Truth
from spinscope.pipeline.shots import Shot, ShotLog
from spinscope.pipeline.stages.track_result import ShotEnd
from spinscope.pipeline.track_evidence import NO_EVIDENCE

CAMERA = Camera.of(CameraParameters(), 1280, 720)


def ball(number: int, shot: int, *, start_us: int | None = None, x_px: float = 100.0, is_shot: bool = True) -> Any:
    """What a shot needs of one ball in a tick."""
    return SimpleNamespace(
        packet=SimpleNamespace(start_us=5000 * number, end_us=5000 * (number + 1)),
        track=SimpleNamespace(
            shot=shot,
            t_us=5000.0 * (number + 1) - 100,
            mean=np.array([x_px, 50.0, 1000.0, 0.0, 16.0]),
            covariance=np.eye(5),
            measured=None if number % 2 else object(),
            start_us=5000 * number if start_us is None else start_us,
            began_by="found" if start_us is None else "bounce",
            is_shot=is_shot,
        ),
        evidence=NO_EVIDENCE,
        earlier=(),
        results={"logo": SimpleNamespace(events=[0] * number)},
        estimates={"triplet": SpinEstimate.refused("triplet", f"tick {number}")},
        best=None,
        best_reason=f"tick {number}",
    )


def tick(number: int, *shots: int | Any, ended: tuple[ShotEnd, ...] = (), reason: str | None = None) -> Any:
    """A tick with these balls, or shots of these numbers, in flight."""
    balls = [ball(number, shot) if isinstance(shot, int) else shot for shot in shots]
    return SimpleNamespace(track=SimpleNamespace(reason=reason, ended=ended), balls=balls)


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


def test_a_contact_that_is_known_late_ends_one_shot_and_begins_the_next() -> None:
    """Shot 0 bounces at 12.5 ms; in tick 5 that is known, and shot 1 has its results of ticks 2 to 4."""
    earlier = tuple(ball(number, 1, start_us=12_500) for number in (2, 3, 4))
    announced = ball(5, 1, start_us=12_500)
    announced.earlier = earlier
    bounced = (ShotEnd(0, 12_500, "bounce"),)
    ticks = [*(tick(number, 0) for number in range(5)), tick(5, announced, ended=bounced), tick(6, 1)]
    before, after = gathered(*ticks, tick(7, ended=(ShotEnd(1, 31_000, "left"),))).shots
    assert (before.start_us, before.end_us, before.began_by, before.ended_by) == (0, 12_500, "found", "bounce")
    assert before.t_us.tolist() == [4900.0, 9900.0]
    assert before.logo_events == 0 + 1
    assert before.estimates["triplet"].reason == "tick 1", "later ones have seen the other shot's events"
    assert (after.start_us, after.end_us, after.began_by, after.ended_by) == (12_500, 31_000, "bounce", "left")
    assert after.t_us.tolist() == [14_900.0, 19_900.0, 24_900.0, 29_900.0]
    assert after.logo_events == 2 + 3 + 4 + 5
    assert after.number == 1


def test_no_answer_is_trusted_of_a_shot_whose_end_is_doubted() -> None:
    flying = [ball(number, 0) for number in range(3)]
    for one in flying:
        one.evidence = SimpleNamespace(doubt=None)
    ticks = [tick(number, one) for number, one in enumerate(flying)]
    for doubt in ("it may have bounced", None):
        (shot,) = gathered(*ticks, tick(3, ended=(ShotEnd(0, 15_000, "bounce", doubt),))).shots
        assert shot.best is None
        assert (shot.best_reason == doubt) == (doubt is not None)


def test_a_ball_in_flight_at_the_end_and_one_that_goes_unexplained() -> None:
    assert [shot.ended_by for shot in gathered(tick(0, 0), tick(1, 0)).shots] == ["end"]
    assert [shot.ended_by for shot in gathered(tick(0, 0), tick(1, 0), tick(2)).shots] == ["lost"]


def test_a_ball_that_rolls_is_no_shot() -> None:
    rolling = [tick(number, ball(number, 3, is_shot=False), 4) for number in range(4)]
    assert [shot.number for shot in gathered(*rolling).shots] == [4]
    alone = gathered(*(tick(number, ball(number, 3, is_shot=False)) for number in range(4)))
    assert not alone.shots
    assert "rolls" in str(alone.no_shot_reason)


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
    ticks = [tick(number, ball(number, 4, x_px=100.0 + number)) for number in range(3)]
    for row in ticks:
        row.balls[0].track.covariance = np.diag([0.01, 0.04, 100.0, 400.0, 0.25])
    (shot,) = gathered(*ticks).shots
    assert shot.state[:, 0].tolist() == [100.0, 101.0, 102.0]
    assert shot.std == pytest.approx(np.tile([0.1, 0.2, 10.0, 20.0, 0.5], (3, 1)))
    assert shot.measured.tolist() == [True, False, True]
    assert shot.t_us.tolist() == [4900.0, 9900.0, 14_900.0]


def test_the_history_has_each_ticks_spin_and_rates() -> None:
    balls = [ball(number, 4) for number in range(3)]
    vector, covariance = np.array([1.0, 2.0, 3.0]), np.diag([0.1, 0.2, 0.3])
    balls[1].estimates = {"triplet": SpinEstimate("triplet", vector, covariance, None)}
    balls[2].results["rate"] = SimpleNamespace(spin_rps=50.0)
    (shot,) = gathered(*(tick(number, one) for number, one in enumerate(balls))).shots
    history = shot.history
    assert history is not None
    assert history.logo_rate_hz.tolist() == [0.0, 200.0, 400.0]
    assert np.isnan(history.rate_rps).tolist() == [True, True, False] and history.rate_rps[2] == 50.0
    assert history.estimates(0) == history.estimates(2) == []
    (estimate,) = history.estimates(1)
    assert estimate.method == "triplet" and estimate.vector_rps is not None
    assert estimate.vector_rps.tolist() == vector.tolist()
    assert np.array_equal(estimate.covariance_rps2, covariance)


def test_of_a_long_shot_only_the_last_ticks_are_kept_whole() -> None:
    """A ball on a spinner is one shot of any length."""
    log, balls = ShotLog(), [ball(number, 4) for number in range(200)]
    alive = [weakref.ref(one.track.mean) for one in balls]
    for number in range(200):
        log.add(tick(number, balls.pop(0)))
    gc.collect()
    assert sum(mean() is not None for mean in alive) <= EARLIER_US // 5000 + 2, "those, and the first"
    log.close()
    assert log.shots[0].t_us.size == 200 and log.shots[0].estimates["triplet"].reason == "tick 199"


def test_velocity_is_the_flights() -> None:
    assert flight((1.0, 6.0, -0.5)).velocity_m_s(CAMERA, 0.02) == pytest.approx([1.0, 6.0, -0.5], abs=1e-6)


def test_errors_against_truth_keep_the_axis_signed() -> None:
    def truth(*spin: float) -> Truth:
        many = np.tile(spin, (2, 1))
        return Truth(np.array([0, 10**6]), *np.zeros((3, 2)), many, many, many, np.zeros(0, np.uint8))

    assert flight((0, 5, 0)).error_against(truth(0, 50, 0), "triplet") == pytest.approx((10, 0))
    assert flight((0, 5, 0)).error_against(truth(0, -50, 0), "triplet") == pytest.approx((10, 180))
    assert flight((0, 5, 0)).error_against(truth(50, 0, 0), "triplet") == pytest.approx((10, 90))
