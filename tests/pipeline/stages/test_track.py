"""The tracker against the truth of the sample flights, and what it must never do."""

from __future__ import annotations

import re

import numpy as np
import pytest

from spinscope.pipeline.errors import ParameterError
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.stages import track
from spinscope.pipeline.stages.track_parameters import TrackParameters
from tests.track_runs import (
    HEIGHT,
    WIDTH,
    disc_events,
    inputs,
    merged,
    run,
    sample,
    setting,
    tracked,
    transformed,
    true_ball,
    wholly_in_view,
)

FLIGHTS = (
    "flight_slow_top",
    "flight_back",
    "flight_fast_top",
    "flight_mixed",
    "flight_two_balls",
    "flight_side",
)


@pytest.mark.parametrize("tick_us", [1000, 5000, 10_000])
@pytest.mark.parametrize("name", FLIGHTS)
def test_flights_are_tracked_to_a_fraction_of_a_pixel(name: str, tick_us: int) -> None:
    """Found within 10 ms of being wholly in view, never lost before it leaves, with an honest 1 sigma."""
    _, truth = sample(name)
    results = tracked(name, tick_us)
    ball = true_ball(truth, np.array([result.t_us for result in results]))
    whole = wholly_in_view(ball)
    mean = np.stack([result.mean for result in results])
    near = np.hypot(*(mean[:, :2] - ball[:, :2]).T) < 20
    first = int(np.argmax(near))
    dense_us = np.arange(truth.t_us[0], truth.t_us[-1], 100.0)
    in_view_us = dense_us[np.argmax(wholly_in_view(true_ball(truth, dense_us)))]
    assert results[first].t_us - in_view_us <= 10_000

    judged = np.flatnonzero(whole & (np.arange(len(results)) >= first))
    assert all(results[i].status == "tracking" for i in judged)
    assert len({results[i].shot for i in judged}) == 1
    off = mean[judged][:, [0, 1, 4]] - ball[judged]
    assert np.hypot(off[:, 0], off[:, 1]).mean() <= 0.2
    assert np.abs(off[:, 2]).mean() <= 0.2
    surprise = [
        e @ np.linalg.solve(results[i].covariance[np.ix_([0, 1, 4], [0, 1, 4])], e) / 3
        for i, e in zip(judged, off, strict=True)
    ]
    assert 0.3 < np.sqrt(np.mean(surprise)) < 1.5


@pytest.mark.parametrize("name", FLIGHTS)
def test_the_velocity_is_the_truths(name: str) -> None:
    _, truth = sample(name)
    for result in tracked(name)[3:]:
        if result.status == "tracking" and result.shot == tracked(name)[8].shot:
            before, after = true_ball(truth, np.array([result.t_us - 2500, result.t_us + 2500]))[:, :2]
            if np.isfinite(before + after).all() and wholly_in_view(true_ball(truth, np.array([result.t_us])))[0]:
                assert np.hypot(*(result.mean[2:4] - (after - before) / 5e-3)) < 200


def test_reasons_and_fields_fit_the_status() -> None:
    for name in FLIGHTS:
        for result in tracked(name):
            assert (result.reason is None) == result.has_ball
            assert (result.shot is None) == (not result.has_ball)
            assert (result.measured is not None) == (result.status == "tracking")
            assert (result.candidate is not None) == (result.status == "starting")
            assert np.isnan(result.mean).all() != result.has_ball
            if result.status == "tracking":
                assert result.hough is not None
    ends = [result.reason for result in tracked("flight_back") if result.status == "lost"]
    assert ends == ["the ball left the view"]


def test_a_slow_second_ball_never_takes_over() -> None:
    """It crosses in front of the first one: from the first sighting on the fast ball is the only one."""
    results = tracked("flight_two_balls")
    _, truth = sample("flight_two_balls")
    ball = true_ball(truth, np.array([result.t_us for result in results]))
    first = next(i for i, r in enumerate(results) if r.has_ball and abs(r.mean[0] - ball[i, 0]) < 2)
    assert first <= 2
    for result, there in zip(results[first:], ball[first:], strict=True):
        if result.has_ball and np.isfinite(there[0]):
            assert np.hypot(*(result.mean[:2] - there[:2])) < 2


