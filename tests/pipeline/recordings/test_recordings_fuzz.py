"""Damaged files of every registered format, made at random: one line of error, or events that keep the rules."""

from __future__ import annotations

import os
import re
import struct
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.recordings import FORMATS, open_recording, summary
from tests.pipeline.recordings.sound_files import some_events, sound_files

NAMES = [format.name for format in FORMATS]
CASES, ISOLATED_CASES = 200, 50  # a foreign library that crashes costs a new process of 0.4 s
MOST_S = 5.0  # until a file is refused or read
MOST_GROWTH_BYTES = 512 << 20  # of this process over all cases; one that reads for it has its own limit
EVENTS = 500  # of a sound file: reading lines of text costs by their number
HEAD_BYTES = 1500  # where headers, tables of contents and superblocks lie; half of the damage is done there
NUMBERS = (0, 1, 2**15, 2**16 - 1, 2**31 - 1, 2**32 - 1, 2**40, 2**63 - 1, 2**64 - 1)

Random = np.random.Generator


def _place(data: bytearray, rng: Random) -> int:
    """A byte anywhere, or among the first or last of the file."""
    near = int(rng.integers(0, min(HEAD_BYTES, len(data))))
    return int(rng.choice([near, near, len(data) - 1 - near, *rng.integers(0, len(data), 3).tolist()]))


def cut(data: bytearray, rng: Random) -> None:
    del data[max(_place(data, rng), 1) :]


def flip_bits(data: bytearray, rng: Random) -> None:
    for _ in range(int(rng.choice([1, 1, 1, 2, 5, 20]))):
        data[_place(data, rng)] ^= 1 << int(rng.integers(0, 8))


def overwrite(data: bytearray, rng: Random) -> None:
    at, size = _place(data, rng), int(rng.choice([1, 8, 64, 512, 4096]))
    size = min(size, len(data) - at)
    data[at : at + size] = [rng.bytes(size), bytes(size), b"\xff" * size][int(rng.integers(0, 3))]


def insert(data: bytearray, rng: Random) -> None:
    at = _place(data, rng)
    data[at:at] = rng.bytes(int(rng.integers(1, 100)))


def remove(data: bytearray, rng: Random) -> None:
    at = _place(data, rng)
    del data[at : at + int(rng.integers(1, 100))]


def repeat(data: bytearray, rng: Random) -> None:
    """Append an earlier part: time steps back."""
    at = _place(data, rng)
    data += data[at : at + 4000]


def lie(data: bytearray, rng: Random) -> None:
    """State another number in the header: in digits where there are any, else in 2, 4 or 8 bytes."""
    number = int(rng.choice(np.array(NUMBERS, np.uint64)))
    digits = list(re.finditer(rb"\d+", data[:HEAD_BYTES]))
    if digits and rng.random() < 0.5:
        found = digits[int(rng.integers(0, len(digits)))]
        text = [str(number).encode(), b"-" + str(number).encode(), b"9" * 5000, b"1e9", b"nan"]
        data[found.start() : found.end()] = text[int(rng.integers(0, len(text)))]
    else:
        at, kind = _place(data, rng), "HIQ"[int(rng.integers(0, 3))]
        packed = struct.pack(f"<{kind}", number % (1 << 8 * struct.calcsize(kind)))
        data[at : at + len(packed)] = packed


DAMAGES = (cut, flip_bits, flip_bits, overwrite, insert, remove, repeat, lie, lie)


def read(path: Path) -> EventBatch | None:
    """Read a file as `info` and a window do, and check what comes; None where it is refused."""
    try:
        recording = open_recording(path)
        found = summary(recording)
        events = recording.read()
        half_us = ((found.first_us or 0) + (found.last_us or 0)) // 2
        window = recording.read(start_us=half_us)
        recording.truth  # noqa: B018
    except RecordingError as error:
        assert "\n" not in str(error) and str(path) in str(error) and len(str(error)) < 1000
        return None
    assert len(events) == found.events and np.all(events.t_us[1:] >= events.t_us[:-1])
    assert len(window) == np.count_nonzero(events.t_us >= half_us)
    if len(events):
        assert events.x_px.max() < recording.width_px and events.y_px.max() < recording.height_px
    return events


