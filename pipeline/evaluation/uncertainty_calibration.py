"""Calibration of the stated uncertainties, risk-coverage curves, and required quality of the answers."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..results import SpinEstimate
from .tables import Cell, ResultTable, Row, share, where

GROSS_RPS, GROSS_DEG = 10.0, 20.0  # an error beyond one of these is gross
RIGHT_SHARE, RIGHT_DEG = 0.1, 20.0  # largest errors of an answer that counts as right
# A flight alone tells the magnitude to a share only: its answer is right within so many of its stated errors, if the
# magnitude is stated to a third and the axis to RIGHT_DEG.
STATED_SIGMAS, STATED_SHARE = 2.0, 1.0 / 3.0
FLIGHT_NOTE = (
    f"Where the program answers by the flight alone: within {STATED_SIGMAS:g} of the stated errors, which are a third "
    f"of the magnitude and {RIGHT_DEG:g} degrees at most."
)
RIGHT_NOTE = f"Right: within {RIGHT_SHARE:.0%} of the magnitude and {RIGHT_DEG:g} degrees of the axis."
ERRORS = ("magnitude_error_rps", "axis_error_deg")  # columns of the rows
STATED = ("magnitude_std_rps", "axis_std_deg")
# Errors stated of the truth itself, by those of the answer; a simulated truth has none.
OF_TRUTH = dict(zip(STATED, ("truth_std_rps", "truth_axis_std_deg"), strict=True))


def is_answer(row: Row) -> bool:
    """Whether there is an estimate in the row."""
    return row["magnitude_error_rps"] is not None


def is_gross(row: Row) -> bool:
    """Whether an answer is far off."""
    magnitude, axis = row["magnitude_error_rps"], row["axis_error_deg"]
    return isinstance(magnitude, float) and (magnitude > GROSS_RPS or (isinstance(axis, float) and axis > GROSS_DEG))


def is_right(row: Row) -> bool:
    """Whether there is an answer near the truth, of `rps`; by the magnitude alone where the true axis is not known."""
    magnitude, axis, rps = row["magnitude_error_rps"], row["axis_error_deg"], row["rps"]
    if not (isinstance(magnitude, float) and isinstance(rps, float)):
        return False
    return magnitude <= RIGHT_SHARE * rps and (not isinstance(axis, float) or axis <= RIGHT_DEG)


def is_within_stated(estimate: SpinEstimate, magnitude_error_rps: float, axis_error_deg: float) -> bool:
    """Whether the stated errors of an estimate are small enough to be of use, and hold."""
    magnitude, std, axis_std = estimate.magnitude_rps, estimate.magnitude_std_rps, estimate.axis_std_deg
    if magnitude is None or std is None or axis_std is None:
        return False
    is_narrow = std <= STATED_SHARE * magnitude and axis_std <= RIGHT_DEG
    return is_narrow and magnitude_error_rps <= STATED_SIGMAS * std and axis_error_deg <= STATED_SIGMAS * axis_std


def calibration_table(groups: Sequence[tuple[str, Sequence[Row]]], methods: Sequence[str]) -> ResultTable:
    """Errors over the stated ones, by group of recordings and method."""
    lines: list[tuple[Cell, ...]] = []
    for label, rows in groups:
        for method in methods:
            answers = [row for row in where(rows, method=method) if is_answer(row)]
            if not answers:
                continue
            cells: list[Cell] = [label, method, len(answers), share(answers, is_gross)]
            for error, std in zip(ERRORS, STATED, strict=True):
                ratio = ratios(answers, error, std)
                cells += [float(np.mean(ratio <= limit)) if ratio.size else None for limit in (1, 2)]
                cells.append(float(np.median(ratio)) if ratio.size else None)
            lines.append(tuple(cells))
    quantities = [
        f"{name}{what}" for name in ("magnitude", "axis") for what in (" within 1 sigma", ", 2 sigma", ", median")
    ]
    return ResultTable(
        "Errors over the stated error (1 sigma)",
        ("recordings", "method", "answers", "gross", *quantities),
        lines,
        "Shares of the answers; the median is of the error over the stated one. Calibrated: 0.68 within 1 sigma, 0.95 "
        "within 2, median 0.67. Where the truth itself is uncertain, its error is added. The stated error of the axis "
        "is that of both its directions together (root of the trace): equal both ways it gives 0.63, 0.98 and 0.83. "
        "Gross: more than "
        f"{GROSS_RPS:g} rps or {GROSS_DEG:g} degrees off.",
    )


def ratios(rows: Sequence[Row], error: str, std: str) -> NDArray[np.float64]:
    """(k,) error over stated error, that of the truth added to it, of the rows that have both."""
    pairs = [(row[error], row[std], row.get(OF_TRUTH[std])) for row in rows]
    both = [
        (float(off), math.hypot(stated, true if isinstance(true, float) else 0.0))
        for off, stated, true in pairs
        if isinstance(off, float) and isinstance(stated, float)
    ]
    return np.array([off / max(stated, 1e-9) for off, stated in both])


@dataclass(frozen=True)
class Goal:
    """Required quality of the answers to some recordings; None = no requirement.

    Attributes
    ----------
    answered : float or None
        Smallest share of answers (largest, where `refuse`).
    rps, deg : float or None
        Largest mean absolute errors.
    gross : float or None
        Largest share of gross errors among the answers.
    refuse : bool
        Whether the logo is never seen, so that an answer is wrong.
    """

    what: str
    rows: Sequence[Row]
    answered: float | None = None
    rps: float | None = None
    deg: float | None = None
    gross: float | None = None
    refuse: bool = False


def goals(title: str, asked: Sequence[Goal], note: str) -> ResultTable:
    """Each quantity beside its goal, and whether all of them are met."""
    lines: list[tuple[Cell, ...]] = []
    for goal in asked:
        if not goal.rows:
            continue
        answers = [row for row in goal.rows if is_answer(row)]
        found = (
            (len(answers) / len(goal.rows), goal.answered, not goal.refuse),
            (_mean(answers, "magnitude_error_rps"), goal.rps, False),
            (_mean(answers, "axis_error_deg"), goal.deg, False),
            (share(answers, is_gross), goal.gross, False),
        )
        cells: list[Cell] = [goal.what, len(goal.rows)]
        met = True
        for value, limit, at_least in found:
            # Three digits, so that a goal missed by a hair is seen to be missed.
            cells.append(f"{value:.3f}" if at_least and value is not None else value)
            cells.append(None if limit is None else f"{'>=' if at_least else '<='} {limit:g}")
            if limit is not None and value is not None:
                met = met and (value >= limit if at_least else value <= limit)
        lines.append((*cells, "yes" if met else "no"))
    quantities = ("answered", "magnitude error [rps]", "axis error [deg]", "gross")
    return ResultTable(title, ("recordings", "n", *(c for q in quantities for c in (q, "goal")), "met"), lines, note)


def refusals(groups: Sequence[tuple[str, Sequence[Row]]], method: str) -> ResultTable:
    """Number and share of refusals where the logo is visible, by the stated reason."""
    lines: list[tuple[Cell, ...]] = []
    for label, rows in groups:
        visible = where(rows, method=method, visible=True)
        if not visible:
            continue
        said = (str(row["reason"]) for row in visible if not is_answer(row))
        reasons = Counter(re.split(r"[:(\d]", reason)[0].strip() for reason in said)  # without the numbers
        lines += [(label, reason, count, count / len(visible)) for reason, count in reasons.most_common()]
        if not reasons:
            lines.append((label, "it never does", 0, None))
    note = "The logo's events may all lie so near the outline that the pipeline takes them for the outline's."
    return ResultTable(
        f"Why `{method}` refuses where the logo is visible", ("recordings", "reason", "n", "share"), lines, note
    )


def _mean(rows: Sequence[Row], name: str) -> float | None:
    values = [value for row in rows if isinstance(value := row[name], float)]
    return float(np.mean(values)) if values else None


def risk_coverage(rows: Sequence[Row], error: str, std: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(coverage 0..1, mean error) when only the answers with the smallest stated errors are given."""
    pairs = [(row[std], row[error]) for row in rows]
    both = sorted((float(s), float(e)) for s, e in pairs if isinstance(s, float) and isinstance(e, float))
    errors = np.array([e for _, e in both])
    count = np.arange(1, errors.size + 1)
    return count / max(len(rows), 1), np.cumsum(errors) / count
