"""Outline of a moving ball in the events: a circle that moves at constant velocity, fitted to sub-pixel.

A `circle` is (5,) float64 [x_px, y_px, vx_px_s, vy_px_s, radius_px] at a reference time. `ellipticity` (2,) float64
is the outline's known departure from a circle: at the angle phi (image frame) it lies
radius * (1 + ellipticity[0] cos 2phi + ellipticity[1] sin 2phi) from the centre; a sphere seen off the optical axis is
such an ellipse. Event times are tau_s, seconds after the reference time (mostly negative).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .arrays import Events, Flags, Floats, Integers
from .small_matrices import inverse_matrix

# First and last column, first and last row in px.
Box = tuple[float, float, float, float]
# Parts of an outline: all of it, the half that moves outwards, or the events of both halves as a disc brighter or
# darker than the ground gives them (ON where a bright one moves outwards and OFF where it moves inwards).
WHOLE, HALF_AHEAD, OF_BRIGHT, OF_DARK = range(4)


@njit(cache=True, nogil=True)
def near_outline(
    circle: Floats, events: Events, reference_us: int, gate_px: float, most_events: int, part: int
) -> Integers:
    """Indices (m,) int64 of events within gate_px of a part of the moving outline, thinned evenly to most_events.

    The parts are WHOLE, HALF_AHEAD, OF_BRIGHT and OF_DARK.
    """
    around = in_box(events, box_around(circle, events, reference_us, circle[4] + gate_px))
    return near_outline_of(around, circle, events, reference_us, gate_px, most_events, part)


@njit(cache=True, nogil=True)
def near_outline_of(
    around: Integers,
    circle: Floats,
    events: Events,
    reference_us: int,
    gate_px: float,
    most_events: int,
    part: int,
) -> Integers:
    """`near_outline` of events around it, (n,) int64: all in its `box_around`, and any others."""
    t_us, x_px, y_px, on = events
    x0, y0, vx, vy = circle[0], circle[1], circle[2], circle[3]
    is_whole, is_half, of_bright = part == WHOLE, part == HALF_AHEAD, part == OF_BRIGHT
    inner = max(circle[4] - gate_px, 0.0) ** 2
    outer = (circle[4] + gate_px) ** 2
    chosen = np.empty(around.size, np.int64)
    m = 0
    for n in range(around.size):
        i = np.uint64(around[n])
        tau = np.int32(t_us[i] - reference_us) * 1e-6
        dx, dy = x_px[i] - (x0 + vx * tau), y_px[i] - (y0 + vy * tau)
        square = dx * dx + dy * dy
        outwards = dx * vx + dy * vy >= 0.0
        is_part = is_whole | (outwards if is_half else ((outwards == on[i]) == of_bright))
        chosen[m] = i  # stays only if counted: no branch to mispredict
        m += (inner <= square) & (square <= outer) & is_part
    stride = max(1, -(-m // max(most_events, 1))) | 1  # odd: symmetric motion brings events in pairs
    return chosen[:m:stride].copy()


@njit(cache=True, nogil=True)
def box_around(circle: Floats, events: Events, reference_us: int, reach_px: float) -> Box:
    """Columns and rows that a moving circle of this radius passes during the events, and some more; none without."""
    t_us, _, _, _ = events
    if t_us.size == 0:
        return 0.0, -1.0, 0.0, -1.0
    first_s, last_s = (t_us[0] - reference_us) * 1e-6, (t_us[-1] - reference_us) * 1e-6
    first_x, last_x = circle[0] + circle[2] * first_s, circle[0] + circle[2] * last_s
    first_y, last_y = circle[1] + circle[3] * first_s, circle[1] + circle[3] * last_s
    reach_px += 1.0  # more than any rounding
    left_px, right_px = min(first_x, last_x) - reach_px, max(first_x, last_x) + reach_px
    return left_px, right_px, min(first_y, last_y) - reach_px, max(first_y, last_y) + reach_px


@njit(cache=True, nogil=True)
def in_box(events: Events, box: Box) -> Integers:
    """Indices (m,) int64 of events in these columns and rows, the limits included.

    The processor compares 16 whole numbers at once: in clutter twice as fast as the distances of all events.
    """
    _, x_px, y_px, _ = events
    left_px, right_px, top_px, bottom_px = box
    left, top = np.int64(math.ceil(_pixel(left_px))), np.int64(math.ceil(_pixel(top_px)))
    width, height = np.int64(math.floor(_pixel(right_px))) - left, np.int64(math.floor(_pixel(bottom_px))) - top
    if right_px < 0.0 or bottom_px < 0.0 or width < 0 or height < 0:
        return np.empty(0, np.int64)
    columns, rows = np.uint16(width), np.uint16(height)
    inside = np.empty(x_px.size, np.bool_)
    for n in range(x_px.size):
        i = np.uint64(n)
        # What lies before the first one wraps to large numbers: one comparison an axis.
        inside[i] = (np.uint16(np.int64(x_px[i]) - left) <= columns) & (np.uint16(np.int64(y_px[i]) - top) <= rows)
    return _set_rows(inside)


@njit(cache=True, nogil=True)
def _pixel(place_px: float) -> float:
    """Place within what a pixel's number can be."""
    return min(max(place_px, 0.0), 65535.0)


