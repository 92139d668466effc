"""Which format is this file? Its first bytes say, then its name."""

from __future__ import annotations

from pathlib import Path

from ..errors import RecordingError
from .recording import Recording
from .sensor import stated_sensor
from .source import Progress, Source

READABLE = "HDF5 (.h5, .hdf5), Prophesee RAW (.raw) and DAT (.dat), NPZ (.npz)"
HEAD_BYTES = 16
HDF5_MAGIC = b"\x89HDF\r\n\x1a\n"
OTHER_FORMATS = {
    b"#!AER-DAT": "AEDAT",
    b"#ROSBAG": "ROS bag",
    b"SQLite format 3": "ROS 2 bag (SQLite)",
    b"\x93NUMPY": "single NumPy array (.npy)",
    b"\x1f\x8b": "gzip-packed",
    b"\xfd7zXZ": "xz-packed",
    b"7z\xbc\xaf": "7z-packed",
    b"RRF": "Rerun viewer",
}


def open_recording(
    path: str | Path, *, sensor: tuple[int, int] | None = None, on_progress: Progress | None = None
) -> Recording:
    """Open a recording of any known format; the content decides, then the suffix.

    sensor : (width_px, height_px) as stated by the user; beats what the file says
    on_progress : called with the share done (0..1) while the events are searched for the sensor's size

    Raises RecordingError in one line for everything that cannot be read.
    """
    path = Path(path)
    try:
        asked = None if sensor is None else stated_sensor(*sensor, "command line")
        return Recording(_source(path, _head(path)), asked, on_progress)
    except RecordingError as error:
        if str(path) in str(error):
            raise
        raise RecordingError(f"{error}: {path}") from error


def _head(path: Path) -> bytes:
    """The first bytes of a file that can be read."""
    try:
        if path.is_dir():
            raise RecordingError(f"recording is a folder, not a file: name a file in it: {path}")
        if not path.exists():
            raise RecordingError(f"recording does not exist: check the name and the folder: {path}")
        if not path.is_file():
            raise RecordingError(f"recording is not an ordinary file: copy it into one first: {path}")
        with open(path, "rb") as file:
            head = file.read(HEAD_BYTES)
    except PermissionError as error:
        raise RecordingError(f"recording may not be read: ask for the right to read it: {path}") from error
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or str(error)
        raise RecordingError(f"recording cannot be opened ({why}): check the name and the disk: {path!s}") from error
    if not head:
        raise RecordingError(f"recording is empty (0 bytes): record or copy it again: {path}")
    return head


def _source(path: Path, head: bytes) -> Source:
    # Each reader is imported only when needed: h5py takes 0.15 s, the RAW decoders compile.
    if head.startswith(HDF5_MAGIC):
        from .hdf5 import Hdf5Source

        return Hdf5Source(path)
    if head.startswith(b"PK"):
        from .npz import NpzSource

        return NpzSource(path)
    if head.startswith(b"% Data file"):
        from .dat import DatSource

        return DatSource(path)
    if head.startswith(b"% "):
        from .raw import RawSource

        return RawSource(path)
    for magic, name in OTHER_FORMATS.items():
        if head.startswith(magic):
            raise RecordingError(f"{name} file is not read here: convert it to one of {READABLE}: {path}")
    suffix = path.suffix.lower()
    expected = {".h5": "HDF5", ".hdf5": "HDF5", ".npz": "NPZ", ".raw": "Prophesee RAW with its header"}.get(suffix)
    if expected is not None:
        raise RecordingError(
            f"file named {suffix} is no {expected} file (it starts with {head[:8].hex(' ')}): "
            f"copy or export it again as one of {READABLE}: {path}"
        )
    raise RecordingError(f"format of the recording is unknown: readable are {READABLE}: {path}")
