"""Each threshold of the tracker on both sides of it, and what its stated errors are made of."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.kernels.moving_circle import HALF_AHEAD, OF_DARK
from spinscope.pipeline.results import Packet
from spinscope.pipeline.stages import track, track_ball, track_initiation, track_state
from spinscope.pipeline.stages.track_ball import TrackedBall
from spinscope.pipeline.stages.track_kalman import BallFilter
from spinscope.pipeline.stages.track_outline import Sighting
from spinscope.pipeline.stages.track_parameters import TrackParameters
from spinscope.pipeline.stages.track_result import BallTrack
from spinscope.pipeline.stages.track_rim import USUAL_BEHIND_PX, Rim
from spinscope.pipeline.stages.track_search import agree
from tests.track_runs import PAPER_CONTEXT

RING = np.array([600.0, 350.0, 3000.0, -4000.0, 17.0])
SPREAD = np.diag([0.01, 0.02, 100.0**2, 120.0**2, 0.03])


def sighting(**changes: object) -> Sighting:
    """An outline that is beyond doubt, 5000 px/s fast."""
    clear = Sighting(RING, SPREAD, 0.15, 80, ahead=0.95, behind=0.9, contrast=0.95, ahead_on=0.97, visible=1.0,
                     clutter=0.05)  # fmt: skip
    return dataclasses.replace(clear, **changes)


def speed_known_to(share: float) -> np.ndarray:
    """Covariance with this standard deviation of the speed, as a share of 5000 px/s, on both axes together."""
    return np.diag([0.01, 0.01, 0.5 * (share * 5000.0) ** 2, 0.5 * (share * 5000.0) ** 2, 0.01])


def radius_known_to(share: float) -> np.ndarray:
    """Covariance with this standard deviation of the radius, as a share of it."""
    return np.diag([0.01, 0.01, 100.0**2, 100.0**2, (share * RING[4]) ** 2])


@pytest.mark.parametrize(
    ("enough", "too_little"),
    [
        ({"ahead": 0.81}, {"ahead": 0.79}),
        ({"behind": 0.61}, {"behind": 0.59}),
        ({"contrast": 0.81}, {"contrast": 0.79}),
        ({"contrast": -0.81}, {"contrast": -0.79}),
        ({"visible": 0.61}, {"visible": 0.59}),
        ({"clutter": 0.29}, {"clutter": 0.31}),
        ({"covariance": speed_known_to(0.099)}, {"covariance": speed_known_to(0.101)}),
    ],
)
def test_one_outline_is_trusted_only_with_every_sign_of_a_ball(
    enough: dict[str, object], too_little: dict[str, object]
) -> None:
    assert sighting().trusted
    assert sighting(**enough).trusted and not sighting(**too_little).trusted


@pytest.mark.parametrize(
    ("enough", "too_little"),
    [
        ({"ahead": 0.21}, {"ahead": 0.19}),
        ({"behind": 0.21}, {"behind": 0.19}),
        ({"clutter": 0.019}, {"clutter": 0.021}),
        ({"covariance": speed_known_to(0.099)}, {"covariance": speed_known_to(0.101)}),
        ({"covariance": radius_known_to(0.029)}, {"covariance": radius_known_to(0.031)}),
    ],
)
def test_arcs_are_an_outline_only_with_every_sign_of_one(
    enough: dict[str, object], too_little: dict[str, object]
) -> None:
    base = {"ahead": 0.33, "behind": 0.33, "clutter": 0.0}
    assert sighting(**base).in_arcs and not sighting(**base).trusted
    assert sighting(**base | enough).in_arcs and not sighting(**base | too_little).in_arcs


def test_a_ball_seen_in_arcs_is_less_certain_along_its_motion() -> None:
    packet = Packet(0, 0, 5000, EventBatch.empty())
    half, whole = (
        TrackedBall.at(sighting(part=part), MEASURING, 0, packet, "found").total_covariance()[:2, :2]
        for part in (HALF_AHEAD, OF_DARK)
    )
    along = RING[2:4] / 5000.0
    across = np.array([-along[1], along[0]])
    assert math.isclose(along @ (whole - half) @ along, track_ball.ARCS_LAG_STD_PX**2)
    assert abs(across @ (whole - half) @ across) < 1e-12


@pytest.mark.parametrize(
    ("enough", "too_little"),
    [
        ({"ahead": 0.71}, {"ahead": 0.69}),
        ({"ahead_on": 0.86}, {"ahead_on": 0.84}),
        ({"ahead_on": 0.14}, {"ahead_on": 0.16}),
        ({"clutter": 0.49}, {"clutter": 0.51}),
    ],
)
def test_a_half_outline_is_promising_if_clear(enough: dict[str, object], too_little: dict[str, object]) -> None:
    assert sighting(behind=0.0, **enough).promising and not sighting(behind=0.0, **too_little).promising


@pytest.mark.parametrize(
    ("enough", "too_little"),
    [
        ({"ahead": 0.51}, {"ahead": 0.49}),
        ({"clutter": 0.09}, {"clutter": 0.11}),
        ({"covariance": speed_known_to(0.099)}, {"covariance": speed_known_to(0.101)}),
    ],
)
def test_a_part_of_an_outline_is_isolated_if_nothing_is_around_it(
    enough: dict[str, object], too_little: dict[str, object]
) -> None:
    assert sighting(behind=0.0, contrast=0.0, **enough).isolated
    assert not sighting(behind=0.0, contrast=0.0, **too_little).isolated


@pytest.mark.parametrize(
    ("near", "far"),
    [
        ([2.0 + 2.45, 0, 0, 0, 0], [2.0 + 2.55, 0, 0, 0, 0]),  # 2 px and a tenth of the way of 5 ms
        ([0, -4.45, 0, 0, 0], [0, -4.55, 0, 0, 0]),
        ([0, 0, 0, 0, 2.65], [0, 0, 0, 0, 2.75]),  # a pixel and a tenth of the radius
        ([0, 0, 0, 0, -2.65], [0, 0, 0, 0, -2.75]),
        ([0, 0, 1490, 0, 0], [0, 0, 1510, 0, 0]),  # three tenths of the speed
    ],
)
def test_two_sightings_are_of_one_ball_if_it_moved_as_it_said(near: list[float], far: list[float]) -> None:
    moved = np.add(RING, [15.0, -20.0, 0, 0, 0])
    assert agree(sighting(), sighting(ring=moved + near), 5000)
    assert not agree(sighting(), sighting(ring=moved + far), 5000)


def test_other_balls_are_looked_for_every_5_ms_and_at_once_when_one_is_missed() -> None:
    state = track.start(TrackParameters(), PAPER_CONTEXT)
    state.looked_us = 50_000

    def is_due(end_us: int, tick_us: int = 5000) -> bool:
        return track_initiation.is_search_due(TrackParameters(tick_us=tick_us), state, packet_to(end_us))

    assert is_due(51_000), "no ball yet"
    assert not is_due(54_000, 1000) and is_due(55_000, 1000), "not sooner in short ticks"
    assert not is_due(52_000, 2000) and is_due(54_000, 2000), "nor later"
    state.balls = [tracked_ball()]
    assert not is_due(54_999) and is_due(55_000)
    assert not is_due(51_000)
    state.balls[0].coast(51_000)
    assert is_due(51_000) and is_due(51_000, 1000)


@pytest.mark.parametrize(
    ("speed_m_s", "x_px", "trusted", "wait_us"),
    [
        (3.4, 640.0, True, 20_000),
        (3.6, 640.0, True, 0),
        (3.6, 640.0, False, 3000),
        (2.0, 86.0, True, 20_000),  # five radii of 17 px from the border
        (2.0, 84.0, True, 0),
        (2.0, 1279.0 - 86.0, True, 20_000),
        (2.0, 1279.0 - 84.0, False, 3000),
    ],
)
def test_what_turns_up_slowly_in_the_middle_is_watched(
    speed_m_s: float, x_px: float, trusted: bool, wait_us: int
) -> None:
    parameters = TrackParameters()
    state = track.start(parameters, PAPER_CONTEXT)
    speed_px_s = speed_m_s * 17.0 / 0.02
    ring = np.array([x_px, 300.0, 0.6 * speed_px_s, 0.8 * speed_px_s, 17.0])
    ahead = 0.95 if trusted else 0.75
    seen = sighting(ring=ring, covariance=np.zeros((5, 5)), ahead=ahead)
    assert seen.trusted == trusted
    assert track_initiation._wait_us(parameters, state, seen) == wait_us


def ball_filter() -> BallFilter:
    return BallFilter(RING, SPREAD, 2e4, 100.0)


def test_the_filter_takes_in_what_is_within_its_gate() -> None:
    """Squared Mahalanobis distance of three independent offsets, each by its own variance."""
    noise = np.diag([0.03, 0.07, 0.06])
    sigmas = np.sqrt([0.01 + 0.03, 0.02 + 0.07, 0.03 + 0.06])
    for distance, taken in ((4.9, True), (5.1, False)):
        for towards in (np.array([1.0, 0, 0]), np.array([0, 0.6, -0.8]), np.array([2.0, -1.0, 2.0]) / 3):
            ball = ball_filter()
            observed = RING[[0, 1, 4]] + distance * sigmas * towards
            assert ball.update(observed, noise, track_ball.MOST_SURPRISE) == taken
            assert np.array_equal(ball.mean, RING) != taken
            assert np.array_equal(ball.covariance, SPREAD) != taken


def test_the_filters_update_is_the_bayesian_one() -> None:
    ball, noise = ball_filter(), np.diag([0.03, 0.07, 0.06])
    observed = RING[[0, 1, 4]] + [0.1, -0.2, 0.05]
    assert ball.update(observed, noise, 25.0)
    pick = np.eye(5)[[0, 1, 4]]
    information = np.linalg.inv(SPREAD) + pick.T @ np.linalg.inv(noise) @ pick
    expected = np.linalg.solve(information, np.linalg.solve(SPREAD, RING) + pick.T @ np.linalg.solve(noise, observed))
    np.testing.assert_allclose(ball.mean, expected, rtol=1e-9)
    np.testing.assert_allclose(ball.covariance, np.linalg.inv(information), rtol=1e-6, atol=1e-12)


def test_a_prediction_moves_the_ball_and_spreads_by_its_acceleration() -> None:
    ball = ball_filter()
    for _ in range(2):  # the second step with the same matrices, the third with others
        ball.predict(0.005)
    ball.predict(0.002)
    np.testing.assert_allclose(ball.mean, np.add(RING, [36.0, -48.0, 0, 0, 0]))
    covariance = SPREAD
    for dt in (0.005, 0.005, 0.002):
        move, push = np.eye(5), np.zeros((5, 3))
        move[0, 2] = move[1, 3] = dt
        push[[0, 1], [0, 1]], push[[2, 3], [0, 1]], push[4, 2] = 2e4 * dt * dt / 2, 2e4 * dt, 100.0 * dt
        covariance = move @ covariance @ move.T + push @ push.T
    np.testing.assert_allclose(ball.covariance, covariance, rtol=1e-9)


MEASURING = track.start(TrackParameters(), PAPER_CONTEXT).measuring


def packet_to(end_us: int, tick_us: int = 5000) -> Packet:
    return Packet(end_us // tick_us - 1, end_us - tick_us, end_us, EventBatch.empty())


def tracked_ball() -> TrackedBall:
    """A ball of the clear sighting, seen until 15 ms."""
    return TrackedBall.at(sighting(), MEASURING, 0, packet_to(15_000), "start")


def updated(
    monkeypatch: pytest.MonkeyPatch, seen: Sighting | None, tick_us: int = 5000
) -> tuple[bool, TrackedBall, list[np.ndarray]]:
    """(whether it was measured, the ball, noise given to the filter) of one measurement with this sighting."""
    given: list[np.ndarray] = []

    def update(self: BallFilter, observed: np.ndarray, noise: np.ndarray, most_surprise: float) -> bool:
        given.append(noise)
        return True

    ball = tracked_ball()
    monkeypatch.setattr(track_ball, "measure", lambda *arguments: seen)
    monkeypatch.setattr(BallFilter, "update", update)
    measured = ball.measure(MEASURING, EventBatch.empty(), 20_000 - tick_us, 20_000)
    return measured is not None, ball, given


def test_an_outline_must_show_some_of_its_half_ahead(monkeypatch: pytest.MonkeyPatch) -> None:
    measured, ball, _ = updated(monkeypatch, sighting(ahead=0.31))
    assert measured and ball.seen_us == 20_000
    for seen in (sighting(ahead=0.29), None):
        measured, ball, given = updated(monkeypatch, seen)
        assert not measured and ball.seen_us == 15_000 and not given


@pytest.mark.parametrize(("tick_us", "shared"), [(1000, 3.0), (2000, 1.5), (3000, 1.0), (5000, 1.0)])
def test_events_shared_by_two_ticks_count_less(monkeypatch: pytest.MonkeyPatch, tick_us: int, shared: float) -> None:
    """An outline reaches 3 ms back: at 1 kHz each event is in three of them."""
    _, _, (noise,) = updated(monkeypatch, sighting(), tick_us)
    np.testing.assert_allclose(noise, shared * (np.diag([0.01, 0.02, 0.03]) + 0.05**2 * np.eye(3)))


def test_circles_from_arcs_scatter_more(monkeypatch: pytest.MonkeyPatch) -> None:
    """By half a pixel, which is neither a contact nor another ball."""
    _, _, (noise,) = updated(monkeypatch, sighting(part=OF_DARK))
    np.testing.assert_allclose(noise, np.diag([0.01, 0.02, 0.03]) + 0.5**2 * np.eye(3))


def test_an_outline_cut_by_the_border_counts_less_in_the_path(monkeypatch: pytest.MonkeyPatch) -> None:
    """A fifth of it hidden: by 0.3 of a fifth of the radius more."""
    _, ball, (noise,) = updated(monkeypatch, sighting(visible=0.8))
    np.testing.assert_allclose(ball.path[-1].noise - noise, (0.3 * 0.2 * 17.0) ** 2 * np.eye(3))


def test_the_stated_error_holds_what_no_filtering_takes_away() -> None:
    """12 us of latency along the flight, 0.06 px of place and 0.3 px of radius, beside the filter's own."""
    late_px = np.array([3000.0, -4000.0]) * 12e-6
    expected = SPREAD + np.diag([0.06**2, 0.06**2, 0.0, 0.0, 0.3**2])
    expected[:2, :2] += np.outer(late_px, late_px)
    ball = dataclasses.replace(tracked_ball(), filter=ball_filter())
    np.testing.assert_allclose(ball.total_covariance(), expected, rtol=1e-12)
    np.testing.assert_array_equal(ball.filter.covariance, SPREAD)


