"""Balls of which only arcs show, and backgrounds that move as a whole: on ideal discs and edges."""

from __future__ import annotations

import numpy as np
import pytest

from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.stages import track_search
from spinscope.pipeline.stages.track_background import background_moves
from spinscope.pipeline.stages.track_parameters import TrackParameters
from spinscope.pipeline.stages.track_search import SearchMemory
from tests.track_runs import PAPER_CONTEXT, disc_events, inputs, merged, run, setting

PLACE = setting(focal_length_mm=500.0)
IDEAL = TrackParameters(latency_us=0.0, lag_px=0.0, outline_px=0.0, radius_min_px=5.0, radius_max_px=40.0)
RING = np.array([500.0, 360.0, 5000.0, 0.0, 18.0])


def lower_arcs(share: float, bright: bool) -> EventBatch:
    """The events of a ball that flies to the right, below this share of its radius under its centre."""
    events = disc_events(RING, 0, 60_000, bright)
    return events[events.y_px > RING[1] + share * RING[4]]


@pytest.mark.parametrize("bright", [False, True])
def test_a_ball_of_which_only_the_lower_side_shows_is_found_and_followed(bright: bool) -> None:
    """As before a white wall that is as bright as its lit side."""
    results = run(inputs(lower_arcs(0.35, bright), surface_mode="off"), IDEAL, PLACE)
    found = [result for result in results if result.balls]
    assert results.index(found[0]) <= 2 and len(found) >= len(results) - 2
    assert sum(result.measured is not None for result in found) >= len(found) - 1
    for result in found[1:]:
        x, y, vx, _, radius = result.mean
        assert abs(x - (500.0 + 5e-3 * result.t_us)) < 1.0 and abs(y - 360.0) < 1.0
        assert abs(radius - 18.0) < 1.0 and abs(vx - 5000.0) < 250.0


def test_a_circle_seen_once_is_looked_for_where_it_must_be_next(monkeypatch: pytest.MonkeyPatch) -> None:
    """The Hough transform finds it in the first tick alone."""
    of_hough = track_search.candidates
    monkeypatch.setattr(
        track_search,
        "candidates",
        lambda surface, events, *rest: of_hough(surface, events[events.t_us < 5000], *rest),
    )
    results = run(inputs(lower_arcs(0.35, False), surface_mode="off"), IDEAL, PLACE)
    assert [result.status for result in results[:2]] == ["starting", "tracking"]


def test_too_small_an_arc_is_no_ball() -> None:
    results = run(inputs(lower_arcs(0.93, False), surface_mode="off"), IDEAL, PLACE)
    assert not any(result.balls for result in results)


def test_edges_in_most_of_the_image_are_a_moving_background() -> None:
    """Vertical edges 40 px apart that move by a pixel a millisecond; half of the image, and noise, are none."""
    camera = PAPER_CONTEXT.camera
    columns, rows = np.meshgrid(np.arange(20, camera.width_px, 40), np.arange(0, camera.height_px, 4))
    x, y = (np.tile(place.ravel(), 2).astype(np.uint16) for place in (columns, rows))
    t_us = np.repeat([0, 1000], columns.size)
    x[t_us > 0] += 1
    edges = EventBatch(t_us, x, y, np.ones(x.size, np.bool_))
    last_us = SearchMemory.of(camera).last_us
    assert background_moves(edges, last_us, camera)
    assert not background_moves(edges[edges.x_px < camera.width_px // 2], last_us, camera)
    alone = EventBatch(edges.t_us, edges.x_px // 2 * 2, edges.y_px, edges.on)  # no event of a neighbouring pixel
    assert not background_moves(alone, last_us, camera)
    assert not background_moves(merged(*[disc_events(RING + np.array([0, y, 0, 0, 0]), 0, 3000)
                                         for y in (-200.0, 0.0, 200.0)]), last_us, camera)  # fmt: skip
