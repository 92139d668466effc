"""`analyze` against the contract's schema and the simulator's truth, as a process and in this one."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import h5py
import jsonschema
import numpy as np
import pytest
from click.testing import CliRunner

from spinscope.app.analysis import analyzed, implausible_speed, report_on
from spinscope.app.cli import cli
from spinscope.app.commands.analyze import PrintedRecording, print_shots
from spinscope.pipeline import calibrate_flights, estimate
from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.flight_calibration import estimate_with_measured_up
from spinscope.pipeline.recordings import open_recording, write_recording
from spinscope.pipeline.result_rows import shot_rows
from spinscope.pipeline.session import Choices, Result, Session
from spinscope.pipeline.stages.logo import LogoParameters
from tests.command_line import spinscope

SCHEMA = json.loads((Path(__file__).parent / "analyze.schema.json").read_text(encoding="utf-8"))
FLIGHTS = (
    "flight_slow_top",
    "flight_back",
    "flight_fast_top",
    "flight_side",
    "flight_mixed",
    "flight_two_balls",
)


@pytest.fixture(scope="module")
def reports(samples: Path) -> dict[str, dict[str, Any]]:
    command = [sys.executable, "-m", "spinscope", "analyze", *(str(samples / f"{name}.h5") for name in FLIGHTS)]
    done = subprocess.run([*command, "--json", "-"], capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stderr
    return dict(zip(FLIGHTS, map(json.loads, done.stdout.splitlines()), strict=True))


@pytest.mark.parametrize("name", FLIGHTS)
def test_reports_keep_the_schema(reports: dict[str, dict[str, Any]], name: str) -> None:
    jsonschema.validate(reports[name], SCHEMA)
    for shot in reports[name]["shots"]:
        lengths = {key: len(column) for key, column in shot["track"].items()}
        assert len(set(lengths.values())) == 1, lengths
        assert {"began_by", "ended_by"} <= set(shot)
        assert (shot["best"] is None) == bool(shot["best_reason"]), "where none is trusted it says why"


@pytest.mark.parametrize("name", FLIGHTS)
def test_track_and_speed_are_the_truths(reports: dict[str, dict[str, Any]], samples: Path, name: str) -> None:
    """What the README promises: centre to 0.3 px, radius to 0.5 px, while the whole ball is in view."""
    with h5py.File(samples / f"{name}.h5") as file:
        t, x, y, r = (file[f"truth/{key}"][:] for key in ("t_us", "x_px", "y_px", "radius_px"))
        velocity = file["truth/velocity_m_s"][:]
    assert len(reports[name]["shots"]) == (2 if name == "flight_two_balls" else 1)
    shot = reports[name]["shots"][0]
    track = {key: np.array(column) for key, column in shot["track"].items()}
    true_x, true_y, true_r = (np.interp(track["t_us"], t, column) for column in (x, y, r))
    whole = (true_x > true_r) & (true_x < 1279 - true_r) & (true_y > true_r) & (true_y < 719 - true_r)
    error = np.hypot(track["x_px"] - true_x, track["y_px"] - true_y)[whole]
    assert error.mean() <= 0.3
    assert np.abs(track["radius_px"] - true_r)[whole].mean() <= 0.5
    assert shot["speed_m_s"] == pytest.approx(np.linalg.norm(velocity, axis=1).mean(), rel=0.05)


def test_a_ball_faster_than_any_is_warned_of() -> None:
    def warnings(*speeds_m_s: float) -> str:
        parameters = SimpleNamespace(track=SimpleNamespace(ball="flying"))
        session: Any = SimpleNamespace(camera=None, ball_radius_m=0.02, parameters=parameters)
        shots: Any = [SimpleNamespace(velocity_m_s=lambda *_, v=v: np.array([0.0, v, 0.0])) for v in speeds_m_s]
        return " ".join(implausible_speed(Result(session, tuple(shots), None)))

    assert "8000 m/s" in warnings(8.0, 8000.0) and "--time-unit" in warnings(8000.0)
    assert not warnings(8.0, 33.0) and not warnings()


def test_times_that_no_camera_sends_are_not_analyzed(tmp_path: Path) -> None:
    """A ball of 0.1 s whose nanoseconds are taken as microseconds would be 100 s of nothing."""
    t_ns = np.arange(2000) * 50_001
    np.savez(tmp_path / "ns.npz", t=t_ns, x=t_ns % 640, y=t_ns % 480, p=t_ns % 2)
    for work in (analyzed, report_on):
        with pytest.raises(RecordingError, match=r"--time-unit ns \(2e\+04 a second\), or --time-unit us if that is"):
            work(tmp_path / "ns.npz", Choices(), "triplet")
    assert not open_recording(tmp_path / "ns.npz", time_unit="us").time_doubt
    t_us = t_ns // 1000 + np.repeat([0, 600_000_000], 1000)  # two shots ten minutes apart, without noise
    np.savez(tmp_path / "rare.npz", t=t_us, x=t_us % 640, y=t_us % 480, p=t_us % 2)
    rare = open_recording(tmp_path / "rare.npz")
    assert not rare.time_doubt and any("no event camera" in warning for warning in rare.warnings)


def test_an_assumed_focal_length_is_said_with_the_distance(
    reports: dict[str, dict[str, Any]], samples: Path, tmp_path: Path
) -> None:
    (warning,) = (one for one in reports["flight_fast_top"]["warnings"] if "focal length" in one)
    found = re.search(r"8 mm with pixels of 4.86 um are assumed, by which the ball is (.*) m away", warning)
    with h5py.File(samples / "flight_fast_top.h5") as file:
        distance_m = np.median(np.linalg.norm(file["truth/position_m"][:], axis=1))
    assert found and float(found[1]) == pytest.approx(distance_m, abs=0.05)
    events = open_recording(samples / "spinner_ball1_top.h5").read()
    stated: dict[str, str | float] = {"camera.focal_length_mm": 8.0}
    write_recording(tmp_path / "stated.raw", events, width_px=1280, height_px=720, attributes=stated)
    write_recording(tmp_path / "plain.raw", events, width_px=1280, height_px=720)
    assert Session.open(tmp_path / "stated.raw").states_focal_length
    assert Session.open(tmp_path / "plain.raw", Choices(assignments=["camera.focal_length_mm=8"])).states_focal_length
    assert not Session.open(tmp_path / "plain.raw").states_focal_length


def test_a_trusted_answer_is_right_and_a_hidden_logo_is_refused(
    reports: dict[str, dict[str, Any]], samples: Path
) -> None:
    for name, report in reports.items():
        shot = report["shots"][0]
        if name == "flight_side":
            assert shot["best"] is None, "no logo event in the whole recording"
        if shot["best"]:
            with h5py.File(samples / f"{name}.h5") as file:
                truth = file["truth/spin_rps"][0]
            answer = np.array(shot["spin"][shot["best"]]["vector_rps"])
            cosine = answer @ truth / np.linalg.norm(answer) / np.linalg.norm(truth)
            assert np.degrees(np.arccos(cosine)) < 20
            assert np.linalg.norm(answer) == pytest.approx(np.linalg.norm(truth), abs=10)


def test_contrast_is_best_where_the_logo_is_seen(reports: dict[str, dict[str, Any]], samples: Path) -> None:
    """To a degree or so: 5 is what the README promises of the mean."""
    for name in set(FLIGHTS) - {"flight_side"}:
        shot = reports[name]["shots"][0]
        assert list(shot["spin"]) == ["triplet", "normal_flow", "contrast", "trajectory", "combined"]
        assert shot["best"] == "contrast"
        with h5py.File(samples / f"{name}.h5") as file:
            truth = file["truth/spin_rps"][0]
        answer = np.array(shot["spin"]["contrast"]["vector_rps"])
        assert np.linalg.norm(answer) == pytest.approx(np.linalg.norm(truth), abs=1)
        assert np.linalg.norm(answer - truth) < 2 * np.sin(np.radians(5) / 2) * np.linalg.norm(truth) + 1
    assert reports["flight_side"]["shots"][0]["spin"]["contrast"]["status"] == "refused"


def test_a_window_uses_its_events_only(samples: Path) -> None:
    ball = ("--fixed-ball", 528.43, 426.87, 16.49)
    window = ("--window", 20_000, 30_000)
    done = spinscope("analyze", samples / "spinner_ball2_side.h5", *ball, *window, "--json", "-")
    report = json.loads(done.stdout)
    assert report["recording"]["duration_us"] == 10_000
    shot = report["shots"][0]
    assert (shot["start_us"], shot["end_us"]) == (20_000, 30_000)
    assert shot["speed_m_s"] == pytest.approx(0, abs=1e-9)


def test_one_method_only(samples: Path) -> None:
    """Only what it needs is run: without contrast, `best` can be normal flow."""
    chosen = ("--fixed-ball", "auto", "--method", "triplet")
    done = spinscope("analyze", samples / "spinner_ball2_side.h5", *chosen, "--json", "-")
    report = json.loads(done.stdout)
    assert list(report["shots"][0]["spin"]) == ["triplet"]
    assert report["shots"][0]["best"] is None, "triplet is never trusted"
    assert report["shots"][0]["best_reason"]
    assert any("fixed ball found" in warning for warning in report["warnings"])
    session = Session.open(samples / "flight_back.h5", Choices())
    for method, best in (("normal_flow", "normal_flow"), ("contrast", "contrast")):
        result = session.estimate(method)
        assert result.shots[0].best == best
        made = result.to_dict()["shots"][0]
        assert (list(made["spin"]), made["best"]) == ([method], best)
    assert session.chain.seconds["contrast"] > 0
    other = Session.open(samples / "flight_back.h5", Choices())
    other.estimate("triplet")
    assert not other.chain.seconds["contrast"] and not other.chain.seconds["normal_flow"], "only what it needs is run"
    assert other.chain.seconds["triplet"] > 0


def test_of_several_recordings_a_bad_one_is_named_and_the_rest_goes_on(samples: Path, tmp_path: Path) -> None:
    bad = tmp_path / "bad.h5"
    bad.write_bytes(b"")
    done = spinscope("analyze", bad, samples / "flight_side.h5", "--json", "-")
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    assert done.returncode == 2
    assert set(lines[0]) == {"schema", "recording", "error"}
    assert lines[1]["shots"]


def test_no_ball_is_an_answer_not_an_error(samples: Path) -> None:
    done = spinscope("analyze", samples / "spinner_ball5_back_no_logo.h5", "--json", "-")
    report = json.loads(done.stdout)
    assert done.returncode == 0
    assert report["shots"] == []
    assert report["no_shot_reason"]
    jsonschema.validate(report, SCHEMA)


def test_the_table_for_people_names_units_and_methods(samples: Path) -> None:
    done = spinscope("analyze", samples / "flight_slow_top.h5")
    assert done.returncode == 0
    for word in ("rps", "m/s", "triplet", "normal_flow", "contrast", "deg", "view"):
        assert word in done.stdout


def test_the_table_says_how_a_shot_began_and_ended_and_why_nothing_is_trusted(
    samples: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    result = Session.open(samples / "flight_side.h5").estimate("normal_flow")
    report = result.to_dict()
    report["shots"][0] |= {"began_by": "hit", "ended_by": "bounce"}
    print_shots([PrintedRecording(report, shot_rows(result))])
    table = capsys.readouterr().out
    assert "(from a hit, bounced)" in table
    assert f"none is trusted: {report['shots'][0]['best_reason']}" in table


def test_the_table_shows_distance_components_and_the_error_against_the_truth(samples: Path) -> None:
    done = CliRunner().invoke(cli, ["analyze", str(samples / "flight_back.h5"), "--method", "normal_flow"])
    assert "1.74 m from the camera" in done.output and "off the truth, 55.22 rps" in done.output
    row = next(line for line in done.output.splitlines() if "* normal_flow" in line)
    assert float(row.split("rps")[0].split()[-1]) < 2 and "deg" in row
    topspin, sidespin, corkscrew = re.findall(r"(?:topspin|sidespin|corkscrew) ([+-][0-9.]+)", done.output)
    assert float(topspin) < -50 and abs(float(sidespin)) < 5 and abs(float(corkscrew)) < 5


def test_a_ball_that_turns_in_place_is_recognised_and_said(samples: Path) -> None:
    arguments = ["analyze", str(samples / "spinner_ball2_side.h5"), "--method", "contrast", "--json", "-"]
    report = json.loads(CliRunner().invoke(cli, arguments).stdout)
    assert report["shots"][0]["best"] == "contrast"
    assert any("turns in place" in warning for warning in report["warnings"])


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["missing.h5"], "missing.h5"),
        (["{samples}/flight_back.h5", "{samples}/no/*.h5"], "no file fits the pattern"),
        (["{samples}/flight_back.h5", "--set", "logo.pad_px=-1"], "0 to 100 px"),
        (["{samples}/flight_back.h5", "--set", "logo.pad=1"], "did you mean pad_px"),
        (["{samples}/flight_back.h5", "--preset", "best"], "default, paper"),
        (["{samples}/flight_back.h5", "--window", 5, 5], "START_US must be below END_US"),
        (["{samples}/flight_back.h5", "--fixed-ball", "here"], "auto"),
        (["{samples}/flight_back.h5", "--fixed-ball", 5000, 5000, 3], "1280 x 720"),
        (["{samples}/flight_back.h5", "--json", "{samples}/no/such/folder/x.json"], "its folder does not exist"),
        (["{samples}/flight_back.h5", "--sensor", "big"], "WIDTHxHEIGHT"),
        (["{samples}/flight_back.h5", "--sensor", "640x480"], "640"),
        (["{samples}/flight_back.h5", "--method", "magic"], "triplet"),
        ([], "--help"),
        (["{samples}/README.md"], "README.md"),
    ],
)
def test_wrong_input_is_one_clear_line_and_status_2(samples: Path, arguments: list[object], says: str) -> None:
    done = spinscope("analyze", *(str(argument).replace("{samples}", str(samples)) for argument in arguments))
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1, done.stderr
    assert says in done.stderr
    assert done.stdout == ""


def test_a_former_name_of_a_parameter_is_taken_with_a_notice(samples: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(LogoParameters, "renamed", {"margin_px": "pad_px"})
    arguments = [str(samples / "spinner_ball5_back_no_logo.h5"), "--set", "logo.margin_px=3"]
    done = CliRunner().invoke(cli, ["analyze", *arguments])
    assert done.exit_code == 0, done.output
    assert "warning: spinner_ball5_back_no_logo.h5: logo.margin_px is now called logo.pad_px" in done.stderr
    report = json.loads(CliRunner().invoke(cli, ["analyze", *arguments, "--json", "-"]).stdout)
    assert report["parameters"]["logo"]["pad_px"] == 3.0
    assert report["warnings"] == ["logo.margin_px is now called logo.pad_px"]


def test_flights_calibrate_their_set_up_and_later_calls_read_it(samples: Path, tmp_path: Path) -> None:
    sample, file = samples / "flight_fast_top.h5", tmp_path / "club.toml"
    done = CliRunner().invoke(cli, ["analyze", str(sample), "--json", "-", "--calibrate-flight", str(file)])
    assert done.exit_code == 0, done.output
    written = tomllib.loads(file.read_text())
    report = json.loads(done.stdout)
    for group, fields in written.items():
        for name, value in fields.items():
            assert report["parameters"][group][name] == value
    assert written["trajectory"]["lift_std"] < 0.12
    session = Session.open(sample, Choices(flight_calibration=file, assignments=["trajectory.lift_scale=1"]))
    assert session.parameters.trajectory.lift_std == written["trajectory"]["lift_std"]
    assert session.parameters.trajectory.lift_scale == 1.0, "what is set by hand comes last"
    assert session.parameters.camera.up == tuple(written["camera"]["up"])
    calibration = calibrate_flights([sample])
    assert calibration.flights == 1 and calibration.values == written
    assert calibration.values["trajectory"]["plumb_std_deg"] < 1.0


def test_without_a_flight_whose_logo_is_seen_there_is_no_calibration(samples: Path, tmp_path: Path) -> None:
    arguments = ["analyze", str(samples / "flight_side.h5"), "--calibrate-flight"]
    done = CliRunner().invoke(cli, [*arguments, str(tmp_path / "club.toml")])
    assert done.exit_code != 0 and "no flight to calibrate by" in f"{done.output}{done.exception}"
    assert not (tmp_path / "club.toml").exists()
    done = CliRunner().invoke(cli, [*arguments, str(tmp_path / "club.txt")])
    assert done.exit_code != 0 and ".toml" in f"{done.output}{done.exception}"


@pytest.mark.parametrize(("up", "is_doubted"), [("0,0,-1", False), ("0,-0.6,-0.8", True)])
def test_flights_that_contradict_the_up_direction_are_said(samples: Path, up: str, is_doubted: bool) -> None:
    sample = samples / "own" / "shot_slow_top.h5"
    done = CliRunner().invoke(cli, ["analyze", str(sample), "--json", "-", "--set", f"camera.up={up}"])
    warnings = [one for one in json.loads(done.stdout)["warnings"] if "camera.up" in one]
    assert len(warnings) == int(is_doubted)
    for warning in warnings:
        words = warning.rpartition("--set camera.up=")[2]
        assert np.array([float(word) for word in words.split(",")]) == pytest.approx([0, 0, -1], abs=0.1)


def test_up_that_nobody_states_is_taken_from_how_the_balls_fall(samples: Path, tmp_path: Path) -> None:
    sample = samples / "own" / "shot_slow_top.h5"
    shutil.copy(sample, tmp_path / "stating.h5")
    with h5py.File(tmp_path / "stating.h5", "r+") as file:
        file.attrs["camera.up"] = "0,0,-1"
    assert Session.open(tmp_path / "stating.h5").states_up
    assert Session.open(sample, Choices(assignments=["camera.up=0,0,-1"])).states_up
    session = Session.open(sample)
    assert not session.states_up
    session.parameters = session.parameters.with_values({"camera": {"up": (0.0, -0.6, -0.8)}})
    parameters = session.parameters
    result = estimate_with_measured_up(session)
    assert session.parameters.camera.up == pytest.approx((0, 0, -1), abs=0.1)
    assert 0.0 < session.parameters.trajectory.plumb_std_deg < 10.0
    assert result.session is session and result.shots[0].estimates["trajectory"].status == "ok"
    (warning,) = (one for one in session.warnings if "camera.up" in one)
    assert "not given" in warning and "+-" in warning
    as_it_is = estimate(sample, parameters)
    assert as_it_is.session.parameters.camera.up == (0.0, -0.6, -0.8), "whole parameters are taken as they are"
    (warning,) = (one for one in as_it_is.session.warnings if "camera.up" in one)
    assert "--set camera.up=" in warning
