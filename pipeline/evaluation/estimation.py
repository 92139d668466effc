"""Estimates of the pipeline under evaluation, and the rows of their errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..api import estimate
from ..chain import Chain
from ..event_source import EventsInMemory
from ..presets import preset
from ..recordings.in_memory import RecordingInMemory
from ..registry import Parameters, methods
from ..results import Truth, spin_errors
from ..session import Result
from ..shots import Shot
from ..sidecar import StatedTruth
from ..simulator import SimulatedRecording
from ..simulator.sensor import LOGO
from .tables import Cell, Row, distinct, share, summary, where
from .uncertainty_calibration import ERRORS, OF_TRUTH, STATED, is_answer, is_right

BEST = "best"  # what the program itself trusts
PAPER_METHOD = "triplet"
PAPER_PRESET = "triplet, paper preset"  # the paper's method behind the paper's own filters, surface, logo and rate

PRESET_NOTE = (
    f"'{PAPER_PRESET}': the paper's method with the settings that the paper states; all other rows run with ours. "
)


def estimated(
    recording: SimulatedRecording,
    parameters: Parameters,
    window_us: tuple[int, int] | None = None,
    rivals: Sequence[str] = (),
) -> Result:
    """The shots that the pipeline finds in the recording, or in a window of it, and their spins, also by rivals."""
    in_memory = RecordingInMemory(recording.events, recording.width_px, recording.height_px)
    return estimate(in_memory, parameters, window_us=window_us or (0, recording.duration_us), rivals=rivals)


def chain_over(recording: SimulatedRecording, end_us: int | None = None, **options: Any) -> Chain:
    """A chain over all events of the recording, or up to a time."""
    end_us = recording.duration_us if end_us is None else end_us
    size = recording.width_px, recording.height_px
    return Chain(EventsInMemory("simulation", recording.events, *size, 0, end_us), **options)


def longest(result: Result) -> Shot | None:
    """The shot that the recording is about: the one that was seen longest."""
    return max(result.shots, key=lambda shot: shot.t_us.size, default=None)


def logo_events(recording: SimulatedRecording, window_us: tuple[int, int] | None = None) -> int:
    """Number of events of the logo according to the truth."""
    first, last = np.searchsorted(recording.events.t_us, window_us or (0, recording.duration_us))
    return int(np.count_nonzero(recording.truth.label[first:last] == LOGO))


def estimate_rows(result: Result, truth: Truth | StatedTruth, about: Row) -> list[Row]:
    """One row a method and one for `best`: its errors against the truth, or why there is no answer."""
    shot = longest(result)
    rows: list[Row] = []
    run = result.session.chain.stages
    for name in (*(method.name for method in methods() if method.name in run), BEST):
        method = name if name != BEST or shot is None else shot.best
        rows.append(_estimate_row(result, method, truth, {**about, "method": name}))
    return rows


def rows_of_both_presets(result: Result, truth: Truth | StatedTruth, about: Row) -> list[Row]:
    """Rows of `estimate_rows`, and one of the paper's method with the paper's preset over the same events."""
    session = result.session
    of_paper = preset("paper").with_groups(camera=session.parameters.camera, ball=session.parameters.ball)
    track = session.parameters.track
    circle = {name: getattr(track, name) for name in track.tunables() if name == "ball" or name.startswith("fixed_")}
    chain = Chain(session.source)  # without rivals
    paper = replace(session, parameters=of_paper.with_values({"track": circle}), chain=chain).estimate(PAPER_METHOD)
    about_paper = {**about, "method": PAPER_PRESET}
    return [*estimate_rows(result, truth, about), _estimate_row(paper, PAPER_METHOD, truth, about_paper)]


def _estimate_row(result: Result, method: str | None, truth: Truth | StatedTruth, about: Row) -> Row:
    """The row of one method (None: none is trusted) in the longest shot."""
    row: Row = {
        **about,
        "shots": len(result.shots),
        **dict.fromkeys(("found_rps", *ERRORS, *STATED, *OF_TRUTH.values(), "reason")),
    }
    if isinstance(truth, StatedTruth):
        row |= zip(OF_TRUTH.values(), (truth.spin_std_rps, truth.axis_std_deg), strict=True)
    shot = longest(result)
    if shot is None:
        row["reason"] = result.no_shot_reason
    elif method is None:
        row["reason"] = "no method is trusted"
    else:
        found = shot.estimates[method]
        row |= zip(ERRORS, _errors(shot, method, truth), strict=True)
        row |= zip((*STATED, "reason"), (found.magnitude_std_rps, found.axis_std_deg, found.reason), strict=True)
        row["found_rps"] = found.magnitude_rps
    return row


def _errors(shot: Shot, method: str, truth: Truth | StatedTruth) -> tuple[float | None, float | None]:
    """Errors of magnitude in rps and axis in degrees; None where the method refuses, or the true axis is not known."""
    if isinstance(truth, Truth):
        return shot.error_against(truth, method) or (None, None)
    found = shot.estimates[method].vector_rps
    return (None, None) if found is None else errors_against_stated(found, truth)


def errors_against_stated(found_rps: NDArray[np.float64], truth: StatedTruth) -> tuple[float, float | None]:
    """Errors of magnitude in rps and axis in degrees of a spin (3,); None where the true axis is not known."""
    if truth.spin_rps is None or not truth.rps:
        return abs(float(np.linalg.norm(found_rps)) - truth.rps), None
    return spin_errors(found_rps, np.array(truth.spin_rps))


COLUMNS = ("method", "n", "success", "right", "of those with logo", "magnitude error [rps]", "axis error [deg]")


def method_lines(rows: Sequence[Row], *labels: Cell) -> list[tuple[Cell, ...]]:
    """One line a method under these labels and COLUMNS; right: near the truth, see `is_right`."""
    lines: list[tuple[Cell, ...]] = []
    for method in distinct(rows, "method"):
        part = where(rows, method=method)
        magnitude, axis = (summary(part, name) for name in ERRORS)
        seen = share(where(part, visible=True), is_answer)
        lines.append((*labels, method, len(part), magnitude.success, share(part, is_right), seen, magnitude, axis))
    return lines
