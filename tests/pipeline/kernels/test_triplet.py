"""Triplet Matching against its slow twin, and on edges whose velocity is known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spinscope.pipeline.kernels.triplet import earlier_neighbours, triplet_flow
from tests.reference.spin import naive_neighbours, naive_triplets

LIMITS = (0.7, 3.0, 1000.0, 20_000.0)


def moving_edge(speed_px_s: float, angle: float, *, jitter_us: float = 0.0, seed: int = 0) -> tuple[np.ndarray, ...]:
    """Pixels of a 12 x 12 patch when a straight edge passes their middle: t_us, x_px, y_px, on, in order of time."""
    x, y = (axis.ravel().astype(np.float64) for axis in np.meshgrid(np.arange(12), np.arange(12)))
    t = (x * np.cos(angle) + y * np.sin(angle)) / speed_px_s * 1e6 + 20_000
    t_us = np.round(t + jitter_us * np.random.default_rng(seed).normal(size=t.size)).astype(np.int64)
    order = np.argsort(t_us, kind="stable")
    return t_us[order], x[order], y[order], np.ones(t_us.size, np.bool_)


@settings(max_examples=60)
@given(
    events=st.lists(st.tuples(st.integers(0, 60), st.integers(0, 9), st.integers(0, 9), st.booleans()), max_size=60),
    most=st.integers(1, 15),
)
def test_equals_its_twin(events: list[tuple[int, int, int, bool]], most: int) -> None:
    t = np.cumsum([e[0] for e in events]).astype(np.int64)
    x, y = (np.array([e[c] for e in events], np.float64) * 0.7 for c in (1, 2))
    on = np.array([e[3] for e in events], np.bool_)
    neighbours = earlier_neighbours((t, x, y, on), *LIMITS, most)
    slow = naive_neighbours(t, x, y, on, *LIMITS, most)
    assert [[int(j) for j in row if j >= 0] for row in neighbours] == slow
    vx, vy, triplets = triplet_flow(t, x, y, neighbours, 0.5, 0.3)
    for k, (slow_x, slow_y, count) in enumerate(naive_triplets(t, x, y, slow, 0.5, 0.3)):
        assert triplets[k] == count
        np.testing.assert_allclose((vx[k], vy[k]), (slow_x, slow_y), rtol=1e-9, atol=1e-6)


@pytest.mark.parametrize("angle", [0.0, 0.6, 2.0, -1.3])
@pytest.mark.parametrize("speed", [1500.0, 6000.0])
def test_a_straight_edge_has_the_flow_across_it(speed: float, angle: float) -> None:
    t, x, y, on = moving_edge(speed, angle, jitter_us=20.0)
    neighbours = earlier_neighbours((t, x, y, on), 0.7, 3.0, 3e6 / speed, 20_000.0, 12)
    vx, vy, triplets = triplet_flow(t, x, y, neighbours, 0.5, 0.2)
    inside = (triplets > 0) & (np.abs(x - 5.5) < 3) & (np.abs(y - 5.5) < 3)
    assert inside.sum() > 15
    mean = np.array([vx[inside].mean(), vy[inside].mean()])
    np.testing.assert_allclose(mean, speed * np.array([np.cos(angle), np.sin(angle)]), atol=0.15 * speed)


def test_no_flow_of_scattered_events() -> None:
    rng = np.random.default_rng(1)
    t = np.sort(rng.integers(0, 200_000, 60))
    x, y, on = rng.uniform(0, 40, 60), rng.uniform(0, 40, 60), rng.random(60) < 0.5
    neighbours = earlier_neighbours((t, x, y, on), *LIMITS, 12)
    _, _, triplets = triplet_flow(t, x, y, neighbours, 0.5, 0.2)
    assert not triplets.any()
