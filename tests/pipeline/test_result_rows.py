"""Rows of results: numbers of the shots, the truth of the right ball, every column declared."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from spinscope.pipeline.result_rows import shot_columns, shot_rows, tick_columns, tick_rows
from spinscope.pipeline.session import Choices, Result, Session
from spinscope.pipeline.sidecar import Sidecar, StatedTruth


@pytest.fixture(scope="module")
def two_balls(samples: Path) -> Result:
    return Session.open(samples / "flight_two_balls.h5").estimate("normal_flow")


@pytest.fixture(scope="module")
def spinner(samples: Path) -> Result:
    choices = Choices(fixed_ball=(528.43, 426.87, 16.49))
    return Session.open(samples / "spinner_ball2_side.h5", choices).estimate("normal_flow")


def test_the_truth_is_that_of_the_ball_that_it_is_of(two_balls: Result) -> None:
    named, other = shot_rows(two_balls)
    assert named["true_magnitude_rps"] == pytest.approx(40) and named["truth_from"] == "simulator"
    assert named["error_rps"] == abs(named["magnitude_rps"] - named["true_magnitude_rps"])  # type: ignore[operator]
    assert named["error_deg"] == named["normal_flow_error_deg"]
    assert other["magnitude_rps"] is not None and "error_rps" not in other and other["truth_from"] is None


def test_components_follow_the_flight(two_balls: Result) -> None:
    """By hand: topspin along up x v, left sidespin along up, corkscrew along v."""
    row, shot = shot_rows(two_balls)[0], two_balls.shots[0]
    camera, radius_m = two_balls.session.camera, two_balls.session.ball_radius_m
    v, up = shot.velocity_m_s(camera, radius_m), np.array(camera.up)
    assert v is not None
    spin = np.array([row["x_rps"], row["y_rps"], row["z_rps"]], np.float64)
    across = np.cross(up, v)
    assert row["topspin_rps"] == pytest.approx(spin @ across / np.linalg.norm(across))
    assert row["sidespin_rps"] == pytest.approx(spin @ up)
    assert row["corkscrew_rps"] == pytest.approx(spin @ v / np.linalg.norm(v))
    assert row["speed_m_s"] == pytest.approx(np.linalg.norm(v))
    assert row["distance_m"] == pytest.approx(np.linalg.norm(shot.positions_m(camera, radius_m), axis=1).mean())
    assert row["kind"] == "topspin" and row["best"] == "normal_flow"


def test_every_column_is_declared_with_its_type(two_balls: Result) -> None:
    for rows, columns in ((shot_rows(two_balls), shot_columns()), (tick_rows(two_balls), tick_columns())):
        for row in rows:
            for name, value in row.items():
                assert name in columns and (value is None or type(value) is columns[name]), name


def test_rivals_have_columns_where_they_were_named() -> None:
    for columns in (shot_columns, tick_columns):
        assert not [name for name in columns() if name.startswith("eeppr_")]
        named = columns(["all", "eeppr"])
        assert set(named) > set(columns()) and named["eeppr_magnitude_rps"] is float
        assert not [name for name in named if name.startswith("s_cmax_")]


def test_ticks_of_a_shot_end_with_its_result(two_balls: Result) -> None:
    rows = tick_rows(two_balls)
    for number, (shot, row) in enumerate(zip(two_balls.shots, shot_rows(two_balls), strict=True), start=1):
        own = [one for one in rows if one["shot"] == number]
        assert [one["t_us"] for one in own] == np.rint(shot.t_us).astype(int).tolist()
        assert [one["x_px"] for one in own] == shot.state[:, 0].tolist()
        assert own[-1]["normal_flow_z_rps"] == row["normal_flow_z_rps"]
        assert shot.history is not None
        events = 0.005 * shot.history.logo_rate_hz[1:-1].sum()
        assert 0 < events <= row["logo_events"] + 1e-6  # type: ignore[operator]


def test_a_stated_magnitude_has_no_axis_to_compare_with(spinner: Result) -> None:
    session = replace(spinner.session, sidecar=Sidecar(truth=StatedTruth(spin_rps=None, rps=48.0)))
    (row,) = shot_rows(replace(spinner, session=session))
    assert row["error_rps"] == pytest.approx(abs(row["magnitude_rps"] - 48.0))  # type: ignore[operator]
    assert (row["true_x_rps"], row["true_magnitude_rps"], row["truth_from"]) == (None, 48.0, "sidecar")
    assert "error_deg" not in row and row["topspin_rps"] is None and row["fixed_ball"] is True


def test_a_stated_truth_is_of_one_shot_only(two_balls: Result) -> None:
    session = replace(two_balls.session, sidecar=Sidecar(truth=StatedTruth(spin_rps=(40.0, 0.0, 0.0), rps=40.0)))
    assert all("error_rps" not in row for row in shot_rows(replace(two_balls, session=session)))


def test_a_damaged_truth_costs_the_errors_only(samples: Path, tmp_path: Path) -> None:
    recording = tmp_path / "flight.h5"
    shutil.copy(samples / "flight_back.h5", recording)
    with h5py.File(recording, "r+") as file:
        del file["truth/spin_rps"]
    (row,) = shot_rows(Session.open(recording).estimate("triplet"))
    assert row["triplet_magnitude_rps"] is not None and "triplet_error_rps" not in row
    assert "truth" in str(row["warnings"])


def test_no_shot_is_a_row_with_its_reason(samples: Path) -> None:
    result = Session.open(samples / "spinner_ball5_back_no_logo.h5").estimate("triplet")
    (row,) = shot_rows(result)
    assert (row["shots"], row["no_shot_reason"]) == (0, result.no_shot_reason)
    assert tick_rows(result) == []
