"""Order of events in time, against NumPy's differences."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spinscope.pipeline.kernels.time_order import is_in_order
from tests.columns import read_only


@pytest.mark.parametrize("compiled", [True, False])
@given(times=st.lists(st.integers(-3, 3), max_size=4))
def test_times_that_fall_anywhere_are_out_of_order(compiled: bool, times: list[int]) -> None:
    (t_us,) = read_only(np.array(times, np.int64))
    kernel = is_in_order if compiled else is_in_order.py_func
    assert kernel(t_us) == bool(np.all(np.diff(t_us) >= 0))
