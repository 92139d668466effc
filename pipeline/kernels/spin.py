"""Spin from many linear constraints a . spin = b: a start by random samples, then robust least squares."""

from __future__ import annotations

import numba
import numpy as np

from .arrays import Floats
from .order_statistics import median


@numba.njit(cache=True, nogil=True)
def solve3(m: Floats, b: Floats) -> tuple[Floats, float]:
    """Solution (3,) of m x = b by Cramer's rule, and the determinant; zeros where the determinant is zero."""
    c0 = m[1, 1] * m[2, 2] - m[1, 2] * m[2, 1]
    c1 = m[1, 2] * m[2, 0] - m[1, 0] * m[2, 2]
    c2 = m[1, 0] * m[2, 1] - m[1, 1] * m[2, 0]
    determinant = m[0, 0] * c0 + m[0, 1] * c1 + m[0, 2] * c2
    x = np.zeros(3)
    if determinant == 0.0:
        return x, 0.0
    x[0] = b[0] * c0 + m[0, 1] * (m[1, 2] * b[2] - b[1] * m[2, 2]) + m[0, 2] * (b[1] * m[2, 1] - m[1, 1] * b[2])
    x[1] = m[0, 0] * (b[1] * m[2, 2] - m[1, 2] * b[2]) + b[0] * c1 + m[0, 2] * (m[1, 0] * b[2] - b[1] * m[2, 0])
    x[2] = m[0, 0] * (m[1, 1] * b[2] - b[1] * m[2, 1]) + m[0, 1] * (b[1] * m[2, 0] - m[1, 0] * b[2]) + b[0] * c2
    for k in range(3):
        x[k] /= determinant
    return x, determinant


@numba.njit(cache=True, nogil=True)
def support(rows: Floats, speeds: Floats, spin: Floats, share: float) -> float:
    """Agreement of a spin with the constraints, 0..1: mean of 1 - (off / (share x speed))^2, zero beyond 1."""
    total = 0.0
    for i in range(speeds.size):
        predicted = rows[i, 0] * spin[0] + rows[i, 1] * spin[1] + rows[i, 2] * spin[2]
        off = (predicted - speeds[i]) / (share * speeds[i])
        total += max(1.0 - off * off, 0.0)
    return total / max(speeds.size, 1)


@numba.njit(cache=True, nogil=True)
def sampled_spin(
    rows: Floats, speeds: Floats, share: float, spin_max_rad_s: float, tries: int, seed: int
) -> tuple[Floats, float]:
    """Best supported spin of those that three random constraints each fix (RANSAC).

    Parameters
    ----------
    rows, speeds : (n, 3), (n,) float64
        Constraints; their right-hand sides are > 0.
    share : float
        Scale of `support`.
    spin_max_rad_s : float
        Spins above this are passed over, and samples of three nearly coplanar rows.
    tries, seed : int
        Number of samples; the same seed gives the same answer.

    Returns
    -------
    spin, support : (3,) float64, float
        Zeros where there is none.
    """
    best, best_support = np.zeros(3), 0.0
    n = speeds.size
    m, b = np.empty((3, 3)), np.empty(3)
    for _ in range(tries if n >= 3 else 0):
        size = 1.0
        for i in range(3):
            seed = (seed * 1103515245 + 12345) % 2147483648  # the C standard's sample generator
            pick = (seed >> 8) % n
            m[i, 0], m[i, 1], m[i, 2], b[i] = rows[pick, 0], rows[pick, 1], rows[pick, 2], speeds[pick]
            size *= np.sqrt(m[i, 0] ** 2 + m[i, 1] ** 2 + m[i, 2] ** 2)
        spin, determinant = solve3(m, b)
        square = spin[0] ** 2 + spin[1] ** 2 + spin[2] ** 2
        if abs(determinant) < 1e-3 * size or square > spin_max_rad_s * spin_max_rad_s:
            continue
        found = support(rows, speeds, spin, share)
        if found > best_support:
            best, best_support = spin, found
    return best, best_support


@numba.njit(cache=True, nogil=True)
def robust_spin(
    rows: Floats, speeds: Floats, stds: Floats, start: Floats, rounds: int
) -> tuple[Floats, Floats, Floats, float]:
    """Spin with rows . spin ~ speeds by iteratively reweighted least squares.

    Tukey's bisquare with its usual 4.685 robust standard deviations (1.4826 x median of the residuals over stds).

    Parameters
    ----------
    rows, speeds, stds : (n, 3), (n,), (n,) float64
        Constraints and the standard deviations of their right-hand sides.
    start : (3,) float64
        Spin to begin with.

    Returns
    -------
    spin : (3,) float64
        The start where the constraints do not fix a spin.
    weights : (n,) float64
        Of the last round, 1 / std^2 included.
    matrix : (3, 3) float64
        The normal matrix they give; singular where the constraints do not fix a spin.
    scale : float
        Robust standard deviation in units of stds.
    """
    n = speeds.size
    spin, weights, matrix, off = start.copy(), np.zeros(n), np.zeros((3, 3)), np.empty(n)
    scale = 0.0
    for _ in range(rounds):
        for i in range(n):
            predicted = rows[i, 0] * spin[0] + rows[i, 1] * spin[1] + rows[i, 2] * spin[2]
            off[i] = abs(predicted - speeds[i]) / stds[i]
        scale = max(1.4826 * median(off.copy()), 1e-9)
        matrix[:, :] = 0.0
        right = np.zeros(3)
        for i in range(n):
            part = off[i] / (4.685 * scale)
            weights[i] = (1.0 - part * part) ** 2 / stds[i] ** 2 if part < 1.0 else 0.0
            for p in range(3):
                right[p] += weights[i] * rows[i, p] * speeds[i]
                for q in range(3):
                    matrix[p, q] += weights[i] * rows[i, p] * rows[i, q]
        solved, determinant = solve3(matrix, right)
        if determinant <= 0.0:
            break
        spin = solved
    return spin, weights, matrix, scale
