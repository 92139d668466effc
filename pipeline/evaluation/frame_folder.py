"""Frames of a real frame camera: a folder with pictures that are named by their time, or with a video."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera, CameraParameters
from ..errors import ParameterError, RecordingError
from ..pictures import grey_picture
from ..toml import toml_tables
from . import frame_video
from .frame_camera import Frame

Floats = NDArray[np.float64]

SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp")
LEAST_FRAMES = 5  # the median of fewer still shows the ball
# SpinDOE names pictures by microseconds, its later versions by nanoseconds. A step of more than 0.1 s, or of less than
# 0.1 ms, is that of no camera that sees a ball turn.
SLOWEST_STEP_US = 100_000
WHITE_SHARE = 0.9999  # of a picture's pixels that are darker than white: a ball of 10 px has 300 of a million
CHANGE = 0.1  # of white, between ball and background, as in `frame_albedo`
MARGIN = 1.6  # half a frame's part around the ball, over its radius, and so many pixels more
MARGIN_PX = 4


@dataclass(frozen=True, eq=False)
class FrameFolder:
    """Frames of one flight.

    Attributes
    ----------
    frames : list of Frame
        With all of the ball in view, in order of time.
    rate_hz : float
        By the median step between pictures.
    size_px : (int, int)
        Width and height of the pictures.
    """

    frames: list[Frame]
    rate_hz: float
    size_px: tuple[int, int]

    @classmethod
    def read(cls, folder: Path) -> FrameFolder:
        """The frames of a folder; raises RecordingError.

        It holds pictures `TIME.png`, TIME in microseconds or nanoseconds, or one video, see `read_video`.
        """
        videos = [path for path in sorted(folder.glob("*")) if path.suffix.lower() in frame_video.SUFFIXES]
        if len(videos) > 1:
            raise RecordingError(f"{len(videos)} videos are of one flight, keep one of them: {folder}")
        times_us, pictures = frame_video.read_video(videos[0]) if videos else _named_pictures(folder)
        if len(pictures) < LEAST_FRAMES:
            raise RecordingError(
                f"{len(pictures)} pictures of a flight are too few, give {LEAST_FRAMES} or more: {folder}"
            )
        if len({picture.shape for picture in pictures}) > 1:
            raise RecordingError(f"the pictures are not all of one size: {folder}")
        white = max(1.0, *(float(np.quantile(picture, WHITE_SHARE)) for picture in pictures))
        middle = len(pictures) // 2
        background = np.partition(np.array(pictures), middle, axis=0)[middle] / white  # the median, in a byte a pixel
        found = [
            frame
            for time_us, picture in zip(times_us - times_us[0], pictures, strict=True)
            if (frame := _around_ball(float(time_us) * 1e-6, picture / white, background)) is not None
        ]
        height, width = pictures[0].shape
        return cls(found, 1e6 / float(np.median(np.diff(times_us))), (width, height))


def _named_pictures(folder: Path) -> tuple[Floats, list[NDArray[np.uint8]]]:
    """Times (n,), us, and pictures of a folder in order of time."""
    named = {path: path.stem for path in sorted(folder.glob("*")) if path.suffix.lower() in SUFFIXES}
    wrong = [path.name for path, stem in named.items() if not stem.isdecimal()]
    if wrong:
        raise RecordingError(
            f"pictures are named by their time in whole microseconds or nanoseconds, {wrong[0]} is not: {folder}"
        )
    paths = sorted(named, key=lambda path: int(path.stem))
    times = np.array([int(path.stem) for path in paths], np.float64)
    step = float(np.median(np.diff(times))) if times.size > 1 else 1.0
    if step <= 0:
        raise RecordingError(f"two pictures have the same time: {folder}")
    return times / (1000.0 if step > SLOWEST_STEP_US else 1.0), [grey_picture(path) for path in paths]


def _around_ball(t_s: float, image: Floats, background: Floats) -> Frame | None:
    """The part around what differs most from the background; None where it leaves the image, or nothing differs."""
    import cv2

    changed = (np.abs(image - background) > CHANGE).astype(np.uint8)
    count, _, boxes, _ = cv2.connectedComponentsWithStats(changed)
    if count < 2:
        return None
    x, y, width, height = (int(value) for value in max(boxes[1:], key=lambda box: int(box[4]))[:4])
    half = math.ceil(MARGIN * max(width, height) / 2 + MARGIN_PX)
    x0, y0 = x + width // 2 - half, y + height // 2 - half
    rows, columns = slice(y0, y0 + 2 * half), slice(x0, x0 + 2 * half)
    if x0 < 0 or y0 < 0 or x0 + 2 * half > image.shape[1] or y0 + 2 * half > image.shape[0]:
        return None
    return Frame(t_s, image[rows, columns], background[rows, columns], x0, y0)


def frame_camera_beside(path: Path, size_px: tuple[int, int]) -> tuple[Camera, Floats]:
    """The frame camera, and the rotation (3, 3) from the event camera's frame to its own.

    `path` is the file of `spinscope calibrate stereo`. Raises RecordingError.
    """
    if not path.is_file():
        raise RecordingError(f"the frame camera is not calibrated: `spinscope calibrate stereo` writes {path.name}")
    try:
        tables = toml_tables(path.read_text(encoding="utf-8"))
        camera = Camera.of(CameraParameters().with_values(tables["frame_camera"]), *size_px)
        return camera, np.array(tables["stereo"]["rotation"], np.float64).reshape(3, 3)
    except (OSError, KeyError, TypeError, ValueError, ParameterError) as error:
        raise RecordingError(f"this is no file of `spinscope calibrate stereo` ({error}): {path}") from error
