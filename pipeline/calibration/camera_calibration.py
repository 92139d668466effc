"""Focal length, principal point and distortion from views of a board, or the focal length from a ball."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from numpy.typing import NDArray

from ..camera import Camera, CameraParameters
from ..errors import ParameterError, RecordingError
from ..files import atomic_file
from .board import Board, BoardView, corners_of
from .bundle_adjustment import BoardPoses, adjusted, distortion_std_px, residuals

Floats = NDArray[np.float64]

LEAST_VIEWS = 5  # five unknowns of the lens and six of each view; OpenCV's advice is ten
# A view that fits so much worse than the median's is wrong: a corner taken for its neighbour, or a moving board.
OUTLIER_RATIO = 3.0
GRID = 4  # cells of the image a side; the four at its corners tell the distortion
# A focal length, and a distortion in the image's corners, known less well than this are said to be so.
FOCAL_STD_SHARE, CORNER_STD_PX = 0.005, 0.3


@dataclass(frozen=True, eq=False)
class CameraCalibration:
    """A calibrated camera and how well the views agree with it.

    Attributes
    ----------
    camera : Camera
    pixel_um : float
        Pitch by which the focal length is stated in mm.
    focal_std_px, corner_std_px : float
        1 sigma of the focal length, and of the distortion in the image's worst corner.
    reprojection_px : float
        Root mean square distance of the corners from where the camera puts them.
    corners_px, residual_px : (n, 2) float64
        The corners of all views used, and their distances from where the camera puts them.
    views, left_out : int
        Used, and left out as outliers.
    """

    camera: Camera
    pixel_um: float
    focal_std_px: float
    corner_std_px: float
    reprojection_px: float
    corners_px: Floats
    residual_px: Floats
    views: int
    left_out: int

    @property
    def values(self) -> dict[str, Any]:
        """The parameters `camera.*`."""
        camera = self.camera
        return {
            "focal_length_mm": camera.focal_px * self.pixel_um / 1000.0,
            "pixel_um": self.pixel_um,
            "principal_x_px": camera.principal_x_px,
            "principal_y_px": camera.principal_y_px,
            "distortion": list(camera.distortion),
        }

    @property
    def warnings(self) -> list[str]:
        """Doubts about the calibration, with the remedy, in sentences."""
        said = []
        names = [
            f"{vertical} {horizontal}"
            for vertical, row in (("top", 0), ("bottom", GRID - 1))
            for horizontal, column in (("left", 0), ("right", GRID - 1))
            if not self.coverage[row, column]
        ]
        if names:
            said.append(
                f"the board never came into the image's corners {', '.join(names)}: the distortion there is a guess; "
                "record views with the board in them"
            )
        if not names and self.corner_std_px > CORNER_STD_PX:
            said.append(
                f"the distortion in the image's corners is uncertain by {self.corner_std_px:.1f} px: bring the board "
                "farther into them, and nearer, or show a ChArUco board, of which a part is enough"
            )
        if self.focal_std_px > FOCAL_STD_SHARE * self.camera.focal_px:
            said.append(
                f"the focal length is uncertain by {100 * self.focal_std_px / self.camera.focal_px:.1f} %: tilt the "
                "board by 20 to 40 degrees in some views"
            )
        return said

    @property
    def coverage(self) -> NDArray[np.int64]:
        """(GRID, GRID) int64 number of corners in each cell of the image, rows from the top."""
        edges = [np.linspace(-0.5, size - 0.5, GRID + 1) for size in (self.camera.height_px, self.camera.width_px)]
        return np.histogram2d(self.corners_px[:, 1], self.corners_px[:, 0], bins=edges)[0].astype(np.int64)

    def __str__(self) -> str:
        camera = self.camera
        distortion = ", ".join(f"{value:.4f}" for value in camera.distortion)
        left_out = f"; {self.left_out} views left out" if self.left_out else ""
        return (
            f"focal length {self.values['focal_length_mm']:.4f} mm "
            f"({camera.focal_px:.2f} +- {self.focal_std_px:.2f} px), "
            f"principal point ({camera.principal_x_px:.1f}, {camera.principal_y_px:.1f}) px, "
            f"distortion {distortion} (+- {self.corner_std_px:.2f} px in the image's corners); {self.views} views, "
            f"reprojection error {self.reprojection_px:.3f} px{left_out}"
        )

    def write(self, path: Path) -> None:
        """Write [camera] as a preset, which is a sidecar's table, too; raises RecordingError."""
        with atomic_file(path, "calibration") as part:
            part.write_text("\n".join(f"# {line}" for line in (str(self), *self.warnings)) + "\n")
            with open(part, "ab") as file:
                tomli_w.dump({"camera": self.values}, file)

    def coverage_png(self) -> bytes:
        """PNG of the places where corners were seen, and how far they are off (arrows, enlarged)."""
        from matplotlib.figure import Figure

        camera = self.camera
        figure = Figure(figsize=(8, 8 * camera.height_px / camera.width_px + 1), layout="constrained")
        axes = figure.subplots()
        shown = axes.imshow(
            np.where(self.coverage > 0, self.coverage, np.nan),
            extent=(-0.5, camera.width_px - 0.5, camera.height_px - 0.5, -0.5),
            cmap="Greens",
            alpha=0.5,
        )
        figure.colorbar(shown, ax=axes, label="corners in the cell (white: none)")
        enlarged = 0.05 * camera.width_px / max(float(np.abs(self.residual_px).max()), 1e-9)
        x, y = self.corners_px.T
        axes.quiver(
            x, y, *(enlarged * self.residual_px.T), angles="xy", scale_units="xy", scale=1, width=0.001, color="C3"
        )
        axes.plot(x, y, ".", markersize=2)
        axes.set(
            xlim=(-0.5, camera.width_px - 0.5),
            ylim=(camera.height_px - 0.5, -0.5),
            xlabel="x [px]",
            ylabel="y [px]",
            title=f"{self.views} views, reprojection error {self.reprojection_px:.3f} px (arrows {enlarged:.0f} times)",
        )
        content = io.BytesIO()
        figure.savefig(content, format="png", dpi=120)
        return content.getvalue()


