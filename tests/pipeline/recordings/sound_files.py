"""A small sound file of every registered format, and of encodings that we read and do not write."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np

from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.recordings import FORMATS, Triggers, write_recording
from tests.pipeline.recordings.test_recordings_rosbag import packets, store, write_bag
from tests.reference.recordings import columns, ecf_block, write_aedat4, write_event_stream, write_evt2

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


def write_ecf(path: Path, events: EventBatch) -> None:
    """Prophesee's HDF5 with its own compression."""
    kind = np.dtype([("x", "<u2"), ("y", "<u2"), ("p", "<i2"), ("t", "<i8")])
    rows = 200
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


def write_mono(path: Path, events: EventBatch) -> None:
    """Bag of `event_camera_msgs` packets of 100 events."""
    payloads = []
    for first in range(0, len(events), 100):
        part = events[first : first + 100]
        base_us = int(part.t_us[0])
        words = [int(on) << 63 | y << 48 | x << 32 | (t - base_us) * 1000 for t, x, y, on in columns(part)]
        payloads.append((base_us * 1000, np.array(words, "<u8").tobytes()))
    kind = path.suffix[1:]
    folder = path.with_name(f"made_{kind}")
    folder.mkdir()
    write_bag(folder, kind, {"/camera": packets(store(kind), kind, "mono", payloads)}).rename(path)


def write_rows(path: Path, events: EventBatch) -> None:
    """Array of x, y, t, p in N rows."""
    np.save(path, np.stack([events.x_px, events.y_px, events.t_us, events.on], axis=1).astype(np.int64))


def write_stream(path: Path, events: EventBatch) -> None:
    """Event Stream, of an ATIS where the name says so."""
    size = {"width_px": WIDTH_PX, "height_px": HEIGHT_PX}
    write_event_stream(path, columns(events), **size, is_atis="atis" in path.name)


# Encodings beside the one that `write_recording` writes, by the format's name.
ENCODINGS: dict[str, dict[str, Callable[[Path, EventBatch], None]]] = {
    "prophesee_raw": {
        "evt2.raw": lambda path, events: write_evt2(path, events, width_px=WIDTH_PX, height_px=HEIGHT_PX),
        "evt21.raw": write_evt21,
    },
    "aedat": {"plain.aedat4": lambda path, events: write_aedat4(path, columns(events), WIDTH_PX, HEIGHT_PX)},
    "event_stream": {"dvs.es": write_stream, "atis.es": write_stream},
    "npy": {"rows.npy": write_rows},
    "rosbag": {"a.bag": write_mono, "a.db3": write_mono, "a.mcap": write_mono},
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
