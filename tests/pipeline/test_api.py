"""The public Python API: what scripts and notebooks write, from anywhere and beside files of any name."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import jsonschema
import numpy as np
import pytest

import spinscope
from spinscope.pipeline.session import Choices, Session

ROOT = Path(__file__).parents[2]
SCHEMA = json.loads((ROOT / "tests/app/analyze.schema.json").read_text(encoding="utf-8"))
BALL = (528.43, 426.87, 16.49)


def without_seconds(report: dict) -> dict:
    return {name: value for name, value in report.items() if name != "seconds"}


def test_the_names_of_the_api_exist_and_nothing_else_is_promised() -> None:
    assert set(spinscope.__all__) >= {"estimate", "open_recording", "Parameters", "Result", "preset", "EventBatch"}
    for name in spinscope.__all__:
        assert getattr(spinscope, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'estimat'"):
        _ = spinscope.estimat


def test_a_path_is_estimated_as_the_command_line_does(samples: Path) -> None:
    path = samples / "spinner_ball2_side.h5"
    result = spinscope.estimate(path, {"contrast": {"kernel_rad": 0.05}}, fixed_ball=BALL, window_us=(0, 60_000))
    report = result.to_dict()
    jsonschema.validate(report, SCHEMA)
    choices = Choices(None, ["contrast.kernel_rad=0.05"], (0, 60_000), BALL)
    assert without_seconds(report) == without_seconds(Session.open(path, choices).estimate().to_dict())
    (shot,) = result.shots
    assert shot.best == "contrast" and shot.estimates["contrast"].magnitude_rps == pytest.approx(50.0, abs=0.3)
    assert len(result.ticks) == 12 and result.ticks[-1].surface.values.shape == (720, 1280)
    assert result.no_shot_reason is None


def test_events_in_memory_recordings_and_paths_give_the_same(samples: Path) -> None:
    recording = spinscope.open_recording(samples / "spinner_ball2_side.h5")
    events = recording.read()
    assert (events.t_us.dtype, events.x_px.dtype, events.on.dtype) == (np.int64, np.uint16, np.bool_)
    kwargs = {"fixed_ball": BALL, "method": "triplet", "window_us": (0, 40_000)}
    of_recording = spinscope.estimate(recording, **kwargs).to_dict()["shots"]
    of_events = spinscope.estimate(events, sensor_px=(1280, 720), **kwargs)
    assert (
        of_events.to_dict()["shots"] == of_recording == spinscope.estimate(recording.path, **kwargs).to_dict()["shots"]
    )
    assert list(of_recording[0]["spin"]) == ["triplet"]
    jsonschema.validate(of_events.to_dict(), SCHEMA)
    assert spinscope.estimate(events[::2], sensor_px=(1280, 720), **kwargs).to_dict()["shots"] != of_recording


def test_parameters_are_taken_as_they_are_and_changes_on_top_of_a_preset(samples: Path) -> None:
    path, kwargs = (
        samples / "spinner_ball2_side.h5",
        {"fixed_ball": BALL, "method": "triplet", "window_us": (0, 20_000)},
    )
    own = spinscope.Parameters().with_assignments(["logo.fixed_pad_px=2"])
    assert spinscope.estimate(path, own, **kwargs).session.parameters.logo == own.logo
    mixed = spinscope.estimate(path, ["logo.fixed_pad_px=2"], preset="paper", **kwargs).session.parameters
    assert mixed.logo.fixed_pad_px == 2 and mixed.filter == spinscope.preset("paper").filter
    assert spinscope.preset_names() == ("default", "paper")


def test_changes_may_be_nested_flat_or_texts(samples: Path) -> None:
    path, kwargs = (
        samples / "spinner_ball2_side.h5",
        {"fixed_ball": BALL, "method": "triplet", "window_us": (0, 10_000)},
    )
    nested = {"camera": {"focal_length_mm": 16.0, "distortion": np.zeros(5)}}
    for given in (nested, {"camera.focal_length_mm": 16.0}, ["camera.focal_length_mm=16"], "camera.focal_length_mm=16"):
        assert spinscope.estimate(path, given, **kwargs).session.parameters.camera.focal_length_mm == 16.0


def test_what_is_no_recording_is_refused_and_a_result_is_short_to_read(samples: Path) -> None:
    with pytest.raises(spinscope.ParameterError, match="a ndarray is no recording"):
        spinscope.estimate(np.zeros((3, 4)))
    result = spinscope.estimate(
        samples / "spinner_ball2_side.h5", fixed_ball=BALL, method="triplet", window_us=(0, 10_000)
    )
    assert repr(result) == "Result(spinner_ball2_side.h5: 0 to 10000 us (None))"
    with pytest.raises(spinscope.ParameterError, match="contrast was not run: there are triplet"):
        result.shots[0].error_against(result.session.truth, "contrast")


def test_former_names_of_parameters_are_read_with_a_notice(samples: Path, tmp_path: Path) -> None:
    file = tmp_path / "old.toml"
    file.write_text("[contrast]\nweakest = 0.3\n", encoding="utf-8")
    kwargs = {"fixed_ball": BALL, "method": "triplet", "window_us": (0, 20_000)}
    for given in ({"preset": file}, {"parameters": ["contrast.weakest=0.3"]}):
        result = spinscope.estimate(samples / "spinner_ball2_side.h5", **given, **kwargs)
        assert result.session.parameters.contrast.min_gain == 0.3
        assert result.session.warnings == ["contrast.weakest is now called contrast.min_gain"]


def test_no_ball_is_a_result_with_its_reason(samples: Path) -> None:
    result = spinscope.estimate(samples / "spinner_ball5_back_no_logo.h5", method="triplet")
    assert result.shots == () and "no ball" in str(result.no_shot_reason)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"method": "magic"}, "there is no spin method 'magic'"),
        ({"method": "filter"}, "there is no spin method 'filter'"),
        ({"parameters": {"logo": {"pad": 1}}}, "did you mean pad_px"),
        ({"parameters": {"logos": {"pad_px": 1}}}, "did you mean logo"),
        ({"parameters": ["logo.pad_px"]}, "not of the form"),
        ({"preset": "papr"}, "default, paper"),
        ({"fixed_ball": (5000, 5000, 3)}, "outside the image"),
        ({"fixed_ball": (5, 5)}, "is no circle"),
        ({"fixed_ball": "autos"}, "is no circle"),
        ({"parameters": {"camera": 16}}, "not a table of fields"),
        ({"parameters": spinscope.Parameters(), "preset": "paper"}, "give one of them"),
    ],
)
def test_wrong_arguments_say_what_is_allowed(samples: Path, change: dict, says: str) -> None:
    with pytest.raises(spinscope.ParameterError, match=says):
        spinscope.estimate(samples / "spinner_ball2_side.h5", **change)


def test_events_need_a_sensor_that_holds_them() -> None:
    events = spinscope.EventBatch(*(np.array([5], kind) for kind in (np.int64, np.uint16, np.uint16, np.bool_)))
    with pytest.raises(spinscope.ParameterError, match="give sensor_px"):
        spinscope.estimate(events)
    with pytest.raises(spinscope.ParameterError, match="x = 5 px lies outside"):
        spinscope.estimate(events, sensor_px=(5, 720))


SCRIPT = """
import app, pipeline, spinscope
assert app.MINE and pipeline.MINE
result = spinscope.estimate(SAMPLE, fixed_ball=(528.43, 426.87, 16.49), method="triplet", window_us=(0, 10_000))
print(len(result.shots), spinscope.__file__)
"""


def run_beside_own_files(folder: Path, sample: Path, **environment: str) -> list[str]:
    """What the script prints beside a user's own app.py and pipeline.py: number of shots, path of the package."""
    folder.mkdir()
    for name in ("app.py", "pipeline.py"):
        (folder / name).write_text("MINE = True\n", encoding="utf-8")
    (folder / "script.py").write_text(f"SAMPLE = {str(sample)!r}\n{SCRIPT}", encoding="utf-8")
    command = [sys.executable, "script.py"]
    environment = {**os.environ, **environment}
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def test_a_users_own_pipeline_beside_the_script_does_no_harm(samples: Path, tmp_path: Path) -> None:
    shots, package = run_beside_own_files(tmp_path / "work", samples / "spinner_ball2_side.h5")
    assert shots == "1" and Path(package).is_relative_to(ROOT)


def test_the_wheel_holds_one_package_that_works_alone(samples: Path, tmp_path: Path) -> None:
    """Built as users get it: everything inside `spinscope`, typed, with samples, presets and the page."""
    command = [os.environ.get("UV", "uv"), "build", "--wheel", "--out-dir", str(tmp_path), "--quiet", str(ROOT)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    (wheel,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
        archive.extractall(tmp_path / "site")
    assert {name.split("/")[0] for name in names if ".dist-info/" not in name} == {"spinscope"}
    for name in ("py.typed", "__main__.py", "pipeline/presets/paper.toml", "app/web/static/index.html"):
        assert f"spinscope/{name}" in names
    assert "spinscope/sample_recordings/flight_back.h5" in names
    caches = {
        "PYTHONPATH": str(tmp_path / "site"),
        "NUMBA_CACHE_DIR": str(tmp_path / "numba"),
        "NUMBA_DISABLE_JIT": "1",
    }
    shots, package = run_beside_own_files(tmp_path / "work", samples / "spinner_ball2_side.h5", **caches)
    assert shots == "1" and Path(package).is_relative_to(tmp_path)