def test_shots_one_after_another_are_numbered() -> None:
    parts, later_us = [], 0
    for name in ("flight_back", "flight_mixed", "flight_fast_top"):
        parts.append(transformed(sample(name)[0], t_us=later_us))
        later_us += 200_000
    results = run(inputs(EventBatch.concatenate(parts)))
    shots = [result.shot for result in results if result.shot is not None]
    assert shots == sorted(shots)
    assert set(shots) == {0, 1, 2}
    for number, since_us in enumerate((0, 200_000, 400_000)):
        mine = [r.t_us for r in results if r.shot == number]
        assert since_us < min(mine) < max(mine) < since_us + 130_000


def noise(rate_hz: float, seed: int) -> EventBatch:
    rng = np.random.default_rng(seed)
    count = int(rate_hz * 0.1)
    return EventBatch(
        np.sort(rng.integers(0, 100_000, count)),
        rng.integers(0, WIDTH, count).astype(np.uint16),
        rng.integers(0, HEIGHT, count).astype(np.uint16),
        rng.random(count) < 0.5,
    )


def edges(speed_px_s: float, seed: int) -> EventBatch:
    """Eight slanted edges that move to the right, ON and OFF in turn."""
    rng = np.random.default_rng(seed)
    t_us = np.sort(rng.integers(0, 100_000, 60_000))
    number = rng.integers(0, 8, t_us.size)
    y = rng.integers(100, 600, t_us.size)
    x = (60 * number + speed_px_s * t_us * 1e-6) % WIDTH + 0.2 * y + rng.normal(0, 0.7, t_us.size)
    seen = (x >= 0) & (x < WIDTH)
    return EventBatch(t_us[seen], x[seen].astype(np.uint16), y[seen].astype(np.uint16), (number % 2 == 0)[seen])


@pytest.mark.parametrize(
    "events",
    [
        pytest.param(noise(1e5, 1), id="noise"),
        pytest.param(noise(3e6, 2), id="much noise"),
        pytest.param(edges(1000.0, 3), id="slow edges"),
        pytest.param(edges(6000.0, 4), id="fast edges"),
        pytest.param(sample("spinner_ball2_side")[0], id="ball spinner"),
        pytest.param(sample("spinner_ball1_top")[0], id="ball spinner, top"),
    ],
)
def test_no_ball_where_there_is_none(events: EventBatch) -> None:
    for tick_us in (1000, 5000):
        results = run(inputs(events, tick_us))
        assert not any(result.has_ball for result in results)
        assert all((result.reason or "").startswith("no ball") for result in results)


def test_noise_and_hot_pixels_do_not_disturb() -> None:
    rng = np.random.default_rng(5)
    hot = EventBatch(
        np.sort(rng.integers(0, 95_000, 20_000)),
        rng.integers(400, 700, 20).astype(np.uint16)[rng.integers(0, 20, 20_000)],
        rng.integers(0, 700, 20).astype(np.uint16)[rng.integers(0, 20, 20_000)],
        rng.random(20_000) < 0.5,
    )
    events, truth = sample("flight_fast_top")
    results = run(inputs(merged(events, hot, noise(1e6, 6))))
    ball = true_ball(truth, np.array([result.t_us for result in results]))
    judged = [i for i in np.flatnonzero(wholly_in_view(ball)) if i >= 2]
    assert all(results[i].status == "tracking" for i in judged)
    off = [np.hypot(*(results[i].mean[:2] - ball[i, :2])) for i in judged]
    assert np.mean(off) < 0.3


def test_a_ball_that_stops_sending_is_coasted_then_lost() -> None:
    results = run(inputs(sample("flight_slow_top")[0].between(0, 80_000)))
    assert results[-1].status == "tracking"
    silent = EventBatch.concatenate(
        [sample("flight_slow_top")[0].between(0, 80_000), noise(1e3, 7).between(0, 100_000)]
    )
    results = run(inputs(merged(silent, transformed(noise(1e3, 8), t_us=80_000))))
    after = [result.status for result in results[16:22]]
    assert after == ["coasting", "coasting", "coasting", "coasting", "lost", "searching"]
    widths = [np.sqrt(result.covariance[0, 0]) for result in results[15:20]]
    assert widths == sorted(widths)
    assert results[20].reason == "the ball was not seen for 20 ms"


