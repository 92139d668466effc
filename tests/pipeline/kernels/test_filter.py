"""STC and TRAIL against their slow twin, and against what the supplement says of bursts."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spinscope.pipeline.kernels import filter as kernels
from spinscope.pipeline.kernels.take_events import take_events
from tests.columns import read_only
from tests.reference.filter import NaiveFilter

MODES = ("off", "stc", "trail", "stc_cut_trail")
WIDTH, HEIGHT = 4, 3
setting = st.tuples(st.sampled_from(MODES), st.integers(1, 12))
event = st.tuples(st.integers(0, 8), st.integers(0, WIDTH - 1), st.integers(0, HEIGHT - 1), st.booleans())


def passed_rows(
    last: np.ndarray,
    events: list[tuple[int, int, int, bool]],
    one: tuple[str, int],
    other: tuple[str, int] = ("off", 1),
) -> tuple[list[int], list[int]]:
    """Rows that the two filters pass; events are (t_us, x_px, y_px, on)."""
    t, x, y, on = (np.array([e[c] for e in events]) for c in range(4))
    rows, logo_rows = kernels.filter_events(
        last,
        WIDTH,
        read_only(t.astype(np.int64), x.astype(np.uint16), y.astype(np.uint16), on.astype(np.bool_)),
        MODES.index(one[0]),
        one[1],
        MODES.index(other[0]),
        other[1],
    )
    return rows.tolist(), logo_rows.tolist()


def fresh() -> np.ndarray:
    return np.full(WIDTH * HEIGHT, kernels.NEVER)


@given(
    steps=st.lists(event, max_size=300),
    cuts=st.lists(st.integers(0, 300), max_size=4),
    one=setting,
    other=setting,
    start_us=st.sampled_from([0, 7, 1_600_000_000_000_000]),
)
def test_both_filters_equal_their_twins_over_any_packets(
    steps: list[tuple[int, int, int, bool]],
    cuts: list[int],
    one: tuple[str, int],
    other: tuple[str, int],
    start_us: int,
) -> None:
    times = start_us + np.cumsum([0] + [s[0] for s in steps])[1:]
    events = [(int(t), *s[1:]) for t, s in zip(times, steps, strict=True)]
    twins, last = (NaiveFilter(*one), NaiveFilter(*other)), fresh()
    for start, end in zip([0, *sorted(cuts)], [*sorted(cuts), len(events)], strict=True):
        packet = events[start:end]
        expected = tuple([i for i, e in enumerate(packet) if twin.passes(*e)] for twin in twins)
        assert passed_rows(last, packet, one, other) == expected


# A burst of four ON events, one after a long pause, two OFF and an ON; the threshold is 10 us.
BURST = [(t, 1, 1, on) for t, on in ((0, 1), (5, 1), (9, 1), (19, 1), (60, 1), (65, 0), (66, 0), (67, 1))]


@pytest.mark.parametrize(
    ("mode", "rows"),
    [
        ("off", [0, 1, 2, 3, 4, 5, 6, 7]),
        ("stc", [1, 2, 3, 6]),  # not the first of a burst, nor what comes alone
        ("trail", [0, 3, 4, 5, 7]),  # 3 came exactly the threshold after 2: both filters pass it
        ("stc_cut_trail", [1, 6]),  # one a polarity
    ],
)
def test_a_burst_passes_as_the_supplement_says(mode: str, rows: list[int]) -> None:
    assert passed_rows(fresh(), BURST, (mode, 10), (mode, 10)) == (rows, rows)


@pytest.mark.parametrize("on", [False, True])
def test_the_first_event_of_a_pixel_passes_trail_only(on: bool) -> None:
    for mode in MODES:
        assert passed_rows(fresh(), [(0, 0, 0, on)], (mode, 10))[0] == ([0] if mode in ("off", "trail") else [])


def test_rows_are_taken_from_every_column() -> None:
    rng = np.random.default_rng(3)
    columns = (
        np.arange(1000),
        rng.integers(0, 60000, 1000).astype(np.uint16),
        rng.integers(0, 60000, 1000).astype(np.uint16),
        rng.random(1000) < 0.5,
    )
    for rows in (np.flatnonzero(rng.random(1000) < 0.3), np.empty(0, np.int64)):
        for column, kept in zip(columns, take_events(rows, columns), strict=True):
            assert kept.dtype == column.dtype
            assert np.array_equal(kept, column[rows])
