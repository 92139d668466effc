"""Accumulated frame and linear time surface against their slow twin."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spinscope.pipeline.kernels import surfaces
from tests.reference.surface import recent_events

event = st.tuples(st.integers(0, 40), st.integers(0, 5), st.integers(0, 3))


@given(
    steps=st.lists(event, max_size=120),
    tick_us=st.integers(1, 300),
    span_us=st.integers(1, 400),
    linear=st.booleans(),
    start_us=st.sampled_from([0, 1_600_000_000_000_000]),
)
def test_every_tick_equals_the_twin(
    steps: list[tuple[int, int, int]], tick_us: int, span_us: int, linear: bool, start_us: int
) -> None:
    t = start_us + np.cumsum([0] + [s[0] for s in steps])[1:].astype(np.int64)
    x, y = (np.array([s[c] for s in steps], np.uint16) for c in (1, 2))
    last_us = np.full((4, 6), surfaces.NEVER_US)
    for end_us in range(start_us + tick_us, start_us + 5 * tick_us + 1, tick_us):
        now = (t >= end_us - tick_us) & (t < end_us)
        last_us[y[now], x[now]] = t[now]
        values = np.zeros((4, 6), np.uint8)
        surfaces.render(values, last_us, end_us, span_us, linear)
        expected = recent_events(t.tolist(), x.tolist(), y.tolist(), (4, 6), end_us, span_us, linear)
        assert np.array_equal(values, expected)


@pytest.mark.parametrize(("age_us", "value"), [(1, 255), (500, 191), (1000, 128), (1999, 0), (2000, 0)])
def test_linear_falls_from_255_to_0_over_the_span(age_us: int, value: int) -> None:
    values = np.zeros((1, 1), np.uint8)
    surfaces.render(values, np.array([[10_000 - age_us]]), 10_000, 2000, True)
    assert values[0, 0] == value
