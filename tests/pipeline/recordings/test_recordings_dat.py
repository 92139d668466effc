"""DAT: the decoder against a slow one, and what damage costs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.recordings import ReadingOptions, open_recording
from spinscope.pipeline.recordings.formats.prophesee_dat.reader import DatReader
from spinscope.pipeline.recordings.reader import ReadPass
from tests.pipeline.recordings.column_files import assert_columns, some_columns
from tests.reference.recordings import NaiveDecoded, naive_dat

HEADER = b"% Data file\n% Height 720\n% Width 1280\n" + bytes((12, 8))
N = 2000

# Steps from one time to the next: near, far ahead, back, and anywhere.
STEPS = st.one_of(
    st.integers(0, 500),
    st.integers(-10_005, 10_005),
    st.integers(0, 3_000_000),
    st.integers(-(1 << 32), 1 << 32),
    st.sampled_from([0, 9_999, 10_000, 10_001, -9_999, -10_000, -10_001, 1 << 31, 1_000_000, 1_000_001]),
)


@st.composite
def dat_words(draw: st.DrawFn) -> list[tuple[int, int]]:
    """Up to 60 events, some of them copies of the one before, at times about those of the events before."""
    words: list[tuple[int, int]] = []
    at = draw(st.sampled_from([0, 5_000, 1 << 31, (1 << 32) - 3_000]))
    for step in draw(st.lists(STEPS, max_size=60)):
        at = draw(st.sampled_from([at, words[-1][0] if words else at])) + step
        words += [(at % (1 << 32), draw(st.one_of(st.integers(0, 1279), st.integers(0, (1 << 32) - 1))))] * draw(
            st.sampled_from([1, 1, 1, 3])
        )
        at -= draw(st.sampled_from([0, 0, 0, step]))
    return words


def write_dat(path: Path, words: NDArray[np.uint32]) -> None:
    path.write_bytes(HEADER + words.astype("<u4").tobytes())


@given(words=dat_words(), max_events=st.sampled_from([1, 7, 1000]))
def test_dat_is_decoded_as_by_its_twin_however_it_is_cut(
    tmp_path_factory: pytest.TempPathFactory, words: list[tuple[int, int]], max_events: int
) -> None:
    path = tmp_path_factory.getbasetemp() / "twin.dat"
    write_dat(path, np.array(words, np.uint32).reshape(-1, 2))
    reading, out = ReadPass(max_events), NaiveDecoded()
    for c in DatReader(path, ReadingOptions()).columns(reading):
        out.events += zip(c.t_us.tolist(), c.x.tolist(), c.y.tolist(), c.on.tolist(), strict=True)
    out.time_jumps, out.outside = reading.damage.time_jumps, reading.damage.outside_events
    assert out == naive_dat(words)


def sound_words(start_us: int = 40_000, step_us: int = 60) -> NDArray[np.uint32]:
    """Words of N events in order, each on a pixel of its own."""
    rng = np.random.default_rng(4)
    t = start_us + np.cumsum(rng.integers(0, step_us, N))
    number = np.arange(N)
    return np.stack([t % (1 << 32), number % 1280 | (number // 1280) << 14], axis=1).astype(np.uint32)


def kept(path: Path, words: NDArray[np.uint32], sound: NDArray[np.uint32]) -> int:
    """Number of the sound events that are read from the damaged words with their own time."""
    write_dat(path, words)
    found = open_recording(path).read()
    number = found.y_px.astype(np.int64) * 1280 + found.x_px
    number = np.where(number < N, number, 0)
    times = sound[:, 0].astype(np.int64) + (np.cumsum(np.diff(sound[:, 0].astype(np.int64), prepend=0) < 0) << 32)
    return int(np.unique(number[found.t_us == times[number]]).size)


@pytest.mark.parametrize("start_us", [0, 40_000, (1 << 31) - 20_000, (1 << 32) - 20_000])
@pytest.mark.parametrize("step_us", [60, 40_000])
def test_one_flipped_bit_costs_few_events(tmp_path: Path, start_us: int, step_us: int) -> None:
    """At 33,000 events a second the event itself, at 50 a second also those before it that nothing confirms."""
    sound = sound_words(start_us, step_us)
    for bit in range(64):
        for at in (0, 700, N - 1):
            words = sound.copy()
            words[at, bit // 32] ^= np.uint32(1 << bit % 32)
            assert kept(tmp_path / "a.dat", words, sound) >= N - (1 if step_us < 100 else 13), (bit, at)


@pytest.mark.parametrize("content", ["zeros", "ones", "noise"])
@pytest.mark.parametrize("start_us", [40_000, 3 << 30])
@pytest.mark.parametrize("events", [1, 64, 900])
def test_all_before_and_after_a_damaged_block_is_kept(tmp_path: Path, content: str, start_us: int, events: int) -> None:
    sound = sound_words(start_us)
    words = sound.copy()
    block = words[500 : 500 + events]
    noise = np.random.default_rng(3).integers(0, 1 << 32, block.shape)
    block[:] = {"zeros": 0, "ones": (1 << 32) - 1, "noise": noise}[content]
    assert kept(tmp_path / "a.dat", words, sound) >= N - events - 1


@pytest.mark.parametrize("start_us", [40_000, (1 << 32) - 20_000])
@pytest.mark.parametrize("at", [1, 700, N - 9])
def test_gaps_are_believed(tmp_path: Path, at: int, start_us: int) -> None:
    """Also where the clock has turned before."""
    words, gap_us = sound_words(start_us), 1_500_000_000
    times_us = start_us + np.cumsum(np.diff(words[:, 0], prepend=np.uint32(start_us)).astype(np.int64))
    words[at:, 0] += np.uint32(gap_us)
    times_us[at:] += gap_us
    write_dat(tmp_path / "a.dat", words)
    assert open_recording(tmp_path / "a.dat").read().t_us.tolist() == times_us.tolist()


@pytest.mark.parametrize(("step_us", "believed"), [(900_000, True), (1_500_000, False)])
def test_nothing_confirms_the_time_of_the_last_event(tmp_path: Path, step_us: int, believed: bool) -> None:
    words = sound_words()
    words[-1, 0] += step_us
    write_dat(tmp_path / "a.dat", words)
    assert len(open_recording(tmp_path / "a.dat").read()) == N - (not believed)


def test_dat_files_are_read_and_their_times_wrap(tmp_path: Path) -> None:
    columns = some_columns()
    t = columns["t"] + 2**32 - 500_000  # wraps in the middle
    words = np.stack([t % 2**32, columns["x"] | columns["y"] << 14 | columns["p"] << 28], axis=1).astype("<u4")
    header = b"% Data file containing CD events.\n% Version 2\n% Height 480\n% Width 640\n"
    path = tmp_path / "a.dat"
    path.write_bytes(header + b"\x0c\x08" + words.tobytes() + b"cut")
    recording = open_recording(path)
    assert_columns(recording.read(), {**columns, "t": t})
    parts = EventBatch.concatenate(recording.chunks(max_events=333))
    assert_columns(parts, {**columns, "t": t})
    assert (recording.width_px, recording.height_px, recording.sensor_from) == (640, 480, "file")
    assert recording.events == len(t) and recording.damage.lost_bytes == 3
    path.write_bytes(header + b"\x0e\x08" + words.tobytes())
    with pytest.raises(RecordingError, match="holds events of kind 14"):
        open_recording(path)
    path.write_bytes(header)
    assert len(open_recording(path).read()) == 0


@pytest.mark.parametrize(
    ("lines", "kind", "size"),
    [
        (["Data file containing CD events."], 0x0C, None),
        (["Data file containing Event2D events.", "Width 640"], 0x00, None),
        (["Date 2020-1-1", "Height 480", "Width 640"], 0x0C, (640, 480)),  # told by the bytes behind the header
        (["Height 0", "Width 640", "Data file"], 0x0C, None),
    ],
)
def test_dat_files_are_told_by_first_line_or_kind(
    tmp_path: Path, lines: list[str], kind: int, size: tuple[int, int] | None
) -> None:
    words = np.array([[7, 5 | 9 << 14 | 1 << 28], [9, 16383 & 303 | 239 << 14]], "<u4")
    header = "".join(f"% {line}\n" for line in lines).encode()
    (tmp_path / "a.bin").write_bytes(header + bytes((kind, 8)) + words.tobytes())
    recording = open_recording(tmp_path / "a.bin")
    assert recording.format == "DAT"
    assert_columns(recording.read(), {"t": [7, 9], "x": [5, 303], "y": [9, 239], "p": [1, 0]})
    assert (recording.width_px, recording.height_px) == (size or (304, 240))