def test_a_ball_reaches_as_far_as_its_rim(monkeypatch: pytest.MonkeyPatch) -> None:
    """As the outlines wholly in view tell; arcs say nothing of it."""

    def state(**changes: object) -> tuple[TrackedBall, BallTrack]:
        _, ball, _ = updated(monkeypatch, sighting(**changes))
        return ball, ball.track(20_000, 40.0, 0.5, ())

    first = tracked_ball().rim
    (_, usual), (ball, bright) = state(behind_px=USUAL_BEHIND_PX), state(behind_px=0.8, behind=0.4)
    assert first == Rim().with_outline(sighting()) and ball.rim == first.with_outline(
        sighting(behind_px=0.8, behind=0.4)
    )
    rim_px = ball.rim.outside_px(float(np.hypot(*bright.mean[2:4])))
    np.testing.assert_allclose(bright.mean - usual.mean, [0.0, 0.0, 0.0, 0.0, rim_px], atol=1e-9)
    assert usual.measured is not None and bright.measured is not None
    assert bright.measured.radius_px - usual.measured.radius_px == pytest.approx(rim_px)
    spread = np.diag([1.0, 1.0, 0.0, 0.0, 1.0]) * ball.rim.std_px(float(usual.mean[4])) ** 2
    np.testing.assert_allclose(bright.covariance - ball.total_covariance(), spread, atol=1e-9)
    assert ball.track(20_000, 40.0, 0.0, ()).mean[4] == usual.mean[4], "the circle of the events ahead"
    _, printed, _ = updated(monkeypatch, sighting(ahead_on=0.8))
    shown = printed.path[-1]
    assert shown.circle is not None and shown.shake_px == printed.rim.unsteady_px(shown.circle.radius_px) > 0.0
    for changes in ({"part": OF_DARK}, {"visible": 0.9}):
        assert state(behind_px=0.8, behind=0.4, **changes)[0].rim == first


