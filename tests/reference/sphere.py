"""Slow, obvious twins of the geometry on the ball's surface."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def image_velocity(
    points_m: Floats, normals: Floats, spin_rad_s: Floats, focal_px: float, ball_radius_m: float
) -> Floats:
    """Image velocities (n, 2) in px/s, in the ball's frame, of surface points (n, 3) that turn with the spin (3,)."""
    surface_m_s = ball_radius_m * np.cross(spin_rad_s, normals)
    depth_m = points_m[:, 2:]
    velocity: Floats = focal_px / depth_m * (surface_m_s - points_m / depth_m * surface_m_s[:, 2:])[:, :2]
    return velocity
