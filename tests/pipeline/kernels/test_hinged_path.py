"""The change test's kernel and that of crossing outlines equal their slow twins."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from spinscope.pipeline.kernels import crossing, hinged_path
from tests.columns import read_only
from tests.reference import hinged_path as reference


@given(seed=st.integers(0, 2**32 - 1), count=st.integers(6, 25))
def test_costs_equal_the_twins(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    times_s = np.cumsum(rng.uniform(1e-3, 6e-3, count))
    times_s -= times_s[-1]
    circles = rng.uniform(-300, 300, (1, 3)) + rng.uniform(-3000, 3000, (1, 3)) * times_s[:, None]
    circles += rng.normal(0, 1, (count, 3))
    weights = rng.uniform(1, 400, (count, 3))
    precisions = 1.0 / np.array([1e5, 1e5, 3e4, 1e6, 1e4, 1e4]) ** 2 * rng.uniform(0.5, 2, (3, 6))
    hinges_s = rng.uniform(times_s[1], times_s[-2], 5)
    costs = np.empty(6)
    hinged_path.path_costs(costs, times_s, circles, weights, precisions, hinges_s)
    np.testing.assert_allclose(
        costs, reference.path_costs(times_s, circles, weights, precisions, hinges_s), rtol=1e-5, atol=1e-3
    )
    assert np.all(costs[1:] <= costs[0] + 1e-3), "a hinge never costs more"


@given(seed=st.integers(0, 2**32 - 1), count=st.integers(2, 25), stays=st.booleans())
def test_channels_equal_the_twins(seed: int, count: int, stays: bool) -> None:
    rng = np.random.default_rng(seed)
    times_s = np.cumsum(rng.uniform(1e-3, 6e-3, count))
    circles = rng.uniform(-300, 300, (count, 3))
    circles[-1, :2] = circles[0, :2] if stays else circles[-1, :2]
    roots = rng.normal(size=(count, 3, 3))
    given_to = times_s, circles, roots @ np.swapaxes(roots, 1, 2), rng.uniform(0.01, 0.1, (count, 3))
    for found, expected in zip(hinged_path.edge_channels(*given_to), reference.edge_channels(*given_to), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)


@given(seed=st.integers(0, 2**32 - 1), count=st.integers(4, 25))
def test_a_smooth_path_is_that_of_the_channels_with_what_a_flight_allows(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    times_s, shakes_px = np.cumsum(rng.uniform(1e-3, 6e-3, count)), rng.uniform(0, 1, count)
    circles = rng.uniform(5, 30, (1, 3)) + rng.uniform(-3000, 3000, (1, 3)) * [1, 1, 0] * times_s[:, None]
    roots = rng.normal(size=(count, 3, 3))
    noises, errors_px2 = roots @ np.swapaxes(roots, 1, 2), rng.uniform(0.01, 0.1, 3)
    rows = np.column_stack([times_s, circles, shakes_px])
    *found, cost = hinged_path.smooth_path(rows, noises, errors_px2, 1646.0, 0.02, (9.81, 0.07, 0.16, 30.0))
    values, weights, speed_px_s = reference.edge_channels(
        times_s, circles, noises, errors_px2 + shakes_px[:, None] ** 2 * [1.0, 1.0, 0.0]
    )
    precisions = reference.flight_precisions(speed_px_s, circles[-1, 2], 1646.0, 0.02)
    for one, expected in zip(found, (times_s, values, weights, precisions), strict=True):
        np.testing.assert_allclose(one, expected, rtol=1e-9, atol=1e-30)
    costs = np.empty(1)
    hinged_path.path_costs(costs, *found, np.empty(0))
    assert cost == costs[0]


@given(seed=st.integers(0, 2**32 - 1), balls=st.integers(1, 3))
def test_the_nearest_outline_is_the_twins(seed: int, balls: int) -> None:
    rng = np.random.default_rng(seed)
    rings = np.stack(
        [[*rng.uniform(40, 60, 2), *rng.uniform(-5000, 5000, 2), rng.uniform(8, 20)] for _ in range(balls + 1)]
    )
    t_us = np.sort(rng.integers(0, 3000, 200))
    x, y = (rng.integers(0, 100, 200).astype(np.uint16) for _ in range(2))
    events = read_only(t_us, x, y, rng.random(200) < 0.5)
    found = crossing.nearest_outline(rings[0], rings[1:], events, 3000.0)
    expected = reference.nearest_outline(rings[0], rings[1:], (t_us - 3000.0) * 1e-6, x.astype(float), y.astype(float))
    assert np.array_equal(found, expected)
