"""HDF5, NPZ and text in columns: order of events and windows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.recordings import Recording, open_recording
from tests.pipeline.recordings.column_files import N, assert_columns, some_columns, write_columns
from tests.reference.recordings import naive_order


@pytest.mark.parametrize("kind", ["h5", "npz", "csv"])
def test_a_clock_that_was_set_back_is_a_segment_of_columns_too(tmp_path: Path, kind: str) -> None:
    path, columns = tmp_path / f"a.{kind}", some_columns()
    half = N // 2
    later = columns["t"] + 7_000_000
    columns["t"] = np.append(later[:half], columns["t"][: N - half])
    if kind == "h5":
        write_columns(path, columns)
    elif kind == "npz":
        np.savez(path, **columns)
    else:
        rows = np.stack([columns[name].astype(np.int64) for name in "txyp"], axis=1)
        np.savetxt(path, rows, "%d", ",", header="t,x,y,p", comments="")
    recording = open_recording(path, sensor=(1280, 720))
    events = recording.read()
    assert recording.damage.clock_resets == 1 and "set back 1 times" in " ".join(recording.warnings)
    assert np.array_equal(events.x_px, columns["x"]) and np.all(events.t_us[1:] >= events.t_us[:-1])
    assert np.array_equal(np.diff(events.t_us[half:]), np.diff(columns["t"][half:]))
    middle_us = int(events.t_us[half])
    window = open_recording(path, sensor=(1280, 720)).read(middle_us + 1000, middle_us + 90_000)
    assert np.array_equal(window.x_px, events.between(middle_us + 1000, middle_us + 90_000).x_px) and len(window)


@given(st.lists(st.integers(0, 30_000), max_size=60), st.integers(1, 7))
def test_small_disorder_is_sorted_as_by_the_twin(
    tmp_path_factory: pytest.TempPathFactory, times: list[int], max_events: int
) -> None:
    path = tmp_path_factory.mktemp("order") / "a.npz"
    n = len(times)
    np.savez(path, t=np.array(times, np.int64), x=np.arange(n), y=np.zeros(n, int), p=np.ones(n, int))
    recording = open_recording(path)
    ordered, backward, late = naive_order([(t, k, 0, True) for k, t in enumerate(times)])
    if late:
        with pytest.raises(RecordingError, match="time goes backwards"):
            recording.scan()
        return
    parts = list(recording.chunks(max_events=max_events))
    assert all(1 <= len(part) <= max_events for part in parts)
    found = EventBatch.concatenate(parts)
    assert [(t, k, 0, True) for t, k in zip(found.t_us.tolist(), found.x_px.tolist(), strict=True)] == ordered
    assert recording.damage.backward_steps == backward
    assert bool(recording.damage.sentences()) == bool(backward)
    for start, end in ((5000, 12_000), (0, 1), (29_000, 40_000)):
        expected = [event[1] for event in ordered if start <= event[0] < end]
        assert recording.read(start, end).x_px.tolist() == expected


@settings(max_examples=30)
@given(st.integers(0, 1_000_100), st.integers(-10, 400_000), st.sampled_from(["h5", "npz"]))
def test_a_window_is_the_events_of_it(window_files: dict[str, Recording], start: int, span: int, kind: str) -> None:
    recording = window_files[kind]
    t = some_columns()["t"]
    inside = (t >= start) & (t < start + span)
    assert_columns(recording.read(start, start + span), {c: v[inside] for c, v in some_columns().items()})


@pytest.mark.parametrize("kind", ["h5", "npz"])
@pytest.mark.parametrize("span_us", [1, 3000, 40_000])
def test_a_window_of_a_disordered_file_misses_no_event(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str, span_us: int
) -> None:
    """Events up to 10 ms out of order, the last one by all of it: neither end of the window may be cut too close."""
    monkeypatch.setattr("spinscope.pipeline.recordings.recording.CHUNK_EVENTS", 5)
    rng = np.random.default_rng(span_us)
    columns = some_columns(900)
    columns["t"] = np.arange(900) * 400 + rng.choice([0, 1, 5000, 9999, 10_000], 900)
    path = tmp_path / f"a.{kind}"
    if kind == "h5":
        write_columns(path, columns, chunks=(64,))
    else:
        np.savez(path, **columns)
    recording = open_recording(path, sensor=(640, 480))
    order = np.argsort(columns["t"], kind="stable")
    ordered = {name: column[order] for name, column in columns.items()}
    for start_us in [*range(0, 370_000, 7300), *columns["t"][::90].tolist()]:
        inside = (ordered["t"] >= start_us) & (ordered["t"] < start_us + span_us)
        found = recording.read(start_us, start_us + span_us)
        assert_columns(found, {name: column[inside] for name, column in ordered.items()})
    assert_columns(recording.read(None, 50_000), {n: c[ordered["t"] < 50_000] for n, c in ordered.items()})
    assert_columns(recording.read(50_000), {n: c[ordered["t"] >= 50_000] for n, c in ordered.items()})


@pytest.fixture(scope="module")
def window_files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Recording]:
    folder = tmp_path_factory.mktemp("window")
    write_columns(folder / "a.h5", some_columns(), chunks=(97,))
    np.savez_compressed(folder / "a.npz", **some_columns())
    return {kind: open_recording(folder / f"a.{kind}") for kind in ("h5", "npz")}