@pytest.mark.parametrize("axis", [0, 1])
def test_a_ball_has_left_when_less_than_a_tenth_of_its_width_is_in_view(axis: int) -> None:
    """Its centre 0.8 radii beyond the middle of the last pixel, on every side."""
    for place, last in ((-0.8 * 17.0, -1), ((1279, 719)[axis] + 0.8 * 17.0, 1)):
        for inwards, beyond in ((0.05, False), (-0.05, True)):
            mean = RING.copy()
            mean[axis] = place - last * inwards
            assert track_state.is_beyond(mean, PAPER_CONTEXT.camera) == beyond


def test_the_ball_is_smaller_than_its_outline_and_ahead_of_it() -> None:
    """By 0.5 px, and by 0.1 px along the flight whatever the speed; there and back is nothing."""
    edge = MEASURING.edge
    shift = 0.1 * np.array([0.6, -0.8])
    np.testing.assert_allclose(edge.ball(RING), np.add(RING, [*shift, 0, 0, -0.5]))
    np.testing.assert_allclose(edge.ball(edge.outline(RING)), RING)
    still = RING * [1, 1, 0, 0, 1]
    np.testing.assert_allclose(edge.outline(still), np.add(still, [0, 0, 0, 0, 0.5]))


def test_a_new_track_begins_with_the_sightings_spread_and_room_for_acceleration() -> None:
    state = track.start(TrackParameters(outline_px=0.0, lag_px=0.0), PAPER_CONTEXT)
    state.shots = 4
    state.past.add(packet_to(10_000))
    earlier: track_state.Earlier = {}
    track_initiation._begin(TrackParameters(), state, packet_to(10_000), sighting(), earlier, [])
    (ball,) = state.balls
    assert not earlier, "no tick came before"
    speed_std_px_s = 0.2 * 17.0 / 0.02
    expected = SPREAD + np.diag([0.05**2, 0.05**2, speed_std_px_s**2, speed_std_px_s**2, 0.05**2])
    np.testing.assert_allclose(ball.filter.covariance, expected)
    assert (ball.shot, state.shots, ball.seen_us, ball.start_us) == (4, 5, 10_000, 5000)
    ball.filter.predict(1.0)
    radius_std_px = math.sqrt(0.03 + 0.05**2 + (3.0 * 17.0 / 0.02 * 17.0 / 1646.09) ** 2)
    assert math.sqrt(ball.filter.covariance[4, 4]) == pytest.approx(radius_std_px, rel=1e-4)


