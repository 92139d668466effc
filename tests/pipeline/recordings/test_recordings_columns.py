"""HDF5 and NPZ: layouts, types, filters, sensor, units."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.recordings import open_recording
from tests.pipeline.recordings.column_files import N, assert_columns, some_columns, write_columns


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


def test_hdf5_behind_a_user_block_is_read(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w", userblock_size=512) as file:
        for name, values in some_columns().items():
            file[f"events/{name}"] = values
    assert_columns(open_recording(tmp_path / "a.h5").read(), some_columns())
