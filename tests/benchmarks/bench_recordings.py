"""Reading speed in events a second, against the twins and the usual libraries.

    pytest tests/benchmarks/bench_recordings.py --benchmark-only -s

Every test prints its own figure and the ratio to what it is compared with, measured in the same run. The libraries are
installed with `uv run --group rivals pytest ...`; those that are not are left out.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.recordings import open_recording, summary, write_recording
from tests.reference.recordings import ecf_block, naive_evt2, naive_evt3, write_evt2

EVENTS = 2_000_000
TWIN_EVENTS = 20_000


def scene(n: int) -> EventBatch:
    """n events at 10 million a second, in bursts along rows as sensors read them out."""
    rng = np.random.default_rng(1)
    t = np.sort(rng.integers(0, max(n // 10, 1), n))
    y = (np.cumsum(rng.random(n) < 0.2) * 37 % 720).astype(np.uint16)
    return EventBatch(t, rng.integers(0, 1280, n).astype(np.uint16), y, rng.integers(0, 2, n).astype(np.bool_))


def best_seconds(run: Callable[[], Any], times: int = 3, clock: Callable[[], float] = time.process_time) -> float:
    """Seconds of the fastest of several runs.

    Processor time, for which other work on the machine does not count; time.perf_counter where another process reads.
    """
    seconds = []
    for _ in range(times):
        start = clock()
        run()
        seconds.append(clock() - start)
    return min(seconds)


def say(name: str, seconds: float, other: str, other_seconds: float) -> None:
    ratio = other_seconds / seconds
    sys.stdout.write(f"\n{name}: {EVENTS / seconds / 1e6:.1f} Mev/s, {ratio:.2f} x {other}\n")


@pytest.mark.parametrize("format", ["EVT3", "EVT2"])
def test_raw_against_its_twin(benchmark: Any, tmp_path: Path, format: str) -> None:
    path, write = tmp_path / "a.raw", write_recording if format == "EVT3" else write_evt2
    write(path, scene(TWIN_EVENTS), width_px=1280, height_px=720)
    data = path.read_bytes()
    words = data[data.index(b"% end\n") + 6 :]
    numbers = np.frombuffer(words, "<u2" if format == "EVT3" else "<u4").tolist()
    twin = naive_evt3 if format == "EVT3" else naive_evt2
    twin_seconds = best_seconds(lambda: twin(numbers), 1) * EVENTS / TWIN_EVENTS
    write(path, scene(EVENTS), width_px=1280, height_px=720)
    recording = open_recording(path)
    recording.scan()
    benchmark.pedantic(recording.scan, rounds=3)
    say(f"{format} RAW scan", best_seconds(recording.scan), "the twin", twin_seconds)


def test_hdf5_against_h5py(benchmark: Any, tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    write_recording(path, scene(EVENTS), width_px=1280, height_px=720)
    recording = open_recording(path)

    def plain() -> list[Any]:
        with h5py.File(path) as file:
            return [file["events"][name][:] for name in "txyp"]

    benchmark.pedantic(recording.read, rounds=3)
    say("HDF5 read", best_seconds(recording.read, clock=time.perf_counter), "h5py alone", best_seconds(plain))


@pytest.mark.parametrize("way", [0, 1, 2])
def test_ecf(tmp_path: Path, way: int) -> None:
    """Prophesee's HDF5 in the three ways in which it packs pixels: a few blocks again and again."""
    rows, repeats = 1 << 14, 16
    blocks = EVENTS // rows // repeats
    t_us, x, y, p = (column.astype(np.int64) for column in scene(blocks * rows).columns)
    parts = [slice(first, first + rows) for first in range(0, t_us.size, rows)]
    packed = [ecf_block(t_us[part], x[part], y[part], p[part], way) for part in parts]
    kind = np.dtype([("x", "<u2"), ("y", "<u2"), ("p", "<i2"), ("t", "<i8")])
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.attrs["geometry"] = "1280x720"
        settings = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        settings.set_chunk((rows,))
        settings.set_filter(0x8ECF, h5py.h5z.FLAG_OPTIONAL, ())
        space = h5py.h5s.create_simple((repeats * t_us.size,))
        data = h5py.h5d.create(file.create_group("CD").id, b"events", h5py.h5t.py_create(kind), space, settings)
        for number in range(repeats * blocks):
            block, first_us = packed[number % blocks], int(t_us[number % blocks * rows])
            first_us += number // blocks * (int(t_us[-1]) + 1)
            data.write_direct_chunk((number * rows,), block[:4] + first_us.to_bytes(8, "little") + block[12:])
    recording = open_recording(tmp_path / "a.h5")
    events = len(recording.read())
    assert events == repeats * t_us.size and not any(recording.damage.sentences())
    seconds = best_seconds(recording.read, 7, time.perf_counter)
    sys.stdout.write(f"\nECF packed in way {way}: {events / seconds / 1e6:.1f} Mev/s\n")


