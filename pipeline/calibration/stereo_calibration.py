"""Rotation and shift from an event camera to a frame camera beside it, by views of the same board.

As in the supplement ("Ball thrower benchmark"): the screen with the board blinks for the event camera and shows the
board for the frame camera, in the same pose. Spins of one camera are then stated in the frame of the other.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import tomli_w
from numpy.typing import NDArray

from ..camera import Camera, CameraParameters
from ..errors import RecordingError
from ..files import atomic_file
from .board import Board, BoardView

Floats = NDArray[np.float64]

LEAST_PAIRS = 4  # six unknowns, and a spread of the pairs to tell wrong ones and the error by
# A pair so much farther from the common rotation than the median is wrong: the board moved in between.
OUTLIER_RATIO, EXACT_DEG = 4.0, 0.01
ROTATION_STD_DEG = 0.2  # an uncertainty beyond it is said: a tenth of SpinDOE's error of the axis


@dataclass(frozen=True, eq=False)
class StereoCalibration:
    """Place of the frame camera beside the event camera.

    Attributes
    ----------
    frame_camera : Camera
    rotation : (3, 3) float64
        A vector v, like a spin, of the event camera's frame is rotation @ v in the frame camera's.
    shift_m : (3,) float64
        A point p of the event camera's frame is at rotation @ p + shift_m in the frame camera's.
    rotation_std_deg : float
        1 sigma of the rotation's angle, by leaving out one pair after the other (jackknife).
    reprojection_px : float
        Root mean square distance of the corners, in the frame camera, from where the event camera's views put them.
    pairs, left_out : int
        Used, and left out as outliers.
    """

    frame_camera: Camera
    rotation: Floats
    shift_m: Floats
    rotation_std_deg: float
    reprojection_px: float
    pairs: int
    left_out: int

    @property
    def warnings(self) -> list[str]:
        """Doubts, with the remedy, in sentences."""
        if self.rotation_std_deg <= ROTATION_STD_DEG:
            return []
        return [
            f"the rotation is uncertain by {self.rotation_std_deg:.2f} degrees: record poses of the board that fill "
            "the image and tilted by 20 to 40 degrees"
        ]

    def __str__(self) -> str:
        left_out = f"; {self.left_out} pairs left out" if self.left_out else ""
        return (
            f"turned by {_angle_deg(self.rotation):.2f} +- {self.rotation_std_deg:.2f} degrees, "
            f"{1000 * np.linalg.norm(self.shift_m):.1f} mm apart; {self.pairs} pairs, reprojection error "
            f"{self.reprojection_px:.2f} px{left_out}"
        )

    def write(self, path: Path) -> None:
        """Write [stereo] and [frame_camera] for sidecars and the suite `frames`; raises RecordingError."""
        pixel_um = CameraParameters().pixel_um  # the focal length in px is what counts
        stereo = {"rotation": self.rotation.tolist(), "shift_m": self.shift_m.tolist()}
        camera = {
            "focal_length_mm": self.frame_camera.focal_px * pixel_um / 1000.0,
            "pixel_um": pixel_um,
            "principal_x_px": self.frame_camera.principal_x_px,
            "principal_y_px": self.frame_camera.principal_y_px,
            "distortion": list(self.frame_camera.distortion),
        }
        with atomic_file(path, "calibration") as part:
            part.write_text("\n".join(f"# {line}" for line in (str(self), *self.warnings)) + "\n")
            with open(part, "ab") as file:
                tomli_w.dump({"stereo": stereo, "frame_camera": camera}, file)


def calibrate_stereo(
    pairs: Sequence[tuple[BoardView, BoardView]], board: Board, event_camera: Camera, frame_camera: Camera
) -> StereoCalibration:
    """Find where the frame camera stands, both cameras being calibrated.

    The board's corners may be numbered from either end, as a chessboard looks the same half a turn round. Cameras
    beside each other do not stand on their heads: the smaller rotation is meant.

    Parameters
    ----------
    pairs : sequence of (BoardView, BoardView)
        Views of the board in the same pose, the event camera's first.
    board : Board
    event_camera, frame_camera : Camera

    Returns
    -------
    StereoCalibration

    Raises
    ------
    RecordingError
        For too few pairs, or pairs that fit no common rotation.
    """
    if len(pairs) < LEAST_PAIRS:
        raise RecordingError(
            f"the board was seen by both cameras in {len(pairs)} poses: {LEAST_PAIRS} or more are needed, 10 are good"
        )
    points_mm = board.corners_mm
    common = [_common_corners(event, frame, board, event_camera, frame_camera) for event, frame in pairs]
    turns = np.array([turn for _, _, _, turn in common])
    away = np.array([_angle_deg(turn @ _mean_rotation(turns).T) for turn in turns])
    good = away <= OUTLIER_RATIO * np.median(away) + EXACT_DEG
    if good.sum() < LEAST_PAIRS:
        raise RecordingError(
            f"only {good.sum()} of {len(pairs)} pairs agree on a rotation of the cameras: keep the board still between "
            "both cameras' views of a pose, and the cameras fixed"
        )
    used = [one for one, keep in zip(common, good, strict=True) if keep]
    rotation, shift_mm, reprojection_px = _fit(used, points_mm, event_camera, frame_camera)
    without_one = [
        _fit([*used[:one], *used[one + 1 :]], points_mm, event_camera, frame_camera)[0] for one in range(len(used))
    ]
    off_deg = np.array([_angle_deg(other @ rotation.T) for other in without_one])
    return StereoCalibration(
        frame_camera=frame_camera,
        rotation=rotation,
        shift_m=shift_mm / 1000.0,
        rotation_std_deg=math.sqrt((1 - 1 / len(used)) * float(np.sum(off_deg**2))),
        reprojection_px=reprojection_px,
        pairs=len(used),
        left_out=len(pairs) - len(used),
    )


Common = tuple[NDArray[np.int64], Floats, Floats, Floats]  # numbers, places in both images, event -> frame rotation


def _common_corners(event: BoardView, frame: BoardView, board: Board, *cameras: Camera) -> Common:
    """Corners that both cameras see, numbered alike, and the rotation that this pair suggests."""
    suggested: list[Common] = []
    ends = (frame, _from_the_other_end(frame)) if board.pattern == "chessboard" else (frame,)
    for one in ends:
        numbers, mine, its = np.intersect1d(event.numbers, one.numbers, return_indices=True)
        if numbers.size < 6:  # a pose has six unknowns, a corner gives two
            raise RecordingError(
                f"the cameras have {numbers.size} corners of the board in common at {event.t_us} us: keep all of it in "
                "view of both"
            )
        places = event.corners_px[mine], one.corners_px[its]
        poses = [_pose(board.corners_mm[numbers], *seen) for seen in zip(places, cameras, strict=True)]
        suggested.append((numbers, *places, poses[1] @ poses[0].T))
    return min(suggested, key=lambda one: _angle_deg(one[3]))


def _from_the_other_end(view: BoardView) -> BoardView:
    """A view of a whole chessboard with its corners counted from the opposite one."""
    return replace(view, corners_px=view.corners_px[::-1])


def _pose(points_mm: Floats, corners_px: Floats, camera: Camera) -> Floats:
    """(3, 3) rotation from the board to the camera."""
    import cv2

    rays = np.ascontiguousarray(camera.rays(*corners_px.T)[:, :2])
    turn = cv2.solvePnP(points_mm, rays, np.eye(3), np.zeros(5))[1]
    return np.asarray(cv2.Rodrigues(turn)[0], np.float64)


def _fit(
    pairs: Sequence[Common], points_mm: Floats, event_camera: Camera, frame_camera: Camera
) -> tuple[Floats, Floats, float]:
    """Rotation, shift in mm and reprojection error that fit all pairs at once."""
    import cv2

    answer = cv2.stereoCalibrate(
        [points_mm[numbers].astype(np.float32) for numbers, _, _, _ in pairs],
        [seen.astype(np.float32).reshape(-1, 1, 2) for _, seen, _, _ in pairs],
        [seen.astype(np.float32).reshape(-1, 1, 2) for _, _, seen, _ in pairs],
        *_intrinsics(event_camera),
        *_intrinsics(frame_camera),
        (event_camera.width_px, event_camera.height_px),
        flags=cv2.CALIB_FIX_INTRINSIC,
    )
    return np.asarray(answer[5], np.float64), np.asarray(answer[6], np.float64).ravel(), float(answer[0])


def _intrinsics(camera: Camera) -> tuple[Floats, Floats]:
    """OpenCV's matrix and distortion of a camera."""
    matrix = np.array(
        [[camera.focal_px, 0, camera.principal_x_px], [0, camera.focal_px, camera.principal_y_px], [0, 0, 1.0]]
    )
    return matrix, np.array(camera.distortion, np.float64)


def _mean_rotation(turns: Floats) -> Floats:
    """(3, 3) rotation nearest to those (n, 3, 3), the median of each component being taken."""
    left, _, right = np.linalg.svd(np.median(turns, axis=0))
    return np.asarray(left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right)


def _angle_deg(turn: Floats) -> float:
    """Angle of a rotation, by its odd part, which is exact for small ones, too."""
    odd = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    return float(np.degrees(np.arctan2(np.linalg.norm(odd), np.trace(turn) - 1.0)))
