"""Normal flow as seen by an observer who turns with the ball.

Given a guess of the spin, every event is turned back on the sphere to where the guess says it was at one common
time. If the guess is right, an edge of the logo then stands still, however fast it moved: its events lie on one
line, and strokes that follow each other stay apart. If it is not quite right, the line drifts, and the drift is a
linear constraint on what is missing from the guess. This is plane fitting in the ball's own frame: no velocity bound,
no length scale in time, and no bias from the sphere's curvature or the perspective.
"""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

FEWEST = 8  # events for the line's two parameters, its drift, and enough left to judge it by
NEIGHBOURS = 64  # at most, half of them before and half after


@numba.njit(cache=True, nogil=True)
def turned_back(normals: Floats, t_us: NDArray[np.int64], common_us: int, spin_rad_s: Floats) -> Floats:
    """(n, 3) normals where they were at common_us, if the ball turns with this spin (3,)."""
    n = t_us.size
    turned = np.empty((n, 3))
    speed = np.sqrt(spin_rad_s[0] ** 2 + spin_rad_s[1] ** 2 + spin_rad_s[2] ** 2)
    ax, ay, az = 0.0, 0.0, 1.0
    if speed > 0.0:
        ax, ay, az = spin_rad_s[0] / speed, spin_rad_s[1] / speed, spin_rad_s[2] / speed
    for i in range(n):
        angle = -speed * (t_us[i] - common_us) * 1e-6
        cosine, sine = np.cos(angle), np.sin(angle)
        x, y, z = normals[i, 0], normals[i, 1], normals[i, 2]
        along = (ax * x + ay * y + az * z) * (1.0 - cosine)
        turned[i, 0] = x * cosine + (ay * z - az * y) * sine + ax * along
        turned[i, 1] = y * cosine + (az * x - ax * z) * sine + ay * along
        turned[i, 2] = z * cosine + (ax * y - ay * x) * sine + az * along
    return turned


@numba.njit(cache=True, nogil=True)
def drifting_line(
    u: Floats, v: Floats, t_s: Floats, width: float
) -> tuple[float, float, float, float, float, float]:
    """Line (nu, nv) . (u, v) = c + drift t through points, robustly: nu, nv, drift, 1/sum of t^2, rms, sharpness.

    Total least squares in (u, v): the normal is the direction in which the points spread least once their linear
    dependence on t is taken out. Three rounds with bisquare weights of this width. Sharpness is the spread across the
    line over the spread along it, squared; 2.0 where there is no line.
    """
    n = t_s.size
    weights = np.ones(n)
    nu, nv, drift, certainty, rms, sharpness = 1.0, 0.0, 0.0, 0.0, 0.0, 2.0
    for round_ in range(4):
        total, mu, mv, mt = 0.0, 0.0, 0.0, 0.0
        for i in range(n):
            total += weights[i]
            mu, mv, mt = mu + weights[i] * u[i], mv + weights[i] * v[i], mt + weights[i] * t_s[i]
        if total < 0.5 * FEWEST:
            return nu, nv, 0.0, 0.0, 0.0, 2.0
        mu, mv, mt = mu / total, mv / total, mt / total
        uu, uv, vv, ut, vt, tt = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(n):
            du, dv, dt = u[i] - mu, v[i] - mv, t_s[i] - mt
            uu, uv, vv = uu + weights[i] * du * du, uv + weights[i] * du * dv, vv + weights[i] * dv * dv
            ut, vt, tt = ut + weights[i] * du * dt, vt + weights[i] * dv * dt, tt + weights[i] * dt * dt
        if tt <= 0.0:
            return nu, nv, 0.0, 0.0, 0.0, 2.0
        uu, uv, vv = uu - ut * ut / tt, uv - ut * vt / tt, vv - vt * vt / tt
        half, split = 0.5 * (uu + vv), np.sqrt(0.25 * (uu - vv) ** 2 + uv * uv)
        across, along = max(half - split, 0.0), half + split
        if along <= 0.0:
            return nu, nv, 0.0, 0.0, 0.0, 2.0
        angle = 0.5 * np.arctan2(2.0 * uv, uu - vv) + 0.5 * np.pi
        nu, nv = np.cos(angle), np.sin(angle)
        drift, certainty = (nu * ut + nv * vt) / tt, tt
        rms, sharpness = np.sqrt(across / total), across / along
        if round_ < 3:
            for i in range(n):
                off = (nu * (u[i] - mu) + nv * (v[i] - mv) - drift * (t_s[i] - mt)) / width
                weights[i] = (1.0 - off * off) ** 2 if abs(off) < 1.0 else 0.0
    return nu, nv, drift, 1.0 / certainty, rms, sharpness