@pytest.mark.parametrize("bright", [True, False])
@pytest.mark.parametrize("radius_px", [5.0, 7.0, 18.0, 38.0, 52.0, 100.0, 150.0])
def test_ideal_balls_of_any_size_bright_or_dark(bright: bool, radius_px: float) -> None:
    """No latency, no lag, no width, and so long a lens that the outline is round: 2 to 20 m/s of a 40 mm ball."""
    place = setting(focal_length_mm=500.0)
    ideal = TrackParameters(latency_us=0.0, lag_px=0.0, outline_px=0.0, radius_min_px=4.0, radius_max_px=180.0)
    # A small and slow one gives too few events, and a large one crosses the image at 20 m/s before it is tracked.
    for speed_m_s in (8.0, 20.0) if radius_px < 6 else (2.0, 8.0, 20.0) if radius_px < 50 else (2.0, 4.0):
        speed_px_s = speed_m_s * radius_px / 0.02
        ring = np.array([1.5 * radius_px, 360.4, 0.8 * speed_px_s, -0.6 * speed_px_s, radius_px])
        rows = inputs(disc_events(ring, 0, 15_000, bright=bright), surface_mode="off")
        results = run(rows, ideal, place)
        for result in results[1:]:
            assert result.status == "tracking"
            expected = ring + np.array([ring[2], ring[3], 0, 0, 0]) * result.t_us * 1e-6
            assert np.hypot(*(result.mean - expected)[:2]) < 0.15
            assert abs(result.mean[4] - radius_px) < 0.15


@pytest.mark.parametrize("ground", ["darker", "brighter", "both"])
def test_low_contrast_of_one_event_a_pixel_is_tracked_within_10_ms(ground: str) -> None:
    """STC passes none of these events: the surface stays empty. Over a line the outline is ON here and OFF there."""
    ring = np.array([400.0, 300.4, 4800.0, -2100.0, 17.5])
    events = disc_events(ring, 0, 40_000, bright=ground != "brighter")
    if ground == "both":
        events = EventBatch(events.t_us, events.x_px, events.y_px, events.on ^ (events.y_px % 40 < 20))
    rows = inputs(events)
    assert all(len(filtered.surface_events) == 0 for _, filtered, _ in rows)
    ideal = TrackParameters(latency_us=0.0, lag_px=0.0, outline_px=0.0)
    results = run(rows, ideal)
    assert [result.status for result in results[1:]] == ["tracking"] * 7
    for result in results[1:]:
        expected = ring + np.array([ring[2], ring[3], 0, 0, 0]) * result.t_us * 1e-6
        assert np.hypot(*(result.mean - expected)[:2]) < 0.3
        assert abs(result.mean[4] - 17.5) < 0.3


@pytest.mark.parametrize(
    ("setting_name", "value", "words"),
    [
        ("radius_max_px", 12.0, "moves like a ball, track.radius_max_px = 12 excludes it"),
        ("radius_min_px", 30.0, "moves like a ball, track.radius_min_px = 30 excludes it"),
        ("speed_max_m_s", 3.0, "m/s, track.speed_max_m_s = 3 excludes it"),
        ("speed_min_m_s", 20.0, "m/s, track.speed_min_m_s = 20 excludes it"),
    ],
)
def test_no_ball_names_the_setting_that_excludes_a_circle_and_a_value_that_admits_it(
    setting_name: str, value: float, words: str
) -> None:
    rows = inputs(sample("flight_slow_top")[0].between(20_000, 80_000))
    results = run(rows, TrackParameters(**{setting_name: value}))
    assert not any(result.has_ball for result in results)
    reason = results[-1].reason or ""
    assert words in reason and reason.startswith("no ball: a circle of radius 1")
    advised = re.search(r"excludes it: ([0-9.]+) or (?:more|less) admits it$", reason)
    assert advised is not None
    assert any(result.has_ball for result in run(rows, TrackParameters(**{setting_name: float(advised[1])})))


