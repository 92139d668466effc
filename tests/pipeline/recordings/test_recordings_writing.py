"""Writing and converting: exact round trips, all or nothing."""

from __future__ import annotations

import resource
import signal
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.recordings import Triggers, convert, open_recording, write_recording
from spinscope.pipeline.recordings.reader import CameraFrame, FormatReader
from spinscope.pipeline.results import Truth
from tests.pipeline.recordings.test_recordings_raw import assert_same_events, moving_edge


@st.composite
def any_events(draw: st.DrawFn) -> EventBatch:
    """Up to 50 events at any times, on any pixels that the columns can hold."""
    t = np.sort(np.array(draw(st.lists(st.integers(-(2**61), 2**61), max_size=50)), np.int64))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    pixels = rng.integers(0, 4096, (2, t.size)).astype(np.uint16)
    return EventBatch(t, pixels[0], pixels[1], rng.integers(0, 2, t.size).astype(np.bool_))


@settings(max_examples=40)
@given(any_events(), st.sampled_from(["h5", "npz"]))
def test_round_trips_are_exact(tmp_path_factory: pytest.TempPathFactory, events: EventBatch, kind: str) -> None:
    path = tmp_path_factory.mktemp("round") / f"a.{kind}"
    write_recording(path, events, width_px=4096, height_px=4096)
    recording = open_recording(path)
    assert_same_events(recording.read(), events)
    assert recording.warnings == [] and recording.events == len(events)


def test_dat_round_trip_is_exact(tmp_path: Path) -> None:
    events = moving_edge(2000)
    late = EventBatch(events.t_us + ((1 << 32) - 4_250_001), events.x_px, events.y_px, events.on)
    for batch in (events, late, moving_edge(0)):
        attributes: dict[str, str | float] = {"camera.focal_length_mm": 16.0}
        write_recording(tmp_path / "a.dat", batch, width_px=1280, height_px=720, attributes=attributes)
        recording = open_recording(tmp_path / "a.dat")
        assert_same_events(recording.read(), batch)
        assert (recording.format, recording.width_px, recording.height_px) == ("DAT", 1280, 720)
        assert recording.attributes["camera.focal_length_mm"] == "16.0" and not recording.damage.sentences()
    convert(tmp_path / "a.dat", tmp_path / "b.dat")
    assert (tmp_path / "a.dat").read_bytes() == (tmp_path / "b.dat").read_bytes()
    with pytest.raises(RecordingError, match="do not fit in DAT"):
        beyond = EventBatch(events.t_us + (1 << 32), events.x_px, events.y_px, events.on)
        write_recording(tmp_path / "c.dat", beyond, width_px=1280, height_px=720)


def test_raw_is_written_in_the_encoding_asked_for(tmp_path: Path) -> None:
    events = moving_edge(300)
    write_recording(tmp_path / "a.h5", events, width_px=1280, height_px=720)
    for encoding, format in (("evt2", "EVT2 RAW"), ("EVT3", "EVT3 RAW"), (None, "EVT3 RAW")):
        convert(tmp_path / "a.h5", tmp_path / "b.raw", encoding=encoding)
        recording = open_recording(tmp_path / "b.raw")
        assert recording.format == format
        assert_same_events(recording.read(), events)
    for name in ("b.raw", "b.csv"):
        with pytest.raises(RecordingError, match=r"not written in the encoding 'EVT4': give (one of EVT3, EVT2|none)"):
            convert(tmp_path / "a.h5", tmp_path / name, encoding="EVT4")


def some_truth(events: EventBatch) -> Truth:
    rng = np.random.default_rng(0)
    n = 7
    return Truth(
        t_us=np.arange(n) * 1000,
        x_px=rng.normal(size=n),
        y_px=rng.normal(size=n),
        radius_px=rng.normal(size=n),
        position_m=rng.normal(size=(n, 3)),
        velocity_m_s=rng.normal(size=(n, 3)),
        spin_rps=rng.normal(size=(n, 3)),
        label=rng.integers(0, 5, len(events)).astype(np.uint8),
    )


def test_our_own_layout_is_as_promised(tmp_path: Path) -> None:
    """The names, types and filters that other programs rely on, looked at without our reader."""
    events = moving_edge(1000)
    truth = some_truth(events)
    attributes = {"camera.focal_length_mm": 12.0, "note": "a text"}
    write_recording(tmp_path / "a.h5", events, width_px=1280, height_px=720, attributes=attributes, truth=truth)
    with h5py.File(tmp_path / "a.h5") as file:
        assert set(file) == {"events", "truth"} and set(file["events"]) == {"t", "x", "y", "p"}
        kinds = {name: (data.dtype.str, data.compression) for name, data in file["events"].items()}
        assert kinds == {n: (k, "gzip") for n, k in (("t", "<i8"), ("x", "<u2"), ("y", "<u2"), ("p", "|u1"))}
        assert {**attributes, "width": 1280, "height": 720} == dict(file.attrs)
        np.testing.assert_array_equal(file["events/p"][:], events.on)
        for name in Truth.__slots__:
            np.testing.assert_array_equal(file["truth"][name][:], getattr(truth, name))
    recording = open_recording(tmp_path / "a.h5")
    assert recording.truth is not None
    for name in Truth.__slots__:
        np.testing.assert_array_equal(getattr(recording.truth, name), getattr(truth, name))


