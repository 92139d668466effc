"""Ends asked for by signals, one or many: everything is written, nothing is left running, no traceback."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pyarrow.parquet
import pytest

from spinscope.app.terminal import ends_on_signals
from spinscope.pipeline.recordings import open_recording

SIGNALS = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
PATIENCE_S = 300.0  # the first run on a machine compiles the kernels
REPLAY = ("--replay", "sample_recordings/own/rally.h5", "--loop", "--method", "triplet")
BOUNCE, ROUND_MS = "sample_recordings/own/bounce.h5", 500  # of it and the gap behind it
PAGES = {
    "tune": ("tune", "sample_recordings/spinner_ball2_side.h5", "--no-browser", "--port", "0"),
    "view": ("view", "sample_recordings/spinner_ball2_side.h5", "--no-browser", "--port", "0"),
    "live": ("live", *REPLAY, "--no-browser", "--port", "0"),
    "coach": ("coach", "live", *REPLAY, "--no-browser", "--port", "0", "--session", "{folder}/day"),
}

pytestmark = pytest.mark.skipif(os.name != "posix", reason="a group of processes gets the signals of its terminal")


@contextmanager
def program(*arguments: str) -> Iterator[tuple[subprocess.Popen[str], Iterator[str]]]:
    """The program in a group of its own, as a terminal starts it, and the lines that it prints, of both streams.

    Signals end it also where the tests were started to outlive their terminal.
    """
    with subprocess.Popen(
        [sys.executable, "-m", "spinscope", *arguments],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
        preexec_fn=lambda: [signal.signal(one, signal.SIG_DFL) for one in SIGNALS],
    ) as process:
        hanging = threading.Timer(PATIENCE_S, os.killpg, (process.pid, signal.SIGKILL))
        hanging.start()
        try:
            assert process.stdout is not None
            yield process, iter(process.stdout.readline, "")
            assert hanging.is_alive(), "it had to be killed"
        finally:
            hanging.cancel()
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)


def told_again_and_again(process: subprocess.Popen[str], chosen: list[signal.Signals]) -> None:
    """Send signals to the whole group, one after the other, until the program has ended."""
    while process.poll() is None:
        for one in chosen:
            os.killpg(process.pid, one)
        time.sleep(0.005)


def until_the_group_is_gone(group: int) -> None:
    """Wait for the processes behind the program, which end when their pipes do; the timer kills what stays."""
    with suppress(ProcessLookupError):
        while True:
            os.killpg(group, 0)
            time.sleep(0.01)


@pytest.mark.parametrize("name", PAGES)
def test_a_page_ends_whatever_comes_how_often(name: str, tmp_path: Path) -> None:
    with program(*(one.format(folder=tmp_path) for one in PAGES[name])) as (process, lines):
        said = next(line for line in lines if "http://127.0.0.1" in line or "Traceback" in line)
        told_again_and_again(process, SIGNALS)
        said += "".join(lines)
        assert process.returncode == 0 and "Traceback" not in said and "Exception" not in said, said
        until_the_group_is_gone(process.pid)


@pytest.mark.parametrize("one", SIGNALS)
def test_a_watched_camera_s_table_is_whole(one: signal.Signals, tmp_path: Path) -> None:
    table, raw = tmp_path / "day.parquet", tmp_path / "day.raw"
    with program("watch", str(table), "--record", str(raw), *REPLAY) as (process, lines):
        said = next(line for line in lines if line.startswith("shot 2") or "Traceback" in line)
        told_again_and_again(process, [one])
        rest = list(lines)
    assert process.returncode == 0 and "Traceback" not in said, rest
    rows = pyarrow.parquet.read_table(table).to_pylist()
    assert len(rows) >= 2 and rest[-1].startswith(f"{len(rows)} shots in {table}")
    assert all((tmp_path / row["events_file"]).is_file() for row in rows)


def spins_of(process: int) -> int:
    """The process of the spins that another one has started (Linux)."""
    for folder in Path("/proc").iterdir():
        with suppress(OSError, ValueError):
            parent = (folder / "stat").read_text().rpartition(")")[2].split()[1]
            if int(parent) == process and "live_spins" in (folder / "cmdline").read_text():
                return int(folder.name)
    raise AssertionError("there is none")


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
@pytest.mark.parametrize("name", ["watch", "live"])
def test_an_end_says_what_it_waits_for_and_comes_at_once_when_asked_for_again(name: str, tmp_path: Path) -> None:
    """With a process of the spins that stands still, so that they never come."""
    table, raw, jsonl = tmp_path / "day.csv", tmp_path / "day.raw", tmp_path / "lines.jsonl"
    command = ("watch", str(table)) if name == "watch" else ("live", "--no-browser", "--port", "0")
    outputs = "--record", str(raw), "--jsonl", str(jsonl)
    with program(*command, "--replay", BOUNCE, "--loop", "--method", "triplet", *outputs) as (process, lines):
        next(line for line in lines if line.startswith("shot 2"))
        os.kill(spins_of(process.pid), signal.SIGSTOP)
        while '"spin_backlog_ms":' not in (last := jsonl.read_text().rpartition('{"status"')[2]) or (
            float(last.partition('"spin_backlog_ms":')[2].split(",")[0]) < ROUND_MS
        ):
            time.sleep(0.1)
        os.killpg(process.pid, signal.SIGINT)
        said = next(line for line in lines if line.startswith("ending") or "Traceback" in line)
        assert "shots; Ctrl-C ends it at once" in said
        told_again_and_again(process, [signal.SIGINT])
        rest = list(lines)
    assert process.returncode == 0 and not any("Traceback" in line for line in rest), rest
    assert any(line.startswith("ended without the spins of ") for line in rest)
    if name == "watch":
        rows = table.read_text().splitlines()
        assert len(rows) >= 3 and rest[-1].startswith(f"{len(rows) - 1} shots in {table}")
    assert open_recording(raw).read().t_us.size > 0


@contextmanager
def handled_signals() -> Iterator[None]:
    """Signals as a program finds them, also where the tests were started with some ignored; put back afterwards."""
    before = {one: signal.signal(one, signal.SIG_DFL) for one in SIGNALS}
    try:
        yield
    finally:
        for one, handler in before.items():
            signal.signal(one, handler)


def test_signals_of_one_request_are_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """As when a shell hands on what the terminal has sent already."""
    now_s, asked = [100.0], list[float]()
    monkeypatch.setattr("spinscope.app.terminal.time.monotonic", lambda: now_s[0])
    with handled_signals():
        with ends_on_signals(lambda: asked.append(now_s[0])):
            for now_s[0], requests in ((100.0, 1), (100.01, 1), (100.4, 1), (101.0, 2), (101.01, 2)):
                for one in SIGNALS:
                    signal.raise_signal(one)
                while len(asked) < requests:  # by another thread
                    time.sleep(0.001)
        signal.raise_signal(signal.SIGINT)  # nothing comes of it any more
    assert asked == [100.0, 101.0]


def test_an_end_may_need_what_the_main_thread_holds_when_the_signal_comes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("spinscope.app.terminal._requested_s", -math.inf)
    lock, ends = threading.Lock(), list[str]()

    def end() -> None:
        with lock:
            ends.append(threading.current_thread().name)

    with handled_signals(), ends_on_signals(end), lock:
        signal.raise_signal(signal.SIGINT)
    assert ends == ["requests for the end"]


@pytest.mark.parametrize(("one", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
@pytest.mark.parametrize("place", ["class Owner: name = Loaded()", "Dropped(); time.sleep(60)"])
def test_an_error_that_python_wraps_or_drops_is_still_the_end_asked_for(
    place: str, one: signal.Signals, status: int
) -> None:
    """While a class gets its attributes, as modules do that are being loaded, and in a finalizer."""
    script = f"""
import time
from spinscope.app import cli

def wait(*_):
    print("here", flush=True)
    time.sleep(60)

class Loaded:
    __set_name__ = wait

class Dropped:
    __del__ = wait

def command(*_, **__):
    {place}

cli.cli.main = command
cli.main()
"""
    with subprocess.Popen(
        [sys.executable, "-c", script], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None and process.stdout.readline() == "here\n"
        process.send_signal(one)
        said = process.communicate(timeout=PATIENCE_S)[1]
    assert (process.returncode, said) == (status, "")


def test_an_end_asked_for_while_it_starts_is_an_end(tmp_path: Path) -> None:
    with program("watch", str(tmp_path / "day.csv"), *REPLAY) as (process, lines):
        said = next(lines)
        told_again_and_again(process, [signal.SIGINT])
        said += "".join(lines)
    assert process.returncode in (0, 130) and "Traceback" not in said, said
