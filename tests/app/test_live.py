"""`spinscope live` and `watch` from the command line: lines, tables, recordings and clients."""

from __future__ import annotations

import csv
import json
import os
import socket
import threading
import time
import tomllib
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pyarrow.parquet
import pytest
from click.testing import CliRunner

from spinscope.app.cli import cli
from spinscope.app.live import camera_view, headless, page
from spinscope.app.live.camera_view import WINDOWS_KEPT, CameraView
from spinscope.app.live.headless import OpenLive
from spinscope.app.live.json_lines import JsonLines, JsonServer
from spinscope.app.live.recording import CameraRecording, RecordChoice
from spinscope.app.live.shot_table import ShotTable
from spinscope.app.web import open_recording as web_recording
from spinscope.pipeline.biases import BiasParameters
from spinscope.pipeline.cameras import CameraOptions, RecentEvents
from spinscope.pipeline.errors import CameraError, RecordingError
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.live_outputs import LiveNotice, LiveShot
from spinscope.pipeline.recordings import open_recording
from spinscope.pipeline.registry import Parameters
from spinscope.pipeline.session import Session

QUICK = ("--speed", "inf", "--method", "triplet")


@pytest.fixture(autouse=True)
def _warm(monkeypatch: pytest.MonkeyPatch) -> None:
    for module, loading in ((headless, "warm_up"), (camera_view, "load_stages")):
        monkeypatch.setattr(module, loading, lambda: None)  # two recordings with all methods each


def run(*arguments: object) -> Any:
    return CliRunner().invoke(cli, [str(one) for one in arguments])


@pytest.fixture(scope="module")
def bounce(request: pytest.FixtureRequest) -> Session:
    samples: Path = request.getfixturevalue("samples")
    return Session.open(samples / "own/bounce.h5")


def test_lines_and_recording(bounce: Session, tmp_path: Path) -> None:
    lines, raw = tmp_path / "out.jsonl", tmp_path / "a.raw"
    result = run(
        "live",
        "--headless",
        "--replay",
        bounce.recording.path,
        *QUICK,
        "--jsonl",
        lines,
        "--record",
        raw,
        "--split-s",
        1,
    )
    assert result.exit_code == 0, result.output
    written = list(map(json.loads, lines.read_text().splitlines()))
    shots, states = ([one for one in written if key in one] for key in ("start_us", "status"))
    expected = [shot.to_dict(bounce.camera, bounce.ball_radius_m) for shot in bounce.estimate("triplet").shots]
    assert [{name: one[name] for name in expected[0]} for one in shots] == expected
    assert [(one["clock"], one["recorded_us"]) for one in shots] == [(0, 75_000), (0, 120_000)]
    assert all(one["latency_ms"] >= 0 for one in shots)
    told = [one["announced"] for one in written if "announced" in one]
    assert {(one["t_us"], one["ended_by"]) for one in told} == {(one["end_us"], one["ended_by"]) for one in shots}
    assert {"events", "rate_mev_s", "dropped", "backlog_ms", "p50_ms", "p99_ms"} <= states[-1]["status"].keys()
    recorded = open_recording(raw).read()
    assert (recorded.t_us == bounce.source.between(0, 10**9).t_us).all()
    assert "focal_length_mm" in raw.with_suffix(".toml").read_text()
    again = Session.open(raw).estimate("triplet")
    assert [shot.end_us for shot in again.shots] == [one["end_us"] for one in shots]


