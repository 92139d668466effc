"""The recorder: what comes is on disk at once, in files that open, also when it is killed or the disk is full."""

from __future__ import annotations

import errno
import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from spinscope.pipeline.cameras import Recorder
from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.live import raw_file
from spinscope.pipeline.recordings import open_recording


def some(start_us: int, count: int = 200, length_us: int = 1000) -> EventBatch:
    made = np.random.default_rng(start_us)
    t_us = np.sort(made.integers(start_us, start_us + length_us, count))
    x_px, y_px = (made.integers(0, size, count, np.uint16) for size in (1280, 720))
    return EventBatch(t_us, x_px, y_px, made.random(count) < 0.5)


def recorder(path: Path, **options: Any) -> Recorder:
    return Recorder(path, lambda one: raw_file(one, 1280, 720, {"serial_number": "7"}), **options)


def read(paths: list[Path]) -> EventBatch:
    return EventBatch.concatenate(open_recording(path).read() for path in paths)


def equal(a: EventBatch, b: EventBatch) -> bool:
    return all(np.array_equal(x, y) for x, y in zip(a.columns, b.columns, strict=True))


@pytest.mark.parametrize(("limits", "files"), [({}, 1), ({"most_us": 20_000}, 5), ({"most_bytes": 5_000}, 20)])
def test_all_events_are_in_files_of_the_size_asked_for(tmp_path: Path, limits: dict[str, int], files: int) -> None:
    batches = [some(start_us) for start_us in range(0, 100_000, 1000)]
    writing = recorder(tmp_path / "a.raw", beside=lambda: {".toml": "[camera]\nfocal_length_mm = 12.0\n"}, **limits)
    for batch in batches:
        writing(0, batch)
    writing.close()
    assert abs(len(writing.files) - files) <= files // 6
    assert equal(read(writing.files), EventBatch.concatenate(batches))
    assert [path.name for path in writing.files[:2]] == ["a.raw", "a-2.raw"][: len(writing.files)]
    for path in writing.files:
        assert "focal_length_mm = 12.0" in path.with_suffix(".toml").read_text()


def test_another_clock_begins_another_file(tmp_path: Path) -> None:
    writing = recorder(tmp_path / "a.raw")
    writing(0, some(5000))
    writing(1, some(100))
    writing.close()
    assert [int(open_recording(path).read().t_us[0] // 1000) for path in writing.files] == [5, 0]


def test_a_file_that_exists_is_kept(tmp_path: Path) -> None:
    (tmp_path / "a.raw").write_text("mine")
    with pytest.raises(RecordingError, match=r"cannot be written \(it exists\): give another name"):
        recorder(tmp_path / "a.raw")
    assert (tmp_path / "a.raw").read_text() == "mine"


def test_a_recording_goes_on_behind_the_files_that_are_there(tmp_path: Path) -> None:
    for start_us in (0, 100_000):
        writing = recorder(tmp_path / "a.raw", goes_on=True)
        writing(0, some(start_us))
        writing(1, some(start_us + 50_000))
        writing.close()
    assert [path.name for path in writing.files] == ["a-3.raw", "a-4.raw"]
    paths = [tmp_path / name for name in ("a.raw", "a-2.raw", "a-3.raw", "a-4.raw")]
    assert equal(read(paths), EventBatch.concatenate(some(start_us) for start_us in range(0, 200_000, 50_000)))


def test_a_file_opens_from_the_moment_it_is_there(tmp_path: Path) -> None:
    writing = raw_file(tmp_path / "a.raw", 640, 480, {})
    assert open_recording(tmp_path / "a.raw").width_px == 640
    writing.close()
    assert [path.name for path in tmp_path.iterdir()] == ["a.raw"]


def test_a_full_disk_is_said_and_ends_the_recording_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    notices: list[str] = []
    writing = recorder(tmp_path / "a.raw", on_notice=lambda kind, text: notices.append(text))
    batches = [some(start_us) for start_us in range(0, 10_000, 1000)]
    file = writing._file
    assert file is not None
    write = file.write

    def full(events: EventBatch) -> None:
        if events.t_us[0] >= 5000:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        write(events)

    monkeypatch.setattr(file, "write", full)
    for batch in batches:
        writing(0, batch)
    writing.close()
    assert len(notices) == 1 and "No space left on device" in notices[0] and "live goes on" in notices[0]
    assert equal(read(writing.files), EventBatch.concatenate(batches[:5]))


def test_markers(tmp_path: Path) -> None:
    writing = recorder(tmp_path / "a.raw")
    writing(0, some(5000))
    writing.mark("topspin by hand")
    writing.close()
    (line,) = map(json.loads, (tmp_path / "a.markers.jsonl").read_text().splitlines())
    assert line["text"] == "topspin by hand" and line["file"] == "a.raw"


KILLED = """
import sys, time
import numpy as np
from pathlib import Path
from spinscope.pipeline.cameras import Recorder
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.live import raw_file
made = np.random.default_rng(0)
warm = raw_file(Path(sys.argv[1]).with_name("warm"), 1280, 720, {})
warm.write(EventBatch.checked([5], [1], [1], [True], width_px=1280, height_px=720))  # loads the encoder
writing = Recorder(Path(sys.argv[1]), lambda path: raw_file(path, 1280, 720, {}), most_us=300_000)
print("ready", flush=True)
begin = time.monotonic()
t_us = 0
while True:
    now_us = int((time.monotonic() - begin) * 1e6)
    if now_us - t_us >= 1000:
        times = np.sort(made.integers(t_us, now_us, now_us - t_us))
        x, y = (made.integers(0, size, times.size, np.uint16) for size in (1280, 720))
        writing(0, EventBatch(times, x, y, x % 2 == 0))
        t_us = now_us
        print(t_us, flush=True)
"""


def killed_after(path: Path, seconds: float) -> tuple[int, list[Path]]:
    """Time up to which events had been handed over when the recorder was killed, and its files."""
    process = subprocess.Popen([sys.executable, "-c", KILLED, str(path)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    time.sleep(seconds)
    process.send_signal(signal.SIGKILL)
    lines = process.stdout.read().split()
    process.stdout.close()
    process.wait()
    number = len(list(path.parent.glob("*.raw")))
    return int(lines[-1]) if lines else 0, [path, *(path.with_stem(f"a-{n}") for n in range(2, number + 1))]


@pytest.mark.parametrize("kills", [2, pytest.param(50, marks=pytest.mark.slow)])
def test_killed_at_any_moment_at_most_a_second_is_lost(tmp_path: Path, kills: int) -> None:
    moments = random.Random(7)
    for kill in range(kills):
        folder = tmp_path / str(kill)
        folder.mkdir()
        given_us, paths = killed_after(folder / "a.raw", moments.uniform(0.2, 1.2))
        events = EventBatch.concatenate(open_recording(path).read() for path in paths)
        assert given_us - (int(events.t_us[-1]) if len(events) else 0) < 1_000_000
        assert np.all(np.diff(events.t_us) >= 0)
