"""Order statistics against those of sorted arrays."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from spinscope.pipeline.kernels.order_statistics import median, value_of_rank

# Few different ones among them: equal values are where a selection goes wrong.
VALUES = st.lists(st.one_of(st.integers(-3, 3).map(float), st.floats(-1e9, 1e9)), min_size=1, max_size=60)


@given(VALUES, st.data())
def test_the_value_of_a_rank_is_that_of_the_sorted_array(values: list[float], data: st.DataObject) -> None:
    rank = data.draw(st.integers(0, len(values) - 1))
    array = np.array(values)
    assert value_of_rank(array, rank) == sorted(values)[rank]
    assert sorted(array.tolist()) == sorted(values), "reordered, not changed"


@given(VALUES)
def test_the_median_is_numpys(values: list[float]) -> None:
    assert median(np.array(values)) == np.median(values)
