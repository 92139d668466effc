"""The outline of a moving ball in the events: a circle that moves at constant velocity, fitted to sub-pixel.

A `ring` is (5,) float64 [x_px, y_px, vx_px_s, vy_px_s, radius_px] at a reference time. `oval` (2,) float64 is
the outline's known departure from a circle: at the angle phi (image frame) it lies
radius * (1 + oval[0] cos 2phi + oval[1] sin 2phi) from the centre; a sphere seen off the optical axis is such an
ellipse. Event times are tau_s, seconds after the reference time (mostly negative).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# Events used for a fit: beyond this the pixels' common errors outweigh the statistical, 0.1 px / sqrt(n).
MOST_EVENTS = 200
# Events looked at around a fitted outline, for what supports it.
MOST_AROUND = 400
# Fewer are no outline.
LEAST_EVENTS, LEAST_WEIGHT = 12, 8.0
# A ring's scatter above this is no outline but a band of events.
MOST_SCATTER_PX = 0.5
# An event this near the fitted outline supports it: the scatter on clean outlines is 0.1-0.15 px, on a dim or
# textured scene three times as much.
ON_OUTLINE_PX = 1.2
# Behind, the ball's shading fires up to a fifth of the radius before the edge comes.
EARLY_SHARE = 0.2
SECTORS = 32
# Events that vote for the velocity: a ring of them stands out among some 200 velocities.
MOST_VOTERS = 120


@njit(cache=True, nogil=True)
def near_outline(
    ring: Floats,
    t_us: NDArray[np.int64],
    x_px: NDArray[np.uint16],
    y_px: NDArray[np.uint16],
    reference_us: float,
    gate_px: float,
    most_events: int,
    ahead_only: bool,
) -> NDArray[np.int64]:
    """(m,) int64 indices of events within gate_px of the moving outline, thinned evenly to most_events.

    With ahead_only, only those on the half of the outline that moves outwards.
    """
    near = np.empty(t_us.size, np.int64)
    m = 0
    inner = max(ring[4] - gate_px, 0.0) ** 2
    outer = (ring[4] + gate_px) ** 2
    for i in range(t_us.size):
        tau = (t_us[i] - reference_us) * 1e-6
        dx = x_px[i] - (ring[0] + ring[2] * tau)
        dy = y_px[i] - (ring[1] + ring[3] * tau)
        square = dx * dx + dy * dy
        near[m] = i  # stays only if counted: no branch to mispredict
        m += (inner <= square) & (square <= outer) & ((not ahead_only) | (dx * ring[2] + dy * ring[3] >= 0.0))
    stride = max(1, -(-m // max(most_events, 1))) | 1  # odd: symmetric motion brings events in pairs
    return near[:m:stride].copy()


@njit(cache=True, nogil=True)
def residuals(ring: Floats, oval: Floats, tau_s: Floats, x_px: Floats, y_px: Floats) -> Floats:
    """(n,) float64 distance (px, > 0 outside) of events from the outline."""
    out = np.empty(tau_s.size, np.float64)
    for i in range(tau_s.size):
        dx = x_px[i] - (ring[0] + ring[2] * tau_s[i])
        dy = y_px[i] - (ring[1] + ring[3] * tau_s[i])
        square = dx * dx + dy * dy + 1e-18
        bulge = (oval[0] * (dx * dx - dy * dy) + oval[1] * 2.0 * dx * dy) / square
        out[i] = math.sqrt(square) - ring[4] * (1.0 + bulge)
    return out


@njit(cache=True, nogil=True)
def inverse_of(matrix: Floats) -> Floats:
    """Inverse of a positive definite matrix (n, n), by elimination.

    LAPACK's through NumPy is no faster on 5 x 5 and takes five times as long to compile with the fit.
    """
    n = matrix.shape[0]
    left = matrix.copy()
    inverse = np.eye(n)
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
def _normal_equations(
    information: Floats,
    gradient: Floats,
    ring: Floats,
    oval: Floats,
    tau_s: Floats,
    x_px: Floats,
    y_px: Floats,
    gate_px: float,
) -> tuple[float, float]:
    """Write J^T W J (5, 5) and J^T W e (5,) of the outline's distances (velocity in px/ms); sums of w and w e^2.

    Each sum in a variable of its own, not in the arrays: twice as fast.
    """
    x0, y0, vx, vy, radius = ring[0], ring[1], ring[2], ring[3], ring[4]
    weights, squares = 1e-9, 0.0
    ga, gb, gat, gbt, gc = 0.0, 0.0, 0.0, 0.0, 0.0
    aa, ab, bb, ac, bc, cc = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    aat, abt, bbt, act, bct = 0.0, 0.0, 0.0, 0.0, 0.0
    aatt, abtt, bbtt = 0.0, 0.0, 0.0
    for i in range(tau_s.size):
        dx = x_px[i] - (x0 + vx * tau_s[i])
        dy = y_px[i] - (y0 + vy * tau_s[i])
        distance = math.sqrt(dx * dx + dy * dy) + 1e-9
        a, b = dx / distance, dy / distance
        c = 1.0 + oval[0] * (a * a - b * b) + oval[1] * 2.0 * a * b
        error = distance - radius * c
        share = error / gate_px
        if share * share >= 1.0:
            continue
        weight = (1.0 - share * share) ** 2
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
def fit_ring(
    start: Floats,
    prior_std: Floats,
    oval: Floats,
    tau_s: Floats,
    x_px: Floats,
    y_px: Floats,
    gate_px: float,
    floor_px: float,
    most_rounds: int,
) -> tuple[Floats, Floats, float, float]:
    """Robust fit of a moving circle to events: Gauss-Newton steps with Tukey's biweight.

    start : (5,) ring to begin with
    prior_std : (5,) 1 sigma by which the answer may leave it (large = freely, 0 = not at all: zeros for the
        velocity give the fit of a circle at rest)
    gate_px : Tukey's cut-off in the first round; it then shrinks to 4.7 robust sigma, by half a round at
        least (so that the sharp outline wins over a band of late events inside it), down to floor_px
    Returns the ring, its covariance (5, 5) from the scatter of the residuals alone, that scatter (1 sigma,
    px) and the sum of the weights (about the number of events used).
    """
    ring = start.copy()
    information, gradient = np.zeros((5, 5)), np.zeros(5)
    gate, scatter, weight_sum = gate_px, gate_px, 0.0
    # The velocity is fitted in px/ms, so that all unknowns are of the same size.
    scale = np.array([1.0, 1.0, 1e3, 1e3, 1.0])
    for _ in range(most_rounds):
        weight_sum, squares = _normal_equations(information, gradient, ring, oval, tau_s, x_px, y_px, gate)
        for k in range(5):
            firm = (scale[k] / max(prior_std[k], 1e-9)) ** 2 + 1e-9
            information[k, k] += firm
            gradient[k] += firm * (start[k] - ring[k]) / scale[k]
        inverse = inverse_of(information)
        moved = 0.0
        for j in range(5):
            step = 0.0
            for k in range(5):
                step += inverse[j, k] * gradient[k]
            ring[j] += step * scale[j]
            moved = max(moved, abs(step))
        # Tukey's weights at 4.7 sigma leave 0.83 of the variance of Gaussian residuals: 0.91 of sigma.
        scatter = math.sqrt(squares / weight_sum) / 0.91
        if gate <= floor_px and moved < 1e-3:
            break
        gate = max(min(4.7 * scatter, 0.5 * gate), floor_px)
    covariance = inverse_of(information)
    for j in range(5):
        for k in range(5):
            covariance[j, k] *= scatter * scatter * scale[j] * scale[k]
    return ring, covariance, scatter, weight_sum


# Sums in any order: the compiler then takes several events at once, 3 x as fast; the last bits may differ.
@njit(cache=True, nogil=True, fastmath={"reassoc", "nsz"})
def _support_of_velocity(
    ring: Floats,
    vx_px_s: float,
    vy_px_s: float,
    tau_s: Floats,
    x_px: Floats,
    y_px: Floats,
    sign: Floats,
    gate_px: float,
) -> float:
    """One cell of `vote_velocity`; sign (n,): +1 for ON, -1 for OFF events."""
    x0, y0, radius = ring[0], ring[1], ring[4]
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
    ring: Floats,
    tau_s: Floats,
    x_px: Floats,
    y_px: Floats,
    on: NDArray[np.bool_],
    step_px_s: float,
    gate_px: float,
) -> None:
    """Hough vote for the velocity of a ring (5,) float64 around the one it has; adds into votes.

    votes : (2 m + 1, 2 m + 1) float64; votes[m + j, m + i] is for the ring's velocity plus
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
            vx = ring[2] + i * step_px_s
            vy = ring[3] + j * step_px_s
            votes[m + j, m + i] += _support_of_velocity(ring, vx, vy, tau_s, x_px, y_px, sign, gate_px)


