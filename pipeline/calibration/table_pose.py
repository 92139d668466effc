"""Pose of the table from its four corners in the image: the direction up, and the camera's place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..errors import ParameterError

Floats = NDArray[np.float64]

LENGTH_M, WIDTH_M = 2.74, 1.525  # rules of table tennis
WORST_PX = 5.0  # of a corner clicked by hand; beyond it they are no rectangle of this size


@dataclass(frozen=True, eq=False)
class TablePose:
    """The table before the camera.

    Attributes
    ----------
    up : (3,) float64
        Unit normal of the table, camera frame.
    along : (3,) float64
        Unit vector along its long sides, camera frame: from the first corner on.
    middle_m : (3,) float64
        Middle of the table, camera frame.
    reprojection_px : float
        Largest distance of a corner from where the pose puts it.
    """

    up: Floats
    along: Floats
    middle_m: Floats
    reprojection_px: float

    @property
    def height_m(self) -> float:
        """Height of the camera over the table's plane."""
        return abs(float(self.up @ self.middle_m))

    @property
    def rotation(self) -> Floats:
        """(3, 3) float64 from the camera's frame to the table's: x to the right, y along the table, z up.

        SpinDOE's trajectories have such a frame, see `dotted_shots`.
        """
        return np.stack([np.cross(self.along, self.up), self.along, self.up])


def table_pose(corners_px: Sequence[tuple[float, float]], camera: Camera) -> TablePose:
    """Find the pose of the table.

    Parameters
    ----------
    corners_px : sequence of 4 (float, float)
        Columns and rows of the corners in order round the table, from any one on, either way round.
    camera : Camera
        Focal length and distortion matter.

    Returns
    -------
    TablePose

    Raises
    ------
    ParameterError
        Where the four points are no table of the official size.
    """
    import cv2

    if len(corners_px) != 4:
        raise ParameterError(f"a table has four corners, {len(corners_px)} are given: give X Y four times")
    points = np.array(corners_px, np.float64)
    rays = np.ascontiguousarray(camera.rays(points[:, 0], points[:, 1])[:, :2])
    pinhole = replace(camera, distortion=(0.0,) * 5)
    seen_px = pinhole.project(np.column_stack([rays, np.ones(4)]))
    best: TablePose | None = None
    for length_m, width_m in ((LENGTH_M, WIDTH_M), (WIDTH_M, LENGTH_M)):  # which side comes first is not said
        table_m = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]) * (length_m / 2, width_m / 2, 0.0)
        count, turns, shifts, _ = cv2.solvePnPGeneric(table_m, rays, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE)
        for turn, shift in zip(turns[:count], shifts[:count], strict=True):
            middle_m = np.asarray(shift, np.float64).ravel()
            rotation = np.asarray(cv2.Rodrigues(turn)[0], np.float64)
            placed = table_m @ rotation.T + middle_m
            if not np.all(placed[:, 2] > 0):
                continue
            off_px = np.linalg.norm(pinhole.project(placed) - seen_px, axis=1)
            normal = rotation[:, 2]
            along = rotation[:, 0 if length_m == LENGTH_M else 1]
            found = TablePose(-np.sign(normal @ middle_m) * normal, along, middle_m, float(off_px.max()))
            if best is None or found.reprojection_px < best.reprojection_px:
                best = found
    if best is None or best.reprojection_px > WORST_PX:
        off = "" if best is None else f" (one is {best.reprojection_px:.0f} px off)"
        raise ParameterError(
            f"the four corners are no table of {LENGTH_M:g} x {WIDTH_M:g} m{off}: give them in order round the table, "
            "and the camera's focal length"
        )
    return best
