"""Rivals of the tracker on surfaces and events of circles whose place is known."""

from __future__ import annotations

import numpy as np
import pytest

from spinscope.pipeline.evaluation.tracking_rivals import peak_circle, ring_kernel, shifted_circle
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.results import Circle
from spinscope.pipeline.stages.surface import SurfaceResult


def ring(x_px: float, y_px: float, radius_px: float, count: int = 400) -> tuple[np.ndarray, np.ndarray]:
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
    return np.rint(x_px + radius_px * np.cos(angle)), np.rint(y_px + radius_px * np.sin(angle))


def surface_of(*circles: tuple[float, float, float]) -> SurfaceResult:
    values = np.zeros((200, 300), np.uint8)
    for circle in circles:
        x, y = ring(*circle)
        values[y.astype(int), x.astype(int)] = 255
    return SurfaceResult(values, "off")


@pytest.mark.parametrize("at", [(150.0, 100.0), (130.0, 92.0), (18.0, 20.0)])
def test_the_peak_is_at_the_circle_and_of_its_size(at: tuple[float, float]) -> None:
    found = peak_circle(surface_of((*at, 16.0)), Circle(at[0] + 9, at[1] - 7, 16.0, 1.0), 30.0)
    assert (found.x_px, found.y_px) == pytest.approx(at, abs=1.0)
    assert found.radius_px == pytest.approx(16.0, abs=1.0)


def test_a_circle_beyond_its_reach_is_not_seen_and_an_empty_surface_leaves_the_last() -> None:
    last = Circle(60.0, 60.0, 16.0, 1.0)
    assert peak_circle(surface_of((220.0, 150.0, 16.0)), last, 30.0) is last


def test_the_kernel_answers_nothing_to_an_even_surface() -> None:
    assert ring_kernel(16.0).sum() == pytest.approx(0.0, abs=1e-5)


def test_the_mean_shifts_to_the_events_around_the_ball() -> None:
    x, y = ring(150.0, 100.0, 16.0)
    far_x, far_y = ring(230.0, 60.0, 5.0)
    columns = [np.concatenate(pair).astype(np.uint16) for pair in ((x, far_x), (y, far_y))]
    events = EventBatch(np.arange(columns[0].size), *columns, np.ones(columns[0].size, np.bool_))
    found = shifted_circle(events, Circle(140.0, 106.0, 16.0, 1.0))
    assert (found.x_px, found.y_px) == (pytest.approx(150.0, abs=0.1), pytest.approx(100.0, abs=0.1))


def test_few_events_leave_the_circle_where_it_is() -> None:
    last = Circle(140.0, 106.0, 16.0, 1.0)
    found = shifted_circle(EventBatch.empty(), last)
    assert (found.x_px, found.y_px) == (140.0, 106.0)
