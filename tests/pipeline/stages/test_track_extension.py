"""Paths of a ball before it was found: measured where its events are, and no further."""

from __future__ import annotations

import numpy as np

from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.results import Circle, Packet
from spinscope.pipeline.stages.track_ball import Measuring, TrackedBall
from spinscope.pipeline.stages.track_extension import EXTENDED_US, Past
from spinscope.pipeline.stages.track_outline import FREE, Edge, measure
from spinscope.pipeline.stages.track_path import PathPoint
from tests.track_runs import Floats, disc_events, setting

TICK_US, COAST_US, FOUND_US = 5000, 20_000, 60_000
RING = np.array([300.0, 360.0, 6000.0, 600.0, 18.0])
MEASURING = Measuring(setting(focal_length_mm=500.0).camera, 0.02, Edge(0.0, 0.0), 3000, 15.0, 3.0)
WHOLE = disc_events(RING, 0, FOUND_US)


def before(
    events: EventBatch, tick_us: int = TICK_US, others: tuple[TrackedBall, ...] = (), ring: Floats = RING
) -> tuple[list[PathPoint], Floats]:
    """The path before FOUND_US of the ball that is found there."""
    past = Past()
    for start_us in range(0, FOUND_US, tick_us):
        end_us = start_us + tick_us
        past.add(Packet(start_us // tick_us, start_us, end_us, events.between(start_us, end_us)))
    last = past.ticks[-1]
    recent = events.between(FOUND_US - MEASURING.contour_us, FOUND_US)
    sighting = measure(recent, FOUND_US, MEASURING.camera, at(FOUND_US, ring), 3.0, FREE)
    assert sighting is not None
    ball = TrackedBall.at(sighting, MEASURING, 0, last, "found")
    return past.path_before(ball, list(others), MEASURING, COAST_US)


def at(t_us: int, ring: Floats = RING) -> Floats:
    return ring + np.array([ring[2], ring[3], 0.0, 0.0, 0.0]) * t_us * 1e-6


def test_a_path_goes_back_as_far_as_ticks_are_kept() -> None:
    path, first = before(WHOLE)
    assert [point.end_us for point in path] == list(range(FOUND_US - EXTENDED_US + TICK_US, FOUND_US + 1, TICK_US))
    for point in path:
        assert point.circle is not None
        place = [point.circle.x_px, point.circle.y_px, point.circle.radius_px]
        np.testing.assert_allclose(place, at(point.end_us)[[0, 1, 4]], atol=0.2)
    np.testing.assert_allclose(first, at(path[0].end_us), atol=0.3, rtol=0.02)


def test_a_path_begins_with_a_measured_circle() -> None:
    """Behind something for a tick it goes on; for longer than balls are kept unseen, or before its events, it ends."""
    for hidden_us, first_us in (((25_000, 30_000), 15_000), ((20_000, 40_000), 45_000), ((0, 26_000), 30_000)):
        hidden = (WHOLE.t_us >= hidden_us[0]) & (WHOLE.t_us < hidden_us[1])
        path, _ = before(WHOLE[~hidden])
        assert path[0].end_us == first_us and path[0].circle is not None
        unseen = [point.end_us for point in path if point.circle is None]
        assert unseen == ([30_000] if first_us == 15_000 else [])


def test_a_path_ends_where_the_ball_comes_into_view() -> None:
    ring = RING - np.array([RING[0] + 0.03 * RING[2], 0.0, 0.0, 0.0, 0.0])
    path, _ = before(disc_events(ring, 0, FOUND_US), ring=ring)
    assert path[0].end_us == 35_000, "at 30 ms the border cuts it in half"


def test_a_path_ends_where_another_ball_was_followed() -> None:
    """Whether that ball is still in view does not matter."""
    x, y, _, _, radius = at(40_000)
    other = TrackedBall(1, 0, "found", MEASURING.filter_at(RING, np.eye(5)), 40_000, RING)
    other.path = [PathPoint(40_000, Circle(x, y + 1.9 * radius, radius, 1.0), np.eye(3))]
    path, _ = before(WHOLE, others=(other,))
    assert path[0].end_us == 45_000


def test_short_ticks_give_the_same_path() -> None:
    """Their outlines share events."""
    fine, coarse = (before(WHOLE, tick_us)[0] for tick_us in (1000, TICK_US))
    places = {point.end_us: point.circle for point in fine}
    for point in coarse[1:]:
        one, other = point.circle, places[point.end_us]
        assert one is not None and other is not None
        np.testing.assert_allclose([one.x_px, one.y_px], [other.x_px, other.y_px], atol=0.05)
