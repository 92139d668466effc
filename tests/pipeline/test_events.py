"""Event batches: read-only, checked where they come from outside."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.events import EventBatch


def batch(times: list[int]) -> EventBatch:
    n = len(times)
    return EventBatch.checked(times, np.arange(n) % 7, np.zeros(n, int), np.arange(n) % 2, width_px=8, height_px=4)


def test_columns_are_read_only_and_copied() -> None:
    t = np.array([1, 2, 3])
    events = EventBatch.checked(t, [0, 1, 2], [0, 0, 0], [1, 0, 1], width_px=8, height_px=4)
    t[0] = 99
    assert events.t_us[0] == 1
    with pytest.raises(ValueError, match="read-only"):
        events.x_px[0] = 5


@given(st.lists(st.integers(0, 50)).map(sorted), st.integers(-5, 55), st.integers(-5, 55))
def test_between_takes_start_and_leaves_end(times: list[int], start: int, end: int) -> None:
    assert batch(times).between(start, max(start, end)).t_us.tolist() == [t for t in times if start <= t < end]


@given(st.lists(st.integers(0, 50), min_size=1).map(sorted), st.data())
def test_cutting_and_joining_changes_nothing(times: list[int], data: st.DataObject) -> None:
    events = batch(times)
    cut = data.draw(st.integers(0, len(times)))
    joined = EventBatch.concatenate([events[:cut], events[cut:]])
    for column in ("t_us", "x_px", "y_px", "on"):
        assert np.array_equal(getattr(joined, column), getattr(events, column))


@pytest.mark.parametrize(
    ("columns", "says"),
    [
        (([2, 1], [0, 0], [0, 0], [0, 0]), "time goes backwards at event 1: 2 us, then 1 us"),
        (([1, 2], [0, 8], [0, 0], [0, 0]), "outside the sensor's 8 x 4"),
        (([1, 2], [0, -1], [0, 0], [0, 0]), "outside the sensor's 8 x 4"),
        (([1, 2], [0, 0], [0, 4], [0, 0]), "y runs from 0 to 4"),
        (([1, 2], [0], [0, 0], [0, 0]), "differ in length"),
    ],
)
def test_bad_columns_are_refused(columns: tuple[list[int], ...], says: str) -> None:
    with pytest.raises(RecordingError, match=says):
        EventBatch.checked(*columns, width_px=8, height_px=4)