def moved_on(by_us: int, **changes: object) -> Sighting:
    """The clear sighting's ball so much later."""
    return sighting(ring=RING + np.array([3000.0, -4000.0, 0, 0, 0]) * by_us * 1e-6, **changes)


def test_a_ball_out_of_sight_is_found_again_where_the_paths_meet() -> None:
    """5 ms after its last sight: on its way, or turned round at a racket, but not elsewhere nor of another size."""
    ball = tracked_ball()
    assert ball.is_found(moved_on(5000), 20_000)
    turned = RING * [1, 1, -1, -1, 1] + [-3.0, 4.0, 0, 0, 0]
    assert ball.is_found(sighting(ring=turned), 20_000)
    aside = np.add(turned, [40.0, 30.0, 0, 0, 0])  # fifty pixels beside the old path, parallel to it
    assert not ball.is_found(sighting(ring=aside), 20_000)
    assert not ball.is_found(sighting(ring=turned * [1, 1, 1, 1, 1.15]), 20_000)


def test_two_tracks_of_one_outline_are_told_from_two_balls_that_cross() -> None:
    ball, double, crossing = tracked_ball(), tracked_ball(), tracked_ball()
    assert double.shares_outline(ball)
    assert track._doubles([ball, double]) == [double]
    crossing.filter = BallFilter(RING * [1, 1, -1, 1, 1], SPREAD, 2e4, 100.0)
    assert not crossing.shares_outline(ball)
    double.coast(20_000)
    assert not double.shares_outline(ball)


