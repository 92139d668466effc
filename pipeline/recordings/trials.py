"""Trials of a recording: parts that begin at edges of the trigger input, as recordings of their own."""

from __future__ import annotations

import shutil
from dataclasses import asdict
from pathlib import Path

import numpy as np

from ..errors import ParameterError, RecordingError
from ..files import atomic_file
from .opening import open_recording
from .reader import ReadingOptions, Triggers
from .recording import Recording
from .writing import write_recording

RISING = 1
MOST_TRIALS = 10_000


def trial_windows_us(
    recording: Recording, before_us: int = 0, length_us: int | None = None, channel: int | None = None
) -> list[tuple[int, int]]:
    """Windows [start, end) of the trials, file time.

    Parameters
    ----------
    recording : Recording
    before_us : int
        How long before its rising edge a trial begins, but not before the one of the trial before it.
    length_us : int or None
        How long after the edge it ends at the latest; None = at the next edge, or with the recording.
    channel : int or None
        Number of the trigger input; None = the only one.

    Raises
    ------
    RecordingError
        Where there is no rising edge, or edges on several inputs.
    """
    if before_us < 0 or (length_us is not None and length_us <= 0):
        raise ParameterError("a trial lasts some time, and begins no later than its trigger: give positive times")
    index = recording.index()
    triggers = index.triggers
    channels = np.unique(triggers.id).tolist()
    if channel is None and len(channels) > 1:
        raise RecordingError(f"there are triggers on inputs {channels}: choose one with --channel: {recording.path}")
    rising = triggers.value == RISING
    if channel is not None:
        rising &= triggers.id == channel
    edges_us = np.unique(triggers.t_us[rising])
    if not 0 < edges_us.size <= MOST_TRIALS:
        where = "" if channel is None else f" on input {channel}"
        known = f"; there are some on inputs {channels}" if channels and not edges_us.size else ""
        raise RecordingError(
            f"the recording has {edges_us.size} rising trigger edges{where}: 1 to {MOST_TRIALS} are cut{known}: "
            f"{recording.path}"
        )
    ends_us = np.append(edges_us[1:], index.last_us + 1)
    if length_us is not None:
        ends_us = np.minimum(ends_us, edges_us + length_us)
    starts_us = np.maximum(edges_us - before_us, np.append(edges_us[0] - before_us, edges_us[:-1]))
    return [(int(start), int(end)) for start, end in zip(starts_us, ends_us, strict=True) if start < end]


def split_by_triggers(
    source: Path,
    folder: Path,
    *,
    before_us: int = 0,
    length_us: int | None = None,
    channel: int | None = None,
    options: ReadingOptions | None = None,
) -> list[Path]:
    """Write every trial that holds events as NAME_001.h5 and so on, with the recording's sidecar; returns the files.

    Times stay those of the recording, so that trials keep their relation to other devices. See `trial_windows_us`;
    raises RecordingError where a file is there already.
    """
    recording = open_recording(source, **asdict(options or ReadingOptions()))
    windows = trial_windows_us(recording, before_us, length_us, channel)
    beside = [one for suffix in (".toml", ".bias") if (one := source.with_suffix(suffix)).is_file()]
    folder.mkdir(parents=True, exist_ok=True)
    written: list[Path] = []
    for number, (start_us, end_us) in enumerate(windows, start=1):
        events = recording.read(start_us, end_us)
        if not len(events):
            continue
        path = folder / f"{source.stem}_{number:03d}.h5"
        if path.exists():
            raise RecordingError(f"a trial of this name is there already: choose an empty folder: {path}")
        triggers = recording.triggers
        inside = np.flatnonzero((triggers.t_us >= start_us) & (triggers.t_us < end_us))
        write_recording(
            path,
            events,
            width_px=recording.width_px,
            height_px=recording.height_px,
            attributes={name: value for name, value in recording.attributes.items() if name.startswith("camera.")},
            triggers=Triggers(triggers.t_us[inside], triggers.value[inside], triggers.id[inside]),
            t_offset_us=recording.t_offset_us,
        )
        for sidecar in beside:
            with atomic_file(path.with_suffix(sidecar.suffix), "sidecar") as part:
                shutil.copyfile(sidecar, part)
        written.append(path)
    if not written:
        raise RecordingError(f"no trial holds events: is the trigger's clock the camera's? {source}")
    return written
