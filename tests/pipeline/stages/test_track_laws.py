"""Laws of the tracker: what moves the events moves the track."""

from __future__ import annotations

import numpy as np

from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.stages.track_parameters import TrackParameters
from spinscope.pipeline.stages.track_result import TrackResult
from tests.track_runs import WIDTH, disc_events, inputs, run, sample, tracked, transformed

IDEAL = TrackParameters(latency_us=0.0, lag_px=0.0, outline_px=0.0)


def common(ones: list[TrackResult], others: list[TrackResult]) -> tuple[np.ndarray, np.ndarray]:
    """(n, 5) means of the ticks that are tracked in both runs."""
    both = [(a.mean, b.mean) for a, b in zip(ones, others, strict=True) if a.has_ball and b.has_ball]
    assert len(both) > 12
    return np.stack([a for a, _ in both]), np.stack([b for _, b in both])


def test_later_events_give_the_same_track_later() -> None:
    """By whole ticks: equal to the last bit."""
    later = run(inputs(transformed(sample("flight_back")[0], t_us=100_000)))
    before = tracked("flight_back")
    assert len(later) == len(before)
    for a, b in zip(before, later, strict=True):
        assert a.status == b.status
        assert np.allclose(a.mean, b.mean, rtol=0, atol=1e-6, equal_nan=True)
        assert b.t_us == a.t_us + 100_000


def test_shifting_the_image_shifts_the_track() -> None:
    shifted = run(inputs(transformed(sample("flight_back")[0], x_px=-97)))
    means, moved = common(tracked("flight_back"), shifted)
    # What the tracker knows of the outline's oval, up to 0.2 px, is then that of another place.
    assert np.abs(moved - means - [-97, 0, 0, 0, 0])[:, [0, 1, 4]].max() < 0.25


def test_a_mirror_mirrors_the_track() -> None:
    mirrored = run(inputs(transformed(sample("flight_fast_top")[0], mirrored=True)))
    means, seen = common(tracked("flight_fast_top"), mirrored)
    expected = means * [-1, 1, -1, 1, 1] + [WIDTH - 1, 0, 0, 0, 0]
    assert np.abs(seen - expected)[:, [0, 1, 4]].max() < 0.1


def test_reversed_time_reverses_the_velocity() -> None:
    """An ideal ball: real pixels answer late in either direction of time."""
    ring = np.array([500.0, 250.0, 5000.0, 2000.0, 19.0])
    forward = disc_events(ring, 0, 30_000)
    backward = EventBatch(
        (30_000 - 1 - forward.t_us)[::-1].copy(),
        forward.x_px[::-1].copy(),
        forward.y_px[::-1].copy(),
        ~forward.on[::-1],
    )
    there = {result.t_us: result for result in run(inputs(forward, surface_mode="off"), IDEAL)}
    back = {30_000 - result.t_us: result for result in run(inputs(backward, surface_mode="off"), IDEAL)}
    for t_us in (10_000, 15_000, 20_000):
        one, other = there[t_us].mean, back[t_us].mean
        assert np.abs(one - other)[[0, 1, 4]].max() < 0.1
        assert np.abs(one + other)[2:4].max() < 60


def test_a_swapped_contrast_changes_nothing() -> None:
    events = sample("flight_mixed")[0]
    dark = EventBatch(events.t_us, events.x_px, events.y_px, ~events.on)
    for a, b in zip(tracked("flight_mixed"), run(inputs(dark)), strict=True):
        assert a.status == b.status
        assert np.array_equal(a.mean, b.mean, equal_nan=True)
