"""Kalman filter of the ball (section 3.1): state [x, y, vx, vy, radius], observation [x, y, radius].

Written out for these matrices: a general filter (filterpy) takes 4 to 8 times as long, and seconds to load.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .arrays import Floats
from .small_matrices import inverse_matrix

STATES = 5
OBSERVED = np.array([0, 1, 4])


@njit(cache=True, nogil=True)
def predict(
    mean: Floats, covariance: Floats, dt_s: float, acceleration_px_s2: float, growth_px_s: float
) -> tuple[Floats, Floats]:
    """State (5,) and covariance (5, 5) dt_s later, as new arrays.

    The ball moves straight on; acceleration_px_s2 and growth_px_s are 1 sigma of its acceleration and of its radius'
    rate of change, each constant over the step.
    """
    later, spread = mean.copy(), covariance.copy()
    later[0] += dt_s * mean[2]
    later[1] += dt_s * mean[3]
    # F P F^T, F = 1 but for the two places where a velocity moves its place.
    for k in range(STATES):
        spread[0, k] += dt_s * spread[2, k]
        spread[1, k] += dt_s * spread[3, k]
    for k in range(STATES):
        spread[k, 0] += dt_s * spread[k, 2]
        spread[k, 1] += dt_s * spread[k, 3]
    moved, sped = acceleration_px_s2 * dt_s**2 / 2, acceleration_px_s2 * dt_s
    for place in range(2):
        spread[place, place] += moved * moved
        spread[place, place + 2] += moved * sped
        spread[place + 2, place] += moved * sped
        spread[place + 2, place + 2] += sped * sped
    spread[4, 4] += (growth_px_s * dt_s) ** 2
    return later, spread


@njit(cache=True, nogil=True)
def update(
    mean: Floats, covariance: Floats, observed: Floats, noise: Floats, most_surprise: float
) -> tuple[bool, Floats, Floats]:
    """Take in an observation (3,) with covariance noise (3, 3): whether it matches, new state, new covariance.

    An observation matches when its squared Mahalanobis distance from the prediction is at most most_surprise; else
    state and covariance stay. The covariance is Joseph's form, positive whatever the rounding.
    """
    later, spread = mean.copy(), covariance.copy()
    off, innovation = np.empty(3), noise.copy()
    for a in range(3):
        off[a] = observed[a] - mean[OBSERVED[a]]
        for b in range(3):
            innovation[a, b] += covariance[OBSERVED[a], OBSERVED[b]]
    inverse = inverse_matrix(innovation)
    surprise = 0.0
    for a in range(3):
        for b in range(3):
            surprise += off[a] * inverse[a, b] * off[b]
    if surprise > most_surprise:
        return False, later, spread
    gain, kept = np.zeros((STATES, 3)), np.zeros((STATES, STATES))
    for i in range(STATES):
        kept[i, i] = 1.0
        for b in range(3):
            for a in range(3):
                gain[i, b] += covariance[i, OBSERVED[a]] * inverse[a, b]
            later[i] += gain[i, b] * off[b]
            kept[i, OBSERVED[b]] -= gain[i, b]
    spread, added = _transformed(kept, covariance), _transformed(gain, noise)
    for i in range(STATES):
        for k in range(STATES):
            spread[i, k] += added[i, k]
    return True, later, spread


@njit(cache=True, nogil=True)
def observation_noise(covariance: Floats, scatter_px2: float, times: float) -> Floats:
    """Covariance (3, 3) of an observation from that of a state (5, 5) and a variance of its own, so many times."""
    noise = np.empty((3, 3))
    for a in range(3):
        for b in range(3):
            noise[a, b] = (covariance[OBSERVED[a], OBSERVED[b]] + (scatter_px2 if a == b else 0.0)) * times
    return noise


@njit(cache=True, nogil=True)
def _transformed(matrix: Floats, covariance: Floats) -> Floats:
    """Covariance M C M^T of a matrix M (m, n) times what has this covariance C (n, n)."""
    rows, n = matrix.shape
    half, result = np.zeros((rows, n)), np.zeros((rows, rows))
    for i in range(rows):
        for k in range(n):
            for j in range(n):
                half[i, k] += matrix[i, j] * covariance[j, k]
    for i in range(rows):
        for k in range(rows):
            for j in range(n):
                result[i, k] += half[i, j] * matrix[k, j]
    return result
