"""Several balls at once, contacts and occlusion, on ideal discs: who is who, when shots begin and end, and how."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.stages.track_parameters import TrackParameters
from spinscope.pipeline.stages.track_result import ShotEnd, TrackResult
from tests.track_runs import disc_events, inputs, merged, run, sample, setting, tracked

# So long a lens that the outline is round, before which a ball of this size is out of reach; no latency, lag or width.
PLACE = setting(focal_length_mm=500.0)
IDEAL = TrackParameters(latency_us=0.0, lag_px=0.0, outline_px=0.0, radius_min_px=5.0, radius_max_px=40.0)
RADIUS_PX, M_S = 17.0, 17.0 / 0.02


def disc(x_px: float, y_px: float, vx_m_s: float, vy_m_s: float, start_us: int, end_us: int) -> EventBatch:
    """A ball at this place at start_us."""
    return disc_events(np.array([x_px, y_px, vx_m_s * M_S, vy_m_s * M_S, RADIUS_PX]), start_us, end_us)


def results_of(*discs: EventBatch) -> list[TrackResult]:
    return run(inputs(merged(*discs), surface_mode="off"), IDEAL, PLACE)


def places(results: list[TrackResult], shot: int) -> dict[float, NDArray[np.float64]]:
    """Centres of a shot by time."""
    return {ball.t_us: ball.mean[:2] for result in results for ball in result.balls if ball.shot == shot}


def ends(results: list[TrackResult]) -> list[ShotEnd]:
    return [end for result in results for end in result.ended]


def test_balls_that_cross_keep_their_names() -> None:
    """Of the same speed, head on but for a third of the radius, and at a right angle."""
    for offset_px, velocity in ((6.0, (-6.0, 0.0)), (0.0, (0.0, 6.0))):
        start = 640.0 - 0.03 * velocity[0] * M_S, 360.0 + offset_px - 0.03 * velocity[1] * M_S
        first, second = (640.0 - 0.03 * 6.0 * M_S, 360.0), start
        results = results_of(disc(*first, 6.0, 0.0, 0, 60_000), disc(*start, *velocity, 0, 60_000))
        assert {ball.shot for result in results for ball in result.balls} == {0, 1}
        assert {result.balls[0].shot for result in results[1:]} == {0}, "the followed one stays first"
        paths = [((6.0, 0.0), first), (velocity, second)]
        for shot in (0, 1):
            seen = places(results, shot)
            off = [
                max(
                    np.hypot(*(np.add(begin, np.multiply(v, M_S * t_us * 1e-6)) - place))
                    for t_us, place in seen.items()
                )
                for v, begin in paths
            ]
            assert min(off) < 1.0 and len(seen) >= 11


def test_four_balls_have_a_track_each_within_15_ms() -> None:
    starts = [
        (300.0, 200.0, 5.0, 1.0),
        (900.0, 200.0, -5.0, 1.0),
        (300.0, 550.0, 5.0, -1.0),
        (900.0, 550.0, -5.0, -1.0),
    ]
    results = results_of(*(disc(*start, 0, 40_000) for start in starts))
    assert len(results[2].balls) == 4
    assert {ball.shot for result in results for ball in result.balls} == {0, 1, 2, 3}


def test_a_ball_that_comes_in_while_another_leaves_is_found_within_15_ms() -> None:
    leaving = disc(1000.0, 300.0, 6.0, 0.0, 0, 80_000)
    coming = disc(-20.0, 400.0, 6.0, 0.0, 30_000, 80_000)  # wholly in view after 37.3 ms
    results = results_of(leaving, coming)
    first = next(result for result in results if any(ball.shot == 1 for ball in result.balls))
    assert first.t_us <= 50_000
    (ball,) = [ball for ball in first.balls if ball.shot == 1]
    assert ball.began_by == "entered" and first.balls[0].shot == 0
    assert [(end.shot, end.ended_by) for end in ends(results)] == [(0, "left")]
    assert results[-1].balls[0].shot == 1


def test_balls_in_quick_succession_are_shots_of_their_own() -> None:
    """Three on the same path, 25 ms apart."""
    results = results_of(*(disc(-20.0, 360.0, 8.0, 0.0, start_us, 100_000) for start_us in (0, 25_000, 50_000)))
    assert {ball.shot for result in results for ball in result.balls} == {0, 1, 2}
    assert {ball.began_by for result in results for ball in result.balls} == {"entered"}


def hit(at_us: int) -> list[TrackResult]:
    x_px = 300.0 + 6.0 * M_S * at_us * 1e-6
    return results_of(
        disc(300.0, 360.0, 6.0, 0.5, 0, at_us),
        disc(x_px, 360.0 + 0.5 * M_S * at_us * 1e-6, -9.0, 2.0, at_us, at_us + 30_000),
    )


def test_a_hit_ends_a_shot_and_begins_the_next() -> None:
    """Wherever in a tick it is; the states since are given when it is known, and none of them mixes both."""
    for at_us in (40_000, 41_300, 43_900):
        results = hit(at_us)
        (end,) = ends(results)
        assert (end.shot, end.ended_by) == (0, "hit") and abs(end.end_us - at_us) < 2000
        known = next(number for number, result in enumerate(results) if result.ended)
        assert results[known].t_us <= at_us + 20_000
        (ball,) = results[known].balls
        assert (ball.shot, ball.began_by, ball.start_us) == (1, "hit", end.end_us)
        since = [result.t_us for result in results[:known] if result.t_us > end.end_us]
        assert [state.t_us for state in ball.earlier] == since and len(since) >= 1
        assert {state.shot for state in ball.earlier} == {1}
        for state in (*ball.earlier, ball):
            after_s = (state.t_us - at_us) * 1e-6
            x_px = 300.0 + 6.0 * M_S * at_us * 1e-6 - 9.0 * M_S * after_s
            y_px = 360.0 + 0.5 * M_S * at_us * 1e-6 + 2.0 * M_S * after_s
            assert np.hypot(*(state.mean[:2] - [x_px, y_px])) < 1.5
        assert all(not ball.earlier for result in results[known + 1 :] for ball in result.balls)


def test_a_ball_hidden_for_a_while_is_the_same_shot() -> None:
    """Behind an arm 10 ms long it goes on as predicted, and is found on its path; 40 ms later it is another."""
    whole = disc(200.0, 360.0, 6.0, 0.0, 0, 100_000)
    for hidden_us, shots in ((10_000, {0}), (40_000, {0, 1})):
        seen = merged(whole.between(0, 40_000), whole.between(40_000 + hidden_us, 100_000))
        results = results_of(seen)
        assert {ball.shot for result in results for ball in result.balls} == shots
        assert [end.ended_by for end in ends(results)] == ["lost"] * (len(shots) - 1)
        assert all(end.end_us == 40_000 for end in ends(results)), "when it was last seen"


def test_a_ball_that_rolls_is_tracked_but_no_shot() -> None:
    """A disc of constant radius and velocity, and a shot that comes in later, which is then followed."""
    place = setting()
    rolling = disc(100.0, 200.0, 2.0, 0.0, 0, 350_000)
    results = run(
        inputs(merged(rolling, disc(-20.0, 500.0, 8.0, 0.0, 300_000, 350_000)), surface_mode="off"), IDEAL, place
    )
    (ball,) = results[59].balls
    assert not ball.is_shot and ball.measured is not None
    assert [(ball.shot, ball.is_shot) for ball in results[-1].balls] == [(1, True), (0, False)]


def test_a_balls_shadow_is_tracked_but_no_shot() -> None:
    """A dark disc that goes along with a bright one; one that comes towards it is another ball."""

    def shots(shadow_m_s: float, shadow_x_px: float) -> list[tuple[int, bool]]:
        shadow = disc_events(np.array([shadow_x_px, 400.0, shadow_m_s * M_S, 0.0, 20.0]), 0, 60_000, bright=False)
        results = results_of(disc(300.0, 300.0, 6.0, 0.0, 0, 60_000), shadow)
        return sorted((round(ball.mean[1]), ball.is_shot) for ball in results[-1].balls)

    assert shots(5.4, 300.0) == [(300, True), (400, False)]
    assert shots(-5.4, 900.0) == [(300, True), (400, True)]


def test_a_ball_seen_in_part_counts_when_seen_again() -> None:
    """Two thirds of its outline, in every second tick: ground as bright as the rest of it hides that."""
    whole = disc(200.0, 360.0, 6.0, 0.0, 0, 60_000)
    seen = whole[(whole.y_px < 360 + 0.3 * RADIUS_PX) & (whole.t_us // 5000 % 2 == 1)]
    results = results_of(seen)
    assert [len(result.balls) for result in results[:3]] == [0, 0, 1], "at 10, 15 and 20 ms"
    assert results[0].status == results[1].status == "starting"
    ball = results[2].balls[0]
    states = (*ball.earlier, ball)
    assert [state.t_us for state in states] == [10_000, 15_000, 20_000]
    assert [state.measured is not None for state in states] == [True, False, True], "nothing is seen from 10 to 15 ms"
    assert {state.start_us for state in states} == {5000} and ball.began_by == "start"
    for state in states:
        true = [200.0 + 6.0 * M_S * state.t_us * 1e-6, 360.0, 6.0 * M_S, 0.0, RADIUS_PX]
        np.testing.assert_allclose(state.mean, true, atol=0.5, rtol=0.05)


def test_the_samples_balls_begin_and_end_as_they_do() -> None:
    for name in ("flight_back", "flight_fast_top", "flight_side"):
        balls = [ball for result in tracked(name) for ball in result.balls]
        assert {(ball.shot, ball.began_by, ball.is_shot) for ball in balls} == {(0, "entered", True)}
        assert all(end.ended_by == "left" for end in ends(tracked(name)))
    second = [ball for result in tracked("flight_two_balls") for ball in result.balls if ball.shot == 1]
    assert second[0].t_us < sample("flight_two_balls")[1].t_us[0] + 30_000


def test_a_shots_states_follow_each_other() -> None:
    for results in (tracked("flight_two_balls"), hit(42_000)):
        for shot in {ball.shot for result in results for ball in result.balls}:
            ends_us = [
                state.t_us + state.latency_us
                for result in results
                for ball in result.balls
                if ball.shot == shot
                for state in (*ball.earlier, ball)
            ]
            (start_us,) = {ball.start_us for result in results for ball in result.balls if ball.shot == shot}
            assert ends_us[0] > start_us, "its first tick ends after the shot began"
            assert all(later - before == 5000 for before, later in itertools.pairwise(ends_us))
