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
# What bends a flight and what turns it: gravity in m/s^2, lift and drag coefficients in 1/m, jump of velocity in m/s.
Allowed = tuple[float, float, float, float]


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


@njit(cache=True, nogil=True)
def _precisions(speed_px_s: float, radius_px: float, focal_px: float, ball_radius_m: float, allowed: Allowed) -> Floats:
    """One over the variances (3, 6) of each channel's coefficients: what flight and contacts allow."""
    gravity_m_s2, lift_1_m, drag_1_m, jump_m_s = allowed
    depth_m = focal_px * ball_radius_m / radius_px
    across, along = radius_px / ball_radius_m, radius_px / depth_m  # px a metre across the view, and along it
    speed_m_s = speed_px_s / across
    acceleration = 2.0 * (gravity_m_s2 + (lift_1_m + drag_1_m) * speed_m_s**2)
    # Drag falls with the speed that it takes, and a depth that changes by gravity bends the path in perspective.
    jerk = 3.0 * acceleration * max(speed_m_s, 1.0) / depth_m + 2.0 * drag_1_m**2 * speed_m_s**3
    # A contact changes the image's acceleration by perspective, as it changes the speed towards the camera.
    largest = (1e6, 1e6, acceleration / 2, jerk / 6, jump_m_s, acceleration / 4)
    precisions = np.empty((3, TERMS))
    for channel in range(3):
        for k, most in enumerate(largest):
            precisions[channel, k] = 1.0 / ((along if channel == 2 else across) * most) ** 2
    return precisions


@njit(cache=True, nogil=True)
def smooth_path(
    rows: Floats,
    noises: Floats,
    errors_px2: Floats,
    focal_px: float,
    ball_radius_m: float,
    allowed: Allowed,
) -> tuple[Floats, Floats, Floats, Floats, float]:
    """Channels of measured circles, and the least cost of a path through them without a hinge.

    Parameters
    ----------
    rows : (n, 5) float64
        Times in s, x, y and radius in px, and 1 sigma in px by which the place was shaken.
    noises : (n, 3, 3) float64
        Covariances of x, y and radius.
    errors_px2 : (3,) float64
        Variance of each channel beyond these.

    Returns
    -------
    times_s, values, weights, precisions
        As `path_costs` takes them.
    cost : float
    """
    n = rows.shape[0]
    times_s, errors = np.empty(n), np.empty((n, 3))
    for i in range(n):
        times_s[i] = rows[i, 0]
        for channel in range(3):
            errors[i, channel] = errors_px2[channel] + (rows[i, 4] ** 2 if channel < 2 else 0.0)
    values, weights, speed_px_s = edge_channels(times_s, rows[:, 1:4].copy(), noises, errors)
    precisions = _precisions(speed_px_s, rows[n - 1, 3], focal_px, ball_radius_m, allowed)
    cost = np.empty(1)
    path_costs(cost, times_s, values, weights, precisions, np.empty(0))
    return times_s, values, weights, precisions, cost[0]
