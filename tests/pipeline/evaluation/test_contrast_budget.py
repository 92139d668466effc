"""The error budget of contrast: its tables from made-up rows, and one shot in every case against the chain."""

from __future__ import annotations

import numpy as np
import pytest

from spinscope.pipeline.evaluation import TaskContext
from spinscope.pipeline.evaluation.estimation import estimated, longest
from spinscope.pipeline.evaluation.rendering import render
from spinscope.pipeline.evaluation.suites.contrast_budget import CASES, figures, measure, scene_of, tables, tasks
from spinscope.pipeline.evaluation.suites.spinner import known_circle
from spinscope.pipeline.evaluation.tables import Row, Summary
from spinscope.pipeline.registry import Parameters
from spinscope.pipeline.results import spin_errors


def made_up(kind: str, number: int, case: str, magnitude: float | None, axis: float | None) -> Row:
    row: Row = {"kind": kind, "number": number, "case": case, "method": "contrast"}
    row |= {"magnitude_error_rps": magnitude, "axis_error_deg": axis}
    return row | {"magnitude_std_rps": 0.015, "axis_std_deg": 1.5}


ROWS = [
    made_up(kind, number, case, 0.01 * (number + 1), 1.0 + number - 0.1 * step)
    for kind in ("flight", "spinner")
    for number in range(2)
    for step, case in enumerate(CASES)
]


def test_the_budget_holds_every_case_over_the_shots_that_all_answer() -> None:
    refused = [made_up("flight", 2, case, *((None, None) if case == CASES[3] else (1.0, 1.0))) for case in CASES]
    gross = [made_up("flight", 3, case, 1.0, 21.0 if case == CASES[0] else 1.0) for case in CASES]
    flights, spinners, calibration = tables([*ROWS, *refused, *gross])
    assert flights.title == "Error of `contrast`: 2 flights" and spinners.title == "Error of `contrast`: 2 spinners"
    assert [row[0] for row in flights.rows] == list(CASES)
    magnitude, axis = flights.rows[2][1:]
    assert isinstance(magnitude, Summary) and isinstance(axis, Summary)
    assert (magnitude.count, magnitude.mean) == (2, pytest.approx(0.015))
    assert axis.mean == pytest.approx(1.3)
    assert [row[:3] for row in calibration.rows] == [("flights", "contrast", 4), ("spinners", "contrast", 2)]
    assert calibration.rows[1][3:] == pytest.approx((0.0, 0.5, 1.0, 1.0, 0.5, 1.0, 1.0))
    assert set(figures(ROWS)) == {"coverage"}


def test_spin_errors() -> None:
    assert spin_errors(np.array([0.0, 3.0, 0.0]), np.array([0.0, 0.0, -4.0])) == pytest.approx((1.0, 90.0))
    assert spin_errors(np.array([0.0, 0.0, 4.0]), np.array([0.0, 0.0, -4.0])) == pytest.approx((0.0, 180.0))


def test_every_case_takes_away_its_source_of_error() -> None:
    rows = {str(row["case"]): row for row in measure(TaskContext(), "spinner", 0)}
    assert list(rows) == list(CASES) and len(tasks(False)) == 30 and len(tasks(True)) == 2
    # As it is: the estimate of the chain itself, found here by another way.
    scene, seed = scene_of("spinner", 0)
    recording = render(TaskContext(), scene, seed=seed)
    parameters = Parameters().with_values({"track": known_circle(recording.truth, seed)})
    shot = longest(estimated(recording, parameters, (0, int(recording.truth.t_us[-1]))))
    assert shot is not None and (expected := shot.error_against(recording.truth, "contrast")) is not None
    as_it_is = rows[CASES[0]]
    assert (as_it_is["magnitude_error_rps"], as_it_is["axis_error_deg"]) == pytest.approx(expected, rel=1e-6)
    assert as_it_is["axis_std_deg"] == shot.estimates["contrast"].axis_std_deg
    # The other cases differ from it: the start hardly, the true circle and the prompt pixels by much.
    errors = [float(str(rows[case]["axis_error_deg"])) for case in CASES]
    assert 0 < abs(errors[1] - errors[0]) < 0.02
    assert errors[3] < errors[2] < errors[1] - 0.1
    assert max(errors) < 2.0 and max(float(str(row["magnitude_error_rps"])) for row in rows.values()) < 0.02
