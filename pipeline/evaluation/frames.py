"""Suite `frames`: frame camera against event camera on the ball thrower's flights (table 2)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..simulator import thrown
from . import paper, thrower
from .estimating import COLUMNS, method_line
from .frame_camera import FrameCamera, frames
from .frame_matching import spin_from_frames
from .tables import Cell, Row, Table, distinct, where
from .work import Bench, Task

FRAME = "frame"  # the rival among the methods
# What the rival's results depend on: nothing of the event camera's pipeline.
NEEDS: tuple[str, ...] = ("simulator", "biases.py", "evaluation/thrower.py", "evaluation/rendering.py")
NEEDS += tuple(f"evaluation/{name}.py" for name in ("frames", "frame_camera", "frame_ink", "frame_matching"))
EVERY = 3  # every so many of the thrower's flights are taken: the rival needs seconds for each
BINS_RPS = ((0, 30), (30, 60), (60, 90), (90, 150))


def tasks(quick: bool) -> list[Task]:
    """Flights of the suite `thrower`, for both cameras."""
    flights = thrower.thrower_tasks(quick)
    own = [
        Task(measure, {"velocity": velocity, "spin": spin, "side": side, "seed": seed}, needs=NEEDS)
        for velocity, spin, side, seed in thrower.settings(quick)
    ]
    return flights[:1] + own[:1] if quick else flights[::EVERY] + own[::EVERY]


def measure(bench: Bench, velocity: int, spin: int, side: bool, seed: int) -> list[Row]:
    """The frame camera's errors in one flight."""
    recording = thrower.flight_of(bench, velocity, spin, side, seed)
    scene = thrown(velocity, spin, side=side, seed=seed)
    rival = FrameCamera()
    found, reason = spin_from_frames(
        list(frames(scene, rival, seed)), rival.camera, scene.balls[0].radius_m, rival.rate_hz, scene.balls[0].logo
    )
    row = thrower.about_flight(recording, velocity, spin, side, seed)
    row |= {"method": FRAME, "magnitude_error_rps": None, "axis_error_deg": None, "reason": reason}
    if found is not None:
        true = recording.truth.spin_rps[0]
        size, true_size = float(np.linalg.norm(found)), float(np.linalg.norm(true))
        row["magnitude_error_rps"] = abs(size - true_size)
        cosine = float(found @ true) / max(size * true_size, 1e-9)
        row["axis_error_deg"] = math.degrees(math.acos(min(max(cosine, -1.0), 1.0)))
    return [row]


def tables(rows: Sequence[Row]) -> list[Table]:
    """Frame against event as in table 2, and by spin."""
    methods = sorted(distinct(rows, "method"), key=lambda method: method != FRAME)
    lines: list[tuple[Cell, ...]] = [
        (f"paper, {name}", None, success, None, magnitude, axis)
        for name, (success, magnitude, axis) in paper.TABLE_2.items()
    ]
    lines += [method_line(where(rows, method=method), method) for method in methods]
    by_spin: list[tuple[Cell, ...]] = []
    for low, high in BINS_RPS:
        part = [row for row in rows if isinstance(row["rps"], float) and low <= row["rps"] < high]
        by_spin += [
            (f"{low} to {high}", *method_line(where(part, method=m), m)) for m in methods if where(part, method=m)
        ]
    return [
        Table("Frame against event: flying balls", COLUMNS, lines, NOTE),
        Table("Frame against event by spin", ("spin [rps]", *COLUMNS), by_spin),
    ]


NOTE = (
    "Every third of the thrower's flights. Frame: 380 frames a second, 1.5 times the resolution, 0.5 ms of exposure. "
    "The rival is stronger than the paper's (Tebbe 2020): it knows the logo that is printed on the ball, is told "
    "roughly where the ball is, so it never takes anything else for it, and fits all frames of the flight at once, "
    "where Tebbe's matches the logo of neighbouring frames."
)
