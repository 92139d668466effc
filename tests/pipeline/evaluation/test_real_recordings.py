"""Suites on a folder of recordings with truth from sidecars: simulated stand-ins give what the suites give."""

from __future__ import annotations

import subprocess
import sys
import time
import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import tomli_w
from click.testing import CliRunner

from spinscope.app.cli import cli, run
from spinscope.app.evaluate import evaluate_suite, write_page
from spinscope.pipeline.api import estimate
from spinscope.pipeline.biases import PAPER, write_biases
from spinscope.pipeline.errors import ParameterError, RecordingError
from spinscope.pipeline.evaluation import LabFolder, SceneChoices, TaskContext, evaluate
from spinscope.pipeline.evaluation.protocol import protocol_findings
from spinscope.pipeline.evaluation.real_recordings import evaluate_real
from spinscope.pipeline.evaluation.rendering import render
from spinscope.pipeline.evaluation.suites import SUITES, biases, filters, runtime, spinner, thrower
from spinscope.pipeline.evaluation.suites.biases import picture_of
from spinscope.pipeline.evaluation.tables import Row, where
from spinscope.pipeline.evaluation.tasks import run as run_tasks
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.recordings import open_recording, write_recording
from spinscope.pipeline.registry import Parameters
from spinscope.pipeline.session import Choices
from spinscope.pipeline.simulator import SimulatedRecording
from spinscope.pipeline.simulator import spinner as spinner_scene

Lab = tuple[Path, dict[str, list[Row]]]  # folder of recordings, and rows of the suites by name
UNKNOWN = {
    "setting",
    "dotted_shots",
    "sensor",
    "recording",
    "seed",
    "logo_events",
    "visible",
    "velocity_setting",
    "spin_setting",
    "kind",
    "duration_ms",
}


def keep(made: SimulatedRecording, path: Path, truth: dict[str, object], **tables: object) -> None:
    """Write events alone, with the truth in a sidecar."""
    write_recording(path, made.events, width_px=made.width_px, height_px=made.height_px)
    path.with_suffix(".toml").write_text(tomli_w.dumps({"truth": truth, **tables}))
    write_biases(PAPER, path.with_suffix(".bias"))


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory, cache: Path) -> Lab:
    """Recordings of the thinned suites, as a lab would have them, and the suites' own rows."""
    folder = tmp_path_factory.mktemp("lab")
    context = TaskContext(cache)
    spinners, throws = spinner.tasks(True)[:2], thrower.tasks(True)[:2]
    for number, task in enumerate(spinners):
        ball, kind, rps, seed = (task.arguments[name] for name in ("ball", "kind", "rps", "seed"))
        made = render(context, spinner_scene(ball=ball, kind=kind, magnitude_rps=rps, seed=seed), seed=seed)
        circle = spinner.known_circle(made.truth, seed)
        fixed = {name: circle[f"fixed_{name}"] for name in ("x_px", "y_px", "radius_px")}
        truth = {"spin_rps": made.truth.spin_rps[0].tolist(), "ball": ball, "setting": kind}
        keep(made, folder / f"spinner{number}.raw", truth, fixed_ball=fixed)
    for number, task in enumerate(throws):
        flight = task.arguments
        made, about = thrower.flight_of(context, **flight)
        middle = len(made.truth.t_us) // 2
        setting = f"velocity {flight['velocity']}, spin {flight['spin']}, {'side' if flight['side'] else 'top'}"
        truth = {"spin_rps": made.truth.spin_rps[middle].tolist(), "speed_m_s": about["speed_m_s"], "setting": setting}
        keep(made, folder / f"day2-flight{number}.npz", truth)
    return folder, {"spinner": run_tasks(spinners, context), "thrower": run_tasks(throws, context)}


def comparable(rows: list[Row]) -> list[tuple[object, ...]]:
    """Rows without what a real recording cannot tell, sorted; numbers to six digits."""
    rounded = [
        tuple(
            f"{row[name]:.6g}" if isinstance(row[name], float) else str(row[name])
            for name in sorted(row.keys() - UNKNOWN)
        )
        for row in rows
    ]
    return sorted(rounded)


