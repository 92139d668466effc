"""Events by tiles, against NumPy's histogram."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from spinscope.pipeline.kernels.tiles import events_by_tile
from tests.columns import read_only


@given(count=st.integers(0, 200), width=st.integers(4, 90), height=st.integers(4, 90), seed=st.integers(0, 2**32 - 1))
def test_every_event_is_counted_in_its_tile(count: int, width: int, height: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    x, y = (rng.integers(0, size, count).astype(np.uint16) for size in (width, height))
    rows, columns = (pixel.astype(int) * 4 // size for pixel, size in ((y, height), (x, width)))
    expected = np.bincount(rows * 4 + columns, minlength=16).reshape(4, 4)
    assert np.array_equal(events_by_tile(*read_only(x, y), width, height, 4), expected)