@njit(cache=True, nogil=True)
def support(
    ring: Floats,
    oval: Floats,
    tau_s: Floats,
    x_px: Floats,
    y_px: Floats,
    on: NDArray[np.bool_],
    width_px: int,
    height_px: int,
    tolerance_px: float,
    early_px: float,
    bins: int,
) -> Floats:
    """How well events support a moving outline: (8,) float64

    [events on the outline, share of ON among those ahead of the centre, the same behind it,
     share of the visible outline ahead that has events, the same behind it, share of the whole outline that is
     visible, events just outside (one to four tolerances beyond), events inside].
    On the outline = within tolerance_px of it, and behind the centre up to early_px inside.
    The outline is cut into `bins` sectors, which count from two events on, from one where there are fewer than
    three a sector; sectors that the motion passes at a grazing angle (|cos| < 0.25)
    yield few events and do not count. Shares of nothing are 0.
    """
    counts = np.zeros(bins, np.int64)
    ahead_on, ahead, behind_on, behind, outside, inside = 0, 0, 0, 0, 0, 0
    error = residuals(ring, oval, tau_s, x_px, y_px)
    for i in range(tau_s.size):
        if error[i] > tolerance_px:
            outside += error[i] < 4.0 * tolerance_px
            continue
        dx = x_px[i] - (ring[0] + ring[2] * tau_s[i])
        dy = y_px[i] - (ring[1] + ring[3] * tau_s[i])
        is_ahead = dx * ring[2] + dy * ring[3] > 0.0
        if error[i] < -(tolerance_px if is_ahead else max(tolerance_px, early_px)):
            inside += 1
            continue
        if is_ahead:
            ahead += 1
            ahead_on += on[i]
        else:
            behind += 1
            behind_on += on[i]
        counts[int((math.atan2(dy, dx) / (2.0 * math.pi) + 1.0) * bins) % bins] += 1
    speed = math.hypot(ring[2], ring[3]) + 1e-9
    least = 2 if ahead + behind >= 3 * bins else 1
    seen = np.zeros(2)
    visible = np.zeros(2)
    in_view = 0
    for b in range(bins):
        angle = 2.0 * math.pi * (b + 0.5) / bins
        nx = math.cos(angle)
        ny = math.sin(angle)
        x = ring[0] + ring[4] * nx
        y = ring[1] + ring[4] * ny
        if x < 0.0 or y < 0.0 or x > width_px - 1 or y > height_px - 1:
            continue
        in_view += 1
        across = (nx * ring[2] + ny * ring[3]) / speed
        if abs(across) < 0.25:
            continue
        side = 0 if across > 0.0 else 1
        visible[side] += 1.0
        seen[side] += counts[b] >= least
    return np.array(
        [
            float(ahead + behind),
            ahead_on / max(ahead, 1),
            behind_on / max(behind, 1),
            seen[0] / max(visible[0], 1.0),
            seen[1] / max(visible[1], 1.0),
            in_view / bins,
            float(outside),
            float(inside),
        ]
    )


