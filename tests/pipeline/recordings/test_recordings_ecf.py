"""HDF5 with Prophesee's own compression, ECF."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spinscope.pipeline.recordings import open_recording
from tests.pipeline.recordings.column_files import assert_columns, some_columns
from tests.reference.recordings import ecf_block


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
