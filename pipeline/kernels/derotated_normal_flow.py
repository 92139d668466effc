"""Normal flow on the derotated ball, as seen by an observer who turns with it.

Given a guess of the spin, every event is turned back on the sphere to where the guess says it was at one common
time. If the guess is right, an edge of the logo then stands still, however fast it moved: its events lie on one
line, and strokes that follow each other stay apart. If it is not quite right, the line drifts, and the drift is a
linear constraint on what is missing from the guess. This is plane fitting in the ball's own frame: no velocity bound,
no length scale in time, and no bias from the sphere's curvature or the perspective. Not in the paper.
"""

from __future__ import annotations

import numba
import numpy as np

from .arrays import Flags, Floats, Integers
from .rotation import axis_and_length, rotate

FEWEST = 8  # events for the line's two parameters, its drift, and enough left to judge it by
NEIGHBOURS = 48  # at most, half of them before and half after
ROUNDS = 3  # of a line's fit: one with equal weights, two with bisquare weights
NO_LINE = 2.0


@numba.njit(cache=True, nogil=True)
def derotated_normals(normals: Floats, t_us: Integers, common_us: int, spin_rad_s: Floats) -> Floats:
    """Normals (n, 3) turned from their own times (n,) to common_us, if the ball turns with this spin."""
    derotated = np.empty((t_us.size, 3))
    ax, ay, az, speed = axis_and_length(spin_rad_s)
    for i in range(t_us.size):
        angle = -speed * (t_us[i] - common_us) * 1e-6
        cosine = np.cos(angle)
        normal = (normals[i, 0], normals[i, 1], normals[i, 2])
        turned = rotate(normal, (ax, ay, az), np.sin(angle), cosine, 1.0 - cosine)
        derotated[i, 0], derotated[i, 1], derotated[i, 2] = turned
    return derotated


@numba.njit(cache=True, nogil=True, error_model="numpy")
def fit_moving_line(u: Floats, v: Floats, t_s: Floats, width_rad: float) -> tuple[float, float, float, float, float]:
    """Fit a line (nu, nv) . (u, v) = c + drift t to points, robustly.

    Total least squares in (u, v), rad in the tangent plane: the normal is the direction in which the points (n,) spread
    least once their linear dependence on t is taken out. Once with equal weights, then ROUNDS - 1 times with bisquare
    weights of width_rad.

    Returns
    -------
    nu, nv : float
        Unit normal of the line.
    drift, variance : float
        Velocity along the normal, rad/s, and its variance.
    sharpness : float
        Squared spread across the line over that along it; NO_LINE where there is no line.
    """
    nu, nv, c, drift, variance, sharpness = 0.0, 0.0, 0.0, 0.0, 0.0, NO_LINE
    weights = np.ones(t_s.size)
    for round_ in range(ROUNDS):
        if round_ > 0:  # in a loop of its own without a branch: several at once
            for i in range(t_s.size):
                off = (nu * u[i] + nv * v[i] - drift * t_s[i] - c) / width_rad
                within = max(1.0 - off * off, 0.0)
                weights[i] = within * within
        w, wu, wv, wt, uu, uv, vv, ut, vt, tt = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(t_s.size):
            weight = weights[i]
            a, b, d = weight * u[i], weight * v[i], weight * t_s[i]
            w, wu, wv, wt = w + weight, wu + a, wv + b, wt + d
            uu, uv, vv = uu + a * u[i], uv + a * v[i], vv + b * v[i]
            ut, vt, tt = ut + a * t_s[i], vt + b * t_s[i], tt + d * t_s[i]
        if w < 0.5 * FEWEST:
            return nu, nv, 0.0, 0.0, NO_LINE
        mu, mv, mt = wu / w, wv / w, wt / w
        ut, vt, tt = ut - w * mu * mt, vt - w * mv * mt, tt - w * mt * mt
        if tt <= 0.0:
            return nu, nv, 0.0, 0.0, NO_LINE
        uu, uv, vv = uu - w * mu * mu - ut * ut / tt, uv - w * mu * mv - ut * vt / tt, vv - w * mv * mv - vt * vt / tt
        half, split = 0.5 * (uu + vv), np.sqrt(0.25 * (uu - vv) ** 2 + uv * uv)
        if half + split <= 0.0:
            return nu, nv, 0.0, 0.0, NO_LINE
        angle = 0.5 * np.arctan2(2.0 * uv, uu - vv) + 0.5 * np.pi
        nu, nv = np.cos(angle), np.sin(angle)
        drift = (nu * ut + nv * vt) / tt
        c = nu * mu + nv * mv - drift * mt
        across = max(half - split, 0.0)
        variance, sharpness = across / w / tt, across / (half + split)
    return nu, nv, drift, variance, sharpness