@pytest.mark.parametrize("name", ["spinner", "thrower"])
def test_stand_ins_give_the_suites_own_rows(name: str, lab: Lab, tmp_path: Path) -> None:
    folder, own = lab
    fixed_std = Choices(assignments=[f"track.fixed_std_px={spinner.CENTRE_STD_PX}"])  # as the suite states it
    found = evaluate_real(name, folder, TaskContext(tmp_path, fixed_std.parameters(), fixed_std))
    assert comparable(found.rows) == comparable(own[name])
    assert found.tables[0].rows[:2] == [("evaluated", 2, None), (f"not for this suite: {other(name)}", 2, None)]
    assert "real recordings" in found.title and found.as_dict()["real"]
    ours = {table.title: table for table in SUITES[name].tables(own[name])}
    of_settings = [table.title for table in found.tables[1:] if table.title not in ours]
    assert of_settings == (["Flying balls by setting"] if name == "thrower" else [])
    for table in found.tables[1:]:
        assert table.rows and table.columns == ours.get(table.title, table).columns


def other(name: str) -> str:
    return {"spinner": "flight", "thrower": "spinner"}[name]


def test_a_tachometer_alone_judges_the_magnitude(lab: Lab, tmp_path: Path) -> None:
    source = lab[0] / "spinner0.raw"
    (tmp_path / "a.raw").write_bytes(source.read_bytes())
    beside = source.with_suffix(".toml").read_text().split("[fixed_ball]")[1]
    (tmp_path / "a.toml").write_text(f"[truth]\nrps = 50\n[fixed_ball]{beside}")
    best = where(evaluate_real("spinner", tmp_path, TaskContext()).rows, method="best", window_ms=100)
    assert [row["axis_error_deg"] for row in best] == [None] and best[0]["ball"] is None
    assert isinstance(error := best[0]["magnitude_error_rps"], float) and error < 0.05


def test_what_is_wrong_is_named_and_the_rest_goes_on(lab: Lab, tmp_path: Path) -> None:
    def taken(name: str, change: Callable[[str], str]) -> None:
        (tmp_path / name).write_bytes((lab[0] / "spinner1.raw").read_bytes())
        sidecar = change((lab[0] / "spinner1.toml").read_text())
        (tmp_path / name).with_suffix(".toml").write_text(sidecar)

    taken("good.raw", lambda text: text)
    taken("typo.raw", lambda text: text.replace("spin_rps", "spin_rpm"))
    taken("nothing.raw", lambda text: "[fixed_ball]" + text.split("[fixed_ball]")[1])
    taken("outside.raw", lambda text: text.replace("x_px = ", "x_px = 9"))
    taken("damaged.raw", lambda text: text)
    (tmp_path / "damaged.raw").write_bytes(b"% evt 3.0\n% end\nxx")
    found = evaluate_real("spinner", tmp_path, TaskContext(tmp_path / "cache"))
    assert {row["recording"] for row in found.rows} == {"good.raw"}
    (evaluated, *left_out) = found.tables[0].rows
    assert evaluated == ("evaluated", 1, None)
    said = [str(line[2]) for line in left_out]
    assert [line.split(":")[0] for line in said] == ["damaged.raw", "nothing.raw", "outside.raw", "typo.raw"]
    for line, word in zip(said, ("events", "[truth]", "outside the image", "did you mean spin_rps"), strict=True):
        assert word in line
    findings = {finding.recording: finding.what for finding in protocol_findings(LabFolder.of(tmp_path, Choices()))}
    assert set(findings) == {"damaged.raw", "nothing.raw", "outside.raw", "typo.raw", "good.raw"}