def test_the_same_events_give_the_same_bytes(tmp_path: Path) -> None:
    for k in range(2):
        write_recording(tmp_path / f"{k}.h5", moving_edge(500), width_px=1280, height_px=720)
        write_recording(tmp_path / f"{k}.npz", moving_edge(500), width_px=1280, height_px=720)
        write_recording(tmp_path / f"{k}.raw", moving_edge(500), width_px=1280, height_px=720)
    for kind in ("h5", "npz", "raw"):
        assert (tmp_path / f"0.{kind}").read_bytes() == (tmp_path / f"1.{kind}").read_bytes()


def test_npz_has_the_promised_columns(tmp_path: Path) -> None:
    write_recording(tmp_path / "a.npz", moving_edge(300), width_px=1280, height_px=720)
    with np.load(tmp_path / "a.npz") as arrays:
        kinds = {name: arrays[name].dtype.str for name in arrays.files}
        assert kinds == {"t": "<i8", "x": "<u2", "y": "<u2", "p": "|u1", "width": "<u2", "height": "<u2"}
        np.testing.assert_array_equal(arrays["t"], moving_edge(300).t_us)


@pytest.mark.parametrize("first", ["h5", "npz", "raw"])
@pytest.mark.parametrize("second", ["h5", "hdf5", "npz", "raw"])
def test_conversion_keeps_events_and_what_the_format_can_hold(tmp_path: Path, first: str, second: str) -> None:
    events = moving_edge(2000)
    edges = Triggers(np.array([4_000_100, 4_100_000]), np.array([1, 0], np.uint8), np.array([0, 6], np.uint8))
    source, target = tmp_path / f"a.{first}", tmp_path / f"b.{second}"
    size = {"width_px": 1000 + 280, "height_px": 720}
    note: dict[str, str | float] = {"lens": "8 mm"}
    write_recording(source, events, **size, attributes=note, triggers=edges, truth=some_truth(events), t_offset_us=77)
    shares: list[float] = []
    convert(source, target, on_progress=shares.append)
    recording = open_recording(target)
    assert_same_events(recording.read(), events)
    assert (recording.width_px, recording.height_px, recording.sensor_from) == (1280, 720, "file")
    assert shares == sorted(shares) and shares[-1] == 1.0
    if "npz" not in (first, second):
        assert recording.attributes["lens"] == "8 mm"
        assert recording.triggers.t_us.tolist() == edges.t_us.tolist()
        assert recording.triggers.id.tolist() == [0, 6]
    if first == "h5" and second in ("h5", "hdf5"):
        assert recording.truth is not None and recording.t_offset_us == 77
        np.testing.assert_array_equal(recording.truth.label, some_truth(events).label)


def test_conversion_refuses_what_it_cannot_do(tmp_path: Path) -> None:
    source = tmp_path / "a.h5"
    write_recording(source, moving_edge(50), width_px=1280, height_px=720)
    with pytest.raises(RecordingError, match=r"suffix '\.png' is no format"):
        convert(source, tmp_path / "b.png")
    with pytest.raises(RecordingError, match="onto itself"):
        convert(source, source)
    with pytest.raises(RecordingError, match="its folder does not exist"):
        convert(source, tmp_path / "no" / "b.npz")
    (tmp_path / "c.npz").mkdir()
    with pytest.raises(RecordingError, match="it is a folder"):
        convert(source, tmp_path / "c.npz")
    with pytest.raises(RecordingError, match="does not exist"):
        convert(tmp_path / "gone.h5", tmp_path / "b.npz")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.h5", "c.npz"]


def failing(events: EventBatch) -> Iterator[EventBatch]:
    yield events
    raise RecordingError("the source broke off")


def test_a_source_that_breaks_off_leaves_the_old_file_alone(tmp_path: Path) -> None:
    for name in ("a.h5", "a.npz", "a.raw"):
        path = tmp_path / name
        write_recording(path, moving_edge(30), width_px=1280, height_px=720)
        before = path.read_bytes()
        with pytest.raises(RecordingError, match="the source broke off"):
            write_recording(path, failing(moving_edge(400)), width_px=1280, height_px=720)
        assert path.read_bytes() == before
    assert len(list(tmp_path.iterdir())) == 3


