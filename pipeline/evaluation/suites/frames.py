"""Suite `frames`: frame camera against event camera on the ball thrower's flights (table 2)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...errors import RecordingError
from ...results import spin_errors
from ...simulator.logos import Logo
from .. import paper
from ..estimation import COLUMNS, errors_against_stated, method_lines
from ..frame_camera import FrameCamera, frames
from ..frame_folder import FrameFolder, frame_camera_beside
from ..frame_matching import spin_from_frames
from ..lab_recordings import FLIGHT, LabRecording
from ..plots import flight_figure
from ..tables import Cell, ResultTable, Row
from ..tasks import Task, TaskContext
from ..uncertainty_calibration import ERRORS, RIGHT_NOTE, STATED
from . import thrower

LABEL = "Frame camera against event camera: the paper's table 2"
HELP = "A frame camera beside the event camera on the same flights (table 2)."

TAKES_SCENE_CHOICES = True
TAKES_RIVALS = True
REAL_KINDS = (FLIGHT,)

STEREO = "stereo.toml"  # of `spinscope calibrate stereo`
FRAME = "frame"  # the rival among the methods
# What the rival's results depend on: nothing of the event camera's pipeline.
FILES = ("rendering", "suites/thrower", "suites/frames", "frame_camera", "frame_albedo", "frame_matching")
NEEDS = ("simulator", "biases.py", *(f"evaluation/{name}.py" for name in FILES))
EVERY = 3  # every so many of the thrower's flights are taken: the rival needs seconds for each
BINS_RPS = ((0, 30), (30, 60), (60, 90), (90, 150))


def tasks(quick: bool) -> list[Task]:
    """Flights of the suite `thrower`, for both cameras."""
    chosen = thrower.flights(quick)[:1] if quick else thrower.flights(quick)[::EVERY]
    events = [Task(thrower.measure, flight) for flight in chosen]
    return events + [Task(measure, flight, needs=NEEDS) for flight in chosen]


def measure(context: TaskContext, velocity: int, spin: int, side: bool, seed: int) -> list[Row]:
    """The frame camera's errors in one flight."""
    recording, row = thrower.flight_of(context, velocity, spin, side, seed)
    scene, rival = recording.scene, FrameCamera()
    ball, seen = scene.balls[0], list(frames(scene, rival, seed))
    found, reason = spin_from_frames(seen, rival.camera, ball.radius_m, rival.rate_hz, ball.logo)
    row |= {"method": FRAME, "magnitude_error_rps": None, "axis_error_deg": None, "reason": reason}
    if found is not None:
        row["magnitude_error_rps"], row["axis_error_deg"] = spin_errors(found, recording.truth.spin_rps[0])
    return [row]


def real(context: TaskContext, recording: LabRecording) -> list[Row]:
    """The same of a real flight, of which pictures or a video lie in the folder `NAME.frames` beside `NAME.raw`.

    `stereo.toml` there or beside the recording tells of the frame camera; `logo.png` beside the recording is the
    ball's logo, the simulator's where it is absent.
    """
    folder = recording.path.with_suffix(".frames")
    if not folder.is_dir():
        raise RecordingError(f"no pictures of the frame camera: put them, named by time, or a video into {folder.name}")
    rows = thrower.real(context, recording)
    truth, session = recording.stated, recording.session
    read = FrameFolder.read(folder)
    own = folder / STEREO
    camera, rotation = frame_camera_beside(own if own.is_file() else folder.parent / STEREO, read.size_px)
    drawn = folder.parent / "logo.png"
    logo = Logo.of(str(drawn)) if drawn.is_file() else Logo()
    found, reason = spin_from_frames(read.frames, camera, session.ball_radius_m, read.rate_hz, logo)
    row = rows[0] | dict.fromkeys(("found_rps", *ERRORS, *STATED)) | {"method": FRAME, "reason": reason}
    if found is not None:
        row["found_rps"] = float(np.linalg.norm(found))
        row |= zip(ERRORS, errors_against_stated(rotation.T @ found, truth), strict=True)
    return [*rows, row]


def tables(rows: Sequence[Row]) -> list[ResultTable]:
    """Frame against event as in table 2, and by spin."""
    rows = sorted(rows, key=lambda row: row["method"] != FRAME)
    by_spin: list[tuple[Cell, ...]] = []
    for low, high in BINS_RPS:
        part = [row for row in rows if isinstance(row["rps"], float) and low <= row["rps"] < high]
        by_spin += method_lines(part, f"{low} to {high}")
    return [
        ResultTable("Frame against event: flying balls", COLUMNS, [*paper.TABLE_2, *method_lines(rows)], NOTE),
        ResultTable("Frame against event by spin", ("spin [rps]", *COLUMNS), by_spin),
    ]


NOTE = (
    "Every third of the thrower's flights. Frame: 380 frames a second, 1.5 times the resolution, 0.5 ms of exposure. "
    "The rival is stronger than the paper's (Tebbe 2020): it knows the logo that is printed on the ball, is told "
    "roughly where the ball is, so it never takes anything else for it, and fits all frames of the flight at once, "
    "where Tebbe's matches the logo of neighbouring frames. " + RIGHT_NOTE
)

figures = flight_figure