def calibrate_camera(
    views: Sequence[BoardView], board: Board, size_px: tuple[int, int], pixel_um: float = CameraParameters().pixel_um
) -> CameraCalibration:
    """Calibrate a camera by views of a board.

    Parameters
    ----------
    views : sequence of BoardView
        Of all recordings of this camera.
    board : Board
    size_px : (int, int)
        Width and height of the sensor.
    pixel_um : float
        Pitch of its pixels.

    Returns
    -------
    CameraCalibration
        With square pixels and k3 = 0: more is not told by a lens that needs the paper's field of view.

    Raises
    ------
    RecordingError
        For too few views, or views that no camera explains.
    """
    if len(views) < LEAST_VIEWS:
        raise RecordingError(
            f"the board was seen in {len(views)} different places: {LEAST_VIEWS} or more are needed, 15 are good; move "
            "and tilt it between the flashes"
        )
    used = list(views)
    fit = _fit(used, board, size_px)
    good = fit.view_px <= OUTLIER_RATIO * np.median(fit.view_px)
    if not good.all() and good.sum() >= LEAST_VIEWS:
        used = [view for view, keep in zip(used, good, strict=True) if keep]
        fit = _fit(used, board, size_px)
    intrinsics, covariance = adjusted(fit.intrinsics, fit.poses)
    focal_px, cx, cy, *distortion = intrinsics.tolist()
    camera = Camera(*size_px, focal_px, cx, cy, (*distortion, 0.0), CameraParameters().up)
    right, bottom = size_px[0] - 1.0, size_px[1] - 1.0
    image_corners = camera.rays([0.0, right, 0.0, right], [0.0, 0.0, bottom, bottom])
    residual_px = np.concatenate(residuals(intrinsics, fit.poses))
    return CameraCalibration(
        camera=camera,
        pixel_um=pixel_um,
        focal_std_px=math.sqrt(covariance[0, 0]),
        corner_std_px=float(distortion_std_px(intrinsics, covariance, image_corners).max()),
        reprojection_px=math.sqrt(float(np.mean(np.sum(residual_px**2, axis=1)))),
        corners_px=np.concatenate([view.corners_px for view in used]),
        residual_px=residual_px,
        views=len(used),
        left_out=len(views) - len(used),
    )


@dataclass(frozen=True, eq=False)
class _Fit:
    """OpenCV's answer, with the root mean square residual of each view."""

    intrinsics: Floats
    poses: BoardPoses
    view_px: Floats


def _fit(views: Sequence[BoardView], board: Board, size_px: tuple[int, int]) -> _Fit:
    import cv2

    on_board, in_image = (list(places) for places in zip(*corners_of(views, board), strict=True))
    flags = cv2.CALIB_FIX_ASPECT_RATIO | cv2.CALIB_FIX_K3
    try:
        _, matrix, distortion, turns, shifts, _, _, view_px = cv2.calibrateCameraExtended(
            [points.astype(np.float32) for points in on_board],
            [points.astype(np.float32).reshape(-1, 1, 2) for points in in_image],
            size_px,
            np.eye(3),
            np.zeros(5),
            flags=flags,
        )
    except cv2.error as error:
        raise RecordingError(f"no camera explains the views of the board ({error.err}): check --board") from error
    turned, shifted = ([np.asarray(one, np.float64).ravel() for one in every] for every in (turns, shifts))
    poses = BoardPoses(on_board, in_image, turned, shifted)
    intrinsics = np.array([matrix[0, 0], matrix[0, 2], matrix[1, 2], *distortion.ravel()[:4]], np.float64)
    return _Fit(intrinsics, poses, np.asarray(view_px, np.float64).ravel())


def focal_length_px(
    circle: tuple[float, float, float], distance_m: float, ball_radius_m: float, camera: Camera
) -> float:
    """Focal length, in px, at which a ball at a known distance has this silhouette.

    Parameters
    ----------
    circle : (float, float, float)
        Centre x, y and radius of the silhouette, px.
    distance_m : float
        From the lens to the ball's centre.
    ball_radius_m : float
    camera : Camera
        Principal point and distortion are taken from it.

    Raises
    ------
    ParameterError
        Where no focal length fits.
    """
    from scipy.optimize import brentq

    def too_far_m(focal_px: float) -> float:
        centre = replace(camera, focal_px=focal_px).ball_centre_m(*circle, ball_radius_m)
        return float(np.linalg.norm(centre)) - distance_m

    guess = circle[2] * distance_m / ball_radius_m
    if not distance_m > ball_radius_m or not too_far_m(guess / 4) < 0 < too_far_m(guess * 4):
        raise ParameterError(f"a ball of radius {circle[2]:g} px at {distance_m:g} m tells no focal length: check both")
    return float(brentq(too_far_m, guess / 4, guess * 4, xtol=1e-6))