@pytest.mark.parametrize("suffix", [".csv", ".jsonl", ".parquet"])
def test_a_table_goes_on_after_a_crash(bounce: Session, tmp_path: Path, suffix: str) -> None:
    path, recent = tmp_path / f"day{suffix}", RecentEvents()
    recent(0, bounce.source.between(0, 10**9))
    shots = [LiveShot(shot, 0, 0, 12.5) for shot in bounce.estimate("triplet").shots]
    table = ShotTable(path)
    table.append(shots[0], bounce, recent)
    rows = path if suffix != ".parquet" else tmp_path / "day.parquet.rows.jsonl"
    with open(rows, "a") as file:
        file.write('{"number": 2, "da')  # killed while it wrote
    table = ShotTable(path)
    assert table.count == 1
    table.append(shots[1], bounce, recent)
    table.close()
    found: list[dict[str, Any]]
    if suffix == ".csv":
        with open(path, newline="") as file:
            found = list(csv.DictReader(file))
    elif suffix == ".jsonl":
        found = list(map(json.loads, path.read_text().splitlines()))
    else:
        found = pyarrow.parquet.read_table(path).to_pylist()
    assert [int(one["number"]) for one in found] == [1, 2]
    assert [int(one["end_us"]) for one in found] == [shot.shot.end_us for shot in shots]
    assert [one["began_by"] for one in found] == ["start", "bounce"]
    saved = open_recording(tmp_path / found[1]["events_file"])
    assert saved.read().t_us[0] >= shots[1].shot.start_us - 20_000
    assert (saved.width_px, saved.height_px) == (1280, 720)


def test_events_of_another_table_of_this_name_stay(bounce: Session, tmp_path: Path) -> None:
    """As of day.csv and day.parquet, or of a table that somebody has removed."""
    recent = RecentEvents()
    recent(0, bounce.source.between(0, 10**9))
    shots = [LiveShot(shot, 0, 0, 12.5) for shot in bounce.estimate("triplet").shots]
    rows = [
        ShotTable(tmp_path / f"day{suffix}").append(shots[n], bounce, recent)
        for n, suffix in enumerate((".csv", ".jsonl"))
    ]
    assert [row["events_file"] for row in rows] == ["day_shots/shot_00001.h5", "day_shots/shot_00001-2.h5"]
    starts_us = [int(open_recording(tmp_path / str(row["events_file"])).read().t_us[0]) for row in rows]
    assert starts_us[0] < 5000 < shots[1].shot.start_us - 20_000 <= starts_us[1]


