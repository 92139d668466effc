"""Batches: one table whoever does the work, every row kept at once, resumed, nothing overwritten silently."""

from __future__ import annotations

import csv
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as parquet
import pytest
from click.testing import CliRunner

from spinscope.app import batch
from spinscope.app.batch import BatchSummary, BatchWork, analyze_to_table
from spinscope.app.cli import cli
from spinscope.app.result_journal import ResultJournal
from spinscope.pipeline.errors import ParameterError, RecordingError
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.recording_folders import recordings_in
from spinscope.pipeline.recordings.writing import write_recording
from spinscope.pipeline.result_rows import shot_columns
from spinscope.pipeline.session import Choices

NAMES = ["ball_fixed.h5", "bad.raw", "noise0.h5", "noise1.h5", "noise2.h5"]


def noise(path: Path, seed: int) -> None:
    """A recording without a ball."""
    random = np.random.default_rng(seed)
    t_us = np.sort(random.integers(0, 20_000, 400))
    x_px, y_px = random.integers(0, 320, 400), random.integers(0, 240, 400)
    size = {"width_px": 320, "height_px": 240}
    write_recording(path, EventBatch.checked(t_us, x_px, y_px, t_us % 2 == 0, **size), **size)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory, samples: Path) -> Path:
    """Recordings of all kinds: without a ball, damaged, and a ball spinner's with its sidecar."""
    folder = tmp_path_factory.mktemp("made")
    for seed in range(3):
        noise(folder / f"noise{seed}.h5", seed)
    (folder / "bad.raw").write_bytes(b"nothing")
    shutil.copy(samples / "spinner_ball2_side.h5", folder / "ball_fixed.h5")
    circle = "[fixed_ball]\nx_px = 528.43\ny_px = 426.87\nradius_px = 16.49\n"
    (folder / "ball_fixed.toml").write_text(circle + "[truth]\nrps = 48\n")
    return folder


