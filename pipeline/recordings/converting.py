"""From one format to another."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from ..errors import RecordingError
from .opening import open_recording
from .recording import Recording
from .source import Progress
from .writing import Hdf5Writer, write_npz, write_raw

ENCODING_KEYS = ("format", "evt", "geometry", "width", "height", "end")
HDF5_SUFFIXES, NPZ_SUFFIX, RAW_SUFFIX = (".h5", ".hdf5"), ".npz", ".raw"


def convert(
    source: str | Path,
    target: str | Path,
    *,
    sensor: tuple[int, int] | None = None,
    on_progress: Progress | None = None,
) -> None:
    """Write the recording `source` to `target`, as its suffix says: .h5, .hdf5, .npz, .raw (EVT3).

    Events stream through in constant memory. HDF5 takes over attributes, triggers, t_offset and (unless
    events had to be moved or dropped, so that labels do not fit) the truth; RAW attributes and triggers; NPZ
    the size of the sensor. Raises RecordingError for what cannot be read or written.
    """
    source, target = Path(source), Path(target)
    suffix = target.suffix.lower()
    write = _WRITERS.get(suffix)
    if write is None:
        known = ", ".join(_WRITERS)
        raise RecordingError(f"suffix {suffix!r} is no format that can be written: use one of {known}: {target}")
    recording = open_recording(source, sensor=sensor)
    if target.exists() and os.path.samefile(source, target):
        raise RecordingError(f"a recording cannot be converted onto itself: give another name: {target}")
    write(recording, target, on_progress)


def _attributes(recording: Recording) -> dict[str, str | float]:
    """Those that do not speak of the file's own encoding."""
    return {name: value for name, value in recording.attributes.items() if name not in ENCODING_KEYS}


def _write_hdf5(recording: Recording, target: Path, on_progress: Progress | None) -> None:
    with Hdf5Writer.open(target, recording.width_px, recording.height_px) as writer:
        for batch in recording.chunks(on_progress=on_progress):
            writer.append(batch)
        damage = recording.damage
        truth = None if damage.backward_steps or damage.outside_events else recording.truth
        writer.finish(_attributes(recording), truth, recording.triggers, recording.t_offset_us)


def _write_npz(recording: Recording, target: Path, on_progress: Progress | None) -> None:
    batches = recording.chunks(on_progress=on_progress)
    write_npz(target, batches, width_px=recording.width_px, height_px=recording.height_px)


def _write_raw(recording: Recording, target: Path, on_progress: Progress | None) -> None:
    def half(first: float) -> Progress | None:
        report = on_progress
        return None if report is None else lambda share: report(first + share / 2)

    recording.scan(half(0.0))  # triggers go among the events: they must be known before
    write_raw(
        target,
        recording.chunks(on_progress=half(0.5)),
        width_px=recording.width_px,
        height_px=recording.height_px,
        attributes=_attributes(recording),
        triggers=recording.triggers,
    )


_WRITERS: dict[str, Callable[[Recording, Path, Progress | None], None]] = {
    **dict.fromkeys(HDF5_SUFFIXES, _write_hdf5),
    NPZ_SUFFIX: _write_npz,
    RAW_SUFFIX: _write_raw,
}