def test_a_shot_whose_events_cannot_be_saved_has_its_row(
    bounce: Session, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The disk is nearly full, or the events are gone: said, and the spin is not lost."""

    def full(path: Path, *_: object, **__: object) -> None:
        raise RecordingError(f"recording cannot be written (No space left on device): {path}")

    recent = RecentEvents()
    shots = [LiveShot(shot, 0, 0, 12.5) for shot in bounce.estimate("triplet").shots]
    table = ShotTable(tmp_path / "day.jsonl")
    assert table.append(shots[0], bounce, recent)["events_file"] is None
    recent(0, bounce.source.between(0, 10**9))
    monkeypatch.setattr("spinscope.app.live.shot_table.write_recording", full)
    assert table.append(shots[1], bounce, recent)["events_file"] is None
    said = capsys.readouterr().err
    assert "events of shot 1 are not saved: they are no longer in memory" in said
    assert "events of shot 2 are not saved: recording cannot be written (No space" in said
    assert [json.loads(line)["number"] for line in table.path.read_text().splitlines()] == [1, 2]


def test_watch_writes_a_table(bounce: Session, tmp_path: Path) -> None:
    table = tmp_path / "day.csv"
    result = run("watch", table, "--replay", bounce.recording.path, *QUICK)
    assert result.exit_code == 0, result.output
    assert "2 shots in" in result.stderr and len(table.read_text().splitlines()) == 3
    assert len(list((tmp_path / "day_shots").iterdir())) == 2


def test_the_page_opens_on_the_running_camera(bounce: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(camera_view, "FIRST_WINDOW_US", 50_000)
    monkeypatch.setattr(web_recording, "_are_loaded", is_known := threading.Event())
    loads: list[set[str]] = []  # with the threads that run meanwhile
    monkeypatch.setattr(camera_view, "load_stages", lambda: loads.append({one.name for one in threading.enumerate()}))
    served: list[Path] = []

    def serve(
        path: Path, choices: object, port: int | None, *, open_browser: bool, hosts: tuple[str, ...], live: CameraView
    ) -> None:
        assert not open_browser and port == 0 and hosts == ("lab.example",)
        assert is_known.is_set()
        served.append(path)
        while live.view().is_running:
            time.sleep(0.01)
        _check_view(live, bounce)

    monkeypatch.setattr(page, "serve", serve)
    options = ("--no-browser", "--port", 0, "--allow-host", "lab.example")
    result = run("live", "--replay", bounce.recording.path, *QUICK, *options)
    assert result.exit_code == 0, result.output
    (path,) = served
    assert path.suffix == ".raw" and not path.exists()  # goes with the program
    (threads,) = loads
    assert "live" in threads and not threads & {"camera", "tracker"}  # the kernels hold up no tracker


def _check_view(live: CameraView, bounce: Session) -> None:
    """The state, picture and last seconds of a run of the bounce."""
    state, shots = live.view(), bounce.estimate("triplet").shots
    assert any(one.noise_on_hz is not None for one in state.seconds)
    assert [row.is_final for row in state.shots] == [True] * len(shots)
    picture = cv2.imdecode(np.frombuffer(live.picture(), np.uint8), cv2.IMREAD_COLOR)
    assert picture is not None and picture.shape == (360, 640, 3) and picture.any()
    window = open_recording(live.save_window(0.02))
    end_us = int(bounce.source.between(0, 10**9).t_us[-1])
    times = window.read().t_us
    assert (times[0] >= end_us - 20_000, times[-1]) == (True, end_us)
    assert "focal_length_mm" in window.path.with_suffix(".toml").read_text()
    paths = [live.save_window(seconds) for seconds in (0.01, 0.03)]
    assert paths[0] == paths[1] == window.path  # of the same moment
    with pytest.raises(CameraError, match="do not change with them"):
        live.set_biases({"fo": 10})
    biases = live.bias_state()
    assert biases.of_camera and "do not change with them" in (biases.locked or "")
    assert biases.values == biases.ranges == {} and not biases.known and not biases.swept
    with pytest.raises(RecordingError, match="the camera has ended"):
        live.set_recording(True)
    for kind, fault in (("stall", "silent"), ("back", None), ("unplugged", "gone"), ("clock", "gone"), ("back", None)):
        live.add_output(LiveNotice(kind, fault or "here"), None)  # type: ignore[arg-type]
        assert live.view().fault == fault
    numbers = [one.number for one in live.view().notices]
    assert numbers == list(range(numbers[0], numbers[0] + 5))
    other = bounce.parameters.with_assignments(["logo.pad_px=6"])
    live.take_parameters(other)
    assert live.opened.run.parameters is other and live.opened.session.parameters is other


def test_a_recording_begins_and_ends_while_the_camera_runs(bounce: Session, tmp_path: Path) -> None:
    """With another clock than the first, and markers of the moment in which they were thought of."""
    camera: Any = SimpleNamespace(
        width_px=1280, height_px=720, name="stand-in", serial="7", biases={}, options=CameraOptions()
    )
    recording, events = (
        CameraRecording(lambda: camera, bounce, tmp_path, lambda kind, text: pytest.fail(text)),
        bounce.source.between(0, 10**9),
    )
    with pytest.raises(RecordingError, match="nothing is recorded"):
        recording.mark("too early")
    recording(0, events)
    recording.begin()
    with pytest.raises(RecordingError, match="is recorded already"):
        recording.begin()
    recording(1, events)
    present = recording.present
    assert present is not None
    while present.events < len(events):
        time.sleep(0.001)
    recording.mark("serve", seconds_ago=0.05)
    recording.end()
    recording(1, events)
    (path,) = tmp_path.glob("live_*.raw")
    assert open_recording(path).read().t_us.tolist() == events.t_us.tolist() and recording.present is None
    (line,) = map(json.loads, path.with_suffix(".markers.jsonl").read_text().splitlines())
    assert (line["text"], line["t_us"], present.markers) == ("serve", int(events.t_us[-1]) - 50_000, 1)


def test_each_file_states_the_camera_that_is_there_when_it_begins(bounce: Session, tmp_path: Path) -> None:
    """Unplugged, plugged in again and set otherwise: biases, region and parameters of that time."""
    biases, events = BiasParameters().as_dict(), bounce.source.between(0, 10**9)
    about: dict[str, Any] = {"width_px": 1280, "height_px": 720, "name": "stand-in", "serial": "7"}
    cameras: list[Any] = [
        SimpleNamespace(**about, biases={**biases, "diff_on": 40}, options=CameraOptions()),
        SimpleNamespace(**about, biases={**biases, "diff_on": 25}, options=CameraOptions((10, 20, 300, 200), 5.0)),
    ]
    there = cameras[0]
    recording = CameraRecording(lambda: there, bounce, tmp_path, lambda kind, text: pytest.fail(text))
    recording.begin(RecordChoice(tmp_path / "a.raw"))
    recording(0, events)
    present = recording.present
    assert present is not None
    while present.events < len(events):
        time.sleep(0.001)
    there = cameras[1]
    recording(1, events)
    recording.end()
    sidecars = [tomllib.loads(path.with_suffix(".toml").read_text()) for path in present.files]
    settings = [tomllib.loads(path.with_suffix(".settings.toml").read_text()) for path in present.files]
    assert [one["biases"]["diff_on"] for one in sidecars] == [40, 25]
    assert [one["device_biases"]["diff_on"] for one in settings] == [40, 25]
    assert settings[0]["device"] == {"name": "stand-in", "serial": "7"}
    assert settings[1]["device"] == {**settings[0]["device"], "roi_px": [10, 20, 300, 200], "most_mev_s": 5.0}


def test_biases_that_change_while_it_is_recorded_are_noted(bounce: Session, tmp_path: Path) -> None:
    about: dict[str, Any] = {"width_px": 1280, "height_px": 720, "name": "stand-in", "serial": "7"}
    camera: Any = SimpleNamespace(**about, biases={"refr": 4}, options=CameraOptions())
    recording = CameraRecording(lambda: camera, bounce, tmp_path, lambda kind, text: pytest.fail(text))
    asked: list[object] = []
    stream = SimpleNamespace(set_biases=lambda biases: asked.append(biases) or 7, camera=camera)
    run_: Any = SimpleNamespace(stream=stream)
    live = OpenLive(bounce, run_, RecentEvents(), recording)
    assert live.set_biases({"fo": 3}) == 7
    recording.begin(RecordChoice(tmp_path / "a.raw"))
    live.set_biases({"refr": 4})
    live.set_biases({"diff_on": 10, "diff_off": 12, "refr": 4})
    recording.end()
    (line,) = map(json.loads, (tmp_path / "a.markers.jsonl").read_text().splitlines())
    assert line["text"] == "biases: diff_on = 10, diff_off = 12"
    assert asked == [{"fo": 3}, {"refr": 4}, {"diff_on": 10, "diff_off": 12, "refr": 4}]


def test_without_a_camera_no_table_is_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def open_live(*_: object) -> None:
        raise CameraError("no camera is plugged in")

    monkeypatch.setattr(headless, "open_live", open_live)
    assert run("watch", tmp_path / "day.csv").exit_code != 0 and not list(tmp_path.iterdir())


def test_old_recordings_of_the_last_seconds_are_removed(tmp_path: Path) -> None:
    recent, live = RecentEvents(), CameraView(tmp_path, 30.0)
    opened: Any = SimpleNamespace(width_px=4, height_px=4, biases={}, parameters=Parameters())
    opened.stream = SimpleNamespace(camera=opened)
    live.begin(OpenLive(opened, opened, recent, opened))
    with pytest.raises(RecordingError, match="no event"):
        live.save_window(1.0)
    for number in range(WINDOWS_KEPT + 2):
        recent(0, EventBatch.checked([1000 * number + 999], [1], [1], [True], width_px=4, height_px=4))
        live.save_window(1.0)
    assert len(list(tmp_path.glob("*.raw"))) == len(list(tmp_path.glob("*.toml"))) == WINDOWS_KEPT


def test_a_camera_that_cannot_be_opened_opens_no_page(monkeypatch: pytest.MonkeyPatch) -> None:
    def open_live(*_: object) -> None:
        raise CameraError("no camera is plugged in")

    monkeypatch.setattr(headless, "open_live", open_live)
    result = run("live", "--no-browser")
    assert "no camera is plugged in" in str(result.exception) and not result.stderr  # no page is announced


def test_a_table_of_others_is_refused(bounce: Session, tmp_path: Path) -> None:
    (tmp_path / "mine.csv").write_text("a,b\n1,2\n")
    result = run("watch", tmp_path / "mine.csv", "--replay", bounce.recording.path)
    assert "other columns" in str(result.exception)
    assert (tmp_path / "mine.csv").read_text() == "a,b\n1,2\n"


def test_clients_get_every_line_and_slow_ones_hold_nobody_up() -> None:
    with JsonServer(0) as server:
        quick = socket.create_connection(("127.0.0.1", server.port))
        slow = socket.create_connection(("127.0.0.1", server.port))
        while len(server._clients) < 2:
            time.sleep(0.001)
        lines, line = quick.makefile("rb"), {"text": "x" * 100_000}
        for _ in range(200):  # more than the system keeps for the slow one
            sending = threading.Thread(target=server.send, args=(line,))
            sending.start()
            assert json.loads(lines.readline()) == line
            sending.join()
        assert len(server._clients) == 1
    assert lines.read() == b""
    quick.close()
    slow.close()


@pytest.mark.skipif(os.name != "posix", reason="needs named pipes")
def test_a_pipe_goes_on_with_its_next_reader(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A robot's program that ends holds nothing up; the next one begins with a whole line."""
    pipe = tmp_path / "shots"
    os.mkfifo(pipe)
    line = {"text": "x" * 50_000}  # more than a pipe takes at once
    first, read = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK), list[bytes]()
    with JsonLines(str(pipe)) as lines:
        os.close(first)
        for _ in range(3):
            lines.write(line)
        second = open(pipe, "rb")  # noqa: SIM115
        reading = threading.Thread(target=lambda: read.append(second.readline()))
        reading.start()
        lines.write(line)
        reading.join()
        second.close()
    assert json.loads(read[0]) == line
    said = capsys.readouterr().err
    assert said.count("nobody reads the pipe any more") == 1 and f"reads the pipe {pipe}" in said