def peak_bytes() -> int:
    """Most memory this process has had; 0 where the system does not tell."""
    try:
        import resource
    except ImportError:
        return 0
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)


def fuzz(name: str, folder: Path, cases: int, clock: Callable[[], float], first: int = 0) -> None:
    """Damage the sound files of a format in turn; `first` is the number of the first case."""
    files = sound_files(folder, name, some_events(EVENTS))
    sound = [path.read_bytes() for path in files]
    for path in files:
        assert read(path) is not None
    peak, read_cases, slowest = peak_bytes(), 0, (0.0, 0)
    for case in range(first, cases):
        rng = np.random.default_rng([case, cases])
        path, data = files[case % len(files)], bytearray(sound[case % len(files)])
        damage = DAMAGES[int(rng.integers(0, len(DAMAGES)))]
        damage(data, rng)
        path.write_bytes(data)
        start = clock()
        try:
            read_cases += read(path) is not None
        except BaseException:
            print(f"case {case} of {cases}: {damage.__name__} in {path.name}")  # noqa: T201
            raise
        slowest = max(slowest, (clock() - start, case))
    growth = peak_bytes() - peak
    print(f"{name}: {read_cases} of cases {first} to {cases} read, slowest {slowest}, {growth >> 20} MB more")  # noqa: T201
    assert slowest[0] < MOST_S and growth < MOST_GROWTH_BYTES


@pytest.mark.parametrize("name", NAMES)
def test_damaged_files_are_refused_or_read(tmp_path: Path, name: str) -> None:
    fuzz(name, tmp_path, ISOLATED_CASES if FORMATS[name].isolated else CASES, time.process_time)


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_twenty_thousand_damaged_files_are_refused_or_read(tmp_path: Path, name: str) -> None:
    """A run that was stopped goes on: SPINSCOPE_FUZZ_FIRST=CASE uv run pytest -m slow -k twenty_thousand."""
    fuzz(name, tmp_path, 20_000, time.monotonic, int(os.environ.get("SPINSCOPE_FUZZ_FIRST", "0")))


def flip_one(data: bytearray, start: int, rng: Random) -> None:
    data[int(rng.integers(start, len(data)))] ^= 1 << int(rng.integers(0, 8))


def scramble(data: bytearray, start: int, rng: Random) -> None:
    at = start + int(rng.integers(0, len(data) - start - 512)) // 8 * 8
    data[at : at + 512] = rng.bytes(512)


# Most events lost to a flipped bit and to a block of 512 random bytes; what EVT2 and DAT hold in a block is 128 and 64
# events. EVT3 has the time in words of their own: up to the next one (4 ms, 25 events) the old time holds.
MOST_LOST = {"written.raw": (60, 170), "evt2.raw": (5, 140), "evt21.raw": (5, 75), "written.dat": (1, 65)}


@pytest.mark.parametrize("damage", [flip_one, scramble])
@pytest.mark.parametrize("name", ["prophesee_raw", "prophesee_dat"])
def test_events_before_and_after_the_damage_are_kept(
    tmp_path: Path, name: str, damage: Callable[[bytearray, int, Random], None]
) -> None:
    """In formats of events one after the other; 100 cases an encoding.

    The first kilobyte is left whole: there is no earlier time that the first one could be held against.
    """
    events = some_events(3000)
    own = set(zip(*(column.tolist() for column in events.columns), strict=True))
    for path in sound_files(tmp_path, name, events):
        if path.name not in MOST_LOST:
            continue  # a table of columns, or packets: what is damaged is refused, or read up to there
        sound = path.read_bytes()
        start = max(sound.rfind(b"% end\n") + 6, sound.rfind(b"\x0c\x08", 0, 200) + 2) + 1024
        rng = np.random.default_rng(8)
        lost = []
        for _ in range(100):
            data = bytearray(sound)
            damage(data, start, rng)
            path.write_bytes(data)
            found = read(path)
            assert found is not None
            lost.append(len(own - set(zip(*(column.tolist() for column in found.columns), strict=True))))
        assert max(lost) <= MOST_LOST[path.name][damage is scramble], sorted(lost)[-5:]
