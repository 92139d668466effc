"""Whether a ball rolls on a table: told from one in flight by gravity, which bends a flight."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from .track_contact import EDGE_STD_PX, RADIUS_STD_PX
from .track_path import GRAVITY_M_S2, PathPoint, independent_points

Floats = NDArray[np.float64]

# A path is judged over so long at most, enough to see the fall along the view of a camera above a table.
JUDGED_US = 250_000
# Circles that leave one degree of freedom beside a parabola.
FEWEST_CIRCLES = 4
# Faster balls do not roll. Drag and lift of slower ones are a third of gravity at most.
ROLLING_M_S = 3.5
# What cannot be told is more likely a flight above this speed across the view, and not below: the slowest of 203 real
# flights had 2.8 m/s, of which a view at 45 degrees shows so much.
SLOWEST_FLIGHT_M_S = 2.0
# Limits are kept by so many standard errors.
SIGMAS = 3.0


def rolls(path: list[PathPoint], camera: Camera, ball_radius_m: float, apart_us: int) -> bool | None:
    """Whether a slow ball rolls; None where its path is too short to tell.

    It flies if its acceleration is seen to be a quarter of gravity in any direction, as `camera.up` may not be stated,
    and rolls if it is under half of gravity along `camera.up`.

    Parameters
    ----------
    path : list of PathPoint
        Its circles so far, oldest first.
    apart_us : int
        How far back the events of a circle reach: nearer circles share events.
    """
    points = independent_points(path, JUDGED_US, apart_us)
    if len(points) < FEWEST_CIRCLES:
        return None
    acceleration, changes = _acceleration_m_s2(points, camera, ball_radius_m)
    directions = np.vstack([camera.up, np.eye(3)])
    bends, unsure = np.abs(directions @ acceleration), SIGMAS * np.linalg.norm(directions @ changes.T, axis=1)
    if np.any(bends - unsure > GRAVITY_M_S2 / 4):
        return False
    return True if bends[0] + unsure[0] <= GRAVITY_M_S2 / 2 else None


def _acceleration_m_s2(points: list[PathPoint], camera: Camera, ball_radius_m: float) -> tuple[Floats, Floats]:
    """Acceleration (3,) in space by parabolas through the circles.

    Also its changes (3, 3) by 1 sigma of the circles' columns, rows and radii, one a row.
    """
    circles = np.array([[c.x_px, c.y_px, c.radius_px] for point in points if (c := point.circle)])
    s = np.array([(point.end_us - points[0].end_us) * 1e-6 for point in points])
    middle, half = (s[0] + s[-1]) / 2, (s[-1] - s[0]) / 2
    design = np.vander((s - middle) / half, 3)
    bend, slope, circle = np.linalg.lstsq(design, circles)[0]
    shake_px = max(point.shake_px for point in points)
    least_px = np.hypot([EDGE_STD_PX, EDGE_STD_PX, RADIUS_STD_PX], [shake_px, shake_px, 0.0])
    noise_px = np.maximum(least_px, (circles - design @ np.stack([bend, slope, circle])).std(axis=0))
    bend_std = np.sqrt(np.linalg.inv(design.T @ design)[0, 0]) * noise_px
    # The bend as it is, and with each of its errors: one call of the camera takes two thirds of the time of four.
    bends = bend + np.vstack([np.zeros(3), np.diag(bend_std)])
    ends = circle + np.stack([bends - slope, np.zeros_like(bends), bends + slope])
    places_m = camera.ball_centre_m(ends[..., 0].ravel(), ends[..., 1].ravel(), ends[..., 2].ravel(), ball_radius_m)
    start, centre, end = places_m.reshape(3, 4, 3)
    accelerations = (start - 2 * centre + end) / half**2
    return accelerations[0], accelerations[1:] - accelerations[0]