def test_recent_events_are_bounded() -> None:
    recent = RecentEvents()
    for start_us in range(0, 20_000_000, 100_000):
        recent(0, EventBatch.checked([start_us], [1], [1], [True], width_px=4, height_px=4))
    kept = recent.between(0, 0, 20_000_000)
    assert kept.t_us[0] == 9_900_000 and kept.t_us[-1] == 19_900_000
    assert not len(recent.between(1, 0, 20_000_000))


def test_few_of_the_recent_packets_are_cut(monkeypatch: pytest.MonkeyPatch) -> None:
    """Thirty seconds are 30,000 packets: each that is cut takes Python's lock from the tracker. Late ones are found."""
    recent, cut, between = RecentEvents(), list[int](), EventBatch.between
    for start_us in (*range(0, 1_000_000, 1000), 500_200):  # the last one is late
        times = [start_us, start_us + 999]
        recent(0, EventBatch.checked(times, [1, 1], [1, 1], [True, True], width_px=4, height_px=4))

    def counted(events: EventBatch, start_us: int, end_us: int) -> EventBatch:
        cut.append(int(events.t_us[0]))
        return between(events, start_us, end_us)

    monkeypatch.setattr(EventBatch, "between", counted)
    found = recent.between(0, 499_999, 502_000)
    assert found.t_us.tolist() == [499_999, 500_000, 500_999, 501_000, 501_999, 500_200, 501_199]
    assert cut == [499_000, 500_000, 501_000, 500_200]