def test_filters_biases_and_run_times_of_real_flights(
    lab: Lab, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for suffix in (".npz", ".toml", ".bias"):
        name = f"day2-flight0{suffix}"
        (tmp_path / name).write_bytes((lab[0] / name).read_bytes())
    monkeypatch.setattr(filters, "SPIN_THRESHOLDS_US", (5000,))
    of_filters = evaluate_real("filters", tmp_path, TaskContext())
    kept = where(of_filters.rows, question="kept", mode="stc")
    assert [row["kept_all"] for row in kept] == sorted(float(str(row["kept_all"])) for row in kept)
    best = where(of_filters.rows, question="spin", method="best", mode="trail")
    assert len(best) == 1 and all(float(str(row["magnitude_error_rps"])) < 0.5 for row in best)
    of_biases = evaluate_real("biases", tmp_path, TaskContext()).rows
    assert {row["sweep"] for row in of_biases} >= {"fo", "hpf", "refr"}
    assert {row["what"] for row in of_biases} == {"ball", "picture"}
    monkeypatch.setattr(runtime, "TICKS_US", (5000,))
    times = evaluate_real("runtime", tmp_path, TaskContext())
    assert len(times.rows) > 10 and all(float(str(row["latency_ms"])) > 0 for row in times.rows)


def test_dotted_balls_are_the_truth_of_their_setting(lab: Lab, tmp_path: Path) -> None:
    source = lab[0] / "day2-flight0.npz"
    (tmp_path / source.name).write_bytes(source.read_bytes())
    truth = tomllib.loads(source.with_suffix(".toml").read_text())["truth"]
    about = {"setting": truth["setting"], "dotted_shots": "spindoe.csv", "speed_m_s": truth["speed_m_s"]}
    (tmp_path / source.with_suffix(".toml").name).write_text(tomli_w.dumps({"truth": about}))
    scatter = np.random.default_rng(76_010).standard_normal((5, 3))
    shots = np.array(truth["spin_rps"]) + 2.0 * (scatter - scatter.mean(axis=0))
    lines = [f'"{truth["setting"]}",{x:.9f},{y:.9f},{z:.9f}' for x, y, z in shots * 2 * np.pi]
    (tmp_path / "spindoe.csv").write_text("\n".join(["setting,x_spin,y_spin,z_spin", *lines, "other,1,2,3"]))
    found = evaluate_real("thrower", tmp_path, TaskContext())
    (table,) = (table for table in found.tables if table.title == "Flying balls by setting")
    assert table.rows[0][:2] == (truth["setting"], 5)
    assert table.rows[0][2:4] == pytest.approx((np.linalg.norm(truth["spin_rps"]), 2.2), rel=0.5)
    (own,) = where(lab[1]["thrower"], method="best", seed=lab[1]["thrower"][0]["seed"])
    (best,) = where(found.rows, method="best")
    assert best["axis_error_deg"] == pytest.approx(own["axis_error_deg"], abs=1e-4)
    (tmp_path / "spindoe.csv").write_text("setting,x_spin,y_spin,z_spin\nother,1,2,3")
    assert "no dotted shot is of the setting" in str(
        evaluate_real("thrower", tmp_path, TaskContext()).tables[0].rows[-1]
    )


def test_pictures_of_one_movement_are_taken_at_equal_places(lab: Lab, tmp_path: Path) -> None:
    source = lab[0] / "day2-flight0.npz"
    flown = open_recording(source)
    events = flown.read()
    for name, values, later_us in (("paper", {}, 0), ("short", {"refr": 120}, 7_300), ("wide", {"fo": -35}, 51_900)):
        moved = EventBatch(events.t_us + later_us, events.x_px, events.y_px, events.on)
        write_recording(tmp_path / f"{name}.npz", moved, width_px=flown.width_px, height_px=flown.height_px)
        write_biases(PAPER.with_values(values), tmp_path / f"{name}.bias")
    found = evaluate_real("biases", tmp_path, TaskContext())
    pictures = where(found.rows, what="picture")
    assert [(row["recording"], row["sweep"]) for row in pictures] == [
        *(("paper.npz", sweep) for sweep in ("diff_on = diff_off", "fo", "refr")),
        ("short.npz", "refr"),
        ("wide.npz", "fo"),
    ]
    assert all(float(str(row["off_px"])) < 0.5 for row in pictures)
    of_paper, of_short = (picture_of(row) for row in where(pictures, sweep="refr"))
    assert of_paper.shape == of_short.shape
    assert np.count_nonzero(of_paper) > 100
    assert np.corrcoef(of_paper.ravel(), of_short.ravel())[0, 1] > 0.5  # the same events, a part of a pixel apart
    (table,) = (table for table in found.tables if table.title == "Pictures at equal places of the ball")
    assert len(table.rows) == 5 and len(biases.figures(found.rows)["pictures"].axes) >= 5


def test_protocol(lab: Lab, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        run(["evaluate", "--check", str(lab[0])])
    said = capsys.readouterr().out
    assert ended.value.code == 1
    assert "spinner0.raw: the camera is not stated" in said and "has 1 shots: record 5" in said
    stated = Choices(assignments=["camera.focal_length_mm=8.0"])  # the default, but stated
    findings = protocol_findings(LabFolder.of(lab[0], stated))
    assert not [finding for finding in findings if finding.recording.startswith("spinner")]


def test_page_is_marked_as_real(lab: Lab, tmp_path: Path) -> None:
    done = evaluate_suite("thrower", workers=1, cache=tmp_path, real=lab[0])
    write_page([done], tmp_path / "page.md")
    page = (tmp_path / "page.md").read_text()
    assert page.startswith("# Results on real recordings") and "real recordings (`thrower`)" in page
    assert "| paper, event |" in page and "| triplet, paper preset |" in page


def test_one_ball_and_another_lens() -> None:
    number = [task.arguments["ball"] for task in spinner.tasks(True)]
    context = TaskContext(scene=SceneChoices(ball=number[0]))
    assert spinner.measure(context, **spinner.tasks(True)[1].arguments) == []
    lens = "camera.focal_length_mm=12"
    context = TaskContext(None, Parameters().with_assignments([lens]), scene=SceneChoices(lens_mm=12.0))
    made = render(context, spinner_scene(duration_ms=20.0, position_m=(0.0, 0.0, 2.0), seed=76_001), seed=76_001)
    assert made.camera.focal_px == pytest.approx(12000 / 4.86)
    assert made.truth.radius_px[0] == pytest.approx(0.02 / 2.0 * made.camera.focal_px, rel=1e-3)
    result = estimate(made, context.parameters, method="triplet", fixed_ball=(639.5, 359.5, made.truth.radius_px[0]))
    assert result.session.camera.focal_px == made.camera.focal_px
    # All experiments of the paper take another ball or lens; the others' recordings are as they are.
    able = {suite.name for suite in SUITES if suite.takes_scene_choices}
    assert able == {suite.name for suite in SUITES if suite.real}
    for name in set(SUITES.names) - able:
        with pytest.raises(ParameterError, match="leave --ball and --lens-mm out"):
            evaluate(name, TaskContext(scene=SceneChoices(ball=1)), quick=True)


def test_folders_and_suites_that_do_not_go(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="holds no recordings"):
        evaluate_real("spinner", tmp_path, TaskContext())
    with pytest.raises(RecordingError, match="there is no folder"):
        evaluate_real("spinner", tmp_path / "none", TaskContext())
    with pytest.raises(ParameterError, match="simulated recordings only: real ones are for"):
        evaluate_real("scenes", tmp_path, TaskContext())


def test_rivals_are_refused_by_every_suite_without_spin_methods_before_any_runs(tmp_path: Path) -> None:
    able = {suite.name for suite in SUITES if suite.takes_rivals}
    assert able == {"spinner", "thrower", "flights", "scenes", "frames", "samples"}
    for name in set(SUITES.names) - able:
        with pytest.raises(ParameterError, match="compares no spin methods: leave --rival out"):
            evaluate(name, TaskContext(choices=Choices(rivals=("s_cmax",))), quick=True)
    both = ["evaluate", "spinner", "detector", "--real", str(tmp_path), "--rival", "s_cmax"]
    refused = CliRunner().invoke(cli, both)
    assert isinstance(refused.exception, ParameterError) and "the suite detector" in str(refused.exception)


@pytest.mark.slow
def test_thirty_recordings_take_less_than_a_minute_on_two_cores(lab: Lab, tmp_path: Path) -> None:
    sources = [path for path in sorted(lab[0].iterdir()) if path.suffix in (".raw", ".npz")]
    for number in range(30):
        source = sources[number % len(sources)]
        for path in (source, source.with_suffix(".toml"), source.with_suffix(".bias")):
            (tmp_path / f"{number:02}-{path.name}").write_bytes(path.read_bytes())
    begin_s = time.monotonic()
    done = [evaluate_suite(name, workers=2, cache=tmp_path / "cache", real=tmp_path) for name in ("spinner", "thrower")]
    assert time.monotonic() - begin_s < 60.0
    assert [evaluation.report.tables[0].rows[0][1] for evaluation in done] == [14, 16]


def test_a_process_of_its_own_knows_the_suites(tmp_path: Path) -> None:
    """Workers load the function of their task, and nothing else."""
    path = tmp_path / "none.raw"  # its sidecar is missed before it is opened
    arguments = {"suite": "spinner", "recording": "none.raw", "path": str(path), "content": []}
    code = (
        "from spinscope.pipeline.evaluation.real_recordings import real_rows\n"
        "from spinscope.pipeline.evaluation.tasks import TaskContext\n"
        f"print(real_rows(TaskContext(), **{arguments!r})[0]['error'])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "no truth: state [truth]" in done.stdout
