"""Errors beside what is stated of them and asked of them."""

from __future__ import annotations

import numpy as np
import pytest

from spinscope.pipeline.evaluation.tables import Row
from spinscope.pipeline.evaluation.uncertainty_calibration import (
    Goal,
    calibration_table,
    goals,
    is_gross,
    ratios,
    refusals,
    risk_coverage,
)


def row(magnitude: float | None, axis: float | None, std: tuple[float, float] = (1.0, 1.0), method: str = "m") -> Row:
    answered = magnitude is not None
    return {
        "method": method,
        "magnitude_error_rps": magnitude,
        "axis_error_deg": axis,
        "magnitude_std_rps": std[0] if answered else None,
        "axis_std_deg": std[1] if answered else None,
    }


def test_correct_stated_errors_are_calibrated_and_small_ones_not() -> None:
    random = np.random.default_rng(3)
    rows: list[Row] = []
    for _ in range(4000):
        rows_std = float(random.uniform(0.1, 3.0))
        magnitude, axis = float(abs(random.normal(0, rows_std))), float(np.hypot(*random.normal(0, rows_std, 2)))
        rows.append(row(magnitude, axis, (rows_std, rows_std * np.sqrt(2)), "correct"))
        rows.append(row(magnitude, axis, (rows_std / 3, rows_std / 3), "too_small"))
    correct, too_small = calibration_table([("all", rows)], ["correct", "too_small"]).rows
    assert correct[:3] == ("all", "correct", 4000)
    assert np.array(correct[4:], float) == pytest.approx([0.683, 0.954, 0.674, 0.632, 0.982, 0.833], abs=0.03)
    assert float(str(too_small[4])) < 0.3
    assert ratios([row(None, None), row(2.0, 1.0)], "magnitude_error_rps", "magnitude_std_rps").tolist() == [2.0]


def test_gross_errors() -> None:
    assert [is_gross(row(*errors)) for errors in ((11.0, 1.0), (1.0, 21.0), (9.0, 19.0), (None, None))] == [
        True,
        True,
        False,
        False,
    ]


def test_goals_met_and_missed() -> None:
    rows = [row(1.0, 2.0), row(3.0, 4.0), row(None, None), row(2.0, 30.0)]
    asked = [
        Goal("met", rows, answered=0.75, rps=2.0, deg=12.0, gross=0.4),
        Goal("too few", rows, answered=0.8),
        Goal("too far", rows, deg=11.0),
        Goal("too gross", rows, gross=0.1),
        Goal("too few but near", rows, answered=0.8, deg=13.0),
        Goal("should refuse", rows, answered=0.0, refuse=True),
        Goal("refuses", [row(None, None)], answered=0.0, refuse=True),
        Goal("nothing there", []),
    ]
    table = goals("t", asked, "")
    assert [line[0] for line in table.rows] == [goal.what for goal in asked[:-1]]
    assert [line[-1] for line in table.rows] == ["yes", "no", "no", "no", "no", "no", "yes"]
    assert table.rows[0][1:-1] == (4, "0.750", ">= 0.75", 2.0, "<= 2", 12.0, "<= 12", pytest.approx(1 / 3), "<= 0.4")
    assert all(len(line) == len(table.columns) for line in table.rows)


def test_error_against_coverage_takes_the_surest_first() -> None:
    rows = [row(3.0, 0.0, (0.2, 1.0)), row(1.0, 0.0, (0.3, 1.0)), row(None, None), row(2.0, 0.0, (0.1, 1.0))]
    coverage, error = risk_coverage(rows, "magnitude_error_rps", "magnitude_std_rps")
    assert coverage.tolist() == [0.25, 0.5, 0.75]
    assert error.tolist() == [2.0, 2.5, 2.0]


def test_refusals_are_counted_by_reason_where_the_logo_is_visible() -> None:
    rows = [row(1.0, 1.0) | {"visible": True, "reason": None}]
    for reason, visible in (
        ("rival: a", True),
        ("rival: b", True),
        ("no logo: 3 events", True),
        ("flow says (3, 1) rps", True),
        ("no logo", False),
    ):
        rows.append(row(None, None) | {"visible": visible, "reason": reason})
    assert refusals([("all", rows)], "m").rows == [
        ("all", "rival", 2, 0.4),
        ("all", "no logo", 1, 0.2),
        ("all", "flow says", 1, 0.2),
    ]