@numba.njit(cache=True, nogil=True)
def _gather(
    near: Floats, turned: Floats, t_us: Integers, k: int, frame: Floats, reach_rad: float, reach_us: float
) -> int:
    """Write (u, v, t in s) of event k and its neighbours into `near` (3, NEIGHBOURS); return how many there are.

    `turned` (3, n) are the events' normals. The rows of `frame` (3, 3) are that of event k and two directions that span
    the tangent plane. Half the neighbours at most come from before k and the rest from after, nearest in time first.
    """
    size = 0
    xs, ys, zs = turned[0], turned[1], turned[2]
    us, vs, ts = near[0], near[1], near[2]
    ex, ey, ez = frame[0, 0], frame[0, 1], frame[0, 2]
    ux, uy, uz = frame[1, 0], frame[1, 1], frame[1, 2]
    vx, vy, vz = frame[2, 0], frame[2, 1], frame[2, 2]
    for after in range(2):
        room = us.size if after else us.size // 2
        for step in range(t_us.size - k - 1 if after else k + 1):
            j = np.uint64(k + 1 + step) if after else np.uint64(k - step)
            dt_us = t_us[j] - t_us[k]
            if abs(dt_us) > reach_us or size >= room:
                break
            dx, dy, dz = xs[j] - ex, ys[j] - ey, zs[j] - ez
            # Written in any case, kept where it is near: whether it is cannot be foreseen, a branch would cost more.
            at = np.uint64(size)
            us[at] = ux * dx + uy * dy + uz * dz
            vs[at] = vx * dx + vy * dy + vz * dz
            ts[at] = dt_us * 1e-6
            size += dx * dx + dy * dy + dz * dz <= reach_rad * reach_rad
    return size