@pytest.mark.parametrize("limit", [100, 3000, 30_000, 200_000])
def test_a_full_disk_leaves_nothing_behind(tmp_path: Path, limit: int) -> None:
    """The limit of file sizes stands in for the full disk: writes fail in the same way."""
    rng = np.random.default_rng(1)

    def batches() -> Iterator[EventBatch]:
        for k in range(4):
            n = 60_000
            t = np.sort(rng.integers(k * 10**6, (k + 1) * 10**6, n))
            x, y = rng.integers(0, 1280, n).astype(np.uint16), rng.integers(0, 720, n).astype(np.uint16)
            yield EventBatch(t, x, y, rng.integers(0, 2, n).astype(np.bool_))

    old = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, old[1]))
        for name in ("a.h5", "a.npz", "a.raw"):
            with pytest.raises(RecordingError, match=r"cannot be written \(File too large\).*a\.\w+$"):
                write_recording(tmp_path / name, batches(), width_px=1280, height_px=720)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, old)
        signal.signal(signal.SIGXFSZ, handler)
    assert list(tmp_path.iterdir()) == []


def test_what_no_reader_would_take_back_is_not_written(tmp_path: Path) -> None:
    events = moving_edge(50)
    backwards = [events[25:], events[:25]]
    for name in ("a.h5", "a.npz", "a.raw"):
        with pytest.raises(RecordingError, match="not in order of time"):
            write_recording(tmp_path / name, backwards, width_px=1280, height_px=720)
        with pytest.raises(RecordingError, match="state a larger sensor"):
            write_recording(tmp_path / name, events, width_px=1280, height_px=20)
    with pytest.raises(RecordingError, match="one an event is needed"):
        write_recording(tmp_path / "a.h5", events, width_px=1280, height_px=720, truth=some_truth(events[:10]))
    early = EventBatch(events.t_us - 10**9, events.x_px, events.y_px, events.on)
    with pytest.raises(RecordingError, match="do not fit in EVT3"):
        write_recording(tmp_path / "a.raw", early, width_px=1280, height_px=720)
    with pytest.raises(RecordingError, match="EVT3 holds pixels up to 2047"):
        write_recording(tmp_path / "a.raw", events, width_px=2049, height_px=720)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("second", ["h5", "npz", "raw"])
def test_conversion_of_a_part_leaves_the_rest_out_and_says_so(tmp_path: Path, second: str) -> None:
    events = moving_edge(2000)
    edges = Triggers(events.t_us[[400, 1500]], np.array([1, 0], np.uint8), np.array([0, 6], np.uint8))
    source, target = tmp_path / "a.h5", tmp_path / f"b.{second}"
    size = {"width_px": 1280, "height_px": 720}
    write_recording(source, events, **size, triggers=edges, truth=some_truth(events), t_offset_us=77)
    start_us, end_us = int(events.t_us[300]), int(events.t_us[1200])
    x, y = int(events.x_px[600]), int(events.y_px[600])
    roi = (x - 40, y - 300, 90, 310)
    lost = " / ".join(convert(source, target, window_us=(start_us, end_us), roi_px=roi))
    inside = (np.abs(events.x_px.astype(int) - (x + 4.5)) < 45) & (np.abs(events.y_px.astype(int) - (y - 145.5)) < 155)
    inside &= (events.t_us >= start_us) & (events.t_us < end_us)
    assert 0 < np.count_nonzero(inside) < 900
    recording = open_recording(target)
    assert_same_events(recording.read(), events[inside])
    assert (recording.width_px, recording.height_px) == (1280, 720)
    assert recording.truth is None and "truth" in lost
    assert recording.triggers.t_us.tolist() == ([] if second == "npz" else [int(events.t_us[400])])
    assert ("triggers: lost" in lost) == (second == "npz")
    assert ("t_offset: lost" in lost) == (second != "h5")


def test_conversion_says_nothing_is_lost_where_nothing_is(tmp_path: Path) -> None:
    events = moving_edge(500)
    stated: dict[str, str | float] = {"camera.focal_length_mm": 16.0}
    write_recording(
        tmp_path / "a.h5", events, width_px=1280, height_px=720, attributes=stated, truth=some_truth(events)
    )
    assert convert(tmp_path / "a.h5", tmp_path / "b.h5") == []
    assert convert(tmp_path / "b.h5", tmp_path / "c.npz") == ["NPZ does not hold the simulation's truth: lost"]
    for name in ("b.h5", "c.npz"):
        assert open_recording(tmp_path / name).attributes["camera.focal_length_mm"] == 16.0


def test_pictures_and_a_sensor_that_are_lost_are_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_recording(tmp_path / "a.raw", moving_edge(500), width_px=1280, height_px=720)
    (lost,) = convert(tmp_path / "a.raw", tmp_path / "b.csv")
    assert lost.startswith("CSV or text does not hold the size of the sensor") and "--sensor 1280x720" in lost
    picture = CameraFrame(5, 0, 0, np.zeros((2, 3), np.uint8))
    monkeypatch.setattr(FormatReader, "frames", lambda *_: iter([picture]))
    assert convert(tmp_path / "a.raw", tmp_path / "b.h5") == ["HDF5 does not hold the camera's pictures: lost"]
