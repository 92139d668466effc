"""Calibration of camera and table from recordings, written as presets."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from spinscope.pipeline.calibration.board import Board, BoardView, Pattern, board_views
from spinscope.pipeline.calibration.camera_calibration import calibrate_camera, focal_length_px
from spinscope.pipeline.calibration.outline_offset import MeasuredOutline, outline_offset
from spinscope.pipeline.calibration.pixel_latency import TurningDisc, pixel_latency
from spinscope.pipeline.calibration.stereo_calibration import calibrate_stereo
from spinscope.pipeline.calibration.table_pose import table_pose
from spinscope.pipeline.camera import Camera
from spinscope.pipeline.errors import ParameterError, RecordingError
from spinscope.pipeline.files import atomic_file, check_writable
from spinscope.pipeline.pictures import grey_picture
from spinscope.pipeline.presets import preset
from spinscope.pipeline.recording_folders import recordings_in
from spinscope.pipeline.recordings import ReadingOptions, open_recording
from spinscope.pipeline.recordings.trials import trial_windows_us
from spinscope.pipeline.registry import STAGES
from spinscope.pipeline.session import Choices, Progress, Session
from spinscope.pipeline.shots import ShotLog
from spinscope.pipeline.stages.track_parameters import TrackParameters
from spinscope.pipeline.toml import toml_tables

COARSE_PERCENT = 3.0  # uncertainty of a focal length of which the user is warned
LATENCY_RANGE_US, OUTLINE_RANGE_PX = 10_000.0, 5.0  # of `track.latency_us` and `track.outline_px`


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
    coarse = (
        f"warning: distances and speeds will be as uncertain, {error:.0f} %: give the circle as a picture shows it by "
        "--fixed-ball X_PX Y_PX RADIUS_PX, bring the ball nearer, or take a chessboard (--board)"
    )
    return [known, *([coarse] if error > COARSE_PERCENT else []), f"wrote {out}"]


def calibrate_table(
    corners_px: Sequence[tuple[float, float]], camera: str, size_px: tuple[int, int], out: Path
) -> list[str]:
    """Find camera.up by the table's corners and write it with the camera's preset; see `calibrate_by_board`.

    The table's frame is written beside it, for the truth of what was measured in it (`camera_frame` of a sidecar).
    """
    _check_name(out)
    parameters = preset(camera).camera
    pose = table_pose(corners_px, Camera.of(parameters, *size_px))
    stated = dataclasses.replace(parameters, up=tuple(pose.up.tolist()))
    _write(out, {name: value for name, value in stated.as_dict().items() if value is not None})
    frame = out.with_suffix(".frame.toml")
    with atomic_file(frame, "calibration") as part:
        part.write_text(tomli_w.dumps({"table": {"rotation": pose.rotation.tolist()}}))
    up = ", ".join(f"{value:.4f}" for value in pose.up)
    return [
        f"up is ({up}); the camera stands {pose.height_m:.3f} m over the table; a corner is off by "
        f"{pose.reprojection_px:.2f} px at most",
        f"wrote {out} and {frame}",
    ]


def calibrate_second_camera(
    folder: Path,
    size: tuple[int, int],
    square_mm: float,
    pattern: Pattern,
    camera: str,
    frame_camera: str | None,
    reading: ReadingOptions,
    out: Path,
) -> list[str]:
    """Find where a frame camera stands beside the event camera; see `calibrate_by_board`.

    The folder holds a recording `NAME.raw` (or of another format) and a picture `NAME.png` of the board for each pose.
    Without a preset for the frame camera the pictures calibrate it, too.
    """
    board = Board(*size, square_mm, pattern)
    _check_name(out)
    pairs: list[tuple[BoardView, BoardView]] = []
    said: list[str] = []
    sizes: set[tuple[tuple[int, int], tuple[int, int]]] = set()
    for path in recordings_in([folder]):
        try:
            picture = grey_picture(path.with_suffix(".png"))
            recording = open_recording(path, **dataclasses.asdict(reading))
            views = board_views(recording, board)
            if len(views) > 1:
                raise RecordingError(f"the board moves: keep it still for each pair of recording and picture: {path}")
            seen = board.find(picture)
            if seen is None:
                raise RecordingError(f"the board is not seen in {path.with_suffix('.png')}")
        except RecordingError as error:
            said.append(f"left out: {error}")
            continue
        pairs.append((views[0], BoardView(views[0].t_us, *seen)))
        sizes.add(((recording.width_px, recording.height_px), (picture.shape[1], picture.shape[0])))
    if len(sizes) != 1:
        wrong = "; ".join(said) or "no recordings"
        if sizes:
            wrong = (
                "sensors or pictures are of several sizes: keep those of one pair of cameras in a folder of their own"
            )
        raise RecordingError(f"the cameras cannot be calibrated: {wrong}: {folder}")
    ((event_size, frame_size),) = sizes
    if frame_camera is None:
        own = calibrate_camera([frame for _, frame in pairs], board, frame_size)
        said.append(f"frame camera: {own}")
        second = own.camera
    else:
        second = Camera.of(preset(frame_camera).camera, *frame_size)
    found = calibrate_stereo(pairs, board, Camera.of(preset(camera).camera, *event_size), second)
    found.write(out)
    return [*said, *(f"warning: {one}" for one in found.warnings), str(found), f"wrote {out}"]


def calibrate_latency(
    recordings: Sequence[Path],
    circle: tuple[float, float, float],
    channel: int | None,
    camera: str | None,
    reading: ReadingOptions,
    out: Path,
) -> list[str]:
    """Find track.latency_us by recordings of a turning disc with a trigger a turn; see `calibrate_by_board`.

    What is found is written with the preset of the camera, where one is given.
    """
    _check_name(out)
    discs = []
    for path in recordings:
        recording = open_recording(path, **dataclasses.asdict(reading))
        edges_us = np.array([start_us for start_us, _ in trial_windows_us(recording, channel=channel)], np.int64)
        discs.append(TurningDisc(recording.read(), edges_us))
    found = pixel_latency(discs, circle)
    if not 0.0 <= found.latency_us <= LATENCY_RANGE_US:
        raise RecordingError(
            f"the pixels seem to be {found.latency_us:.0f} us late: do the triggers come at the same place of the disc "
            "at each speed, and is their clock the camera's?"
        )
    _write_with(camera, {"latency_us": round(found.latency_us, 1)}, out)
    speeds = ", ".join(f"{disc.speed_rps:.1f}" for disc in discs)
    known = f"the pixels report an edge {found.latency_us:.1f} +- {found.std_us:.1f} us late (at {speeds} rps)"
    return [known, f"wrote {out}"]


def calibrate_outline(
    recordings: Sequence[Path], distances_m: Sequence[float], camera: str | None, reading: ReadingOptions, out: Path
) -> list[str]:
    """Find track.outline_px by shots at known distances from the lens; see `calibrate_latency`.

    The shots are tracked as later ones are, with the usual offset, and what their circles are too large is added to it.
    So what the events behind a ball tell of its rim is not counted twice. A recording without a shot is said and left
    out; of several shots in one the longest counts.
    """
    _check_name(out)
    usual_px = TrackParameters().outline_px
    said: list[str] = []
    outlines: list[MeasuredOutline] = []
    for path, distance_m in zip(recordings, distances_m, strict=True):
        try:
            session = Session.open(path, Choices(camera, (f"track.outline_px={usual_px}",), reading=reading))
            if not session.states_focal_length:
                raise RecordingError(f"nothing states the focal length: give --camera: {path}")
            shots = ShotLog.of(session.ticks(("track",), forget=STAGES.names)).shots
            if not shots:
                raise RecordingError(f"no shot is found in it: {path}")
        except RecordingError as error:
            said.append(f"left out: {error}")
            continue
        shot, lens = max(shots, key=lambda shot: shot.t_us.size), session.camera
        x, y, _, _, radius = shot.state[shot.measured].T
        at = int(np.argmin(np.hypot(x - lens.principal_x_px, y - lens.principal_y_px)))
        outlines.append(MeasuredOutline(float(x[at]), float(y[at]), float(radius[at]), distance_m))
    if not outlines:
        raise RecordingError("; ".join(said))
    found = outline_offset(outlines, session.ball_radius_m, lens)
    outline_px = usual_px + found.offset_px
    if not 0.0 < outline_px <= OUTLINE_RANGE_PX:
        raise RecordingError(
            f"the circles seem to be {found.offset_px:+.2f} px larger than the ball: check distances and focal length"
        )
    _write_with(camera, {"outline_px": round(outline_px, 3)}, out)
    known = (
        f"with the usual offset of {usual_px:g} px the circles are {found.offset_px:+.2f} +- {found.std_px:.2f} px "
        f"larger than the ball ({len(outlines)} shots): track.outline_px = {outline_px:.2f}; the lens's centre is "
        f"{1000 * found.farther_m:.0f} mm farther away than measured"
    )
    return [*said, known, f"wrote {out}"]


def _check_name(out: Path) -> None:
    if out.suffix != ".toml":
        raise ParameterError(f"a calibration is a TOML file: give a name that ends with .toml instead of {out}")
    check_writable(out, "calibration")


def _write_with(camera: str | None, track: dict[str, float], out: Path) -> None:
    """Write values of the stage `track` as a preset, with all that the preset of the camera states."""
    stated = {} if camera is None else toml_tables(Path(camera).read_text(encoding="utf-8"))
    with atomic_file(out, "calibration") as part:
        part.write_text(tomli_w.dumps({**stated, "track": {**stated.get("track", {}), **track}}))


def _write(out: Path, camera: dict[str, Any]) -> None:
    with atomic_file(out, "calibration") as part:
        part.write_text(tomli_w.dumps({"camera": camera}))