@pytest.fixture
def folder(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder `in` with these recordings, in which the test runs."""
    shutil.copytree(made, tmp_path / "in")
    monkeypatch.chdir(tmp_path)
    return tmp_path / "in"


def analyze(names: list[str], table: str = "out.csv", **options: Any) -> BatchSummary:
    options = {"choices": Choices(), "method": "normal_flow", "jobs": 1} | options
    series = options.pop("series", None)
    work = BatchWork(table=Path(table), series=None if series is None else Path(series), **options)
    return analyze_to_table(recordings_in([Path(name) for name in names]), work)


def read(table: str = "out.csv") -> list[dict[str, str]]:
    with open(table, encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the recordings that are analyzed, in order."""
    names: list[str] = []

    def counted(path: Path, *rest: Any) -> Any:
        names.append(path.name)
        return analyzed(path, *rest)

    analyzed = batch.analyzed
    monkeypatch.setattr(batch, "analyzed", counted)
    return names


def test_a_folder_of_everything_becomes_one_table(folder: Path) -> None:
    summary = analyze(["in"])
    assert (summary.recordings, summary.known) == (5, 0)
    assert [text.partition(":")[0] for text in summary.failed] == ["in/bad.raw"]
    rows = {row["recording"]: row for row in read()}
    assert list(rows) == [f"in/{name}" for name in sorted(NAMES)]
    assert "RAW" in rows["in/bad.raw"]["error"] and not rows["in/bad.raw"]["shot"]
    assert "no ball" in rows["in/noise0.h5"]["no_shot_reason"] and not rows["in/noise0.h5"]["error"]
    ball = rows["in/ball_fixed.h5"]
    assert (ball["shot"], ball["shots"], ball["fixed_ball"], ball["best"]) == ("1", "1", "True", "normal_flow")
    assert float(ball["magnitude_rps"]) == pytest.approx(50, abs=2)
    assert float(ball["error_rps"]) == pytest.approx(abs(float(ball["magnitude_rps"]) - 48)), "the sidecar's truth"
    assert ball["truth_from"] == "sidecar" and not ball["error_deg"] and not ball["contrast_magnitude_rps"]
    assert all(len(ball[name]) >= 24 for name in ("recording_hash", "sidecar_hash", "settings_hash"))
    assert ball["version"].startswith("0.")


@pytest.mark.parametrize("suffix", ["csv", "jsonl", "parquet"])
def test_all_formats_hold_the_same(folder: Path, suffix: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("spinscope.app.table_files.ROWS_TOGETHER", 7)
    analyze(["in"], f"out.{suffix}", series=f"ticks.{suffix}")
    if suffix == "parquet":
        table = parquet.read_table("out.parquet")
        rows, ticks = table.to_pylist(), parquet.read_table("ticks.parquet").to_pylist()
        assert str(table.schema.field("start_us").type) == "int64" and str(table.schema.field("x_rps").type) == "double"
    elif suffix == "jsonl":
        texts = (Path(f"{name}.jsonl").read_text() for name in ("out", "ticks"))
        rows, ticks = ([json.loads(line) for line in text.splitlines()] for text in texts)
    else:
        rows, ticks = read(), read("ticks.csv")
        assert list(rows[0]) == list(shot_columns())
    ball = next(row for row in rows if row["recording"] == "in/ball_fixed.h5")
    assert float(ball["magnitude_rps"]) == pytest.approx(50, abs=2) and int(ball["start_us"]) == 0
    assert len(ticks) == 20 and {row["recording"] for row in ticks} == {"in/ball_fixed.h5"}
    last = ticks[-1]
    assert float(last["normal_flow_magnitude_rps"]) == float(ball["magnitude_rps"])
    assert float(last["x_px"]) == pytest.approx(528.43) and float(last["z_m"]) == pytest.approx(2.0, abs=0.1)
    assert float(last["logo_rate_hz"]) > 1000 and float(last["rate_rps"]) == pytest.approx(50, abs=3)


def test_rows_are_on_disk_as_soon_as_they_are_known_and_a_run_goes_on_where_it_stopped(
    folder: Path, calls: list[str]
) -> None:
    def stop(share: float, what: str) -> None:
        assert len(journal.read_text().splitlines()) == len(calls)
        if len(calls) == 3:
            raise KeyboardInterrupt

    journal = Path("out.csv.rows.jsonl")
    work = BatchWork(choices=Choices(), method="normal_flow", table=Path("out.csv"), jobs=1)
    with pytest.raises(KeyboardInterrupt):
        analyze_to_table(recordings_in([Path("in")]), work, stop)
    assert not Path("out.csv").exists() and len(calls) == 3
    with open(journal, "ab") as file:  # the line that was being written when the power failed
        file.write(b'{"recording": "in/noi')
    summary = analyze(["in"])
    assert summary.known == 2 and sorted(calls) == sorted([*NAMES, "bad.raw"]), "what failed is tried again"
    assert len(read()) == 5
    first = Path("out.csv").read_bytes()
    Path("out.csv").unlink()
    journal.unlink()
    analyze(["in"])
    assert Path("out.csv").read_bytes() == first


def test_more_recordings_are_added_and_changed_ones_done_again(folder: Path, calls: list[str]) -> None:
    analyze(["in/noise0.h5"])
    analyze(["in/noise[01].h5"])
    assert calls == ["noise0.h5", "noise1.h5"] and len(read()) == 2
    noise(folder / "noise0.h5", 7)
    old = read()[0]["recording_hash"]
    analyze(["in/noise2.h5", "in/noise0.h5"])
    assert calls[2:] == ["noise2.h5", "noise0.h5"]
    assert [row["recording"] for row in read()] == [f"in/noise{number}.h5" for number in range(3)]
    assert read()[0]["recording_hash"] != old
    (folder / "noise1.toml").write_text("[camera]\nfocal_length_mm = 16\n")
    analyze(["in/noise[12].h5"])
    assert (calls.count("noise1.h5"), calls.count("noise2.h5")) == (2, 1), "its sidecar is new"
    analyze(["in"], series="ticks.csv")
    assert calls.count("noise2.h5") == 2, "its ticks were not kept"


def test_nothing_is_overwritten_silently(folder: Path) -> None:
    Path("out.csv").write_text("mine")
    with pytest.raises(RecordingError, match="without the journal"):
        analyze(["in/noise0.h5"])
    assert Path("out.csv").read_text() == "mine"
    analyze(["in/noise0.h5"], overwrite=True)
    with pytest.raises(ParameterError, match="other settings"):
        analyze(["in/noise0.h5"], choices=Choices(assignments=["logo.pad_px=3"]))
    Path("ticks.csv").write_text("mine")
    with pytest.raises(RecordingError, match="not of these results"):
        analyze(["in/noise0.h5"], series="ticks.csv")
    with pytest.raises(ParameterError, match=r"\.csv, \.jsonl, \.parquet"):
        analyze(["in/noise0.h5"], "out.xlsx")
    analyze(["in/noise1.h5"], choices=Choices(assignments=["logo.pad_px=3"]), overwrite=True)
    assert [row["recording"] for row in read()] == ["in/noise1.h5"]
    Path("out.csv.rows.jsonl").write_text("[1]\n")
    with pytest.raises(RecordingError, match="damaged at byte 0"):
        analyze(["in/noise1.h5"])


def test_parts_of_an_array_job_make_the_same_table(folder: Path, calls: list[str]) -> None:
    analyze(["in"], "whole.csv")
    for part in (2, 1, 3):
        summary = analyze(["in"], part=(part, 3))
        assert summary.recordings == (2 if part < 3 else 1)
        assert not Path("out.csv").exists()
    assert sorted(calls[5:]) == sorted(NAMES)
    assert analyze(["in"]).known == 4
    assert Path("out.csv").read_bytes() == Path("whole.csv").read_bytes()


@pytest.mark.parametrize(
    "other",
    [
        {"method": "triplet"},
        {"choices": Choices(rivals=("s_cmax",))},
        {"choices": Choices(window_us=(0, 5000))},
        {"choices": Choices(assignments=("logo.pad_px=3",))},
    ],
)
def test_results_of_other_settings_are_told_apart(other: dict[str, Any]) -> None:
    options: dict[str, Any] = {"choices": Choices(), "method": "contrast", "jobs": 1, "table": Path("a.csv")}
    assert BatchWork(**options).settings_hash != BatchWork(**options | other).settings_hash


def test_two_processes_make_the_same_table(folder: Path) -> None:
    analyze(["in"], "one.csv", series="one.ticks.csv")
    analyze(["in"], "two.csv", series="two.ticks.csv", jobs=2)
    assert Path("one.csv").read_bytes() == Path("two.csv").read_bytes()
    assert Path("one.ticks.csv").read_bytes() == Path("two.ticks.csv").read_bytes()


@pytest.mark.slow  # test_tasks.py has a cluster, and the test above other processes
@pytest.mark.filterwarnings("ignore")  # Dask's own
@pytest.mark.filterwarnings("default")  # Dask warns of slow machines
def test_two_workers_of_a_dask_cluster_make_the_same_table(folder: Path) -> None:
    import distributed as dask

    analyze(["in"], "one.csv")
    with dask.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        analyze(["in"], cluster=cluster.scheduler_address)
    assert Path("out.csv").read_bytes() == Path("one.csv").read_bytes()


def test_a_fault_of_the_program_costs_its_own_row_only(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def faulty(path: Path, *rest: Any) -> Any:
        if path.name == "noise1.h5":
            raise ZeroDivisionError("by zero")
        return analyzed(path, *rest)

    analyzed = batch.analyzed
    monkeypatch.setattr(batch, "analyzed", faulty)
    assert len(analyze(["in"]).failed) == 2
    assert "ZeroDivisionError: by zero; test_batch.py" in read()[3]["error"]
    assert not read()[4]["error"]


def killing(context: Any, path: Path, line: dict[str, Any], work: BatchWork) -> list[dict[str, Any]]:
    """`recording_rows`, but for a recording on which a library ends the process."""
    if path.name == "noise1.h5":
        os.kill(os.getpid(), signal.SIGKILL)
    return [{"line": json.dumps({**line, "failed": False, "shots": [{"shots": 0}]})}]


def test_a_recording_that_kills_its_process_costs_its_own_row_only(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(batch, "recording_rows", killing)
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[2]))
    summary = analyze(["in/noise1.h5", "in/noise0.h5", "in/noise2.h5"], jobs=2)
    assert [text.partition(":")[0] for text in summary.failed] == ["in/noise1.h5"]
    assert ["process that read it was ended" in row["error"] for row in read()] == [False, True, False]


def test_folders_patterns_and_files_are_each_found_once(folder: Path) -> None:
    (folder / "deep" / "er").mkdir(parents=True)
    noise(folder / "deep" / "er" / "NOISE.H5", 1)
    (folder / "out.npz").write_bytes(b"")
    found = recordings_in([Path("in/noise*.h5"), Path("in"), Path("in/noise0.h5")], [Path("in/out.npz")])
    names = [path.as_posix() for path in found]
    assert names[:3] == ["in/noise0.h5", "in/noise1.h5", "in/noise2.h5"]
    assert sorted(names[3:]) == ["in/bad.raw", "in/ball_fixed.h5", "in/deep/er/NOISE.H5"]
    for name, words in (("*.raw", "no file fits"), ("empty", "holds no recordings")):
        Path("empty").mkdir(exist_ok=True)
        with pytest.raises(RecordingError, match=words):
            recordings_in([Path(name)])
    assert recordings_in([Path("missing.h5")]) == [Path("missing.h5")], "opening it says what is wrong"


def test_a_folders_truth_is_no_recording_of_it(folder: Path) -> None:
    (folder / "truth.csv").write_text("recording,spin_rps\nball_fixed,1 2 3\n")
    names = [path.name for path in recordings_in([folder])]
    assert names == ["bad.raw", "ball_fixed.h5", "noise0.h5", "noise1.h5", "noise2.h5"]


def test_the_command_says_what_came_of_it(folder: Path) -> None:
    arguments = ["analyze", "in", "--out", "out.csv", "--method", "triplet", "--jobs", "1"]
    done = CliRunner().invoke(cli, arguments)
    assert done.exit_code == 2, "one failed"
    assert "error: in/bad.raw: " in done.stderr and "wrote out.csv: 5 recordings, 1 failed" in done.stderr
    (folder / "bad.raw").unlink()
    done = CliRunner().invoke(cli, [*arguments[:1], "in/noise0.h5", *arguments[2:]])
    assert done.exit_code == 0 and "1 of them known from earlier" in done.stderr
    for given, words in (
        (["--series", "t.csv"], "--series goes with --out"),
        (["--out", "o.csv", "--json", "-"], "--json and --out"),
        (["--out", "o.csv", "--part", "4/3"], "3/10 for the third of ten"),
    ):
        done = CliRunner().invoke(cli, ["analyze", "in", *given])
        assert done.exit_code != 0 and words in f"{done.output}{done.exception}"


@pytest.mark.parametrize("is_killed", [False, True])
def test_ctrl_c_and_kill_end_all_processes_and_the_rows_are_kept(folder: Path, samples: Path, is_killed: bool) -> None:
    """The workers as well: reading to the end of their output waits for them."""
    for number in range(30):
        shutil.copy(samples / "flight_slow_top.h5", folder / f"flight{number}.h5")
    journal = Path("out.csv.rows.jsonl")
    options = ["--out", "out.csv", "--method", "triplet", "--jobs", "2"]
    command = [sys.executable, "-m", "spinscope", "analyze", "in", *options]
    with subprocess.Popen(
        command, stderr=subprocess.PIPE, text=True, start_new_session=True, env=os.environ
    ) as running:
        _until(lambda: journal.exists() and len(journal.read_text().splitlines()) > 2)
        if is_killed:
            running.kill()
        else:
            os.killpg(running.pid, signal.SIGINT)
        _, said = running.communicate(timeout=240)
    assert running.returncode == (-signal.SIGKILL if is_killed else 130)
    assert is_killed or "what is done is kept" in said
    assert "Traceback" not in said
    assert not Path("out.csv").exists()
    assert len(ResultJournal(journal, []).entries) > 2


def _until(is_so: Callable[[], bool]) -> None:
    for _ in range(6000):
        if is_so():
            return
        time.sleep(0.1)
    raise AssertionError("it never was")