def test_npz_against_numpy(benchmark: Any, tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    write_recording(path, scene(EVENTS), width_px=1280, height_px=720)
    recording = open_recording(path)

    def plain() -> list[Any]:
        with np.load(path) as arrays:
            return [arrays[name] for name in "txyp"]

    benchmark.pedantic(recording.read, rounds=3)
    say("NPZ read", best_seconds(recording.read), "numpy.load alone", best_seconds(plain))


def write_dat(path: Path, events: EventBatch, *, width_px: int, height_px: int) -> None:
    """Prophesee DAT, which Spinscope only reads."""
    pixel = events.x_px.astype("<u4") | events.y_px.astype("<u4") << 14 | events.on.astype("<u4") << 28
    header = f"% Data file\n% Version 2\n% Height {height_px}\n% Width {width_px}\n".encode()
    path.write_bytes(header + bytes((12, 8)) + np.stack([events.t_us.astype("<u4"), pixel], axis=1).tobytes())


def faery_read(path: Path, encoding: str) -> int:
    return len(pytest.importorskip("faery").events_stream_from_file(path).to_array())


def evutils_read(path: Path, encoding: str) -> int:
    io = pytest.importorskip("evutils.io")
    with io.EventReader(str(path), mode="all", max_events=1 << 40, index=False) as reader:
        return len(reader.read())


def expelliarmus_read(path: Path, encoding: str) -> int:
    return len(pytest.importorskip("expelliarmus").Wizard(encoding=encoding.lower()).read(str(path)))


@pytest.mark.parametrize("rival", [faery_read, evutils_read, expelliarmus_read])
@pytest.mark.parametrize("format", ["EVT3", "EVT2", "DAT"])
def test_reading_against_other_libraries(tmp_path: Path, format: str, rival: Callable[[Path, str], int]) -> None:
    write = {"EVT3": write_recording, "EVT2": write_evt2, "DAT": write_dat}[format]
    path = tmp_path / ("a.dat" if format == "DAT" else "a.raw")
    write(path, scene(EVENTS), width_px=1280, height_px=720)
    assert rival(path, format) == EVENTS
    own_seconds = best_seconds(lambda: open_recording(path).read(), 7)
    say(f"{format} read", own_seconds, rival.__name__, best_seconds(lambda: rival(path, format), 7))


def test_summary_against_reading_alone(benchmark: Any, tmp_path: Path) -> None:
    path = tmp_path / "a.raw"
    write_recording(path, scene(EVENTS), width_px=1280, height_px=720)
    recording = open_recording(path)
    recording.scan()
    benchmark.pedantic(lambda: summary(recording), rounds=3)
    say("summary of EVT3", best_seconds(lambda: summary(recording), 7), "reading", best_seconds(recording.read, 7))


def test_seeking_in_an_indexed_file(tmp_path: Path) -> None:
    """A window of 5 ms anywhere in a file that was read once: what a click in the overview waits for."""
    path = tmp_path / "a.raw"
    write_recording(path, scene(EVENTS), width_px=1280, height_px=720)
    recording = open_recording(path)
    last_us = recording.index().last_us
    starts_us = np.random.default_rng(3).integers(0, last_us - 5000, 50).tolist()
    seconds = best_seconds(lambda: [recording.read(start_us, start_us + 5000) for start_us in starts_us]) / 50
    sys.stdout.write(
        f"\nseek and read of 5 ms: {seconds * 1e3:.1f} ms, whole file {best_seconds(recording.read):.2f} s\n"
    )
