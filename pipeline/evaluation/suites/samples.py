"""Suite `samples`: the methods, and the paper's with its own preset, on the samples of an independent simulator."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...errors import RecordingError
from ...session import SAMPLES, Session
from ..estimation import PRESET_NOTE, rows_of_both_presets
from ..plots import Figures
from ..tables import Cell, ResultTable, Row, distinct, where
from ..tasks import Task, TaskContext
from ..uncertainty_calibration import ERRORS

LABEL = "Sample recordings of an independent simulator"
HELP = "Every method, and the paper's with its own preset, on the sample recordings."

TAKES_RIVALS = True

SPINNER = "spinner"  # begins the names of a ball spinner's samples
QUICK = ("flight_back.h5",)


def tasks(quick: bool) -> list[Task]:
    """One sample a task."""
    names = [path.name for path in sorted(SAMPLES.glob("*.h5"))]
    return [Task(measure, {"sample": name}) for name in names if not quick or name in QUICK]


def measure(context: TaskContext, sample: str) -> list[Row]:
    """Every method's answer in one sample, beside its truth; of several shots the longest counts."""
    session = Session.open(SAMPLES / sample, context.choices)
    truth = session.truth
    if truth is None:
        raise RecordingError(f"the sample states no truth: install Spinscope again: {SAMPLES / sample}")
    if sample.startswith(SPINNER):
        x, y, radius = (float(column[0]) for column in (truth.x_px, truth.y_px, truth.radius_px))
        session = Session.open(SAMPLES / sample, replace(context.choices, fixed_ball=(x, y, radius)))
    rps = float(np.linalg.norm(truth.spin_rps, axis=1).mean())
    return rows_of_both_presets(session.estimate(), truth, {"sample": sample, "rps": rps})


def tables(rows: Sequence[Row]) -> list[ResultTable]:
    """The answers, sample by sample."""
    lines: list[tuple[Cell, ...]] = []
    for sample in distinct(rows, "sample"):
        for row in where(rows, sample=sample):
            names = ("method", "rps", "found_rps", *ERRORS)
            reason = row["reason"] if row["found_rps"] is None else None
            lines.append((sample, *(row[name] for name in names), reason))
    quantities = ("true spin [rps]", "found [rps]", "magnitude error [rps]", "axis error [deg]", "refused")
    columns = ("recording", "method", *quantities)
    return [ResultTable("Sample recordings", columns, lines, PRESET_NOTE.strip())]


def figures(rows: Sequence[Row]) -> Figures:
    """None: a handful of recordings makes no curve."""
    return {}
