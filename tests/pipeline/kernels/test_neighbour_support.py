"""Neighbour support against its slow twin, and what it is for."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from spinscope.pipeline.kernels import neighbour_support
from tests.columns import read_only
from tests.reference.filter import supported_events

WIDTH, HEIGHT = 7, 5
event = st.tuples(st.integers(0, 400), st.integers(0, WIDTH - 1), st.integers(0, HEIGHT - 1))


def supported(events: list[tuple[int, int, int]], within_us: int) -> list[int]:
    t, x, y = (np.array([e[c] for e in events]) for c in range(3))
    columns = read_only(t.astype(np.int64), x.astype(np.uint16), y.astype(np.uint16), np.zeros(len(events), np.bool_))
    last_us = np.zeros((HEIGHT + 2, WIDTH + 2), np.uint16)
    rows = neighbour_support.supported_events(last_us, columns, within_us).tolist()
    assert not last_us.any(), "ready for the next events"
    return rows


@given(
    steps=st.lists(event, max_size=150),
    within_us=st.sampled_from([0, 100, 1000]),
    start_us=st.sampled_from([0, 1_600_000_000_000_000]),
)
def test_equals_the_twin(steps: list[tuple[int, int, int]], within_us: int, start_us: int) -> None:
    times = start_us + np.cumsum([0] + [s[0] for s in steps])[1:]
    events = [(int(t), *s[1:]) for t, s in zip(times, steps, strict=True)]
    assert supported(events, within_us) == supported_events(events, within_us)


def test_an_edge_is_kept_and_a_hot_pixel_is_not() -> None:
    edge = [(100 * x, x, 2) for x in range(WIDTH)]
    assert supported(edge, 100) == list(range(1, WIDTH))
    assert supported([(100 * n, 3, 3) for n in range(20)], 100) == []