@numba.njit(cache=True, nogil=True)
def comoving_constraints(
    t_us: NDArray[np.int64],
    normals: Floats,
    on: NDArray[np.bool_],
    spin_rad_s: Floats,
    stride: int,
    reach: float,
    reach_us: float,
    width: float,
    sharpest: float,
) -> tuple[NDArray[np.int64], Floats, Floats, Floats]:
    """Constraints rows . spin = speeds from every stride-th event whose neighbours make a line.

    normals (n, 3), reach and width are on the unit sphere (rad); reach_us is how far apart in time events of one line
    may be. Returned: rows (m,) of the events, constraint rows (m, 3), speeds (m,) in rad/s along the line's normal,
    and their variances (m,) in (rad/s)^2. Lines less sharp than `sharpest` are left out.
    """
    n = t_us.size
    common_us = t_us[n // 2] if n else 0
    turned = turned_back(normals, t_us, common_us, spin_rad_s)
    events, rows = np.empty(n, np.int64), np.empty((n, 3))
    speeds, variances = np.empty(n), np.empty(n)
    u, v, t_s = np.empty(NEIGHBOURS), np.empty(NEIGHBOURS), np.empty(NEIGHBOURS)
    lines = np.empty((n, 3))
    reach2, count = reach * reach, 0
    for k in range(stride // 2, n, stride):
        ex, ey, ez = turned[k, 0], turned[k, 1], turned[k, 2]
        # Two directions that span the tangent plane (Duff et al., JCGT 2017).
        sign = 1.0 if ez >= 0.0 else -1.0
        p = -1.0 / (sign + ez)
        q = ex * ey * p
        ux, uy, uz = 1.0 + sign * ex * ex * p, sign * q, -sign * ex
        vx, vy, vz = q, sign + ey * ey * p, -ey
        size = 0
        for direction in range(2):
            step, room = (1, NEIGHBOURS) if direction else (-1, NEIGHBOURS // 2)
            j = k + direction
            while 0 <= j < n and size < room and abs(t_us[j] - t_us[k]) <= reach_us:
                dx, dy, dz = turned[j, 0] - ex, turned[j, 1] - ey, turned[j, 2] - ez
                if on[j] == on[k] and dx * dx + dy * dy + dz * dz <= reach2:
                    u[size], v[size] = ux * dx + uy * dy + uz * dz, vx * dx + vy * dy + vz * dz
                    t_s[size] = (t_us[j] - t_us[k]) * 1e-6
                    size += 1
                j += step
        if size < FEWEST:
            continue
        nu, nv, drift, inverse, rms, sharpness = drifting_line(u[:size], v[:size], t_s[:size], width)
        if sharpness > sharpest or inverse == 0.0:
            continue
        # n . (missing x e) = drift, n in the tangent plane: missing . (e x n) = drift
        nx, ny, nz = nu * ux + nv * vx, nu * uy + nv * vy, nu * uz + nv * vz
        lines[count, 0], lines[count, 1], lines[count, 2] = ey * nz - ez * ny, ez * nx - ex * nz, ex * ny - ey * nx
        events[count], speeds[count], variances[count] = k, drift, rms * rms * inverse
        count += 1
    events = events[:count].copy()
    rows = turned_back(lines[:count], 2 * common_us - t_us[events], common_us, spin_rad_s)
    for i in range(count):
        for axis in range(3):
            speeds[i] += rows[i, axis] * spin_rad_s[axis]
    return events, rows, speeds[:count].copy(), variances[:count].copy()


@numba.njit(cache=True, nogil=True)
def position_response(
    normals: Floats, sights: Floats, rows: Floats, spin_rad_s: Floats, radius_px: float
) -> Floats:
    """(n, 3) by how much speeds - rows . spin changes (rad/s) per px of error in the ball's x, y and radius.

    rows (n, 3) are e x n as from comoving_constraints, normals (n, 3) the e, sights (n, 3) unit vectors to the
    camera, s. An error of the centre by d (px, across the line of sight) moves e by

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
        line = np.array((a[1] * e[2] - a[2] * e[1], a[2] * e[0] - a[0] * e[2], a[0] * e[1] - a[1] * e[0]))
        turn = np.array((wy * e[2] - wz * e[1], wz * e[0] - wx * e[2], wx * e[1] - wy * e[0]))
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
            change = 0.0
            change += line[0] * (bent[0] - (wy * off[2] - wz * off[1]))
            change += line[1] * (bent[1] - (wz * off[0] - wx * off[2]))
            change += line[2] * (bent[2] - (wx * off[1] - wy * off[0]))
            response[i, which] = change / radius_px
    return response
