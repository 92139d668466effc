"""Offset of the circles: by how much they are larger than the ball, for `track.outline_px`, by shots.

A ball looks as large as its distance says, plus the offset, which is the same number of pixels at any distance. Where
the lens's centre lies in the camera is not known to a centimetre, which is as much as the offset: so shots at two
distances or more are asked for, and both are found.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..errors import RecordingError

Floats = NDArray[np.float64]

LEAST_RATIO = 1.5  # between the largest and the smallest distance
CENTRE_STD_M = 0.05  # 1 sigma of the place of the lens's centre: lenses are no longer
SHOT_STD_M = 0.01  # by which shots of one setting pass nearer or farther
# Of a shot's radius. Those of ten simulated shots (seeds 96100 to 96104, at 1.8 and 2.8 m) scatter by 0.03 px; ground
# and light differ more among real ones.
CIRCLE_STD_PX = 0.1
MOST_STD_PX = 0.3  # beyond it the usual 0.5 px is as good


@dataclass(frozen=True, slots=True)
class MeasuredOutline:
    """Circle of one shot where it is nearest to the image's middle.

    Attributes
    ----------
    x_px, y_px, radius_px : float
        As tracked.
    distance_m : float
        From the lens to the ball's centre, as measured.
    """

    x_px: float
    y_px: float
    radius_px: float
    distance_m: float


@dataclass(frozen=True, slots=True)
class OutlineOffset:
    """Radius of the circles less the ball's, its 1 sigma, and how much farther the lens is than measured."""

    offset_px: float
    std_px: float
    farther_m: float


def outline_offset(outlines: Sequence[MeasuredOutline], ball_radius_m: float, camera: Camera) -> OutlineOffset:
    """Find the offset of the circles.

    Parameters
    ----------
    outlines : sequence of MeasuredOutline
        Of two distances or more.
    ball_radius_m : float
    camera : Camera
        Calibrated: a focal length that is off by 1 % makes the offset wrong by 1 % of the far ball's radius.

    Raises
    ------
    RecordingError
        For distances that are too near each other, or shots that scatter too much.
    """
    distances_m = np.array([one.distance_m for one in outlines])
    if not distances_m.size or distances_m.max() < LEAST_RATIO * distances_m.min():
        raise RecordingError(
            f"the shots are at distances of {', '.join(f'{one:g}' for one in distances_m)} m: record some at two "
            f"distances or more, the largest {LEAST_RATIO:g} times the smallest"
        )
    rays = camera.rays([one.x_px for one in outlines], [one.y_px for one in outlines])
    sight = rays / np.linalg.norm(rays, axis=1)[:, None]
    radii_px = np.array([one.radius_px for one in outlines])
    offset_px, farther_m = 0.0, 0.0
    for _ in range(5):  # Gauss and Newton's method: the outline depends on the distance nearly as 1 over it
        at_m = np.maximum(distances_m + farther_m, 2 * ball_radius_m)
        expected_px = camera.silhouette(sight * at_m[:, None], ball_radius_m)[2]
        slope_px_m = -expected_px / at_m
        weights = 1.0 / np.hypot(CIRCLE_STD_PX, SHOT_STD_M * slope_px_m)
        rows = np.column_stack([np.ones_like(at_m), slope_px_m]) * weights[:, None]
        rows = np.vstack([rows, [0.0, 1.0 / CENTRE_STD_M]])
        wanted = np.append((radii_px - expected_px) * weights, -farther_m / CENTRE_STD_M)
        (offset_px, step_m), *_ = np.linalg.lstsq(rows, wanted)
        farther_m += float(step_m)
    off = (radii_px - expected_px - offset_px - slope_px_m * step_m) * weights
    scatter = max(1.0, float(np.sum(off**2)) / max(off.size - 2, 1))  # over what is expected of it
    std_px = math.sqrt(float(np.linalg.inv(rows.T @ rows)[0, 0]) * scatter)
    if std_px > MOST_STD_PX:
        raise RecordingError(
            f"the shots tell the outline's offset to {std_px:.1f} px only, {MOST_STD_PX:g} are of use: record more, at "
            "distances farther apart, and check the distances"
        )
    return OutlineOffset(float(offset_px), std_px, farther_m)
