"""Normal flow by plane fitting: t = a x + b y + c through each event's neighbours in space and time, robustly.

The gradient (a, b) of the time at which an edge arrives points across the edge, and its length is one over the speed
of the edge (Benosman et al., "Event-Based Visual Flow", IEEE TNNLS 2014).
"""

from __future__ import annotations

import numba
import numpy as np

from .arrays import Floats, Integers, PlacedEvents

NEIGHBOURS = 64  # at most; a logo's edge leaves 10 to 40 events of one polarity in three pixels around an event
FEWEST = 6  # points for the three unknowns of a plane: as many again to judge it by
SPREAD_PX = 0.6  # two pixels wide: (1, 1) would be 0.5


@numba.njit(cache=True, nogil=True)
def near_in_time(rows: Integers, k: int, events: PlacedEvents, reach_px: float, reach_us: float) -> int:
    """Write the indices of event k's neighbours (k included) into `rows` (m,), and return their number.

    A neighbour has k's polarity and lies within reach_px and reach_us. Of those before and of those after k there are
    at most m / 2 each, nearest in time first.
    """
    t_us, x_px, y_px, on = events
    reach2 = reach_px * reach_px
    rows[0] = k
    count, last = 1, rows.size // 2
    for step in (-1, 1):
        j = k + step
        while 0 <= j < t_us.size and abs(t_us[j] - t_us[k]) <= reach_us and count < last:
            dx, dy = x_px[j] - x_px[k], y_px[j] - y_px[k]
            if on[j] == on[k] and dx * dx + dy * dy <= reach2:
                rows[count] = j
                count += 1
            j += step
        last = count + rows.size // 2
    return count


@numba.njit(cache=True, nogil=True)
def fit_plane(
    x_px: Floats, y_px: Floats, t_us: Floats, scales_us: Floats, fewest: int, spread_px: float
) -> tuple[float, float, float, float]:
    """Fit a plane t = a x + b y + c, robustly.

    Weighted least squares of the points (n,), once with equal weights and then once a scale in scales_us (k,) with
    bisquare weights (1 - (residual / scale)^2)^2, zero beyond the scale. There is none where fewer than `fewest`
    points have weight, or these spread by less than spread_px (1 sigma) in any direction of the image.

    Returns
    -------
    a, b : float
        Gradient, us/px.
    rms_us : float
        Residuals.
    weight : float
        Sum of the weights; 0 where there is no plane.
    """
    a, b, c, rms, total = 0.0, 0.0, 0.0, 0.0, 0.0
    for stage in range(scales_us.size + 1):
        total, sx, sy, st, carrying = 0.0, 0.0, 0.0, 0.0, 0
        sxx, sxy, syy, sxt, syt, stt = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(t_us.size):
            weight = 1.0
            if stage > 0:
                off = (t_us[i] - a * x_px[i] - b * y_px[i] - c) / scales_us[stage - 1]
                if abs(off) >= 1.0:
                    continue
                weight = (1.0 - off * off) ** 2
            carrying += 1
            total += weight
            sx, sy, st = sx + weight * x_px[i], sy + weight * y_px[i], st + weight * t_us[i]
            sxx += weight * x_px[i] * x_px[i]
            sxy += weight * x_px[i] * y_px[i]
            syy += weight * y_px[i] * y_px[i]
            sxt += weight * x_px[i] * t_us[i]
            syt += weight * y_px[i] * t_us[i]
            stt += weight * t_us[i] * t_us[i]
        if carrying < fewest:
            return 0.0, 0.0, 0.0, 0.0
        mx, my, mt = sx / total, sy / total, st / total
        cxx, cxy, cyy = sxx / total - mx * mx, sxy / total - mx * my, syy / total - my * my
        cxt, cyt, ctt = sxt / total - mx * mt, syt / total - my * mt, stt / total - mt * mt
        half_trace = 0.5 * (cxx + cyy)
        narrow = half_trace - np.sqrt(max(half_trace * half_trace - (cxx * cyy - cxy * cxy), 0.0))
        if narrow < spread_px * spread_px:
            return 0.0, 0.0, 0.0, 0.0
        determinant = cxx * cyy - cxy * cxy
        a = (cyy * cxt - cxy * cyt) / determinant
        b = (cxx * cyt - cxy * cxt) / determinant
        c = mt - a * mx - b * my
        rms = np.sqrt(max(ctt - a * cxt - b * cyt, 0.0))
    return a, b, rms, total


@numba.njit(cache=True, nogil=True)
def plane_flow(
    events: PlacedEvents,
    first: int,
    last: int,
    stride: int,
    reach_px: float,
    reach_us: float,
    scales_us: Floats,
    speed_max_px_s: float,
) -> tuple[Integers, Floats, Floats]:
    """Normal flow of every stride-th event of first..last-1; the neighbours come from all events.

    A plane needs FEWEST points spread by SPREAD_PX; its residuals may not exceed a third of the last scale (twice that
    and a second edge is in the fit), and its speed lies in 0..speed_max_px_s.

    Parameters
    ----------
    reach_px, reach_us : float
        Neighbourhood, see `near_in_time`.
    scales_us : (k,) float64
        See `fit_plane`.

    Returns
    -------
    rows : (m,) int64
        Indices of the events that have flow.
    directions : (m, 2) float64
        Unit vectors across the edge.
    speeds : (m,) float64
        px/s.
    """
    t_us, x_px, y_px, _ = events
    rows, found = np.empty(NEIGHBOURS, np.int64), np.empty(max(last - first, 0), np.int64)
    directions, speeds = np.empty((found.size, 2)), np.empty(found.size)
    x, y, t = np.empty(NEIGHBOURS), np.empty(NEIGHBOURS), np.empty(NEIGHBOURS)
    count = 0
    for k in range(first + stride // 2, last, stride):
        size = near_in_time(rows, k, events, reach_px, reach_us)
        if size < FEWEST:
            continue
        for i in range(size):
            j = rows[i]
            x[i], y[i], t[i] = x_px[j] - x_px[k], y_px[j] - y_px[k], t_us[j] - t_us[k]
        a, b, rms_us, weight = fit_plane(x[:size], y[:size], t[:size], scales_us, FEWEST, SPREAD_PX)
        slope = np.sqrt(a * a + b * b)
        if weight == 0.0 or rms_us > scales_us[-1] / 3.0 or slope * speed_max_px_s < 1e6:
            continue
        found[count], speeds[count] = k, 1e6 / slope
        directions[count, 0], directions[count, 1] = a / slope, b / slope
        count += 1
    return found[:count].copy(), directions[:count].copy(), speeds[:count].copy()
