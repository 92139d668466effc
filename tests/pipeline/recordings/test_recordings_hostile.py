"""Files made to do harm: one line of error, in bounded time and memory, and nothing of the disk is read for them."""

from __future__ import annotations

import os
import struct
import threading
import time
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from spinscope.pipeline import isolation
from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.recordings import open_recording, write_recording
from spinscope.pipeline.simulated_recordings import DESCRIPTION, description_in
from tests.pipeline.recordings.column_files import some_columns, write_columns
from tests.pipeline.recordings.sound_files import HEIGHT_PX, WIDTH_PX, some_events
from tests.pipeline.recordings.test_recordings_fuzz import MOST_GROWTH_BYTES, peak_bytes

HOSTILE = Path(__file__).parent / "hostile"
# The library is ended after 2 s; the rest is for a machine that does much else. Without a limit it takes for ever.
MOST_S = 30.0


def linked(path: Path) -> None:
    """Events that are another file's."""
    write_columns(path.with_name("other.h5"), some_columns(50))
    with h5py.File(path, "w") as file:
        file["events"] = h5py.ExternalLink(str(path.with_name("other.h5")), "events")


def stored_elsewhere(path: Path) -> None:
    """A column that is any file of the disk."""
    columns = some_columns(50)
    secret = path.with_name("secret")
    secret.write_bytes(bytes(range(50)))
    write_columns(path, {name: columns[name] for name in "typ"})
    with h5py.File(path, "r+") as file:
        file.create_dataset("events/x", (50,), "u1", external=[(str(secret), 0, 50)])


def stored_in_a_pipe(path: Path) -> None:
    """A column from a pipe that nobody writes to."""
    stored_elsewhere(path)
    path.with_name("secret").unlink()
    os.mkfifo(path.with_name("secret"))


def virtual(path: Path) -> None:
    """A column put together from another file."""
    columns = some_columns(50)
    write_columns(path.with_name("other.h5"), columns)
    write_columns(path, {name: columns[name] for name in "typ"})
    layout = h5py.VirtualLayout((50,), "i8")
    layout[:] = h5py.VirtualSource(str(path.with_name("other.h5")), "events/x", (50,))
    with h5py.File(path, "r+") as file:
        file.create_virtual_dataset("events/x", layout)


def huge_sensor(path: Path) -> None:
    write_columns(path, some_columns(50))
    with h5py.File(path, "r+") as file:
        file.attrs["width"], file.attrs["height"] = 65535, 65535


def huge_sensor_of_dat(path: Path) -> None:
    write_recording(path, some_events(50), width_px=WIDTH_PX, height_px=HEIGHT_PX)
    path.write_bytes(path.read_bytes().replace(b"Width 320", b"Width 65535"))


def endless_sensor(path: Path) -> None:
    """A size with more digits than a float can hold."""
    path.write_text("1" + 899 * "0" + " 240\n1.0 5 6 1\n", encoding="ascii")


def objects(path: Path) -> None:
    """Python objects, which run code when they are loaded."""
    np.savez(path, **some_columns(50) | {"t": np.array([{}] * 50, object)})


def broken_header(path: Path) -> None:
    """A header of NumPy that ends within a bracket."""
    np.savez(path, **some_columns(50))
    path.write_bytes(path.read_bytes().replace(b"(50,), }", b"(50,((((", 1))


def pipe(path: Path) -> None:
    os.mkfifo(path)


def copied(name: str) -> Callable[[Path], object]:
    """Copy of a file that was damaged at random."""
    return lambda path: path.write_bytes((HOSTILE / name).read_bytes())


HARM: dict[str, tuple[str, Callable[[Path], object], str]] = {
    "the library loops": ("a.h5", copied("hang.h5"), "makes no progress"),
    "14 kB unpack to 2 GB": ("a.h5", copied("bomb.h5"), "memory|damaged"),
    "another file": ("a.h5", linked, "in another file"),
    "any file of the disk": ("a.h5", stored_elsewhere, "in another file"),
    "a pipe": ("a.h5", stored_in_a_pipe, "in another file"),
    "a virtual column": ("a.h5", virtual, "in another file"),
    "65535 x 65535 pixels": ("a.h5", huge_sensor, "sensor size 65535 x 65535 .* --sensor"),
    "65535 columns": ("a.dat", huge_sensor_of_dat, "sensor size 65535 x 240 .* --sensor"),
    "900 digits of columns": ("a.txt", endless_sensor, r"sensor size 1.000000e\+899 x 240 .* --sensor"),
    "Python objects": ("a.npz", objects, "holds Python objects"),
    "an open bracket": ("a.npz", broken_header, "damaged"),
    "no ordinary file": ("a.raw", pipe, "not an ordinary file"),
}


@pytest.mark.parametrize("harm", HARM)
def test_harm_is_refused_in_bounded_time_and_memory(tmp_path: Path, harm: str) -> None:
    name, make, message = HARM[harm]
    make(tmp_path / name)
    peak, start = peak_bytes(), time.monotonic()
    with pytest.raises(RecordingError, match=message) as refused:
        open_recording(tmp_path / name).read()
    assert time.monotonic() - start < MOST_S and peak_bytes() - peak < MOST_GROWTH_BYTES
    assert "\n" not in str(refused.value) and str(tmp_path) in str(refused.value)


def test_others_are_served_while_a_library_loops(samples: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As in the page's server, where each request is a thread."""
    processes: list[isolation._Process] = []
    failed: list[RecordingError] = []

    class KnownProcess(isolation._Process):
        def __init__(self) -> None:
            super().__init__()
            processes.append(self)

    def open_hanging() -> None:
        try:
            open_recording(HOSTILE / "hang.h5").read()
        except RecordingError as error:
            failed.append(error)

    isolation._idle.end()
    monkeypatch.setattr(isolation, "_Process", KnownProcess)
    monkeypatch.setattr(isolation, "MAX_CPU_S", 600)  # until it is ended here
    monkeypatch.setattr(isolation, "MAX_SILENCE_S", 600.0)
    thread = threading.Thread(target=open_hanging)
    thread.start()
    while not processes:
        time.sleep(0.001)
    assert len(open_recording(samples / "spinner_ball2_side.h5").read()) > 1000
    assert thread.is_alive()
    for process in processes:
        process._process.kill()  # its pipes are the thread's, which reads them
    thread.join()
    assert failed


def test_a_scene_nested_thousands_deep_is_none() -> None:
    assert description_in({DESCRIPTION: "[" * 100_000 + "]" * 100_000}) is None


def test_a_length_beyond_the_disk_is_refused(tmp_path: Path) -> None:
    """A compressed member that states more than there is, in the archive's own table."""
    path = tmp_path / "a.npz"
    np.savez_compressed(path, **some_columns(500))
    data = bytearray(path.read_bytes())
    entry = data.index(b"PK\x01\x02")
    struct.pack_into("<I", data, entry + 24, 0xFFFFFFF0)
    path.write_bytes(data)
    with pytest.raises(RecordingError, match=r"not the .* its header states|damaged"):
        open_recording(path).read()
