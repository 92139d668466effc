"""Local planes against their slow twin, and on edges whose velocity is known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spinscope.pipeline.kernels.plane_flow import FEWEST, SPREAD_PX, fit_plane, near_in_time, plane_flow
from tests.pipeline.kernels.test_triplet import moving_edge
from tests.reference.spin import naive_plane

SCALES_US = np.array([1200.0, 600.0, 300.0, 300.0])


@settings(max_examples=80)
@given(seed=st.integers(0, 100_000), count=st.integers(3, 40), outliers=st.integers(0, 8))
def test_equals_its_twin(seed: int, count: int, outliers: int) -> None:
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(-3, 3, count), rng.uniform(-3, 3, count) * rng.uniform(0.1, 1)
    t = 250 * (x * np.cos(seed) + y * np.sin(seed)) + rng.normal(0, 60, count)
    t[: min(outliers, count)] += rng.uniform(-1500, 1500, min(outliers, count))
    slow = naive_plane(x, y, t, SCALES_US, FEWEST, SPREAD_PX)
    a, b, rms, weight = fit_plane(x, y, t, SCALES_US, FEWEST, SPREAD_PX)
    if slow is None:
        assert weight == 0.0
    else:
        assert weight > 0.0
        np.testing.assert_allclose((a, b, rms), slow, rtol=1e-6, atol=1e-5)


@given(seed=st.integers(0, 100_000), reach_us=st.integers(0, 500))
def test_neighbours_are_all_within_reach_and_the_nearest_in_time(seed: int, reach_us: int) -> None:
    rng = np.random.default_rng(seed)
    t = np.sort(rng.integers(0, 1000, 80))
    x, y, on = rng.uniform(0, 6, 80), rng.uniform(0, 6, 80), rng.random(80) < 0.5
    rows = np.empty(8, np.int64)
    k = int(rng.integers(0, 80))
    found = set(rows[: near_in_time(rows, k, (t, x, y, on), 2.0, float(reach_us))].tolist())
    fits = (on == on[k]) & (np.hypot(x - x[k], y - y[k]) <= 2.0) & (np.abs(t - t[k]) <= reach_us)
    before = [j for j in range(k - 1, -1, -1) if fits[j]][:3]
    after = [j for j in range(k + 1, 80) if fits[j]][:4]
    assert found == {k, *before, *after}


@pytest.mark.parametrize("angle", [0.0, 0.7, 2.4, -1.0])
@pytest.mark.parametrize("speed", [1500.0, 5000.0])
def test_a_straight_edge_has_its_normal_flow(speed: float, angle: float) -> None:
    t, x, y, on = moving_edge(speed, angle, jitter_us=0.05e6 / speed)
    t_acc_us = 10e6 / speed
    rows, direction, found = plane_flow(
        (t, x, y, on), 0, t.size, 1, 3.0, 0.6 * t_acc_us, SCALES_US / 2000 * t_acc_us, 20_000.0
    )
    inside = (np.abs(x[rows] - 5.5) < 3) & (np.abs(y[rows] - 5.5) < 3)
    assert inside.sum() > 20
    np.testing.assert_allclose(found[inside], speed, rtol=0.15)
    cosine = direction[inside] @ np.array([np.cos(angle), np.sin(angle)])
    assert np.degrees(np.arccos(cosine.min())) < 8


def test_every_second_event_and_the_speed_bound() -> None:
    t, x, y, on = moving_edge(4000.0, 0.4)
    everything = ((t, x, y, on), 0, t.size)
    scales = SCALES_US * 1.25
    all_rows = plane_flow(*everything, 1, 3.0, 1500.0, scales, 20_000.0)[0]
    some_rows = plane_flow(*everything, 2, 3.0, 1500.0, scales, 20_000.0)[0]
    assert set(some_rows) == set(all_rows) & set(range(1, t.size, 2))
    assert plane_flow(*everything, 1, 3.0, 1500.0, scales, 3000.0)[0].size == 0


def test_a_single_row_of_pixels_makes_no_plane() -> None:
    t, x, y, on = moving_edge(4000.0, 0.4)
    line = y == 5
    rows = plane_flow((t[line], x[line], y[line], on[line]), 0, int(line.sum()), 1, 3.0, 1500.0, SCALES_US, 20_000.0)[0]
    assert rows.size == 0
