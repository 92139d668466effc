"""HDF5 and NPZ that are damaged or cannot be events."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from numpy.typing import NDArray

from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.recordings import FORMATS, ReadingOptions, open_recording
from tests.pipeline.recordings.column_files import N, assert_columns, some_columns, write_columns

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