@numba.njit(cache=True, nogil=True)
def derotated_constraints(
    t_us: Integers,
    normals: Floats,
    on: Flags,
    spin_rad_s: Floats,
    stride: int,
    reach_rad: float,
    reach_us: float,
    width_rad: float,
    sharpest: float,
) -> tuple[Integers, Floats, Floats, Floats, Integers]:
    """Constraints rows . spin = speeds from every stride-th event whose neighbours make a line.

    Parameters
    ----------
    t_us, normals, on : (n,) int64, (n, 3) float64, (n,) bool
        Rising times of the events, unit normals where they are on the ball, and polarity.
    spin_rad_s : (3,) float64
        Guess of the spin.
    reach_rad, reach_us, width_rad : float
        Distance of neighbours on the unit sphere and in time, and width of the fit's weights.
    sharpest : float
        Lines less sharp than this are left out.

    Returns
    -------
    events : (m,) int64
        Indices of the events that have a constraint, first those OFF, then those ON.
    rows : (m, 3) float64
        Constraint rows e x n, n the line's normal in the tangent plane.
    speeds, variances : (m,) float64
        Velocity along the line's normal, rad/s, and its variance.
    sizes : (m,) int64
        Number of events behind each.
    """
    n = t_us.size
    common_us = t_us[n // 2] if n else 0
    turned = derotated_normals(normals, t_us, common_us, spin_rad_s)
    events, lines = np.empty(n, np.int64), np.empty((n, 3))
    speeds, variances, sizes = np.empty(n), np.empty(n), np.empty(n, np.int64)
    near, frame = np.empty((3, NEIGHBOURS)), np.empty((3, 3))
    count = 0
    members, own, own_us = np.empty(n, np.int64), np.empty((3, n)), np.empty(n, np.int64)
    for polarity in range(2):
        m = 0
        for i in range(n):
            if on[i] == (polarity == 1):
                members[m], own_us[m] = i, t_us[i]
                own[0, m], own[1, m], own[2, m] = turned[i, 0], turned[i, 1], turned[i, 2]
                m += 1
        for k in range(stride // 2, m, stride):
            ex, ey, ez = own[0, k], own[1, k], own[2, k]
            # Two directions that span the tangent plane (Duff et al., JCGT 2017).
            sign = 1.0 if ez >= 0.0 else -1.0
            p = -1.0 / (sign + ez)
            q = ex * ey * p
            frame[0, 0], frame[0, 1], frame[0, 2] = ex, ey, ez
            frame[1, 0], frame[1, 1], frame[1, 2] = 1.0 + sign * ex * ex * p, sign * q, -sign * ex
            frame[2, 0], frame[2, 1], frame[2, 2] = q, sign + ey * ey * p, -ey
            size = _gather(near, own, own_us[:m], k, frame, reach_rad, reach_us)
            if size < FEWEST:
                continue
            nu, nv, drift, variance, sharpness = fit_moving_line(
                near[0, :size], near[1, :size], near[2, :size], width_rad
            )
            if sharpness > sharpest:
                continue
            # n . (missing x e) = drift with n in the tangent plane: missing . (e x n) = drift
            nx = nu * frame[1, 0] + nv * frame[2, 0]
            ny = nu * frame[1, 1] + nv * frame[2, 1]
            nz = nu * frame[1, 2] + nv * frame[2, 2]
            lines[count, 0], lines[count, 1], lines[count, 2] = ey * nz - ez * ny, ez * nx - ex * nz, ex * ny - ey * nx
            events[count], speeds[count], variances[count], sizes[count] = members[k], drift, variance, size
            count += 1
    mirrored_us = np.empty(count, np.int64)
    for k in range(count):
        mirrored_us[k] = 2 * common_us - t_us[events[k]]
    rows = derotated_normals(lines[:count], mirrored_us, common_us, spin_rad_s)
    wx, wy, wz = spin_rad_s[0], spin_rad_s[1], spin_rad_s[2]
    for k in range(count):
        speeds[k] = speeds[k] + rows[k, 0] * wx + rows[k, 1] * wy + rows[k, 2] * wz
    return events[:count].copy(), rows, speeds[:count].copy(), variances[:count].copy(), sizes[:count].copy()


@numba.njit(cache=True, nogil=True)
def position_response(normals: Floats, sights: Floats, rows: Floats, spin_rad_s: Floats, radius_px: float) -> Floats:
    """Change of speeds - rows . spin (rad/s) per px of error in the ball's x, y and radius: (n, 3) float64.

    Parameters
    ----------
    normals, sights, rows : (n, 3) float64
        Unit normals e, unit vectors s to the camera, and constraint rows e x n as from `derotated_constraints`.
    radius_px : float
        Radius r of the ball.

    Notes
    -----
    An error of the centre by d (px, across the line of sight) moves e by

        -d/r + s (e . d) / (r e . s)

    which keeps it on the sphere; one of the radius by dr scales e's part across the line of sight by 1 - dr/r. Both
    move the constraint's place on the sphere and bend the path on which its events were seen.
    """
    n = normals.shape[0]
    response = np.empty((n, 3))
    wx, wy, wz = spin_rad_s[0], spin_rad_s[1], spin_rad_s[2]
    d, off, bent = np.empty(3), np.empty(3), np.empty(3)
    for i in range(n):
        e, s, a = normals[i], sights[i], rows[i]
        line = (a[1] * e[2] - a[2] * e[1], a[2] * e[0] - a[0] * e[2], a[0] * e[1] - a[1] * e[0])
        turn = (wy * e[2] - wz * e[1], wz * e[0] - wx * e[2], wx * e[1] - wy * e[0])
        facing = e[0] * s[0] + e[1] * s[1] + e[2] * s[2]
        facing_rate = turn[0] * s[0] + turn[1] * s[1] + turn[2] * s[2]
        for which in range(3):
            if which < 2:
                for axis in range(3):
                    d[axis] = (1.0 if axis == which else 0.0) - s[which] * s[axis]
                lean = e[0] * d[0] + e[1] * d[1] + e[2] * d[2]
                lean_rate = turn[0] * d[0] + turn[1] * d[1] + turn[2] * d[2]
                for axis in range(3):
                    off[axis] = -d[axis] + s[axis] * lean / facing
                    bent[axis] = s[axis] * (lean_rate / facing - lean * facing_rate / (facing * facing))
            else:
                for axis in range(3):
                    off[axis] = -e[axis] + s[axis] / facing
                    bent[axis] = -turn[axis] - s[axis] * facing_rate / (facing * facing)
            change = line[0] * (bent[0] - (wy * off[2] - wz * off[1]))
            change += line[1] * (bent[1] - (wz * off[0] - wx * off[2]))
            change += line[2] * (bent[2] - (wx * off[1] - wy * off[0]))
            response[i, which] = change / radius_px
    return response


@numba.njit(cache=True, nogil=True)
def correlated_covariance(
    gain: Floats, residuals: Floats, radians: Floats, place: Floats, bias: Floats, place_std_px: Floats
) -> Floats:
    """Covariance (3, 3) of a spin by what many of its constraints have in common.

    Parameters
    ----------
    gain : (n, 3) float64
        Change of the spin per change of each constraint's speed.
    residuals, radians : (n,) float64
        Each constraint's residual, and how far the ball had turned at its time: those of one radian are off together.
    place : (n, 3) float64
        See `position_response`.
    bias : (n, 3) float64
        Change of each constraint's speed by three independent errors of one sigma.
    place_std_px : (3,) float64
        1 sigma of the ball's x, y and radius.
    """
    first = np.floor(np.min(radians))
    pulls = np.zeros((int(np.max(radians) - first) + 1, 3))
    seen = np.zeros(pulls.shape[0], np.bool_)
    moved, bent = np.zeros((3, 3)), np.zeros((3, 3))
    for i in range(radians.size):
        block = int(radians[i] - first)
        seen[block] = True
        for p in range(3):
            pulls[block, p] += gain[i, p] * residuals[i]
            for q in range(3):
                moved[p, q] += gain[i, p] * place[i, q] * place_std_px[q]
                bent[p, q] += gain[i, p] * bias[i, q]
    blocks = 0
    for block in range(seen.size):
        blocks += seen[block]
    more = blocks / max(blocks - 1, 1)
    covariance = np.zeros((3, 3))
    for p in range(3):
        for q in range(3):
            for block in range(seen.size):
                covariance[p, q] += more * pulls[block, p] * pulls[block, q]
            for k in range(3):
                covariance[p, q] += moved[p, k] * moved[q, k] + bent[p, k] * bent[q, k]
    return covariance
