"""Small matrices in kernels beside NumPy's."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from spinscope.pipeline.kernels.small_matrices import cholesky_solve, inverse_matrix, product


@given(n=st.integers(1, 6), seed=st.integers(0, 2**32 - 1))
def test_inverse_equals_numpys(n: int, seed: int) -> None:
    root = np.random.default_rng(seed).normal(size=(n, n + 2))
    matrix = root @ root.T + 0.01 * np.eye(n)
    assert np.allclose(inverse_matrix(matrix) @ matrix, np.eye(n), atol=1e-8)


@given(n=st.integers(1, 6), seed=st.integers(0, 2**32 - 1))
def test_cholesky_solves_as_numpy_does(n: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    root, right = random.normal(size=(n, n)), random.normal(size=n)
    matrix = root @ root.T + np.eye(n)
    np.testing.assert_allclose(cholesky_solve(matrix, right), np.linalg.solve(matrix, right), atol=1e-9)


@given(sizes=st.tuples(st.integers(1, 6), st.integers(1, 6), st.integers(1, 6)), seed=st.integers(0, 2**32 - 1))
def test_product_equals_numpys(sizes: tuple[int, int, int], seed: int) -> None:
    random = np.random.default_rng(seed)
    left, right = random.normal(size=sizes[:2]), random.normal(size=sizes[1:])
    np.testing.assert_allclose(product(left, right), left @ right, atol=1e-12)
