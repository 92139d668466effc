"""The signal processing behind the event rate, against scipy and numpy."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spinscope.pipeline.kernels.rate import (
    autocorrelation,
    falling_crossings,
    low_passed,
    moving_average,
    shortest_period,
)
from tests.reference.spin import naive_autocorrelation, naive_low_pass


@given(seed=st.integers(0, 10_000), cutoff=st.floats(0.01, 0.45), count=st.integers(8, 300))
def test_low_pass_is_scipys(seed: int, cutoff: float, count: int) -> None:
    signal = np.random.default_rng(seed).normal(size=count)
    np.testing.assert_allclose(low_passed(signal, cutoff), naive_low_pass(signal, cutoff), atol=1e-9)


def test_low_pass_shifts_nothing() -> None:
    t = np.arange(400)
    smooth = low_passed(np.cos(2 * np.pi * t / 40), 0.1)
    crossings = falling_crossings(smooth)[1:-1]
    np.testing.assert_allclose(crossings, 10 + 40 * np.arange(1, 1 + crossings.size), atol=0.05)


@given(seed=st.integers(0, 10_000), lag=st.integers(0, 30))
def test_autocorrelation_equals_its_twin(seed: int, lag: int) -> None:
    signal = np.random.default_rng(seed).normal(size=40)
    assert autocorrelation(signal, 31)[lag] == pytest.approx(naive_autocorrelation(signal, lag))


def test_the_period_is_the_rotations_not_a_part_of_it_or_a_multiple() -> None:
    """A logo with three strokes: the rotation repeats best, and the shortest of the best is taken."""
    one = np.zeros(40)
    one[[3, 4, 8, 9, 10, 15]] = [3, 5, 4, 6, 3, 7]
    signal = np.tile(one, 8)
    correlation = autocorrelation(signal - signal.mean(), 240)
    assert shortest_period(correlation, 3, 0.8) == 40
    assert shortest_period(np.zeros(50), 3, 0.8) == 0
    assert shortest_period(correlation, 41, 0.8) == 80


def test_moving_average_is_recursive_and_starts_at_the_first_value() -> None:
    np.testing.assert_allclose(moving_average(np.array([4.0, 0.0, 0.0, 8.0]), 0.5), [4, 2, 1, 4.5])
    assert moving_average(np.empty(0), 0.5).size == 0


def test_falling_crossings_are_placed_between_samples() -> None:
    np.testing.assert_allclose(falling_crossings(np.array([1.0, -1.0, 0.0, 3.0, -1.0, 2.0, 0.0])), [0.5, 3.75, 6.0])