@pytest.mark.parametrize(
    ("contrast", "velocity_share", "is_shadow"),
    [(-0.9, 0.9, True), (-0.9, 0.75, True), (-0.9, 0.65, False), (-0.45, 0.9, False), (0.9, 0.9, False)],
)
def test_a_shadow_is_dark_and_keeps_pace_with_its_ball(contrast: float, velocity_share: float, is_shadow: bool) -> None:
    ball, other = tracked_ball(), tracked_ball()
    other.contrast = contrast
    other.filter.mean = RING * np.array([1, 1, velocity_share, velocity_share, 1]) + [60.0, 0, 0, 0, 0]
    assert other.is_shadow_of(ball) == is_shadow
    assert not ball.is_shadow_of(other)


@pytest.mark.parametrize(
    ("x_px", "first_us", "began_by"),
    [(100.0, 0, "start"), (640.0, 0, "start"), (60.0, -100_000, "entered"), (640.0, -100_000, "found")],
)
def test_how_a_shot_began(x_px: float, first_us: int, began_by: str) -> None:
    """Back along its flight by 30 ms or to the recording's start: out of view, in view, or too late to say."""
    state = track.start(TrackParameters(), PAPER_CONTEXT)
    state.first_us = first_us
    ball = np.array([x_px, 300.0, 3000.0, 0.0, 17.0])
    assert track_initiation._began_by(state, packet_to(10_000), ball) == began_by