def test_no_ball_names_no_setting_for_what_is_seen_once() -> None:
    """A mark on a ball looks for a tick like a smaller ball: changing a limit would find none."""
    parameters = TrackParameters(radius_max_px=12.0)
    ball = disc_events(np.array([400.0, 300.4, 4800.0, -2100.0, 17.5]), 0, 40_000)
    lone = EventBatch(np.array([39_000]), np.array([9], np.uint16), np.array([9], np.uint16), np.array([True]))
    for seen_us, is_named in ((10_000, False), (20_000, True)):
        rows = inputs(merged(ball.between(5000, seen_us), lone))
        reasons = [result.reason for result in run(rows, parameters)]
        assert any("radius_max_px = 12 excludes it" in reason for reason in reasons if reason) == is_named
    assert any(result.has_ball for result in run(inputs(ball.between(5000, 20_000)), TrackParameters()))


@pytest.mark.parametrize("mode", ["stc", "stc_cut_trail"])
def test_no_ball_names_the_filter_that_removes_its_outline(mode: str) -> None:
    """One event a pixel, of which STC passes none; noise that it removes as well is no ball."""
    events = disc_events(np.array([400.0, 300.4, 4800.0, -2100.0, 17.5]), 0, 40_000)
    results = run(inputs(events, place=setting(contour_mode=mode)), place=setting(contour_mode=mode))
    assert not any(result.has_ball for result in results)
    reason = results[-1].reason or ""
    assert reason.startswith("no ball: a circle of radius 1")
    assert reason.endswith(f"filter.contour_mode = {mode} removes it: off keeps it")
    kept = setting(contour_mode="off")
    assert any(result.has_ball for result in run(inputs(events, place=kept), place=kept))
    rng = np.random.default_rng(17)
    noise = EventBatch(
        np.sort(rng.integers(0, 40_000, 20_000)),
        rng.integers(0, WIDTH, 20_000).astype(np.uint16),
        rng.integers(0, HEIGHT, 20_000).astype(np.uint16),
        rng.random(20_000) < 0.5,
    )
    results = run(inputs(noise, place=setting(contour_mode=mode)), place=setting(contour_mode=mode))
    assert not any("filter" in (result.reason or "") for result in results)


def test_a_slow_ball_in_the_middle_is_watched_before_it_is_a_shot() -> None:
    """Across the border it is one at once (the test above); here a fast one would be."""
    place = setting(focal_length_mm=500.0)
    for speed_m_s, ticks in ((2.0, 4), (4.0, 0)):
        speed_px_s = speed_m_s * 18.0 / 0.02
        events = disc_events(np.array([600.0, 350.0, speed_px_s, 0.0, 18.0]), 0, 40_000)
        ideal = TrackParameters(radius_min_px=5.0, radius_max_px=40.0)
        statuses = [result.status for result in run(inputs(events, surface_mode="off"), ideal, place)]
        assert statuses == ["starting"] * ticks + ["tracking"] * (8 - ticks)


def test_a_fixed_ball_is_where_it_is_said_to_be() -> None:
    fixed = TrackParameters(ball="fixed", fixed_x_px=528.0, fixed_y_px=427.0, fixed_radius_px=16.5, fixed_std_px=0.4)
    rows = inputs(sample("spinner_ball2_side")[0].between(0, 20_000))
    for (packet, _, _), result in zip(rows, run(rows, fixed), strict=True):
        assert result.status == "tracking"
        assert result.shot == 0
        assert result.t_us == packet.end_us - fixed.latency_us
        assert result.mean.tolist() == [528.0, 427.0, 0.0, 0.0, 16.5]
        assert np.allclose(np.diag(result.covariance), [0.16, 0.16, 0, 0, 0.16])
        assert result.hough is None


def test_parameters_that_cannot_work_are_refused() -> None:
    with pytest.raises(ParameterError, match="--fixed-ball"):
        track.start(TrackParameters(ball="fixed", fixed_x_px=1.0, fixed_y_px=1.0), setting())
    with pytest.raises(ParameterError, match="20 must be below"):
        track.start(TrackParameters(radius_min_px=20.0, radius_max_px=10.0), setting())
