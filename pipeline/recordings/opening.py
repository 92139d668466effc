"""Opening a recording of any registered format."""

from __future__ import annotations

from pathlib import Path

from ..errors import RecordingError
from .formats.registry import FORMATS, head_of
from .isolated_reader import IsolatedReader
from .reader import FormatReader, Progress, ReadingOptions
from .recording import Recording
from .sensor import stated_resolution

UNREADABLE = {
    b"\x1f\x8b": "gzip-packed",
    b"\xfd7zXZ": "xz-packed",
    b"7z\xbc\xaf": "7z-packed",
    b"RRF": "Rerun viewer",
}


def open_recording(
    path: str | Path,
    *,
    sensor: tuple[int, int] | None = None,
    dataset: str | None = None,
    time_unit: str | None = None,
    on_progress: Progress | None = None,
) -> Recording:
    """Open a recording of any registered format, recognised by its content.

    Parameters
    ----------
    path : str or Path
        The file.
    sensor : (width_px, height_px), optional
        Size of the sensor as stated by the user; beats the file's own statement.
    dataset : str, optional
        Path of the events in a file that holds several streams, like "prophesee/left".
    time_unit : str, optional
        Unit of the times (s, ms, us or ns) in files of columns; beats the file's own statement.
    on_progress : callable, optional
        Called with the share done (0..1) while the events are searched for the sensor's size.

    Returns
    -------
    Recording
        Only the header has been read, or once all events when nothing states the sensor.

    Raises
    ------
    RecordingError
        For everything that cannot be read.
    """
    path = Path(path)
    try:
        stated = None if sensor is None else stated_resolution(*sensor, "command line")
        options = ReadingOptions(sensor=sensor, dataset=dataset, time_unit=time_unit)
        head = _head(path)
        for format in sorted(FORMATS, key=lambda format: format.generic):
            if format.sniff(path, head):
                opened = IsolatedReader(format.open, path, options) if format.isolated else format.open(path, options)
                opened.warnings += _unused(opened)
                return Recording(opened, stated, on_progress)
        raise _unknown(path, head)
    except RecordingError as error:
        if str(path) in str(error):
            raise
        raise RecordingError(f"{error}: {path}") from error


def _unused(reader: FormatReader) -> list[str]:
    """Sentences about options that mean nothing for the format of the file."""
    return [
        f"--{name.replace('_', '-')} {getattr(reader.options, name)} has no effect: a {reader.format} file states it"
        for name in ("dataset", "time_unit")
        if getattr(reader.options, name) is not None and name not in reader.takes
    ]


def _head(path: Path) -> bytes:
    """Read the first bytes; raises RecordingError for all that is no ordinary file with content."""
    try:
        if path.is_dir():
            raise RecordingError(f"recording is a folder, not a file: name a file in it: {path}")
        if not path.exists():
            raise RecordingError(f"recording does not exist: check the name and the folder: {path}")
        if not path.is_file():
            raise RecordingError(f"recording is not an ordinary file: copy it into one first: {path}")
        head = head_of(path)
    except PermissionError as error:
        raise RecordingError(f"recording may not be read: ask for the right to read it: {path}") from error
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or str(error)
        raise RecordingError(f"recording cannot be opened ({why}): check the name and the disk: {path!s}") from error
    if not head:
        raise RecordingError(f"recording is empty (0 bytes): record or copy it again: {path}")
    return head


def _unknown(path: Path, head: bytes) -> RecordingError:
    """Error for a file that no format recognises."""
    readable = ", ".join(format.listed for format in FORMATS)
    for magic, name in UNREADABLE.items():
        if head.startswith(magic):
            return RecordingError(f"{name} file is not read here: convert it to one of {readable}: {path}")
    suffix = path.suffix.lower()
    for format in FORMATS:
        if suffix in format.suffixes:
            return RecordingError(
                f"file named {suffix} is no {format.label} file (it starts with {head[:8].hex(' ')}): "
                f"copy or export it again as one of {readable}: {path}"
            )
    return RecordingError(f"format of the recording is unknown: readable are {readable}: {path}")