@njit(cache=True, nogil=True)
def _set_rows(flags: Flags) -> Integers:
    """Indices (m,) int64 of the flags that are set."""
    rows = np.empty(flags.size, np.int64)
    m = 0
    for n in range(flags.size):
        rows[m] = n  # stays only if counted: no branch to mispredict
        m += flags[np.uint64(n)]
    return rows[:m].copy()


@njit(cache=True, nogil=True, error_model="numpy")
def residuals(circle: Floats, ellipticity: Floats, tau_s: Floats, x_px: Floats, y_px: Floats) -> Floats:
    """Distances (n,) in px of events from the outline, > 0 outside."""
    distances = np.empty(tau_s.size)
    for i in range(tau_s.size):
        dx, dy = x_px[i] - (circle[0] + circle[2] * tau_s[i]), y_px[i] - (circle[1] + circle[3] * tau_s[i])
        square = dx * dx + dy * dy + 1e-18
        bulge = (ellipticity[0] * (dx * dx - dy * dy) + ellipticity[1] * 2.0 * dx * dy) / square
        distances[i] = math.sqrt(square) - circle[4] * (1.0 + bulge)
    return distances


@njit(cache=True, nogil=True, error_model="numpy")
def _derivatives(
    terms: Floats, circle: Floats, ellipticity: Floats, tau_s: Floats, x_px: Floats, y_px: Floats, gate_px: float
) -> None:
    """Write a, b, c, error and weight of each event (n,) into the rows of terms (5, n).

    A move of the circle by (dx, dy) and a radius larger by dr take a dx + b dy + c dr off the error, the distance from
    the outline.
    """
    x0, y0, vx, vy, radius = circle[0], circle[1], circle[2], circle[3], circle[4]
    cosine, sine = ellipticity[0], ellipticity[1]
    for n in range(tau_s.size):
        i = np.uint64(n)
        dx = x_px[i] - (x0 + vx * tau_s[i])
        dy = y_px[i] - (y0 + vy * tau_s[i])
        distance = math.sqrt(dx * dx + dy * dy) + 1e-9
        a, b = dx / distance, dy / distance
        c = 1.0 + cosine * (a * a - b * b) + sine * 2.0 * a * b
        error = distance - radius * c
        share = error / gate_px
        rest = 1.0 - share * share
        terms[0, i], terms[1, i], terms[2, i], terms[3, i] = a, b, c, error
        terms[4, i] = rest * rest if rest > 0.0 else 0.0


@njit(cache=True, nogil=True)
def _normal_equations(information: Floats, gradient: Floats, terms: Floats, tau_s: Floats) -> tuple[float, float]:
    """Write J^T W J (5, 5) and J^T W e (5,) of `_derivatives` (velocity in px/ms); sums of w and w e^2.

    Each sum in a variable of its own, not in the arrays: twice as fast. The derivatives in a loop before, which takes
    several events at once: 1.6 x as fast.
    """
    weights, squares = 1e-9, 0.0
    ga, gb, gat, gbt, gc = 0.0, 0.0, 0.0, 0.0, 0.0
    aa, ab, bb, ac, bc, cc = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    aat, abt, bbt, act, bct = 0.0, 0.0, 0.0, 0.0, 0.0
    aatt, abtt, bbtt = 0.0, 0.0, 0.0
    for n in range(tau_s.size):
        i = np.uint64(n)
        a, b, c, error, weight = terms[0, i], terms[1, i], terms[2, i], terms[3, i], terms[4, i]
        weights += weight
        squares += weight * error * error
        t = tau_s[i] * 1e3
        wa, wb, wc = weight * a, weight * b, weight * c
        wat, wbt = wa * t, wb * t
        ga += wa * error
        gb += wb * error
        gc += wc * error
        gat += wat * error
        gbt += wbt * error
        aa += wa * a
        ab += wa * b
        bb += wb * b
        ac += wa * c
        bc += wb * c
        cc += wc * c
        aat += wat * a
        abt += wat * b
        bbt += wbt * b
        act += wat * c
        bct += wbt * c
        aatt += wat * a * t
        abtt += wat * b * t
        bbtt += wbt * b * t
    gradient[0], gradient[1], gradient[2], gradient[3], gradient[4] = ga, gb, gat, gbt, gc
    upper = (aa, ab, aat, abt, ac, bb, abt, bbt, bc, aatt, abtt, act, bbtt, bct, cc)
    n = 0
    for j in range(5):
        for k in range(j, 5):
            information[j, k] = information[k, j] = upper[n]
            n += 1
    return weights, squares


