"""Product, inverse and solution of small matrices: LAPACK and BLAS take longer, their last bits differ by processor."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .arrays import Floats


@njit(cache=True, nogil=True)
def inverse_matrix(matrix: Floats) -> Floats:
    """Inverse of a positive definite matrix (n, n), by elimination.

    LAPACK's through NumPy is no faster on 5 x 5 and takes five times as long to compile with the fit.
    """
    n = matrix.shape[0]
    left = matrix.copy()
    inverse = np.zeros((n, n))
    for i in range(n):
        inverse[i, i] = 1.0
    for i in range(n):
        pivot = 1.0 / left[i, i]
        for k in range(n):
            left[i, k] *= pivot
            inverse[i, k] *= pivot
        for j in range(n):
            if j != i:
                factor = left[j, i]
                for k in range(n):
                    left[j, k] -= factor * left[i, k]
                    inverse[j, k] -= factor * inverse[i, k]
    return inverse


@njit(cache=True, nogil=True)
def product(left: Floats, right: Floats) -> Floats:
    """Product (m, n) of small matrices (m, k) and (k, n): BLAS sums in another order on another processor."""
    result = np.zeros((left.shape[0], right.shape[1]))
    for i in range(left.shape[0]):
        for j in range(left.shape[1]):
            for k in range(right.shape[1]):
                result[i, k] += left[i, j] * right[j, k]
    return result


@njit(cache=True, nogil=True)
def cholesky_solve(matrix: Floats, right: Floats) -> Floats:
    """Solution x (c,) of matrix x = right; the matrix (c, c) is positive definite."""
    count = right.size
    lower, x = np.zeros((count, count)), right.copy()
    for k in range(count):
        for j in range(k + 1):
            total = matrix[k, j]
            for i in range(j):
                total -= lower[k, i] * lower[j, i]
            lower[k, j] = math.sqrt(max(total, 1e-300)) if k == j else total / lower[j, j]
    for k in range(count):
        for i in range(k):
            x[k] -= lower[k, i] * x[i]
        x[k] /= lower[k, k]
    for k in range(count - 1, -1, -1):
        for i in range(k + 1, count):
            x[k] -= lower[i, k] * x[i]
        x[k] /= lower[k, k]
    return x
