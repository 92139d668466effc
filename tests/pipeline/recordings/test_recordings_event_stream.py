"""Event Stream against a slow encoder, whole and in parts, cut, and of other kinds."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.recordings import open_recording
from tests.pipeline.recordings.test_recordings_raw import moving_edge
from tests.reference.recordings import Event, columns, write_event_stream

SIZE = {"width_px": 1280, "height_px": 720}
GAPS = st.one_of(st.integers(0, 3), st.sampled_from([62, 63, 64, 126, 127, 128, 189, 254]), st.integers(0, 20_000))
EVENTS = st.lists(st.tuples(GAPS, st.integers(0, 1279), st.integers(0, 719), st.booleans()), max_size=40)


@settings(max_examples=50)
@given(EVENTS, st.booleans(), st.integers(1, 60))
def test_events_are_those_written(
    tmp_path_factory: pytest.TempPathFactory, gaps: list[Event], is_atis: bool, max_events: int
) -> None:
    events, now = [], 0
    for gap, x, y, on in gaps:
        now += gap
        events.append((now, x, y, on))
    path = tmp_path_factory.mktemp("es") / "a.es"
    write_event_stream(path, events, **SIZE, is_atis=is_atis)
    recording = open_recording(path)
    found = [event for batch in recording.chunks(max_events=max_events) for event in columns(batch)]
    assert found == events and not recording.damage.sentences()
    assert (recording.width_px, recording.height_px, recording.sensor_from) == (1280, 720, "file")


def test_a_cut_file_gives_the_events_before_the_cut(tmp_path: Path) -> None:
    events = columns(moving_edge(50))
    events = [(t - 4_000_000, x, y, on) for t, x, y, on in events]
    path = tmp_path / "a.es"
    write_event_stream(path, events, **SIZE, is_atis=False)
    whole = path.read_bytes()
    for cut in range(20, len(whole)):
        path.write_bytes(whole[:cut])
        recording = open_recording(path)
        found = columns(recording.read())
        assert found == events[: len(found)] and recording.damage.lost_bytes < 5
    assert len(found) == 49


def test_a_window_is_read_from_a_place_in_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("spinscope.pipeline.recordings.index.PLACE_EVENTS", 100)
    events = [(k * 700, k % 1280, k % 720, k % 2 == 0) for k in range(2000)]
    write_event_stream(tmp_path / "a.es", events, **SIZE, is_atis=True)
    recording = open_recording(tmp_path / "a.es")
    recording.scan()
    found = [event for batch in recording.chunks(900_000, 1_000_000, max_events=50) for event in columns(batch)]
    assert found == [event for event in events if 900_000 <= event[0] < 1_000_000]


@pytest.mark.parametrize(
    ("version", "kind", "why"), [(1, 1, "version 1.0.0 with DVS"), (2, 4, "with color"), (2, 9, "unknown")]
)
def test_other_versions_and_kinds_are_named(tmp_path: Path, version: int, kind: int, why: str) -> None:
    (tmp_path / "a.es").write_bytes(b"Event Stream" + bytes([version, 0, 0, kind, 0, 5, 0, 5, 1, 2, 3, 4, 5]))
    with pytest.raises(RecordingError, match=why):
        open_recording(tmp_path / "a.es")
    (tmp_path / "a.es").write_bytes(b"Event Stream" + bytes([2]))
    with pytest.raises(RecordingError, match="Event Stream file is damaged or was cut"):
        open_recording(tmp_path / "a.es")
