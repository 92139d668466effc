"""A spin from linear constraints: exact, in spite of outliers, and honest about what is open."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from spinscope.pipeline.kernels.spin import robust_spin, sampled_spin, solve3, support

spins = st.tuples(*[st.floats(-600, 600)] * 3).filter(lambda s: np.linalg.norm(s) > 30)


def constraints(seed: int, spin: np.ndarray, count: int = 120) -> tuple[np.ndarray, np.ndarray]:
    """Rows (n, 3) in all directions with rows . spin > 0, and the speeds they give."""
    rows = np.random.default_rng(seed).normal(0, 16, (count, 3))
    rows[rows @ spin < 0] *= -1
    return rows, rows @ spin


@given(seed=st.integers(0, 10_000))
def test_solve3_is_numpys(seed: int) -> None:
    rng = np.random.default_rng(seed)
    m, b = rng.normal(size=(3, 3)), rng.normal(size=3)
    x, determinant = solve3(m, b)
    np.testing.assert_allclose(determinant, np.linalg.det(m), rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(m @ x, b, atol=1e-6 / max(abs(determinant), 1e-6))
    x, determinant = solve3(np.ones((3, 3)), b)
    assert determinant == 0.0 and not x.any()


@settings(max_examples=40)
@given(seed=st.integers(0, 10_000), spin=spins)
def test_a_third_of_the_constraints_may_be_nonsense(seed: int, spin: tuple[float, float, float]) -> None:
    true = np.array(spin)
    rows, speeds = constraints(seed, true)
    rng = np.random.default_rng(seed + 1)
    speeds = np.maximum(speeds, 20.0)
    speeds[:40] = rng.uniform(500, 15_000, 40)
    start, supported = sampled_spin(rows, speeds, 0.25, 1100.0, 300, 1)
    assert supported > 0.25
    assert supported == support(rows, speeds, start, 0.25)
    found, weights, matrix, _ = robust_spin(rows, speeds, 0.05 * speeds + 5.0, start, 20)
    np.testing.assert_allclose(found, true, atol=0.03 * np.linalg.norm(true) + 1.0)
    np.testing.assert_allclose(matrix, (rows * weights[:, None]).T @ rows, rtol=1e-9)


def test_samples_are_drawn_the_same_every_time_and_within_the_bound() -> None:
    rows, speeds = constraints(3, np.array([300.0, 0.0, 0.0]))
    first = sampled_spin(rows, speeds, 0.2, 400.0, 100, 7)
    second = sampled_spin(rows, speeds, 0.2, 400.0, 100, 7)
    np.testing.assert_array_equal(first[0], second[0])
    assert sampled_spin(rows, speeds, 0.2, 100.0, 100, 7)[1] < first[1]
    assert sampled_spin(rows[:2], speeds[:2], 0.2, 400.0, 100, 7)[1] == 0.0


def test_constraints_in_one_plane_leave_the_start_as_it_is() -> None:
    rows = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]])
    start = np.array([1.0, 2.0, 3.0])
    found, _, matrix, _ = robust_spin(rows, rows @ start, np.ones(3), start, 5)
    np.testing.assert_array_equal(found, start)
    assert np.linalg.matrix_rank(matrix) == 2


@given(lift=st.sampled_from([1e-3, 0.0]))
def test_three_nearly_coplanar_constraints_fix_no_spin(lift: float) -> None:
    rows = np.array([[16.0, 0.0, 0.0], [0.0, 16.0, 0.0], [16.0, 16.0, 16.0 * lift]])
    speeds = rows @ np.array([20.0, 30.0, 100.0])
    spin, supported = sampled_spin(rows, speeds, 0.25, 1100.0, 300, 1)
    assert not spin.any() and supported == 0.0
    rows[2, 2] = 16.0
    spin, supported = sampled_spin(rows, rows @ np.array([20.0, 30.0, 100.0]), 0.25, 1100.0, 300, 1)
    np.testing.assert_allclose(spin, [20.0, 30.0, 100.0])
    assert supported == 1.0
