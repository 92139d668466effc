"""Velocity of a circle that a surface shows: the Hough vote of the events for it, the start of an outline's fit.

`circle` and tau_s as in `moving_circle`.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .arrays import Events, Flags, Floats
from .moving_circle import in_box, relative_events
from .outline import LEAST_EVENTS

# The votes for the velocity.
UNSIGNED, SIGNED = range(2)
# Events that vote for the velocity: a circle of them stands out among some 200 velocities.
MOST_VOTERS = 120


@njit(cache=True, nogil=True)
def vote_velocity(
    votes: Floats,
    circle: Floats,
    tau_s: Floats,
    x_px: Floats,
    y_px: Floats,
    on: Flags,
    step_px_s: float,
    gate_px: float,
) -> None:
    """Hough votes for the velocity of a circle around the one it has; adds into `votes` only.

    An event counts by its nearness to the outline moved to its time: the UNSIGNED vote, for a ball over ground brighter
    here and darker there. SIGNED, it counts plus where the outline moves outwards and its polarity is ON or inwards and
    OFF, minus for the opposite: |votes| is the support of a ball brighter (or, where negative, darker) than its
    background that moves so.

    In single precision, good to 1e-4 of an event, and an event's votes for all velocities in one loop, eight at once:
    2.5 x faster, and the same on every processor.

    Parameters
    ----------
    votes : (2, 2 m + 1, 2 m + 1) float64
        votes[:, m + j, m + i] are for the circle's velocity plus (i, j) * step_px_s, within the disc of radius m.
    gate_px : float
        Distance from the outline at which an event no longer counts.
    """
    m, side = votes.shape[1] // 2, votes.shape[1]
    vx_px_s, vy_px_s = np.empty(side * side, np.float32), np.empty(side * side, np.float32)
    cells = np.empty(side * side, np.int64)
    count = 0
    for j in range(-m, m + 1):
        for i in range(-m, m + 1):
            if i * i + j * j <= m * m:
                vx_px_s[count], vy_px_s[count] = circle[2] + i * step_px_s, circle[3] + j * step_px_s
                cells[count] = (m + j) * side + m + i
                count += 1
    unsigned, signed = np.zeros(count, np.float32), np.zeros(count, np.float32)
    zero, one = np.float32(0.0), np.float32(1.0)
    radius, per_px = np.float32(circle[4]), np.float32(1.0 / gate_px)
    for e in range(tau_s.size):
        tau, x, y = np.float32(tau_s[e]), np.float32(x_px[e] - circle[0]), np.float32(y_px[e] - circle[1])
        sign = one if on[e] else -one
        for n in range(count):
            k = np.uint64(n)
            dx, dy = x - vx_px_s[k] * tau, y - vy_px_s[k] * tau
            near = max(one - abs(math.sqrt(dx * dx + dy * dy) - radius) * per_px, zero)
            outwards = dx * vx_px_s[k] + dy * vy_px_s[k]
            moves = (one if outwards > zero else zero) - (one if outwards < zero else zero)
            unsigned[k] += near
            signed[k] += near * (sign * moves)
    for n in range(count):
        row, column = cells[n] // side, cells[n] % side
        votes[UNSIGNED, row, column] += unsigned[n]
        votes[SIGNED, row, column] += signed[n]


@njit(cache=True, nogil=True)
def find_moving_circle(
    x_px: float,
    y_px: float,
    radius_px: float,
    events: Events,
    reference_us: int,
    span_s: float,
    fastest_px_s: float,
) -> tuple[Floats, float]:
    """Circles at this place and of this radius that move as most events say.

    Two rounds: all velocities up to fastest_px_s with an outline as wide as the steps, the same for both votes, then
    between them.

    Parameters
    ----------
    x_px, y_px, radius_px : float
        Place and radius at the time reference_us.
    span_s : float
        Time that the events go back.

    Returns
    -------
    circles : (2, 5) float64
        By the UNSIGNED and by the SIGNED vote, see `vote_velocity`. NaN with too few events.
    gate_px : float
        Width of the last vote: what a Hough circle may be off, about 2 px on balls of 20 px.
    """
    circles = np.zeros((2, 5))
    circles[:, 0], circles[:, 1], circles[:, 4] = x_px, y_px, radius_px
    reach_px = 1.3 * radius_px + fastest_px_s * span_s
    chosen = in_box(events, (x_px - reach_px, x_px + reach_px, y_px - reach_px, y_px + reach_px))
    chosen = chosen[:: max(1, chosen.size // MOST_VOTERS) | 1].copy()
    gate, span = 0.3 * radius_px, fastest_px_s
    if chosen.size < LEAST_EVENTS:
        circles[:] = np.nan
        return circles, gate
    tau_s, x, y, on = relative_events(chosen, events, reference_us)
    step = gate / span_s
    votes = _empty_votes(span, step)
    vote_velocity(votes, circles[0], tau_s, x, y, on, step, gate)
    for kind in (UNSIGNED, SIGNED):
        _add_best_velocity(circles[kind], votes[kind], step)
    gate, span = max(2.0, 0.15 * radius_px), 0.3 * radius_px / span_s
    step = gate / span_s
    for kind in (UNSIGNED, SIGNED):
        votes = _empty_votes(span, step)
        vote_velocity(votes, circles[kind], tau_s, x, y, on, step, gate)
        _add_best_velocity(circles[kind], votes[kind], step)
    return circles, gate


@njit(cache=True, nogil=True)
def _empty_votes(span_px_s: float, step_px_s: float) -> Floats:
    """Votes for velocities up to a span in such steps."""
    side = 2 * math.ceil(span_px_s / step_px_s) + 1
    return np.zeros((2, side, side))


@njit(cache=True, nogil=True)
def _add_best_velocity(circle: Floats, votes: Floats, step_px_s: float) -> None:
    """Add the velocity with the most of one kind of votes to the circle's."""
    side = votes.shape[0]
    best, best_row, best_column = 0.0, side // 2, side // 2
    for row in range(side):
        for column in range(side):
            if abs(votes[row, column]) > best:
                best, best_row, best_column = abs(votes[row, column]), row, column
    circle[2] += (best_column - side // 2) * step_px_s
    circle[3] += (best_row - side // 2) * step_px_s
