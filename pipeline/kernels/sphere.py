"""Geometry on the ball's surface: where camera rays meet it, and how a spin moves it in the image.

Camera frame, metres. e is the outward unit normal (the paper's e_r), p = c + R e the point on the surface, ray =
p / p_z its camera ray, f the focal length in px. All maps are those of the true perspective projection

    u = f/p_z (V_x - p_x/p_z V_z, V_y - p_y/p_z V_z)   image velocity of the surface velocity V,

of which the paper's are the limit for a ball far away on the optical axis.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from .arrays import Floats, Integers


@numba.njit(cache=True, nogil=True)
def intersect_ball(
    rays: Floats, t_us: Integers, first_us: float, last_us: float, centres_m: Floats, ball_radius_m: float
) -> tuple[Floats, Floats]:
    """Intersect rays with the visible side of a moving ball.

    Parameters
    ----------
    rays : (n, 3) float64
        Camera rays, any length.
    t_us : (n,) int64
        Time of each ray.
    first_us, last_us : float
        Times of the first and the last centre.
    centres_m : (k, 3) float64
        The ball's centre at k times spread evenly; linear in between, the same throughout if k = 1.

    Returns
    -------
    points_m, normals : (n, 3) float64
        Points on the ball and outward unit normals, camera frame. A ray that misses gives the point of the ball's
        outline nearest to it (normal perpendicular to the ray).
    """
    n, knots = rays.shape[0], centres_m.shape[0]
    points, normals = np.empty((n, 3)), np.empty((n, 3))
    per_us = (knots - 1) / (last_us - first_us) if knots > 1 else 0.0
    for i in range(n):
        place = (t_us[i] - first_us) * per_us
        knot = min(max(int(place), 0), max(knots - 2, 0))
        part = place - knot
        after = min(knot + 1, knots - 1)
        cx = centres_m[knot, 0] + part * (centres_m[after, 0] - centres_m[knot, 0])
        cy = centres_m[knot, 1] + part * (centres_m[after, 1] - centres_m[knot, 1])
        cz = centres_m[knot, 2] + part * (centres_m[after, 2] - centres_m[knot, 2])
        rx, ry, rz = rays[i, 0], rays[i, 1], rays[i, 2]
        rr = rx * rx + ry * ry + rz * rz
        along = (rx * cx + ry * cy + rz * cz) / rr
        ex, ey, ez = along * rx - cx, along * ry - cy, along * rz - cz  # from the centre to the ray, at right angles
        depth2 = (ball_radius_m * ball_radius_m - (ex * ex + ey * ey + ez * ez)) / rr
        if depth2 > 0.0:
            back = np.sqrt(depth2)
            ex, ey, ez = ex - back * rx, ey - back * ry, ez - back * rz
        length = np.sqrt(ex * ex + ey * ey + ez * ez)
        ex, ey, ez = ex / length, ey / length, ez / length
        normals[i, 0], normals[i, 1], normals[i, 2] = ex, ey, ez
        points[i, 0], points[i, 1] = cx + ball_radius_m * ex, cy + ball_radius_m * ey
        points[i, 2] = cz + ball_radius_m * ez
    return points, normals


@numba.njit(cache=True, nogil=True)
def surface_velocity(points_m: Floats, normals: Floats, vx_px_s: Floats, vy_px_s: Floats, focal_px: float) -> Floats:
    """Surface velocities (n, 3) in m/s that look like these image velocities (equation v_flow, in perspective).

    The two image components leave the velocity along the ray open; tangency, e . V = 0, settles it. On the visible
    side e . ray < 0, so the division is safe except on the outline itself.

    Parameters
    ----------
    points_m, normals : (n, 3) float64
        Points on the ball and outward unit normals, camera frame.
    vx_px_s, vy_px_s : (n,) float64
        Image velocities, the ball's own motion taken off.
    """
    velocity = np.empty_like(points_m)
    for i in range(points_m.shape[0]):
        z = points_m[i, 2]
        rx, ry = points_m[i, 0] / z, points_m[i, 1] / z
        ex, ey, ez = normals[i, 0], normals[i, 1], normals[i, 2]
        a, b = vx_px_s[i] * z / focal_px, vy_px_s[i] * z / focal_px
        along = -(a * ex + b * ey) / (ex * rx + ey * ry + ez)
        velocity[i, 0], velocity[i, 1], velocity[i, 2] = a + rx * along, b + ry * along, along
    return velocity


@numba.njit(cache=True, nogil=True)
def spin_rows(points_m: Floats, normals: Floats, directions: Floats, focal_px: float, ball_radius_m: float) -> Floats:
    """Rows (n, 3) a with a . spin = image velocity along `directions` (n, 2), in px/s for a spin in rad/s.

    From d . J (spin x R e) = spin . (R e x J^T d). The other arguments as in `surface_velocity`.
    """
    rows = np.empty_like(points_m)
    for i in range(points_m.shape[0]):
        z = points_m[i, 2]
        scale = focal_px * ball_radius_m / z
        jx, jy = scale * directions[i, 0], scale * directions[i, 1]
        jz = -(jx * points_m[i, 0] + jy * points_m[i, 1]) / z
        ex, ey, ez = normals[i, 0], normals[i, 1], normals[i, 2]
        rows[i, 0], rows[i, 1], rows[i, 2] = ey * jz - ez * jy, ez * jx - ex * jz, ex * jy - ey * jx
    return rows


def spread_directions(count: int) -> Floats:
    """Unit vectors (count, 3) spread evenly over the sphere (Fibonacci's spiral)."""
    i = np.arange(count) + 0.5
    z = 1.0 - 2.0 * i / count
    angle = math.pi * (1.0 + math.sqrt(5.0)) * i
    across = np.sqrt(1.0 - z * z)
    return np.stack([across * np.cos(angle), across * np.sin(angle), z], axis=1)
