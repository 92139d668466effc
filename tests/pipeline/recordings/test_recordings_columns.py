"""HDF5 and NPZ: layouts, types, filters, windows, order, damage."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.recordings import FORMATS, ReadingOptions, Recording, open_recording
from tests.reference.recordings import ecf_block, naive_order

N = 5000


def some_columns(n: int = N, seed: int = 1) -> dict[str, Any]:
    """Columns of events over 1 s on 640 x 480 pixels; the last corner is used."""
    rng = np.random.default_rng(seed)
    x, y = rng.integers(0, 640, n), rng.integers(0, 480, n)
    x[n // 2], y[n // 2] = 639, 479
    return {"t": np.sort(rng.integers(0, 1_000_000, n)), "x": x, "y": y, "p": rng.integers(0, 2, n)}


def write_columns(path: Path, columns: dict[str, Any], group: str = "events", **options: Any) -> None:
    with h5py.File(path, "w") as file:
        for name, values in columns.items():
            file.create_dataset(f"{group}/{name}", data=values, **options)


def assert_columns(events: EventBatch, columns: dict[str, Any]) -> None:
    np.testing.assert_array_equal(events.t_us, columns["t"])
    np.testing.assert_array_equal(events.x_px, columns["x"])
    np.testing.assert_array_equal(events.y_px, columns["y"])
    np.testing.assert_array_equal(events.on, np.asarray(columns["p"]) == 1)


def hdf5_filters() -> list[dict[str, Any]]:
    import hdf5plugin

    plain: list[dict[str, Any]] = [{}, {"compression": "gzip"}, {"compression": "lzf", "shuffle": True}]
    return [*plain, dict(hdf5plugin.Blosc()), dict(hdf5plugin.Zstd()), dict(hdf5plugin.Blosc2())]


@pytest.mark.parametrize("option", range(6))
def test_columns_are_read_through_every_filter(tmp_path: Path, option: int) -> None:
    columns = some_columns()
    write_columns(tmp_path / "a.h5", columns, **hdf5_filters()[option])
    recording = open_recording(tmp_path / "a.h5")
    assert_columns(recording.read(), columns)
    assert recording.format == "HDF5 columns" and recording.events == N
    assert (recording.width_px, recording.height_px, recording.sensor_from) == (640, 480, "guess")
    assert any("640 x 480" in warning and "--sensor" in warning for warning in recording.warnings)


@pytest.mark.parametrize("place", ["CD/events", "events"])
def test_prophesees_compound_layout_is_read_with_its_triggers(tmp_path: Path, place: str) -> None:
    columns = some_columns()
    records = np.zeros(N, [("x", "<u2"), ("y", "<u2"), ("p", "<i2"), ("t", "<i8")])
    for name, values in columns.items():
        records[name] = values
    edges = np.array([(1, 100, 0), (0, 300, 6)], [("p", "<i2"), ("t", "<i8"), ("id", "<i2")])
    with h5py.File(tmp_path / "a.hdf5", "w") as file:
        file.create_dataset(place, data=records, chunks=(700,), compression="gzip")
        file.create_dataset("EXT_TRIGGER/events", data=edges)
        file.attrs["geometry"] = "1280x720"
    recording = open_recording(tmp_path / "a.hdf5")
    assert_columns(recording.read(), columns)
    assert "compound" in recording.format and recording.sensor_from == "file"
    assert (recording.width_px, recording.height_px) == (1280, 720)
    assert recording.triggers.t_us.tolist() == [100, 300] and recording.triggers.id.tolist() == [0, 6]
    assert recording.triggers.value.tolist() == [1, 0] and recording.warnings == []


@pytest.mark.parametrize("way", [0, 1, 2])
@pytest.mark.parametrize("dense", [True, False])
def test_prophesees_ecf_compression_is_undone(tmp_path: Path, way: int, dense: bool) -> None:
    rng = np.random.default_rng(way)
    n, rows = 2500, 1000
    t = np.sort(rng.integers(5_000_000, 5_000_400 if dense else 900_000_000, n))
    x, y, p = np.sort(rng.integers(0, 1280, n)), np.sort(rng.integers(0, 720, n)), rng.integers(0, 2, n)
    if dense:
        y[100:900], p[100:900] = 7, 1
        t[100:900] = t[100]
    with h5py.File(tmp_path / "a.h5", "w") as file:
        kind = np.dtype([("x", "<u2"), ("y", "<u2"), ("p", "<i2"), ("t", "<i8")])
        plist = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        plist.set_chunk((rows,))
        plist.set_filter(0x8ECF, h5py.h5z.FLAG_OPTIONAL, ())
        group = file.create_group("CD")
        space = h5py.h5s.create_simple((n,), (h5py.h5s.UNLIMITED,))
        data = h5py.h5d.create(group.id, b"events", h5py.h5t.py_create(kind), space, plist)
        for start in range(0, n, rows):
            part = slice(start, min(start + rows, n))
            if start == rows:  # a block may be stored as it is
                records = np.zeros(rows, kind)
                for name, column in {"t": t, "x": x, "y": y, "p": p}.items():
                    records[name] = column[part]
                data.write_direct_chunk((start,), records.tobytes(), 1)
            else:
                data.write_direct_chunk((start,), ecf_block(t[part], x[part], y[part], p[part], way), 0)
        file.attrs["geometry"] = "1280x720"
    recording = open_recording(tmp_path / "a.h5")
    columns = {"t": t, "x": x, "y": y, "p": p}
    assert_columns(recording.read(), columns)
    middle = recording.read(int(t[1200]), int(t[2100]))
    assert_columns(
        middle, {c: v[np.searchsorted(t, t[1200]) : np.searchsorted(t, t[2100])] for c, v in columns.items()}
    )


RUNS = st.sampled_from([1, 2, 14, 15, 16, 30, 31, 32, 126, 127, 128, 300])
STEPS = st.sampled_from([0, 1, 14, 15, 16, 255, 256, 4095, 1 << 20, 1 << 33])


@settings(max_examples=60)
@given(
    st.lists(st.tuples(RUNS, STEPS, st.integers(0, 1279), st.integers(0, 719), st.booleans()), min_size=1, max_size=8),
    st.sampled_from([0, 1, 2]),
    st.booleans(),
)
def test_runs_of_every_length_and_steps_of_every_size_are_decoded_from_ecf(
    runs: list[tuple[int, int, int, int, bool]], way: int, rising: bool
) -> None:
    """Runs and steps at and around the lengths at which the encoding takes more bytes."""
    from spinscope.pipeline.recordings.formats.hdf5.ecf import PAD_BYTES, _empty_block, decode_ecf

    lengths = [run[0] for run in runs]
    n = sum(lengths)
    t = np.repeat(5 + np.cumsum([run[1] for run in runs]), lengths)
    x = (np.repeat([run[2] for run in runs], lengths) + np.arange(n) * rising) % 1280
    y, p = np.repeat([run[3] for run in runs], lengths), np.repeat([int(run[4]) for run in runs], lengths)
    out = _empty_block(n)
    data = np.frombuffer(ecf_block(t, x, y, p, way) + bytes(PAD_BYTES), np.uint8)
    assert decode_ecf(out, data) == n
    for found, expected in zip(out, (t, x, y, p), strict=True):
        np.testing.assert_array_equal(found, expected)


def test_damaged_ecf_blocks_are_refused_not_misread(tmp_path: Path) -> None:
    from spinscope.pipeline.recordings.formats.hdf5.ecf import DAMAGED, PAD_BYTES, _empty_block, decode_ecf

    c = some_columns(300)
    rng = np.random.default_rng(0)
    for way in (0, 1, 2):
        block = ecf_block(c["t"], c["x"], c["y"], c["p"], way)
        for size in range(0, len(block), 7):
            data = np.frombuffer(block[:size] + bytes(PAD_BYTES), np.uint8)
            assert decode_ecf(_empty_block(300), data) == DAMAGED
        for _ in range(300):
            data = bytearray(block + bytes(PAD_BYTES))
            data[int(rng.integers(0, len(block)))] ^= 1 << int(rng.integers(0, 8))
            assert decode_ecf(_empty_block(300), np.frombuffer(bytes(data), np.uint8)) <= 300


@pytest.mark.parametrize("places", [("/", "width_height"), ("events", "width_height"), ("events", "geometry")])
def test_the_file_says_its_sensor_and_the_command_line_beats_it(tmp_path: Path, places: tuple[str, str]) -> None:
    path = tmp_path / "a.h5"
    write_columns(path, some_columns())
    with h5py.File(path, "a") as file:
        attributes = file[places[0]].attrs
        if places[1] == "geometry":
            attributes["geometry"] = np.bytes_(b"800x600")
        else:
            attributes["width"], attributes["height"] = 800, np.array([600])
        file["t_offset"] = 49_599_300_523
    recording = open_recording(path)
    assert (recording.width_px, recording.height_px, recording.sensor_from) == (800, 600, "file")
    assert recording.t_offset_us == 49_599_300_523 and recording.read().t_us[0] < 10_000
    asked = open_recording(path, sensor=(1280, 720))
    assert (asked.width_px, asked.height_px, asked.sensor_from) == (1280, 720, "command line")


def test_events_outside_the_files_sensor_are_dropped_and_outside_a_small_one_asked_for_refused(
    tmp_path: Path,
) -> None:
    path, columns = tmp_path / "a.h5", some_columns()
    write_columns(path, columns)
    with h5py.File(path, "a") as file:
        file.attrs["width"], file.attrs["height"] = 320, 480
    recording = open_recording(path)
    inside = columns["x"] < 320
    assert_columns(recording.read(), {c: v[inside] for c, v in columns.items()})
    assert recording.damage.outside_events == np.count_nonzero(~inside)
    assert any("outside the sensor" in warning for warning in recording.warnings)
    with pytest.raises(RecordingError, match=r"--sensor 300x200 is too small.*640x480 holds them.*a\.h5$"):
        open_recording(path, sensor=(300, 200)).read()
    # A sensor at least as large as the file's own is right: what lies outside it is damage.
    assert open_recording(path, sensor=(320, 480)).damage.outside_events == np.count_nonzero(~inside)


def test_attributes_are_kept_as_numbers_and_texts(tmp_path: Path) -> None:
    write_columns(tmp_path / "a.h5", some_columns())
    with h5py.File(tmp_path / "a.h5", "a") as file:
        file.attrs["camera.focal_length_mm"] = np.float32(12.5)
        file.attrs["camera.distortion"] = [0.1, 0.0, 0.0, 0.0, -0.25]
        file.attrs["lens"] = "Tamron"
        file.attrs["count"] = np.int64(3)
        file.attrs["table"] = np.zeros((3, 3))
    found = open_recording(tmp_path / "a.h5").attributes
    expected = {
        "camera.focal_length_mm": 12.5,
        "camera.distortion": "0.1,0.0,0.0,0.0,-0.25",
        "lens": "Tamron",
    }
    assert found == {**expected, "count": 3}


CASES: dict[str, tuple[Callable[[dict[str, Any]], dict[str, Any]], str]] = {
    "lengths": (lambda c: {**c, "x": c["x"][:-1]}, r"columns differ in length.*x \(4999,\)"),
    "two axes": (lambda c: {k: v.reshape(-1, 2) for k, v in c.items()}, "columns differ in length|holds no events"),
    "text": (lambda c: {**c, "x": c["x"].astype("S4")}, "column x holds .*not numbers"),
    "polarity": (lambda c: {**c, "p": c["p"] + (np.arange(N) % 70 == 0) * 7}, r"p = [78] at event 0 is none of 1"),
    "negative pixel": (
        lambda c: {**c, "y": c["y"] - 2000 * (np.arange(N) % 9 == 1)},
        "y = -.* at event 1 is no whole pixel from 0 on, and 556 values so far are broken",
    ),
    "half a pixel": (lambda c: {**c, "x": c["x"] + 0.5}, "x = .* at event 0 is no whole pixel"),
    "no number": (
        lambda c: {**c, "t": np.where(np.arange(N) % 33 == 3, np.nan, c["t"])},
        "t = nan at event 3 is no time",
    ),
    "huge time": (
        lambda c: {**c, "t": c["t"].astype("u8") + (np.arange(N) % 5 == 4).astype("u8") * 2**63},
        "at event 4 is no time",
    ),
    "backwards": (
        lambda c: {**c, "t": c["t"][::-1]},
        r"time goes backwards at event \d+: \d+ us, then",
    ),
    "no column": (lambda c: {k: v for k, v in c.items() if k != "p"}, "holds no events"),
    "huge pixel": (lambda c: {**c, "x": c["x"] * 9}, r"more than the largest known sensor.*--sensor"),
}


@pytest.mark.parametrize("kind", ["h5", "npz"])
@pytest.mark.parametrize("case", CASES)
def test_what_cannot_be_events_is_refused_in_one_line(tmp_path: Path, case: str, kind: str) -> None:
    change, message = CASES[case]
    path = tmp_path / f"a.{kind}"
    columns = change({name: values.astype(np.int64) for name, values in some_columns().items()})
    if kind == "h5":
        write_columns(path, columns)
    else:
        np.savez(path, **columns)
    with pytest.raises(RecordingError, match=message) as caught:
        open_recording(path).read()
    assert "\n" not in str(caught.value) and str(caught.value).endswith(str(path))


def test_nanoseconds_are_told_by_their_resolution(tmp_path: Path) -> None:
    """Also where the rate would be plausible in both units."""
    columns = some_columns()
    for name, factor, is_doubted in (("ns", 1000, True), ("us", 1, False)):
        np.savez(tmp_path / f"{name}.npz", **{**columns, "t": columns["t"] * factor})
        warnings = " ".join(open_recording(tmp_path / f"{name}.npz").warnings)
        assert ("--time-unit ns" in warnings) == is_doubted
    recording = open_recording(tmp_path / "ns.npz", time_unit="ns")
    assert "--time-unit" not in " ".join(recording.warnings)
    np.testing.assert_array_equal(recording.read().t_us, columns["t"])


def test_a_stated_unit_is_doubted_where_no_camera_has_the_rate(tmp_path: Path) -> None:
    columns = some_columns()
    write_columns(tmp_path / "a.h5", {**columns, "t": columns["t"] * 1000})
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        file["events/t"].attrs["unit"] = "us"
    assert "--time-unit ns" in " ".join(open_recording(tmp_path / "a.h5").warnings)


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


@pytest.mark.parametrize(
    "names",
    [
        ("t", "x", "y", "p"),
        ("timestamps", "x", "y", "polarity"),
        ("event_t", "event_x", "event_y", "event_p"),
    ],
)
def test_npz_columns_have_several_names(tmp_path: Path, names: tuple[str, ...]) -> None:
    columns = some_columns()
    np.savez(tmp_path / "a.npz", gt_x=np.zeros(3), **dict(zip(names, columns.values(), strict=True)))
    recording = open_recording(tmp_path / "a.npz")
    assert_columns(recording.read(), columns)
    assert recording.format == "NPZ"


def test_npz_may_hold_one_array_of_records(tmp_path: Path) -> None:
    columns = some_columns()
    records = np.zeros(N, [("t", "<i8"), ("x", "<i2"), ("y", "<i2"), ("p", "?")])
    for name, values in columns.items():
        records[name] = values
    np.savez(tmp_path / "a.npz", events=records)
    assert_columns(open_recording(tmp_path / "a.npz").read(), columns)


@pytest.mark.parametrize("kind", ["h5", "npz"])
def test_floating_times_are_seconds_with_fractions_and_microseconds_without(tmp_path: Path, kind: str) -> None:
    columns = some_columns()
    for times, unit in ((columns["t"] * 1e-6, "seconds"), (columns["t"].astype(float), "microseconds")):
        path = tmp_path / f"{unit}.{kind}"
        if kind == "h5":
            write_columns(path, {**columns, "t": times})
        else:
            np.savez(path, **{**columns, "t": times})
        recording = open_recording(path)
        assert_columns(recording.read(), columns)
        assert any(f"taken as {unit}" in warning for warning in recording.warnings)


def test_polarity_may_be_minus_one_or_truth_values(tmp_path: Path) -> None:
    columns = some_columns()
    for k, p in enumerate((columns["p"] * 2 - 1, columns["p"] == 1, (columns["p"] * 2 - 1).astype("i1"))):
        np.savez(tmp_path / f"{k}.npz", **{**columns, "p": p})
        assert_columns(open_recording(tmp_path / f"{k}.npz").read(), columns)


def test_objects_in_npz_are_refused_without_opening_them(tmp_path: Path) -> None:
    columns = some_columns()
    np.savez(tmp_path / "a.npz", **{**columns, "t": columns["t"].astype(object)})
    with pytest.raises(RecordingError, match="array t holds Python objects"):
        open_recording(tmp_path / "a.npz")


@pytest.mark.parametrize("kind", ["h5", "npz"])
def test_bombs_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str) -> None:
    """Zeros that pack a thousand times; what is too small to be refused is lowered to 1 MB."""
    monkeypatch.setattr("spinscope.pipeline.recordings.column_types.EXPANSION_FREE_BYTES", 1 << 20)
    path, zeros = tmp_path / f"bomb.{kind}", dict.fromkeys("txyp", np.zeros(3_000_000, np.int8))
    if kind == "h5":
        write_columns(path, zeros, chunks=(1_000_000,), compression="gzip", compression_opts=9)
    else:
        np.savez_compressed(path, **zeros)
    (format,) = (format for format in FORMATS if f".{kind}" in format.suffixes)
    with pytest.raises(RecordingError, match=r"would unpack from 0\.\d+ MB to \d+ MB"):
        format.open(path, ReadingOptions())  # in this process, for the limit lowered here


def test_an_unfinished_file_is_refused(tmp_path: Path) -> None:
    """Space for all events, but only some blocks written: HDF5 itself would read zeros."""
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name in "txyp":
            data = file.create_dataset(f"events/{name}", (1000,), "i4", chunks=(100,))
            data[:300] = 1
    with pytest.raises(RecordingError, match="only 3 of 10 blocks of /events/"):
        open_recording(tmp_path / "a.h5")


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
    assert recording.events == N and recording.damage.lost_bytes == 3
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


def test_hdf5_behind_a_user_block_is_read(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w", userblock_size=512) as file:
        for name, values in some_columns().items():
            file[f"events/{name}"] = values
    assert_columns(open_recording(tmp_path / "a.h5").read(), some_columns())


BROKEN: dict[str, Callable[[dict[str, Any], NDArray[np.bool_]], dict[str, Any]]] = {
    "pixel far outside": lambda c, one: {**c, "y": np.where(one, 33014, c["y"]).astype("u2")},
    "negative pixel": lambda c, one: {**c, "x": np.where(one, -32522, c["x"]).astype("i2")},
    "half a pixel": lambda c, one: {**c, "x": np.where(one, 7.5, c["x"])},
    "pixel that is no number": lambda c, one: {**c, "y": np.where(one, np.nan, c["y"])},
    "time that is no number": lambda c, one: {**c, "t": np.where(one, np.nan, c["t"])},
    "time beyond all": lambda c, one: {**c, "t": np.where(one, -(2**63), c["t"])},
    "polarity": lambda c, one: {**c, "p": np.where(one, 9, c["p"])},
}


@pytest.mark.parametrize("kind", ["h5", "npz"])
@pytest.mark.parametrize("stated", [True, False])
@pytest.mark.parametrize("case", BROKEN)
def test_one_broken_value_costs_one_event(tmp_path: Path, case: str, stated: bool, kind: str) -> None:
    one = np.arange(N) == 700
    columns, path = some_columns(), tmp_path / f"a.{kind}"
    if kind == "h5":
        write_columns(path, BROKEN[case](columns, one), chunks=(100,))
    else:
        np.savez(path, **BROKEN[case](columns, one))
    recording = open_recording(path, sensor=(640, 480) if stated else None)
    assert_columns(recording.read(), {name: column[~one] for name, column in columns.items()})
    assert (recording.width_px, recording.height_px) == (640, 480)
    damage = recording.damage
    assert damage.broken_events + damage.outside_events == 1
    assert any("1 events" in warning for warning in recording.warnings)
    later = recording.read(400_000, 500_000)
    inside = (columns["t"] >= 400_000) & (columns["t"] < 500_000)
    assert_columns(later, {name: column[inside] for name, column in columns.items()})
