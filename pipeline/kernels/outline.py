"""The ball's outline out of the events: its velocity by vote, then the fit with what supports it.

`circle`, `ellipticity` and tau_s as in the contour kernels.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from .moving_circle import fit_circle, near_outline, support

Floats = NDArray[np.float64]

# Events used for a fit: beyond this the pixels' common errors outweigh the statistical, 0.1 px / sqrt(n).
MOST_EVENTS = 200
# Events looked at around a fitted outline, for what supports it.
MOST_AROUND = 400
# Fewer are no outline.
LEAST_EVENTS, LEAST_WEIGHT = 12, 8.0
# A circle's scatter above this is no outline but a band of events.
MOST_SCATTER_PX = 0.5
# An event this near the fitted outline supports it: the scatter on clean outlines is 0.1-0.15 px, on a dim or
# textured scene three times as much.
ON_OUTLINE_PX = 1.2
# Behind, the ball's shading fires up to a fifth of the radius before the edge comes.
EARLY_SHARE = 0.2
SECTORS = 32
# Events that vote for the velocity: a circle of them stands out among some 200 velocities.
MOST_VOTERS = 120


# Sums in any order: the compiler then takes several events at once, 3 x as fast; the last bits may differ.
@njit(cache=True, nogil=True, fastmath={"reassoc", "nsz"})
def _support_of_velocity(
    circle: Floats,
    vx_px_s: float,
    vy_px_s: float,
    tau_s: Floats,
    x_px: Floats,
    y_px: Floats,
    sign: Floats,
    gate_px: float,
) -> float:
    """One cell of `vote_velocity`; sign (n,): +1 for ON, -1 for OFF events."""
    x0, y0, radius = circle[0], circle[1], circle[4]
    total = 0.0
    for e in range(tau_s.size):
        dx = x_px[e] - (x0 + vx_px_s * tau_s[e])
        dy = y_px[e] - (y0 + vy_px_s * tau_s[e])
        near = max(1.0 - abs(math.sqrt(dx * dx + dy * dy) - radius) / gate_px, 0.0)
        outwards = dx * vx_px_s + dy * vy_px_s
        total += near * sign[e] * ((1.0 if outwards > 0.0 else 0.0) - (1.0 if outwards < 0.0 else 0.0))
    return total


@njit(cache=True, nogil=True)
def vote_velocity(
    votes: Floats,
    circle: Floats,
    tau_s: Floats,
    x_px: Floats,
    y_px: Floats,
    on: NDArray[np.bool_],
    step_px_s: float,
    gate_px: float,
) -> None:
    """Hough vote for the velocity of a circle (5,) float64 around the one it has; adds into votes.

    votes : (2 m + 1, 2 m + 1) float64; votes[m + j, m + i] is for the circle's velocity plus
        (i, j) * step_px_s, within the disc of radius m

    An event counts by its nearness to the outline moved to its time, plus where the outline moves outwards and
    its polarity is ON or inwards and OFF, minus for the opposite: |votes| is the support of a ball brighter (or,
    where negative, darker) than its background that moves so.
    """
    m = votes.shape[0] // 2
    sign = np.where(on, 1.0, -1.0)
    for j in range(-m, m + 1):
        for i in range(-m, m + 1):
            if i * i + j * j > m * m:
                continue
            vx = circle[2] + i * step_px_s
            vy = circle[3] + j * step_px_s
            votes[m + j, m + i] += _support_of_velocity(circle, vx, vy, tau_s, x_px, y_px, sign, gate_px)


@njit(cache=True, nogil=True)
def fit_outline(
    expected: Floats,
    prior_std: Floats,
    ellipticity: Floats,
    t_us: NDArray[np.int64],
    x_px: NDArray[np.uint16],
    y_px: NDArray[np.uint16],
    on: NDArray[np.bool_],
    reference_us: float,
    gate_px: float,
    width_px: int,
    height_px: int,
) -> tuple[Floats, Floats, float, Floats]:
    """Fit the half of the outline ahead near an expected circle, and what supports the fit.

    Events within gate_px of the expected outline take part; prior_std as for `fit_circle`.
    Returns the circle (5,), its covariance (5, 5), the scatter in px and what `support` says (8,); the circle is NaN
    with too few events, or where these are a band rather than an outline.
    """
    chosen = near_outline(expected, t_us, x_px, y_px, reference_us, gate_px, MOST_EVENTS, True)
    nothing = np.full(5, np.nan), np.zeros((5, 5)), 0.0, np.zeros(8)
    if chosen.size < LEAST_EVENTS:
        return nothing
    tau_s, x, y = _relative(chosen, t_us, x_px, y_px, reference_us)
    circle, covariance, scatter, weight = fit_circle(expected, prior_std, ellipticity, tau_s, x, y, gate_px, 0.6, 9)
    if not (np.all(np.isfinite(circle)) and circle[4] > 1.0 and weight >= LEAST_WEIGHT and scatter <= MOST_SCATTER_PX):
        return nothing
    early_px = EARLY_SHARE * circle[4]
    around_px = max(4.0 * ON_OUTLINE_PX, early_px)
    around = near_outline(circle, t_us, x_px, y_px, reference_us, around_px, MOST_AROUND, False)
    tau_s, x, y = _relative(around, t_us, x_px, y_px, reference_us)
    found = support(circle, ellipticity, tau_s, x, y, on[around], width_px, height_px, ON_OUTLINE_PX, early_px, SECTORS)
    return circle, covariance, scatter, found


@njit(cache=True, nogil=True)
def _relative(
    chosen: NDArray[np.int64],
    t_us: NDArray[np.int64],
    x_px: NDArray[np.uint16],
    y_px: NDArray[np.uint16],
    reference_us: float,
) -> tuple[Floats, Floats, Floats]:
    """Seconds after the reference time, columns and rows of the chosen events, (m,) float64 each."""
    tau_s, x, y = np.empty(chosen.size), np.empty(chosen.size), np.empty(chosen.size)
    for k in range(chosen.size):
        i = chosen[k]
        tau_s[k] = (t_us[i] - reference_us) * 1e-6
        x[k] = x_px[i]
        y[k] = y_px[i]
    return tau_s, x, y


@njit(cache=True, nogil=True)
def in_square(
    x_px: NDArray[np.uint16], y_px: NDArray[np.uint16], centre_x_px: float, centre_y_px: float, reach_px: float
) -> NDArray[np.int64]:
    """(m,) int64 indices of events within reach_px of a place, in both columns and rows."""
    chosen = np.empty(x_px.size, np.int64)
    m = 0
    for i in range(x_px.size):
        chosen[m] = i
        m += (abs(x_px[i] - centre_x_px) <= reach_px) & (abs(y_px[i] - centre_y_px) <= reach_px)
    return chosen[:m].copy()


@njit(cache=True, nogil=True)
def find_moving_circle(
    x_px: float,
    y_px: float,
    radius_px: float,
    t_us: NDArray[np.int64],
    xs_px: NDArray[np.uint16],
    ys_px: NDArray[np.uint16],
    on: NDArray[np.bool_],
    reference_us: float,
    span_s: float,
    fastest_px_s: float,
) -> tuple[Floats, float]:
    """The circle (5,) at this place and of this radius that moves as most events say, and the width of the last vote.

    span_s : how far back the events go
    Two rounds: all velocities up to fastest_px_s with an outline as wide as the steps, then between them. The second
    width is what a Hough circle may be off, about 2 px on balls of 20 px. The circle is NaN with too few events.
    """
    circle = np.array([x_px, y_px, 0.0, 0.0, radius_px])
    chosen = in_square(xs_px, ys_px, x_px, y_px, 1.3 * radius_px + fastest_px_s * span_s)
    stride = max(1, chosen.size // MOST_VOTERS) | 1
    chosen = chosen[::stride].copy()
    gate, span = 0.3 * radius_px, fastest_px_s
    if chosen.size < LEAST_EVENTS:
        circle[:] = np.nan
        return circle, gate
    tau_s, x, y = _relative(chosen, t_us, xs_px, ys_px, reference_us)
    for turn in range(2):
        if turn == 1:
            gate, span = max(2.0, 0.15 * radius_px), 0.3 * radius_px / span_s
        step = gate / span_s
        m = math.ceil(span / step)
        votes = np.zeros((2 * m + 1, 2 * m + 1))
        vote_velocity(votes, circle, tau_s, x, y, on[chosen], step, gate)
        best, row, column = 0.0, 0, 0
        for j in range(2 * m + 1):
            for i in range(2 * m + 1):
                if abs(votes[j, i]) > best:
                    best, row, column = abs(votes[j, i]), j, i
        if best > 0.0:
            circle[2] += (column - m) * step
            circle[3] += (row - m) * step
    return circle, gate