def test_events_of_shots_without_their_spin_are_kept() -> None:
    """As long as the spins are behind, also over another clock; and what nobody needs is not."""
    recent = RecentEvents(1_000_000)

    def pass_by(clock: int, start_us: int, end_us: int) -> None:
        for t_us in range(start_us, end_us, 100_000):
            recent(clock, EventBatch.checked([t_us], [1], [1], [True], width_px=4, height_px=4))

    def kept(clock: int) -> tuple[int, int]:
        times = recent.between(clock, 0, 10**9).t_us
        return (int(times[0]), int(times[-1])) if len(times) else (-1, -1)

    pass_by(0, 0, 3_000_000)
    assert kept(0) == (1_900_000, 2_900_000)
    recent.keep_from(0, 3_000_000)
    pass_by(0, 3_000_000, 9_000_000)
    pass_by(1, 500_000, 2_000_000)
    assert kept(0) == (2_000_000, 8_900_000) and kept(1) == (500_000, 1_900_000)
    recent.keep_from(1, 1_900_000)
    pass_by(1, 2_000_000, 2_100_000)
    assert kept(0) == (-1, -1) and kept(1) == (900_000, 2_000_000)


def test_clocks_that_begin_anew_fill_no_memory() -> None:
    recent = RecentEvents(1_000_000)
    for clock in range(100):
        for t_us in range(0, 500_000, 100_000):
            recent(clock, EventBatch.checked([t_us], [1], [1], [True], width_px=4, height_px=4))
    assert sum(len(recent.between(clock, 0, 10**9)) for clock in range(100)) < 20


