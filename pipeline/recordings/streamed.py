"""Events of a long recording, read from disk on demand."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Hashable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import platformdirs
from numpy.typing import NDArray

from ..errors import RecordingError
from ..events import EventBatch
from .opening import open_recording
from .reader import Progress
from .recording import Recording, TooManyEvents
from .writing import write_recording

HELD_EVENTS = 1 << 23  # events that are simply held in memory: 109 MB, twice that while they are joined
PIECES_KEPT = 16  # of half a million events each: 109 MB
COPIES_BYTES = 20 << 30


class RecordingPieces:
    """Pieces of a recording between the places of its index, those used last kept in memory; for several threads."""

    def __init__(self, recording: Recording, on_progress: Progress | None = None) -> None:
        self._recording = recording
        self.index = recording.index(on_progress)
        self._cuts_us = [-(2**63), *self.index.cut_us.tolist(), 2**63 - 1]
        self._before: list[int] = [0, *self.index.before.tolist(), self.index.events]
        self._kept: OrderedDict[int, EventBatch] = OrderedDict()
        self._lock = threading.Lock()

    def between(self, start_us: int, end_us: int) -> EventBatch:
        """The events of [start_us, end_us)."""
        first, last = (int(np.searchsorted(self.index.cut_us, t_us, side="right")) for t_us in (start_us, end_us - 1))
        return EventBatch.concatenate(
            self._piece(number).between(start_us, end_us) for number in range(first, last + 1)
        )

    def count_before(self, t_us: int) -> int:
        """Number of events before a time."""
        number = int(np.searchsorted(self.index.cut_us, t_us, side="right"))
        return self._before[number] + int(np.searchsorted(self._piece(number).t_us, t_us))

    def _piece(self, number: int) -> EventBatch:
        with self._lock:
            piece = self._kept.pop(number, None)
            if piece is None:
                piece = self._recording.read(self._cuts_us[number], self._cuts_us[number + 1])
            self._kept[number] = piece
            while len(self._kept) > PIECES_KEPT:
                self._kept.popitem(last=False)
        return piece


@dataclass(frozen=True)
class StreamedEvents:
    """Source whose events are read from disk on demand: a recording, or a part of it, in bounded memory.

    Attributes
    ----------
    identity : Hashable
        Identity of recording and window.
    pieces : RecordingPieces
        Of the whole recording; shared by its parts.
    start_us, end_us : int
        The window, file time.
    """

    identity: Hashable
    pieces: RecordingPieces = field(repr=False)
    width_px: int
    height_px: int
    start_us: int
    end_us: int
    growing: bool = False

    def between(self, start_us: int, end_us: int) -> EventBatch:
        """The events of [start_us, end_us)."""
        return self.pieces.between(max(start_us, self.start_us), min(end_us, self.end_us))

    @property
    def event_count(self) -> int:
        """Number of events."""
        return self.pieces.count_before(self.end_us) - self.pieces.count_before(self.start_us)

    def rate(self, edges_us: NDArray[np.int64]) -> NDArray[np.int64]:
        """(n,) int64 numbers of events between n + 1 times, to about a thousand events."""
        before = np.rint(self.pieces.index.counts_before(edges_us)).astype(np.int64)
        return before[1:] - before[:-1]

    def part(self, identity: Hashable, start_us: int, end_us: int) -> StreamedEvents:
        """The events of [start_us, end_us) as a source of its own."""
        return replace(self, identity=identity, start_us=start_us, end_us=end_us)


def events_of(
    recording: Recording, start_us: int | None, end_us: int | None, on_progress: Progress | None = None
) -> EventBatch | RecordingPieces:
    """Read the events of [start_us, end_us), or make all of the recording readable in pieces where they are many.

    Parameters
    ----------
    start_us, end_us : int or None
        In the file's time; from the start, or to the end, without them.
    on_progress : callable, optional
        Called with the share done, 0..1.

    Raises
    ------
    RecordingError
        The recording cannot be read.
    """
    known = recording.known_index()
    is_long = start_us is None and end_us is None and known is not None and known.events > HELD_EVENTS
    with suppress(TooManyEvents):
        if not is_long:
            return recording.read(start_us, end_us, on_progress, HELD_EVENTS)
    if not recording.seeks:
        recording = copy_that_seeks(recording, on_progress)
        on_progress = None
    return RecordingPieces(recording, on_progress)


def copy_that_seeks(recording: Recording, on_progress: Progress | None = None) -> Recording:
    """Copy a recording that is only read from its start to HDF5 in the user's cache, unless that was done before.

    The copies used last are kept up to COPIES_BYTES. Raises RecordingError when the copy cannot be written.
    """
    folder = platformdirs.user_cache_path("spinscope") / "copies"
    path = folder / f"{recording.identity()}-{recording.width_px}x{recording.height_px}.h5"
    if not path.exists():
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise RecordingError(
                f"{recording.format} is read from its start only and is too large for memory; a copy for random access "
                f"cannot be written ({error.strerror}): convert it to HDF5 (spinscope convert): {recording.path}"
            ) from error
        size: dict[str, Any] = {"width_px": recording.width_px, "height_px": recording.height_px}
        write_recording(path, recording.chunks(on_progress=on_progress), **size)
    with suppress(OSError):
        path.touch()  # used last
        kept = sorted(folder.glob("*.h5"), key=lambda one: one.stat().st_mtime, reverse=True)
        held_bytes = np.cumsum([one.stat().st_size for one in kept])
        for one, upto in zip(kept[1:], held_bytes[1:].tolist(), strict=True):
            if upto > COPIES_BYTES:
                one.unlink()
    return open_recording(path)
