"""Clocks that are set back: against a slow twin, at the start of a file, and when reading begins behind it."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.recordings import open_recording
from spinscope.pipeline.recordings.clock_segments import SEGMENT_EVENTS, ClockSegments
from spinscope.pipeline.recordings.reader import ReadPass, UncheckedEvents
from tests.reference.recordings import naive_segments, write_aedat4

RUN = SEGMENT_EVENTS
# Lengths of runs of events and where their clocks begin, relative to the end of the one before.
RUNS = st.lists(
    st.tuples(
        st.one_of(st.integers(1, 5), st.integers(RUN - 2, RUN + 2), st.integers(1, 3 * RUN)),
        st.one_of(st.integers(-12_000, 12_000), st.integers(-3_000_000, 3_000_000)),
    ),
    min_size=1,
    max_size=6,
)


def runs_of(parts: list[tuple[int, int]], seed: int) -> list[tuple[int, int, int, bool]]:
    rng = np.random.default_rng(seed)
    events, now = [], 10_000_000
    for length, step in parts:
        for t in max(now + step, 0) + np.cumsum(rng.integers(-20, 200, length)):
            now = int(t)
            events.append((now, len(events) % 1280, len(events) % 720, len(events) % 2 == 0))
    return events


def unchecked(events: list[tuple[int, int, int, bool]]) -> UncheckedEvents:
    t, x, y, on = (np.array(column) for column in zip(*events, strict=True))
    return UncheckedEvents(t, x, y, on)


@settings(max_examples=150)
@example([(1, 0), (1, -11_999), (1, -17_190), (198, 0)], 0, [101])  # set back with some disorder, cut behind it
@given(RUNS, st.integers(0, 2**32 - 1), st.lists(st.integers(0, 800), max_size=6))
def test_segments_are_joined_as_by_the_twin_however_they_come(
    parts: list[tuple[int, int]], seed: int, cuts: list[int]
) -> None:
    events = runs_of(parts, seed)
    places = [0, *sorted(min(cut, len(events)) for cut in cuts), len(events)]
    reading = ReadPass()
    pieces = [unchecked(events[a:b]) for a, b in pairwise(places) if b > a]
    found = []
    for part, rises in ClockSegments(reading).joined(pieces):
        assert len(part) and (not rises or np.all(part.t_us[1:] >= part.t_us[:-1]))
        found += zip(*(column.tolist() for column in part.columns), strict=True)
    expected, stale, resets = naive_segments(events, RUN)
    assert found == expected
    assert (reading.damage.stale_events, reading.damage.clock_resets) == (stale, resets)


def write_dat(path: Path, events: list[tuple[int, int, int, bool]]) -> None:
    words = np.array([(t, int(on) << 28 | y << 14 | x) for t, x, y, on in events], "<u4")
    path.write_bytes(b"% Data file\n% Height 720\n% Width 1280\n% end\n\x0c\x08" + words.tobytes())


def test_reading_goes_on_behind_a_reset(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Windows read from places of the index, before and behind two resets, are those of the whole file."""
    monkeypatch.setattr("spinscope.pipeline.recordings.index.PLACE_EVENTS", 100)
    events = runs_of([(900, 0), (700, -5_000_000), (800, -60_000)], seed=1)
    write_dat(tmp_path / "a.dat", events)
    recording = open_recording(tmp_path / "a.dat")
    whole = recording.read()
    assert len(whole) == len(events) and recording.damage.clock_resets == 2
    assert recording.index().shifts_us[-1] > 0
    for start_us in range(int(whole.t_us[0]), int(whole.t_us[-1]), 9000):
        batches = recording.chunks(start_us, start_us + 5000, max_events=64)
        part = type(whole).concatenate(batches)
        inside = whole.between(start_us, start_us + 5000)
        assert np.array_equal(part.t_us, inside.t_us) and np.array_equal(part.x_px, inside.x_px)


def test_times_that_no_shift_can_join_are_refused(tmp_path: Path) -> None:
    """Damaged numbers that go back and forth by more than 64 bits hold are no clock that was set back."""
    t, zeros = np.repeat([4, -4, 4, -4], RUN) * 10**18, np.zeros(4 * RUN, np.uint16)
    np.savez(tmp_path / "a.npz", t=t, x=zeros, y=zeros, p=zeros)
    with pytest.raises(RecordingError, match=f"time goes backwards at event {RUN}"):
        open_recording(tmp_path / "a.npz", sensor=(2, 2)).read()


def test_times_that_no_camera_has_cost_their_events_alone(tmp_path: Path) -> None:
    """AEDAT4's, of which the reader's package checks nothing."""
    events = [(t, 1, 1, True) for t in range(1000, 1300)]
    for at, t in ((3, -7 * 10**18), (250, 2**63 - 1)):
        events[at] = (t, 1, 1, True)
    write_aedat4(tmp_path / "a.aedat4", events, 2, 2)
    recording = open_recording(tmp_path / "a.aedat4")
    assert recording.read().t_us.tolist() == [t for t, *_ in events if 0 < t < 2000]
    assert recording.damage.broken_events == 2
