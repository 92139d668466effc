"""The logo mask against its slow twin."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pipeline.kernels.logo import outline_like, outline_polarity, rows_inside
from tests.naive_spin import naive_rows_inside


@given(
    seed=st.integers(0, 100_000),
    velocity=st.tuples(*[st.floats(-9000, 9000)] * 2),
    radius=st.floats(-3, 40),
    start_us=st.sampled_from([0, 1_600_000_000_000_000]),
)
def test_equals_its_twin(seed: int, velocity: tuple[float, float], radius: float, start_us: int) -> None:
    rng = np.random.default_rng(seed)
    t = start_us + np.sort(rng.integers(0, 5000, 100))
    x, y = (rng.integers(0, 90, 100).astype(np.uint16) for _ in range(2))
    given_circle = (t, x, y, float(start_us + 4900), (45.3, 44.6), velocity, radius)
    assert rows_inside(*given_circle).tolist() == naive_rows_inside(*given_circle)


def test_the_outline_itself_is_outside() -> None:
    x, y = np.array([13, 10, 12], np.uint16), np.array([14, 15, 14], np.uint16)
    t = np.zeros(3, np.int64)
    rows = rows_inside(t, x, y, 0.0, (10.0, 10.0), (0.0, 0.0), 5.0)
    assert rows.tolist() == [2]


@given(seed=st.integers(0, 100_000), speed=st.floats(200, 9000), heading=st.floats(0, 6.3))
def test_the_rims_polarity_is_told_by_the_angle_to_the_motion(seed: int, speed: float, heading: float) -> None:
    rng = np.random.default_rng(seed)
    x, y, on = *rng.uniform(-20, 20, (2, 200)), rng.random(200) < 0.5
    off = np.abs((np.arctan2(y, x) - heading + np.pi) % (2 * np.pi) - np.pi)
    expected = np.where(on, off < np.pi / 3, off > 2 * np.pi / 3) & (np.hypot(x, y) > 10)
    found = outline_like(x, y, on, (speed * np.cos(heading), speed * np.sin(heading)), 10.0)
    assert np.array_equal(found, expected)


@given(seed=st.integers(0, 100_000), velocity=st.tuples(*[st.floats(-9000, 9000)] * 2))
def test_the_outlines_polarities_are_counted(seed: int, velocity: tuple[float, float]) -> None:
    rng = np.random.default_rng(seed)
    t = np.sort(rng.integers(0, 5000, 300))
    x, y = (rng.integers(0, 90, 300).astype(np.uint16) for _ in range(2))
    on = rng.random(300) < 0.5
    likes, others = outline_polarity(t, x, y, on, 4900.0, (45.3, 44.6), velocity, (15.0, 30.0))
    dx = x - (45.3 + velocity[0] * 1e-6 * (t - 4900.0))
    dy = y - (44.6 + velocity[1] * 1e-6 * (t - 4900.0))
    ring = (np.hypot(dx, dy) > 15.0) & (np.hypot(dx, dy) < 30.0)
    ahead = dx * velocity[0] + dy * velocity[1] > 0.0
    assert likes == np.sum(ring & (ahead == on)) and others == np.sum(ring & (ahead != on))
