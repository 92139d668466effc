"""The logo mask against its slow twin."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from spinscope.pipeline.kernels.logo import logo_rows, outline_like
from tests.columns import read_only
from tests.reference.spin import naive_logo_rows


@given(
    seed=st.integers(0, 100_000),
    velocity=st.one_of(st.just((0.0, 0.0)), st.tuples(*[st.floats(-9000, 9000)] * 2)),
    radius=st.floats(-3, 40),
    rim_px=st.floats(-3, 5),
    start_us=st.sampled_from([0, 1_600_000_000_000_000]),
)
def test_equals_its_twin(seed: int, velocity: tuple[float, float], radius: float, rim_px: float, start_us: int) -> None:
    rng = np.random.default_rng(seed)
    t = start_us + np.sort(rng.integers(0, 5000, 100))
    x, y = (rng.integers(0, 90, 100).astype(np.uint16) for _ in range(2))
    events = read_only(t, x, y, rng.random(100) < 0.5)
    circle = (float(start_us + 4900), (45.3, 44.6), velocity, radius, radius + rim_px, (radius + 4.0, radius + 9.0))
    rows, inside, *polarities = logo_rows(events, *circle)
    assert (rows.tolist(), inside.tolist(), *polarities) == naive_logo_rows(*events, *circle)


def test_the_outline_itself_is_outside() -> None:
    x, y = np.array([13, 10, 12], np.uint16), np.array([14, 15, 14], np.uint16)
    t, on = np.zeros(3, np.int64), np.ones(3, np.bool_)
    rows, _, _, _ = logo_rows(read_only(t, x, y, on), 0.0, (10.0, 10.0), (0.0, 0.0), 5.0, 0.0, (0.0, 0.0))
    assert rows.tolist() == [2]


@given(seed=st.integers(0, 100_000), speed=st.floats(200, 9000), heading=st.floats(0, 6.3))
def test_the_rims_polarity_is_told_by_the_angle_to_the_motion(seed: int, speed: float, heading: float) -> None:
    rng = np.random.default_rng(seed)
    x, y, on = *rng.uniform(-20, 20, (2, 200)), rng.random(200) < 0.5
    off = np.abs((np.arctan2(y, x) - heading + np.pi) % (2 * np.pi) - np.pi)
    expected = np.where(on, off < np.pi / 3, off > 2 * np.pi / 3) & (np.hypot(x, y) > 10)
    found = outline_like(x, y, on, (speed * np.cos(heading), speed * np.sin(heading)), 10.0)
    assert np.array_equal(found, expected)
