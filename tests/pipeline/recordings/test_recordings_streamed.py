"""Events on demand: any window of any format as from a read of the whole, the index kept, sessions on top of it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.recordings import Recording, Triggers, index, open_recording, streamed, write_recording
from spinscope.pipeline.recordings.formats.prophesee_dat.reader import DatReader
from spinscope.pipeline.recordings.in_memory import RecordingInMemory
from spinscope.pipeline.recordings.streamed import RecordingPieces, StreamedEvents, events_of
from spinscope.pipeline.session import Choices, Session
from tests.pipeline.recordings.test_recordings_raw import assert_same_events
from tests.reference.recordings import write_evt2

N = 600_000  # readers hand over 131,072 at once
SIZE: dict[str, Any] = {"width_px": 1280, "height_px": 720}


def long_recording(seed: int = 1) -> EventBatch:
    """Bursts with pauses up to 30 s between them: EVT3's time wraps several times."""
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.integers(0, 3, N)) + np.repeat(np.cumsum(rng.integers(0, 30_000_000, 6)), N // 6)
    x, y = (rng.integers(0, size, N).astype(np.uint16) for size in SIZE.values())
    return EventBatch(t, x, y, rng.integers(0, 2, N).astype(np.bool_))


def write_dat(path: Path, t_us: NDArray[np.int64], events: EventBatch) -> None:
    """DAT with the events in this order and these times."""
    pixel = events.x_px.astype(np.uint32) | events.y_px.astype(np.uint32) << 14 | events.on.astype(np.uint32) << 28
    words = np.stack([(t_us & 0xFFFFFFFF).astype("<u4"), pixel.astype("<u4")], axis=1)
    path.write_bytes(b"% Data file\n% Height 720\n% Width 1280\n" + bytes((12, 8)) + words.tobytes())


def shaken_dat(path: Path, events: EventBatch, **_: Any) -> None:
    """Times up to 9 ms out of order, a few of them 15 ms: those are dropped."""
    rng = np.random.default_rng(5)
    late_us = rng.integers(0, 9000, N) + 15_000 * (rng.random(N) < 1e-4)
    write_dat(path, np.maximum(events.t_us + (1 << 31) - late_us, 0), events)


WRITE: dict[str, tuple[str, Callable[..., None]]] = {
    "EVT3": ("a.raw", write_recording),
    "EVT2": ("a.raw", write_evt2),
    "DAT": ("a.dat", lambda path, events, **_: write_dat(path, events.t_us, events)),
    "DAT out of order": ("a.dat", shaken_dat),
    "HDF5": ("a.h5", write_recording),
}


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache; a place after every part that a reader hands over."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(index, "PLACE_EVENTS", 50_000)
    return tmp_path / "cache"


def no_pass(*_: Any) -> None:
    raise AssertionError("the file is read once more")


@pytest.mark.parametrize("format", WRITE)
def test_every_window_is_as_from_a_read_of_the_whole(tmp_path: Path, format: str) -> None:
    name, write = WRITE[format]
    write(tmp_path / name, long_recording(), **SIZE)
    recording = open_recording(tmp_path / name)
    whole = recording.read()
    assert_same_events(whole, EventBatch.concatenate(recording.chunks()))
    pieces = RecordingPieces(recording)
    assert len(pieces.index.cut_us) >= 4 and pieces.index.events == len(whole)
    assert_same_events(pieces.between(-(2**62), 2**62), whole)
    rng = np.random.default_rng(2)
    cuts = [whole.t_us[rng.integers(0, len(whole), 20)], pieces.index.cut_us, pieces.index.cut_us - 1]
    for start_us in np.concatenate(cuts).tolist():
        end_us = start_us + int(rng.choice([1, 5000, 40_000_000]))
        assert_same_events(pieces.between(start_us, end_us), whole.between(start_us, end_us))
        assert_same_events(open_recording(tmp_path / name).read(start_us, end_us), whole.between(start_us, end_us))
        assert pieces.count_before(start_us) == np.searchsorted(whole.t_us, start_us)


def test_only_what_a_window_needs_is_decoded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_dat(tmp_path / "a.dat", long_recording().t_us, long_recording())
    recording = open_recording(tmp_path / "a.dat")
    pieces = RecordingPieces(recording)
    decoded: list[int] = []
    columns = DatReader.columns

    def counted(reader: DatReader, reading: Any) -> Any:
        for part in columns(reader, reading):
            decoded.append(len(part))
            yield part

    monkeypatch.setattr(DatReader, "columns", counted)
    last_us = pieces.index.last_us
    assert len(pieces.between(last_us - 1000, last_us)) > 0
    assert 0 < sum(decoded) < N / 4
    before = sum(decoded)
    assert len(pieces.between(last_us - 2000, last_us - 500)) > 0
    assert sum(decoded) == before, "the piece is still in memory"


def test_pieces_in_memory_are_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(streamed, "PIECES_KEPT", 2)
    write_recording(tmp_path / "a.raw", long_recording(), **SIZE)
    pieces = RecordingPieces(open_recording(tmp_path / "a.raw"))
    pieces.between(-(2**62), 2**62)
    assert len(pieces._kept) == 2


def test_rates_are_those_of_the_events(tmp_path: Path) -> None:
    events = long_recording()
    write_recording(tmp_path / "a.raw", events, **SIZE)
    source = StreamedEvents("a", RecordingPieces(open_recording(tmp_path / "a.raw")), 1280, 720, 0, 1)
    first, last = int(events.t_us[0]), int(events.t_us[-1]) + 1
    edges = np.linspace(first - 1000, last + 1000, 50).astype(np.int64)
    exact = np.histogram(events.t_us, edges)[0]
    assert np.abs(source.rate(edges) - exact).max() <= 2 * index.SAMPLED_EVENTS
    assert source.rate(edges).sum() == N


def large(recording: Recording) -> Recording:
    recording.is_large = True
    return recording


def indexed(path: Path, **options: Any) -> Recording:
    recording = large(open_recording(path, **options))
    recording.index()
    return recording


def test_the_index_of_a_large_file_is_kept(tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.raw"
    edges = Triggers(np.array([5, 900]), np.array([1, 0], np.uint8), np.array([3, 3], np.uint8))
    write_recording(path, long_recording(), triggers=edges, **SIZE)
    path.write_bytes(path.read_bytes() + b"\x00\x90\x00")  # a word of no known type, and half of one
    first = indexed(path)
    assert first.damage.bad_words == first.damage.lost_bytes == 1
    with monkeypatch.context() as patch:
        patch.setattr(Recording, "scan", no_pass)
        again = indexed(path)
        assert (again.damage, again.warnings) == (first.damage, first.warnings)
        assert again.triggers.t_us.tolist() == [5, 900] and again.triggers.value.tolist() == [1, 0]
        for name in (*index.ARRAYS, "events", "first_us", "last_us", "sensor"):
            np.testing.assert_array_equal(getattr(again.index(), name), getattr(first.index(), name), name)
    kept = list((cache / "spinscope" / "indexes").iterdir())
    assert len(kept) == 1
    kept[0].write_bytes(kept[0].read_bytes()[:1000])
    assert indexed(path).index().events == N, "a damaged index is made again"
    path.write_bytes(path.read_bytes()[:-3])
    assert indexed(path).damage.bad_words == 0, "another file"


def test_a_guessed_sensor_is_kept_with_the_index(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.raw"
    write_recording(path, long_recording(), **SIZE)
    data = path.read_bytes()
    path.write_bytes(b"% evt 3.0\n% end\n" + data[data.index(b"% end\n") + 6 :])
    monkeypatch.setattr(Recording, "is_large", True)
    first = open_recording(path)
    first.index()
    monkeypatch.setattr(Recording, "_extent_px", no_pass)
    again = open_recording(path)
    assert (again.width_px, again.height_px, again.sensor_from) == (1280, 720, "guess")
    assert again.warnings == first.warnings and "does not state its sensor" in again.warnings[0]
    assert open_recording(path, sensor=(1280, 960)).known_index() is None, "of another sensor"


def test_without_a_cache_the_index_is_made_anew(tmp_path: Path, cache: Path) -> None:
    cache.write_text("no folder")
    write_recording(tmp_path / "a.raw", long_recording(), **SIZE)
    assert indexed(tmp_path / "a.raw").index().events == indexed(tmp_path / "a.raw").index().events == N


def test_a_format_without_random_access_is_copied_once(
    tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(streamed, "HELD_EVENTS", 1000)
    write_recording(tmp_path / "a.npz", long_recording(), **SIZE)
    pieces = events_of(open_recording(tmp_path / "a.npz"), None, None)
    assert isinstance(pieces, RecordingPieces)
    assert_same_events(pieces.between(0, 2**62), long_recording())
    monkeypatch.setattr(streamed, "write_recording", no_pass)
    assert isinstance(events_of(open_recording(tmp_path / "a.npz"), None, None), RecordingPieces)
    (tmp_path / "cache").rename(tmp_path / "elsewhere")
    (tmp_path / "cache").write_text("no folder")
    with pytest.raises(RecordingError, match=r"NPZ is read from its start only.*convert it to HDF5.*a\.npz$"):
        events_of(open_recording(tmp_path / "a.npz"), None, None)


def without_seconds(session: Session, method: str) -> dict[str, Any]:
    report = session.estimate(method).to_dict()
    del report["seconds"]
    return report


@pytest.mark.parametrize("window_us", [None, (20_000, 70_000)])
def test_a_session_answers_the_same_from_disk(
    samples: Path, monkeypatch: pytest.MonkeyPatch, window_us: tuple[int, int] | None
) -> None:
    choices = Choices(window_us=window_us)
    held = Session.open(samples / "flight_fast_top.h5", choices)
    expected = without_seconds(held, "triplet")
    monkeypatch.setattr(streamed, "HELD_EVENTS", 1000)
    session = Session.open(samples / "flight_fast_top.h5", choices)
    assert isinstance(session.source, StreamedEvents)
    assert session.source.identity == held.source.identity
    assert without_seconds(session, "triplet") == expected and expected["shots"]
    clip, held_clip = session.clip(30_000, 60_000), held.clip(30_000, 60_000)
    assert clip.source.event_count == held_clip.source.event_count
    assert_same_events(clip.source.between(0, 2**62), held_clip.source.between(0, 2**62))


def test_a_fixed_ball_is_found_from_disk(samples: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    choices = Choices(fixed_ball="auto")
    held = Session.open(samples / "spinner_ball2_side.h5", choices)
    monkeypatch.setattr(streamed, "HELD_EVENTS", 1000)
    assert Session.open(samples / "spinner_ball2_side.h5", choices).parameters == held.parameters


def test_an_estimate_keeps_no_columns_of_shots_that_are_over(samples: Path) -> None:
    flight = open_recording(samples / "flight_fast_top.h5").read()
    rally = EventBatch.concatenate(
        EventBatch(flight.t_us + after_us, flight.x_px, flight.y_px, flight.on) for after_us in (0, 200_000, 400_000)
    )
    session = Session.open(RecordingInMemory(rally, **SIZE))
    assert len(session.estimate("triplet").shots) == 3
    assert len({shot for _, shot in session.chain._cache._columns if shot is not None}) <= 1
    assert not any(column.results for column in session.chain._cache._columns.values())
