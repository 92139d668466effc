"""Estimates of the pipeline under evaluation, and the rows of their errors."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..api import estimate
from ..recordings.in_memory import RecordingInMemory
from ..registry import Parameters, methods
from ..results import Truth
from ..session import Result
from ..shots import Shot
from ..simulator.sensor import LOGO
from .rendering import RenderedRecording
from .tables import Cell, Row, share, summary, where
from .uncertainty_calibration import is_answer

Floats = NDArray[np.float64]

BEST = "best"  # what the program itself trusts


def estimated(recording: RenderedRecording, parameters: Parameters, window_us: tuple[int, int] | None = None) -> Result:
    """The shots that the pipeline finds in the recording, or in a window of it, and their spins."""
    in_memory = RecordingInMemory(recording.events, recording.width_px, recording.height_px)
    return estimate(in_memory, parameters, window_us=window_us or (0, recording.duration_us))


def longest(result: Result) -> Shot | None:
    """The shot that the recording is about: the one that was seen longest."""
    return max(result.shots, key=lambda shot: shot.t_us.size, default=None)


def logo_events(recording: RenderedRecording, window_us: tuple[int, int] | None = None) -> int:
    """Number of events of the logo according to the truth."""
    first, last = np.searchsorted(recording.events.t_us, window_us or (0, recording.duration_us))
    return int(np.count_nonzero(recording.truth.label[first:last] == LOGO))


def estimate_rows(result: Result, truth: Truth, about: Row) -> list[Row]:
    """One row a method and one for `best`: its errors against the truth, or why there is no answer."""
    shot = longest(result)
    rows: list[Row] = []
    for name in (*([method.name for method in methods()] if shot is None else shot.estimates), BEST):
        method = name if name != BEST else None if shot is None else shot.best
        row: Row = {**about, "method": name, "shots": len(result.shots)}
        errors = None if shot is None or method is None else shot.error_against(truth, method)
        row |= {
            "magnitude_error_rps": None if errors is None else errors[0],
            "axis_error_deg": None if errors is None else errors[1],
            "magnitude_std_rps": None,
            "axis_std_deg": None,
            "reason": None,
        }
        if shot is not None and method is not None:
            estimate = shot.estimates[method]
            row["magnitude_std_rps"], row["axis_std_deg"] = estimate.magnitude_std_rps, estimate.axis_std_deg
            row["reason"] = estimate.reason
        elif shot is None:
            row["reason"] = result.no_shot_reason
        else:
            row["reason"] = "no method is trusted"
        rows.append(row)
    return rows


def spin_errors(found_rps: Floats, true_rps: Floats) -> tuple[float, float]:
    """Error of the magnitude in rps and angle between the signed axes in degrees of two (3,) spins in rps."""
    size, true_size = float(np.linalg.norm(found_rps)), float(np.linalg.norm(true_rps))
    cosine = float(found_rps @ true_rps) / max(size * true_size, 1e-9)
    return abs(size - true_size), math.degrees(math.acos(min(max(cosine, -1.0), 1.0)))


COLUMNS = ("method", "n", "success", "of those with logo", "magnitude error [rps]", "axis error [deg]")


def method_line(rows: Sequence[Row], label: str) -> tuple[Cell, ...]:
    """One method's line under COLUMNS."""
    seen = where(rows, visible=True)
    return (
        label,
        len(rows),
        summary(rows, "axis_error_deg").success,
        share(seen, is_answer),
        summary(rows, "magnitude_error_rps"),
        summary(rows, "axis_error_deg"),
    )