def test_recent_events_are_bounded_in_number(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("spinscope.pipeline.cameras.recent_events.KEPT_EVENTS", 10)
    recent = RecentEvents()
    for t_us in range(25):
        recent(0, EventBatch.checked([t_us], [1], [1], [True], width_px=4, height_px=4))
    assert recent.between(0, 0, 100).t_us.tolist() == list(range(15, 25))


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("live", "--headless", "--loop"), "--replay FILE"),
        (("live", "--headless", "--split-s", "5"), "--record NAME.raw"),
        (("watch", "table.txt"), "a table is one of"),
        (("live", "--headless", "--replay", "x.h5", "--window", "0", "5"), "no --window"),
        (("live", "--headless", "--replay", "{}", "--record", "a.h5"), "ends with .raw"),
        (("live", "--headless", "--replay", "{}", "--roi", "0", "0", "9", "9"), "are of a camera"),
        (("live", "--headless", "--replay", "{}", "--speed", "0"), "speed = 0 is no speed"),
        (("live", "--headless", "--replay", "{}", "--jsonl", "/nowhere/out"), "lines cannot be written"),
    ],
)
def test_errors_say_what_to_do(bounce: Session, arguments: tuple[str, ...], said: str) -> None:
    result = run(*(one.format(bounce.recording.path) for one in arguments))
    assert result.exit_code != 0
    assert said in f"{result.output} {result.exception}"


@pytest.mark.skipif(not Path("/dev/full").exists() or os.name != "posix", reason="needs /dev/full")
def test_a_full_disk_under_the_lines_is_said(bounce: Session) -> None:
    result = run("live", "--headless", "--replay", bounce.recording.path, *QUICK, "--jsonl", "/dev/full")
    assert "lines cannot be written (No space left on device)" in str(result.exception)
