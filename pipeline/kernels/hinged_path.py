"""Paths of measured circles with and without a hinge, a jump of velocity: what the change test compares.

A path is, in each of three channels (see `edge_channels`), a cubic in time, and after a hinge at tau a jump of velocity
and of acceleration more: terms (1, s, s^2, s^3, (s - tau)+, (s - tau)+^2). Coefficients have zero-mean Gaussian priors,
so that what flight allows (gravity, drag, lift, perspective) costs little and a contact much.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .arrays import Floats

TERMS = 6
SMOOTH_TERMS = 4


@njit(cache=True, nogil=True)
def solve(solution: Floats, normal: Floats, moment: Floats, count: int) -> None:
    """Solve the first `count` rows of the normal equations (k, k) and (k,), by Gauss elimination; writes `solution`."""
    left, right = normal[:count, :count].copy(), moment[:count].copy()
    for i in range(count):
        for j in range(i + 1, count):
            factor = left[j, i] / left[i, i]
            for k in range(i, count):
                left[j, k] -= factor * left[i, k]
            right[j] -= factor * right[i]
    for i in range(count - 1, -1, -1):
        total = right[i]
        for k in range(i + 1, count):
            total -= left[i, k] * solution[k]
        solution[i] = total / left[i, i]


@njit(cache=True, nogil=True)
def edge_channels(times_s: Floats, circles: Floats, noises: Floats, errors_px2: Floats) -> tuple[Floats, Floats, float]:
    """Channels of circles (n, 3) [x, y, radius] in px, measured at times (n,), and the speed along them.

    Not x, y and radius but the place of the edge ahead (along the flight, plus radius), the place across it, and the
    radius: only the half of the outline ahead is fitted, so that a circle too large by 0.2 px lies 0.2 px back, and its
    edge ahead is right.

    Parameters
    ----------
    noises : (n, 3, 3) float64
        Covariances of the circles, px^2.
    errors_px2 : (n, 3) float64
        Variance of each channel beyond these.

    Returns
    -------
    values, weights : (n, 3) float64
        The channels in px, and one over their variances.
    speed_px_s : float
        Length of the path over its time.
    """
    n = times_s.size
    ux, uy = circles[n - 1, 0] - circles[0, 0], circles[n - 1, 1] - circles[0, 1]
    length = math.hypot(ux, uy)
    ux, uy = (ux / length, uy / length) if length > 0.0 else (0.0, 0.0)
    channels = np.zeros((3, 3))
    channels[0, 0], channels[0, 1], channels[0, 2] = ux, uy, 1.0
    channels[1, 0], channels[1, 1], channels[2, 2] = -uy, ux, 1.0
    values, weights = np.zeros((n, 3)), np.empty((n, 3))
    way_px = 0.0
    for i in range(n):
        if i > 0:
            way_px += math.hypot(circles[i, 0] - circles[i - 1, 0], circles[i, 1] - circles[i - 1, 1])
        for channel in range(3):
            variance = errors_px2[i, channel]
            for j in range(3):
                values[i, channel] += channels[channel, j] * circles[i, j]
                for k in range(3):
                    variance += channels[channel, j] * noises[i, j, k] * channels[channel, k]
            weights[i, channel] = 1.0 / variance
    return values, weights, way_px / (times_s[n - 1] - times_s[0])


@njit(cache=True, nogil=True)
def path_costs(
    costs: Floats, times_s: Floats, circles: Floats, weights: Floats, precisions: Floats, hinges_s: Floats
) -> None:
    """Least cost of a path without a hinge, costs[0], and with one at each time, costs[1:]; writes `costs` only.

    The cost is chi^2 of circles and priors.

    Parameters
    ----------
    costs : (1 + m,) float64
    times_s : (n,) float64
        Times of the circles.
    circles, weights : (n, 3) float64
        x, y, radius in px, and one over their variances.
    precisions : (3, 6) float64
        One over the variances of each channel's coefficients (px / s^k).
    hinges_s : (m,) float64
        Times of the hinge.
    """
    n = times_s.size
    terms = np.ones((n, TERMS))
    for i in range(n):
        for k in range(1, SMOOTH_TERMS):
            terms[i, k] = terms[i, k - 1] * times_s[i]
    normal, moment, solution = np.empty((TERMS, TERMS)), np.empty(TERMS), np.empty(TERMS)
    costs[:] = 0.0
    for channel in range(3):
        square = 0.0
        for i in range(n):
            square += weights[i, channel] * circles[i, channel] ** 2
        for h in range(hinges_s.size + 1):
            count = SMOOTH_TERMS if h == 0 else TERMS
            first = 0 if h == 0 else SMOOTH_TERMS  # the smooth part is the same for all hinges
            if h > 0:
                for i in range(n):
                    after = max(times_s[i] - hinges_s[h - 1], 0.0)
                    terms[i, SMOOTH_TERMS], terms[i, SMOOTH_TERMS + 1] = after, after * after
            for j in range(first, count):
                total = 0.0
                for i in range(n):
                    total += weights[i, channel] * terms[i, j] * circles[i, channel]
                moment[j] = total
                for k in range(j + 1):
                    total = precisions[channel, j] if j == k else 0.0
                    for i in range(n):
                        total += weights[i, channel] * terms[i, j] * terms[i, k]
                    normal[j, k] = normal[k, j] = total
            solve(solution, normal, moment, count)
            cost = square
            for j in range(count):
                cost -= solution[j] * moment[j]
            costs[h] += cost