@njit(cache=True, nogil=True)
def fit_circle(
    start: Floats,
    prior_std: Floats,
    ellipticity: Floats,
    tau_s: Floats,
    x_px: Floats,
    y_px: Floats,
    gate_px: float,
    floor_px: float,
    most_rounds: int,
) -> tuple[Floats, Floats, float, float]:
    """Fit a moving circle to events: Gauss-Newton steps with Tukey's biweight.

    Parameters
    ----------
    start : (5,) float64
        Circle to begin with.
    prior_std : (5,) float64
        1 sigma by which the answer may leave it (large = freely, 0 = not at all: zeros for the velocity give the fit of
        a circle at rest).
    gate_px, floor_px : float
        Tukey's cut-off in the first round; it then shrinks to 4.7 robust sigma, by half a round at least (so that the
        sharp outline wins over a band of late events inside it), down to floor_px.

    Returns
    -------
    circle, covariance : (5,), (5, 5) float64
        The covariance is from the scatter of the residuals alone.
    scatter_px : float
        That scatter, 1 sigma.
    weight : float
        Sum of the weights, about the number of events used.
    """
    circle = start.copy()
    information, gradient, terms = np.zeros((5, 5)), np.zeros(5), np.empty((5, tau_s.size))
    gate, scatter, weight_sum = gate_px, gate_px, 0.0
    # The velocity is fitted in px/ms, so that all unknowns are of the same size.
    scale = np.ones(5)
    scale[2] = scale[3] = 1e3
    for _ in range(most_rounds):
        _derivatives(terms, circle, ellipticity, tau_s, x_px, y_px, gate)
        weight_sum, squares = _normal_equations(information, gradient, terms, tau_s)
        for k in range(5):
            firm = (scale[k] / max(prior_std[k], 1e-9)) ** 2 + 1e-9
            information[k, k] += firm
            gradient[k] += firm * (start[k] - circle[k]) / scale[k]
        inverse = inverse_matrix(information)
        moved = 0.0
        for j in range(5):
            step = 0.0
            for k in range(5):
                step += inverse[j, k] * gradient[k]
            circle[j] += step * scale[j]
            moved = max(moved, abs(step))
        # Tukey's weights at 4.7 sigma leave 0.83 of the variance of Gaussian residuals: 0.91 of sigma.
        scatter = math.sqrt(squares / weight_sum) / 0.91
        if gate <= floor_px and moved < 1e-3:
            break
        gate = max(min(4.7 * scatter, 0.5 * gate), floor_px)
    covariance = inverse_matrix(information)
    for j in range(5):
        for k in range(5):
            covariance[j, k] *= scatter * scatter * scale[j] * scale[k]
    return circle, covariance, scatter, weight_sum


@njit(cache=True, nogil=True)
def inside_circles(circles: Floats, events: Events, reference_us: int, margins_px: Floats) -> Integers:
    """Rising indices (k,) int64 of events inside one of the moving circles (m, 5), or beyond by its margin (m,)."""
    t_us, x_px, y_px, _ = events
    inside = np.zeros(t_us.size, np.bool_)
    for m in range(margins_px.size):
        x0, y0, vx, vy = circles[m, 0], circles[m, 1], circles[m, 2], circles[m, 3]
        reach_px = circles[m, 4] + margins_px[m]
        for row in in_box(events, box_around(circles[m], events, reference_us, reach_px)):
            i = np.uint64(row)
            tau = np.int32(t_us[i] - reference_us) * 1e-6
            dx, dy = x_px[i] - (x0 + vx * tau), y_px[i] - (y0 + vy * tau)
            inside[i] |= dx * dx + dy * dy <= reach_px**2
    return _set_rows(inside)


@njit(cache=True, nogil=True)
def box_within(inner: Box, outer: Box) -> bool:
    """Whether a box lies within another one."""
    return inner[0] >= outer[0] and inner[1] <= outer[1] and inner[2] >= outer[2] and inner[3] <= outer[3]


@njit(cache=True, nogil=True)
def relative_events(chosen: Integers, events: Events, reference_us: float) -> tuple[Floats, Floats, Floats, Flags]:
    """Seconds after the reference time, columns and rows of the chosen events, (m,) float64 each, and polarity."""
    t_us, x_px, y_px, on = events
    tau_s, x, y = np.empty(chosen.size), np.empty(chosen.size), np.empty(chosen.size)
    is_on = np.empty(chosen.size, np.bool_)
    for n in range(chosen.size):
        i = chosen[n]
        tau_s[n] = (t_us[i] - reference_us) * 1e-6
        x[n], y[n], is_on[n] = x_px[i], y_px[i], on[i]
    return tau_s, x, y, is_on
