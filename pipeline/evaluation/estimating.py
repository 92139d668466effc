"""The pipeline under evaluation: from a rendered recording to rows of errors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..chain import Chain, EventsInMemory
from ..registry import Parameters, methods
from ..results import Truth
from ..shots import Shot, ShotLog
from .rendering import Rendered
from .tables import Cell, Row, share, summary, where

LOGO = 2  # the truth's label of the logo's events
BEST = "best"  # what the program itself trusts


def source_of(recording: Rendered, window_us: tuple[int, int] | None = None) -> EventsInMemory:
    """The recording, or a window of it: nothing outside may be used."""
    start_us, end_us = window_us or (0, recording.duration_us)
    return EventsInMemory(
        (recording.identity, start_us, end_us),
        recording.events.between(start_us, end_us),
        recording.width_px,
        recording.height_px,
        start_us,
        end_us,
    )


def shots_of(recording: Rendered, parameters: Parameters, window_us: tuple[int, int] | None = None) -> ShotLog:
    """The shots that the pipeline finds."""
    return ShotLog.of(Chain(source_of(recording, window_us)).run(parameters, forget=("surface",)))


def longest(log: ShotLog) -> Shot | None:
    """The shot that the recording is about: the one that was seen longest."""
    return max(log.shots, key=lambda shot: shot.t_us.size, default=None)


def logo_events(truth: Truth, recording: Rendered, window_us: tuple[int, int] | None = None) -> int:
    """How many events the logo made in truth."""
    first, last = np.searchsorted(recording.events.t_us, window_us or (0, recording.duration_us))
    return int(np.count_nonzero(truth.label[first:last] == LOGO))


def estimate_rows(log: ShotLog, truth: Truth, about: Row) -> list[Row]:
    """One row a method and one for `best`: its errors against the truth, or why there is no answer."""
    shot = longest(log)
    rows: list[Row] = []
    for name in (*([method.name for method in methods()] if shot is None else shot.estimates), BEST):
        method = name if name != BEST else None if shot is None else shot.best
        row: Row = {**about, "method": name, "shots": len(log.shots)}
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
            row["reason"] = log.no_shot_reason
        else:
            row["reason"] = "no method is trusted"
        rows.append(row)
    return rows


COLUMNS = ("method", "n", "success", "of those with logo", "magnitude error [rps]", "axis error [deg]")


def method_line(rows: Sequence[Row], label: str) -> tuple[Cell, ...]:
    """One method's line under COLUMNS."""
    seen = where(rows, visible=True)
    return (
        label,
        len(rows),
        summary(rows, "axis_error_deg").success,
        share(seen, _answered),
        summary(rows, "magnitude_error_rps"),
        summary(rows, "axis_error_deg"),
    )


def _answered(row: Row) -> bool:
    return row["axis_error_deg"] is not None