@njit(cache=True, nogil=True)
def clear_of(
    ring: Floats,
    t_us: NDArray[np.int64],
    x_px: NDArray[np.uint16],
    y_px: NDArray[np.uint16],
    reference_us: float,
    margin_px: float,
) -> NDArray[np.int64]:
    """(m,) int64 indices of events more than margin_px outside the moving ring."""
    chosen = np.empty(t_us.size, np.int64)
    m = 0
    limit = (ring[4] + margin_px) ** 2
    for i in range(t_us.size):
        tau = (t_us[i] - reference_us) * 1e-6
        dx = x_px[i] - (ring[0] + ring[2] * tau)
        dy = y_px[i] - (ring[1] + ring[3] * tau)
        chosen[m] = i
        m += dx * dx + dy * dy > limit
    return chosen[:m].copy()


@njit(cache=True, nogil=True)
def measured(
    expected: Floats,
    prior_std: Floats,
    oval: Floats,
    t_us: NDArray[np.int64],
    x_px: NDArray[np.uint16],
    y_px: NDArray[np.uint16],
    on: NDArray[np.bool_],
    reference_us: float,
    gate_px: float,
    width_px: int,
    height_px: int,
) -> tuple[Floats, Floats, float, Floats]:
    """Fit the half of the outline ahead near an expected ring, and what supports the fit.

    Events within gate_px of the expected outline take part; prior_std as for `fit_ring`.
    Returns the ring (5,), its covariance (5, 5), the scatter in px and what `support` says (8,); the ring is NaN
    with too few events, or where these are a band rather than an outline.
    """
    chosen = near_outline(expected, t_us, x_px, y_px, reference_us, gate_px, MOST_EVENTS, True)
    nothing = np.full(5, np.nan), np.zeros((5, 5)), 0.0, np.zeros(8)
    if chosen.size < LEAST_EVENTS:
        return nothing
    tau_s, x, y = _relative(chosen, t_us, x_px, y_px, reference_us)
    ring, covariance, scatter, weight = fit_ring(expected, prior_std, oval, tau_s, x, y, gate_px, 0.6, 9)
    if not (np.all(np.isfinite(ring)) and ring[4] > 1.0 and weight >= LEAST_WEIGHT and scatter <= MOST_SCATTER_PX):
        return nothing
    early_px = EARLY_SHARE * ring[4]
    around_px = max(4.0 * ON_OUTLINE_PX, early_px)
    around = near_outline(ring, t_us, x_px, y_px, reference_us, around_px, MOST_AROUND, False)
    tau_s, x, y = _relative(around, t_us, x_px, y_px, reference_us)
    found = support(ring, oval, tau_s, x, y, on[around], width_px, height_px, ON_OUTLINE_PX, early_px, SECTORS)
    return ring, covariance, scatter, found


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
def moving(
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
    """The ring (5,) at this place and of this radius that moves as most events say, and the width of the last vote.

    span_s : how far back the events go
    Two rounds: all velocities up to fastest_px_s with an outline as wide as the steps, then between them. The second
    width is what a Hough circle may be off, about 2 px on balls of 20 px. The ring is NaN with too few events.
    """
    ring = np.array([x_px, y_px, 0.0, 0.0, radius_px])
    chosen = in_square(xs_px, ys_px, x_px, y_px, 1.3 * radius_px + fastest_px_s * span_s)
    stride = max(1, chosen.size // MOST_VOTERS) | 1
    chosen = chosen[::stride].copy()
    gate, span = 0.3 * radius_px, fastest_px_s
    if chosen.size < LEAST_EVENTS:
        ring[:] = np.nan
        return ring, gate
    tau_s, x, y = _relative(chosen, t_us, xs_px, ys_px, reference_us)
    for turn in range(2):
        if turn == 1:
            gate, span = max(2.0, 0.15 * radius_px), 0.3 * radius_px / span_s
        step = gate / span_s
        m = math.ceil(span / step)
        votes = np.zeros((2 * m + 1, 2 * m + 1))
        vote_velocity(votes, ring, tau_s, x, y, on[chosen], step, gate)
        best, row, column = 0.0, 0, 0
        for j in range(2 * m + 1):
            for i in range(2 * m + 1):
                if abs(votes[j, i]) > best:
                    best, row, column = abs(votes[j, i]), j, i
        if best > 0.0:
            ring[2] += (column - m) * step
            ring[3] += (row - m) * step
    return ring, gate
