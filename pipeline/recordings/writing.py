"""Writing and converting recordings, in the format of the file's suffix."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from ..errors import RecordingError
from ..events import EventBatch
from ..files import atomic_file, check_writable
from ..results import Truth
from .formats.registry import RecordingContent, RecordingFormat, encoding_to_write, format_to_write
from .opening import open_recording
from .reader import Progress, ReadingOptions, Triggers
from .recording import Recording
from .sensor import Resolution, check_resolution

# Attributes about the encoding of a file, which every format states itself.
ENCODING_KEYS = ("format", "evt", "geometry", "width", "height", "end", "Data", "Version", "Width", "Height")


def write_recording(
    path: str | Path,
    events: EventBatch | Iterable[EventBatch],
    *,
    width_px: int,
    height_px: int,
    attributes: Mapping[str, str | float] | None = None,
    truth: Truth | None = None,
    triggers: Triggers | None = None,
    t_offset_us: int | None = None,
    encoding: str | None = None,
) -> None:
    """Write a recording in the format of the suffix; the file appears under its name only when complete.

    HDF5 (.h5, .hdf5) holds all that is given, RAW (.raw) sensor, attributes and triggers, DAT (.dat) and NPZ (.npz)
    sensor and attributes, CSV (.csv) the events alone.

    Parameters
    ----------
    events : EventBatch or iterable of EventBatch
        Events in order of time; batches are written as they come.
    attributes : mapping of str to str or float, optional
        Statements about camera and scene.
    truth : Truth, optional
        Simulator's truth, whose label has one value an event.
    t_offset_us : int, optional
        Offset of the file's time in DSEC recordings.
    encoding : str, optional
        EVT2 or EVT3 of RAW files.

    Raises
    ------
    RecordingError
        The file cannot be written, or events are outside the sensor, out of order or beyond what the format holds.
    """
    _write(
        RecordingContent(
            path=Path(path),
            batches=[events] if isinstance(events, EventBatch) else events,
            width_px=width_px,
            height_px=height_px,
            attributes=attributes or {},
            triggers=lambda: triggers or Triggers.empty(),
            truth=lambda: truth,
            t_offset_us=t_offset_us,
            encoding=encoding_to_write(Path(path), encoding),
        )
    )


def convert(
    source: str | Path,
    target: str | Path,
    *,
    options: ReadingOptions = ReadingOptions(),  # noqa: B008  frozen
    window_us: tuple[int, int] | None = None,
    roi_px: tuple[int, int, int, int] | None = None,
    encoding: str | None = None,
    on_progress: Progress | None = None,
) -> list[str]:
    """Write the recording `source` to `target`, in the format of its suffix, in constant memory.

    Attributes, triggers, `t_offset` and truth are taken over where the format holds them (see `write_recording`). The
    truth is not where events are moved or left out, so that its labels do not fit.

    Parameters
    ----------
    options : ReadingOptions
        Statements about the source.
    window_us : (int, int), optional
        [start, end) in the file's time: only these events and triggers are written.
    roi_px : (x, y, width, height), optional
        Only the events in this rectangle are written. Coordinates and size of the sensor stay as they are, and with
        them the camera's principal point.
    encoding : str, optional
        EVT2 or EVT3 of RAW files.
    on_progress : callable, optional
        Called with the share done, 0..1.

    Raises
    ------
    RecordingError
        `source` cannot be read or `target` not be written.

    Returns
    -------
    list of str
        What the source holds and the target does not, in sentences.
    """
    source, target = Path(source), Path(target)
    format, encoding = format_to_write(target), encoding_to_write(target, encoding)
    check_writable(target, "recording")  # all three fail before the source is read
    recording = open_recording(source, **asdict(options))
    if os.path.exists(target) and os.path.samefile(source, target):
        raise RecordingError(f"a recording cannot be converted onto itself: give another name: {target}")
    read_share = 0.0  # share of the progress before the batches are read

    def report(share: float) -> None:
        if on_progress is not None:
            on_progress(read_share + (1 - read_share) * share)

    def triggers() -> Triggers:
        nonlocal read_share
        if recording.known_index() is None:
            recording.scan(lambda share: report(share / 2))
            read_share = 0.5
        return recording.triggers.between(start_us, end_us)

    def truth() -> Truth | None:
        whole = window_us is None and roi_px is None and not any(asdict(recording.damage).values())
        return recording.truth if whole else None

    start_us, end_us = window_us or (-(2**63), 2**63 - 1)
    batches = recording.chunks(*(window_us or ()), on_progress=report)
    _write(
        RecordingContent(
            path=target,
            batches=batches if roi_px is None else _inside(batches, roi_px),
            width_px=recording.width_px,
            height_px=recording.height_px,
            attributes=recording.attributes,
            triggers=triggers,
            truth=truth,
            t_offset_us=recording.t_offset_us,
            encoding=encoding,
        )
    )
    return _losses(recording, format, truth())


def _inside(batches: Iterable[EventBatch], roi_px: tuple[int, int, int, int]) -> Iterator[EventBatch]:
    """Yield the events in the rectangle (x, y, width, height)."""
    x, y, width, height = roi_px
    for batch in batches:
        columns, rows = batch.x_px.astype(np.int64) - x, batch.y_px.astype(np.int64) - y
        yield batch[(columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)]


def _losses(recording: Recording, format: RecordingFormat, truth: Truth | None) -> list[str]:
    """Sentences about what a converted recording has lost."""
    stated = [name for name in recording.attributes if name not in ENCODING_KEYS]
    there = {
        "sensor": f"the size of the sensor (state it with --sensor {recording.width_px}x{recording.height_px})",
        "attributes": f"what the recording states ({', '.join(stated)})" if stated else "",
        "triggers": f"{len(recording.triggers)} triggers" if len(recording.triggers) else "",
        "t_offset": "t_offset" if recording.t_offset_us is not None else "",
    }
    lost = [
        f"{format.label} does not hold {what}: lost" for key, what in there.items() if what and key not in format.keeps
    ]
    if recording.truth is not None and "truth" not in format.keeps:
        lost.append(f"{format.label} does not hold the simulation's truth: lost")
    elif recording.truth is not None and truth is None:
        lost.append("the simulation's truth is lost: its labels do not fit where events are left out or moved")
    if next(recording.frames(-(2**63), 2**63 - 1), None) is not None:
        lost.append(f"{format.label} does not hold the camera's pictures: lost")
    return lost


def _write(content: RecordingContent) -> None:
    path = content.path
    format = format_to_write(path)
    assert format.write is not None
    check_resolution(Resolution(content.width_px, content.height_px, "events to be written"))
    attributes = {name: value for name, value in content.attributes.items() if name not in ENCODING_KEYS}
    with atomic_file(path, "recording") as part:
        try:
            format.write(part, replace(content, batches=_checked(content), attributes=attributes))
        except (RuntimeError, ValueError, MemoryError) as error:  # of h5py and zipfile, as when the disk is full
            raise OSError(" ".join(str(error).split())) from error


def _checked(content: RecordingContent) -> Iterator[EventBatch]:
    """Yield the batches that hold events; raises RecordingError for those that no reader would take back."""
    last_us = -(2**63)
    for batch in content.batches:
        if not len(batch):
            continue
        if int(batch.x_px.max()) >= content.width_px or int(batch.y_px.max()) >= content.height_px:
            raise RecordingError(
                f"events reach over {int(batch.x_px.max()) + 1} x {int(batch.y_px.max()) + 1} pixels, more than the "
                f"sensor's {content.width_px} x {content.height_px}: state a larger sensor: {content.path}"
            )
        if int(batch.t_us[0]) < last_us or np.any(batch.t_us[1:] < batch.t_us[:-1]):
            raise RecordingError(f"events to be written are not in order of time: sort them: {content.path}")
        last_us = int(batch.t_us[-1])
        yield batch
