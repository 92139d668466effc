"""Weighted least squares of a camera and the poses of a board, with the camera's covariance.

OpenCV's calibration takes all views to be equally good and states standard deviations alone. Views of a blinking board
differ: where an edge runs along the pixels' rows, all of its corners are off together. Each view is weighted by its own
residual here, and the covariance tells how well the distortion is known where no corner was seen (Zhang 2000; the
elimination of the poses is the usual one, Triggs 2000, "Bundle adjustment", section 6.1).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

ROUNDS = 6  # the start is OpenCV's answer; the weights settle within three or four
LEAST_STD = 0.5  # of a view, over the median's: a few corners that fit by chance do not count for all
INTRINSICS = 7  # f, cx, cy, k1, k2, p1, p2


@dataclass(eq=False)
class BoardPoses:
    """Corners of each view, and its pose.

    Attributes
    ----------
    points, seen : list of (k, 3) and (k, 2) float64
        On the board, and in the image.
    turns, shifts : list of (3,) float64
        Rotation vector and shift from the board to the camera.
    """

    points: list[Floats]
    seen: list[Floats]
    turns: list[Floats]
    shifts: list[Floats]


def adjusted(intrinsics: Floats, poses: BoardPoses) -> tuple[Floats, Floats]:
    """Camera (INTRINSICS,) that fits all views best, and its covariance; the poses are changed to go with it.

    The corners of a view are off together, not each on its own: the covariance is enlarged by how much more the views
    pull at the camera than independent corners would (the "design effect" of cluster sampling, Kish 1965).
    """
    covariance = np.full((INTRINSICS, INTRINSICS), np.nan)
    for _ in range(ROUNDS):
        parts = [_linearized(intrinsics, *view) for view in _views(poses)]
        std = np.array([np.sqrt(np.sum(off**2) / (off.size - 6)) for _, _, off in parts])
        std = np.maximum(std, max(LEAST_STD * float(np.median(std)), 1e-9))
        normal, pulls = np.zeros((INTRINSICS, INTRINSICS)), []
        eliminated = []
        for (of_camera, of_pose, off), sigma in zip(parts, std, strict=True):
            of_camera, of_pose, off = of_camera / sigma, of_pose / sigma, off / sigma
            pose_inverse = np.linalg.inv(of_pose.T @ of_pose)
            mixed = of_camera.T @ of_pose @ pose_inverse
            normal += of_camera.T @ of_camera - mixed @ of_pose.T @ of_camera
            pulls.append(of_camera.T @ off - mixed @ of_pose.T @ off)
            eliminated.append((pose_inverse, of_pose.T @ off, mixed))
        inverse = np.linalg.inv(normal)
        step = inverse @ np.sum(pulls, axis=0)
        effect = float(np.einsum("vi,ij,vj->", pulls, inverse, pulls)) / INTRINSICS
        covariance = inverse * max(1.0, effect)
        intrinsics = intrinsics + step
        for number, (pose_inverse, pulled, mixed) in enumerate(eliminated):
            moved = pose_inverse @ pulled - mixed.T @ step
            poses.turns[number] = poses.turns[number] + moved[:3]
            poses.shifts[number] = poses.shifts[number] + moved[3:]
    return intrinsics, covariance


def residuals(intrinsics: Floats, poses: BoardPoses) -> list[Floats]:
    """(k, 2) distance of each corner, view by view, from where the camera puts it."""
    return [_linearized(intrinsics, *view)[2].reshape(-1, 2) for view in _views(poses)]


def distortion_std_px(intrinsics: Floats, covariance: Floats, rays: Floats) -> Floats:
    """(n,) 1 sigma, root of the trace, of the shift by which the lens distorts the image at rays (n, 3), z = 1."""
    slopes = _linearized(intrinsics, rays, np.zeros((len(rays), 2)), np.zeros(3), np.zeros(3))[0]
    slopes[:, 0] -= rays[:, :2].ravel()  # of the place without distortion: that is no part of the shift
    slopes[:, 1:3] = 0.0
    variance = np.einsum("ij,jk,ik->i", slopes, covariance, slopes)
    return np.asarray(np.sqrt(variance.reshape(-1, 2).sum(axis=1)))


def _views(poses: BoardPoses) -> Sequence[tuple[Floats, Floats, Floats, Floats]]:
    return list(zip(poses.points, poses.seen, poses.turns, poses.shifts, strict=True))


def _linearized(
    intrinsics: Floats, points: Floats, seen: Floats, turn: Floats, shift: Floats
) -> tuple[Floats, Floats, Floats]:
    """Slopes (2 k, INTRINSICS) by the camera and (2 k, 6) by the pose, and what is left (2 k,), x and y by turns."""
    import cv2

    focal, cx, cy, *distortion = intrinsics
    matrix = np.array([[focal, 0.0, cx], [0.0, focal, cy], [0.0, 0.0, 1.0]])
    placed, slopes = cv2.projectPoints(points, turn, shift, matrix, np.array(distortion))
    # OpenCV's columns: rotation, shift, fx, fy, cx, cy, k1, k2, p1, p2.
    of_camera = np.column_stack([slopes[:, 6] + slopes[:, 7], slopes[:, 8:10], slopes[:, 10:14]])
    return of_camera, np.asarray(slopes[:, :6], np.float64), (seen - placed.reshape(-1, 2)).ravel()
