"""A small sound file of every registered format, and of encodings that we read and do not write."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np

from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.recordings import FORMATS, Triggers, write_recording
from tests.reference.recordings import ecf_block, write_evt2

WIDTH_PX, HEIGHT_PX = 320, 240


def some_events(n: int = 1500, seed: int = 6) -> EventBatch:
    """Events of 0.25 s, no two on the same pixel."""
    rng = np.random.default_rng(seed)
    t = 4_000_000 + np.sort(rng.integers(0, 250_000, n))
    pixels = rng.permutation(WIDTH_PX * HEIGHT_PX)[:n]
    x, y = (pixels % WIDTH_PX).astype(np.uint16), (pixels // WIDTH_PX).astype(np.uint16)
    return EventBatch(t, x, y, rng.integers(0, 2, n).astype(np.bool_))


def write_evt21(path: Path, events: EventBatch) -> None:
    """EVT2.1 with one event a word."""
    words, before = [], None
    for t, x, y, on in zip(*(column.tolist() for column in events.columns), strict=True):
        if t >> 6 != before:
            before = t >> 6
            words += [0, 0x8 << 28 | before]
        words += [1 << x % 32, on << 28 | (t & 63) << 22 | x // 32 * 32 << 11 | y]
    header = f"% evt 2.1\n% format EVT21;height={HEIGHT_PX};width={WIDTH_PX};endianness=little\n% end\n"
    path.write_bytes(header.encode() + np.array(words, "<u4").tobytes())


def write_dat(path: Path, events: EventBatch) -> None:
    """DAT of CD events."""
    pixel = events.x_px.astype("<u4") | events.y_px.astype("<u4") << 14 | events.on.astype("<u4") << 28
    words = np.stack([(events.t_us & 0xFFFFFFFF).astype("<u4"), pixel], axis=1)
    header = f"% Data file containing CD events.\n% Version 2\n% Height {HEIGHT_PX}\n% Width {WIDTH_PX}\n"
    path.write_bytes(header.encode() + bytes((12, 8)) + words.tobytes())


def write_ecf(path: Path, events: EventBatch) -> None:
    """Prophesee's HDF5 with its own compression."""
    kind = np.dtype([("x", "<u2"), ("y", "<u2"), ("p", "<i2"), ("t", "<i8")])
    rows = 600
    with h5py.File(path, "w") as file:
        plist = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        plist.set_chunk((rows,))
        plist.set_filter(0x8ECF, h5py.h5z.FLAG_OPTIONAL, ())
        space = h5py.h5s.create_simple((len(events),), (h5py.h5s.UNLIMITED,))
        data = h5py.h5d.create(file.create_group("CD").id, b"events", h5py.h5t.py_create(kind), space, plist)
        for start in range(0, len(events), rows):
            part = (column.astype(np.int64) for column in events[start : start + rows].columns)
            data.write_direct_chunk((start,), ecf_block(*part, 0), 0)
        file.attrs["geometry"] = f"{WIDTH_PX}x{HEIGHT_PX}"


# Encodings beside the one that `write_recording` writes, by the format's name.
ENCODINGS: dict[str, dict[str, Callable[[Path, EventBatch], None]]] = {
    "prophesee_raw": {
        "evt2.raw": lambda path, events: write_evt2(path, events, width_px=WIDTH_PX, height_px=HEIGHT_PX),
        "evt21.raw": write_evt21,
    },
    "prophesee_dat": {"cd.dat": write_dat},
    "hdf5": {"ecf.h5": write_ecf},
}


def sound_files(folder: Path, name: str, events: EventBatch) -> list[Path]:
    """Files of these events in the format of this name, one an encoding; at least one."""
    (format,) = (format for format in FORMATS if format.name == name)
    files = []
    if format.write is not None:
        files.append(folder / f"written{format.suffixes[0]}")
        edges = Triggers(np.array([4_000_100, 4_100_000]), np.array([1, 0], np.uint8), np.array([0, 6], np.uint8))
        size = {"width_px": WIDTH_PX, "height_px": HEIGHT_PX}
        write_recording(files[0], events, **size, attributes={"camera.focal_length_mm": 8.0}, triggers=edges)
    for file, write in ENCODINGS.get(name, {}).items():
        files.append(folder / file)
        write(files[-1], events)
    assert files, f"a format that is only read needs a small sound file: add how to make one to ENCODINGS[{name!r}]"
    return files
