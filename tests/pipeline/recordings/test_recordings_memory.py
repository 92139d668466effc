"""Memory and first looks of the commands on a recording that would take a gigabyte if it were held."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.recordings import open_recording, write_recording

pytestmark = pytest.mark.slow

ROUNDS, ROUND_US, NOISE = 320, 200_000, 80_000
EVENTS_BYTES = 13
# A process with all libraries and kernels takes 250 to 350 MB; the events would take 850 MB more.
MOST_MB = {"info": 400, "convert": 400, "window": 450, "tune": 500, "analyze": 500}
TUNE = """
import sys, time
from pathlib import Path
from spinscope.app.web.open_recording import OpenRecording
from spinscope.pipeline.session import Choices
opened = OpenRecording.open(Path(sys.argv[1]), Choices())
counts, edges = opened.rate(1200)
assert opened.is_long and counts.sum() > 6e7
first, last = opened.window_us
for share in (0.9, 0.1, 0.5):
    begin, start_us = time.process_time(), int(first + share * (last - first))
    clip = opened.clip(start_us, start_us + 300_000)
    assert len(clip.source.between(start_us, start_us + 300_000)) > 200_000
    assert time.process_time() - begin < 1, "a clip within a second of the click"
"""


def rounds(flight: EventBatch) -> Iterator[EventBatch]:
    """The flight again and again, in noise."""
    rng = np.random.default_rng(20261129)
    for number in range(ROUNDS):
        t_us = np.append(flight.t_us, rng.integers(0, ROUND_US, NOISE)) + number * ROUND_US
        x_px = np.append(flight.x_px, rng.integers(0, 1280, NOISE).astype(np.uint16))
        y_px = np.append(flight.y_px, rng.integers(0, 720, NOISE).astype(np.uint16))
        on = np.append(flight.on, rng.integers(0, 2, NOISE) == 1)
        order = np.argsort(t_us, kind="stable")
        yield EventBatch(t_us[order], x_px[order], y_px[order], on[order])


@pytest.fixture(scope="module")
def long_recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    samples = Path(__file__).parents[3] / "sample_recordings"
    path = tmp_path_factory.mktemp("long") / "long.raw"
    write_recording(path, rounds(open_recording(samples / "flight_fast_top.h5").read()), width_px=1280, height_px=720)
    assert path.stat().st_size > 300e6
    return path


def peak_mb(arguments: list[str], cache: Path) -> tuple[float, str]:
    """Largest resident memory of a command that has to succeed, and of the processes it started; what it noted."""
    environment = {**os.environ, "XDG_CACHE_HOME": str(cache)}
    process = subprocess.Popen(
        [sys.executable, *arguments], env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    assert process.stderr is not None
    with process.stderr as errors:
        said = errors.read()
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == 0, said
    return usage.ru_maxrss / 1e3, said


@pytest.mark.parametrize("command", MOST_MB)
def test_a_long_recording_is_not_held_in_memory(long_recording: Path, tmp_path: Path, command: str) -> None:
    end_us = ROUNDS * ROUND_US
    window = ["--window", str(end_us - 2 * ROUND_US), str(end_us)]
    arguments = {
        "info": ["-m", "spinscope", "info", str(long_recording)],
        "convert": ["-m", "spinscope", "convert", str(long_recording), str(tmp_path / "b.h5")],
        "window": ["-m", "spinscope", "analyze", str(long_recording), "--method", "triplet", *window],
        "tune": ["-c", TUNE, str(long_recording)],
        "analyze": ["-m", "spinscope", "analyze", str(long_recording), "--method", "triplet"],  # 320 shots
    }[command]
    assert MOST_MB[command] * 1e6 < EVENTS_BYTES * ROUNDS * (120_000 + NOISE)
    peak, said = peak_mb(arguments, tmp_path / "cache")
    assert command != "info" or "EVT3 RAW, 1280 x 720 px (from: file), " in said, "a first look before all is counted"
    sys.stdout.write(f"{command}: {peak:.0f} MB\n")
    assert peak < MOST_MB[command]
