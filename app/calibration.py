"""Calibration of camera and table from recordings, written as presets."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import tomli_w

from spinscope.pipeline.calibration.board import Board, BoardView, Pattern, board_views
from spinscope.pipeline.calibration.camera_calibration import calibrate_camera, focal_length_px
from spinscope.pipeline.calibration.table_pose import table_pose
from spinscope.pipeline.camera import Camera
from spinscope.pipeline.errors import ParameterError, RecordingError
from spinscope.pipeline.files import atomic_file, check_writable
from spinscope.pipeline.presets import preset
from spinscope.pipeline.recordings import ReadingOptions, open_recording
from spinscope.pipeline.session import Choices, Progress, Session


def calibrate_by_board(
    recordings: Sequence[Path],
    size: tuple[int, int],
    square_mm: float,
    pattern: Pattern,
    pixel_um: float,
    reading: ReadingOptions,
    out: Path,
    on_progress: Progress | None = None,
) -> list[str]:
    """Calibrate a camera by recordings of a blinking board and write preset and coverage; what to tell the user.

    A recording in which the board is not seen is said and left out; raises SpinscopeError where none is of use.
    """
    board = Board(*size, square_mm, pattern)
    _check_name(out)
    views: list[BoardView] = []
    said: list[str] = []
    of_sensor: tuple[int, int] | None = None
    for number, path in enumerate(recordings):
        try:
            recording = open_recording(path, **dataclasses.asdict(reading))
            own = recording.width_px, recording.height_px
            if of_sensor not in (None, own):
                raise RecordingError(f"its sensor is {own[0]} x {own[1]} px, the first one's another: {path}")
            views += board_views(recording, board)
            of_sensor = own
        except RecordingError as error:
            said.append(f"left out: {error}")
        if on_progress:
            on_progress((number + 1) / len(recordings), f"{len(views)} views of the board")
    if of_sensor is None:
        raise RecordingError("; ".join(said))
    found = calibrate_camera(views, board, of_sensor, pixel_um)
    found.write(out)
    picture = out.with_suffix(".png")
    with atomic_file(picture, "coverage") as part:
        part.write_bytes(found.coverage_png())
    return [*said, *(f"warning: {one}" for one in found.warnings), str(found), f"wrote {out} and {picture}"]


def calibrate_by_ball(
    recording: Path,
    distance_m: float,
    ball_mm: float,
    fixed_ball: tuple[float, float, float] | str,
    pixel_um: float,
    reading: ReadingOptions,
    out: Path,
) -> list[str]:
    """Find the focal length by a ball of known size at a known distance; see `calibrate_by_board`."""
    _check_name(out)
    session = Session.open(recording, Choices(fixed_ball=fixed_ball, reading=reading))
    track = session.parameters.track
    circle = track.fixed_x_px, track.fixed_y_px, track.fixed_radius_px
    x, y, radius = (float(value) for value in circle if value is not None)
    focal_px = focal_length_px((x, y, radius), distance_m, ball_mm / 2000.0, session.camera)
    focal_mm, error = focal_px * pixel_um / 1000.0, 100 * track.fixed_std_px / radius
    _write(out, {"focal_length_mm": focal_mm, "pixel_um": pixel_um})
    known = f"focal length {focal_mm:.3f} mm +- {error:.1f} % by the circle's radius of {radius:.2f} px"
    return [known, f"wrote {out}"]


def calibrate_table(
    corners_px: Sequence[tuple[float, float]], camera: str, size_px: tuple[int, int], out: Path
) -> list[str]:
    """Find camera.up by the table's corners and write it with the camera's preset; see `calibrate_by_board`."""
    _check_name(out)
    parameters = preset(camera).camera
    pose = table_pose(corners_px, Camera.of(parameters, *size_px))
    stated = dataclasses.replace(parameters, up=tuple(pose.up.tolist()))
    _write(out, {name: value for name, value in stated.as_dict().items() if value is not None})
    up = ", ".join(f"{value:.4f}" for value in pose.up)
    return [
        f"up is ({up}); the camera stands {pose.height_m:.3f} m over the table; a corner is off by "
        f"{pose.reprojection_px:.2f} px at most",
        f"wrote {out}",
    ]


def _check_name(out: Path) -> None:
    if out.suffix != ".toml":
        raise ParameterError(f"a calibration is a TOML file: give a name that ends with .toml instead of {out}")
    check_writable(out, "calibration")


def _write(out: Path, camera: dict[str, Any]) -> None:
    with atomic_file(out, "calibration") as part:
        part.write_text(tomli_w.dumps({"camera": camera}))
