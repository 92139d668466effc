"""Recorder of a running camera: files that open whatever happens, with what was set beside them."""

from __future__ import annotations

import json
import queue
import threading
from collections.abc import Callable, Mapping
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Protocol

from ..errors import RecordingError
from ..events import EventBatch
from .clock import now_s
from .event_stream import Notice

TO_DISK_S = 0.5  # between two times that a file is made safe against a power cut; the system has it at once
WAITING_BYTES = 1 << 29  # events that may wait for a slow disk: 13 bytes each, 10 s at 4 Mev/s
EVENT_BYTES = 13


class EventFile(Protocol):
    """A recording that is written as events come."""

    def write(self, events: EventBatch) -> None:
        """Append events; raises OSError or RecordingError."""

    def flush(self, *, to_disk: bool = False) -> None:
        """Hand everything over to the system, or to the disk itself."""

    @property
    def size_bytes(self) -> int:
        """Length so far."""

    def close(self) -> None:
        """Finish the file."""


class Recorder:
    """Sink of an `EventStream` that writes in a thread of its own: the camera never waits for the disk.

    A file begins anew with the camera's clock, and when it is full; NAME.raw is followed by NAME-2.raw.

    Parameters
    ----------
    path : Path
        First file; it must not exist, unless the recording goes on.
    open_file : callable
        `open_file(path) -> EventFile` creates one; raises OSError or RecordingError.
    beside : callable, optional
        `beside() -> mapping of str to str`: texts to be written beside a file that begins now, by suffix (".toml").
    most_bytes, most_us : int, optional
        Largest file, and longest.
    goes_on : bool
        Whether to go on behind files of these names that are there.
    on_notice : callable
        Told why the recording ended early, as when the disk is full (`EventStream`); live goes on.

    Attributes
    ----------
    files : list of Path
        Files so far.
    events, markers : int
        Numbers of events and markers that were written.

    Raises
    ------
    RecordingError
        The first file cannot be created.
    """

    def __init__(
        self,
        path: Path,
        open_file: Callable[[Path], EventFile],
        *,
        beside: Callable[[], Mapping[str, str]] = dict,
        most_bytes: int | None = None,
        most_us: int | None = None,
        goes_on: bool = False,
        on_notice: Notice = lambda kind, text: None,
    ) -> None:
        self.path, self.files, self.events, self.markers = path, list[Path](), 0, 0
        self._open_file, self._beside, self._on_notice = open_file, beside, on_notice
        self._most_bytes, self._most_us, self._number = most_bytes, most_us, 0
        while goes_on and self._path(self._number + 1).exists():
            self._number += 1
        self._coming: queue.SimpleQueue[tuple[int, EventBatch] | None] = queue.SimpleQueue()
        self._waiting_events = 0
        self._clock: int | None = None  # of the present file, as soon as it has events
        self._start_us: int | None = None
        self._last_us = 0
        self._has_failed = False
        self._file: EventFile | None
        self._file = self._next_file()
        self._thread = threading.Thread(target=self._write_all, name="recorder", daemon=True)
        self._thread.start()

    @property
    def is_running(self) -> bool:
        """Whether it goes on, as long as it is not closed."""
        return not self._has_failed

    def __call__(self, clock: int, events: EventBatch) -> None:
        """Take events; called by the camera's thread."""
        if len(events) and not self._has_failed:
            self._waiting_events += len(events)
            self._coming.put((clock, events))

    def mark(self, text: str, seconds_ago: float = 0.0) -> None:
        """Note a text beside the recording with the date, the file and its time so far; raises RecordingError.

        Both are those of so many seconds ago; the time is not before the file's first event.
        """
        t_us = max(self._last_us - round(seconds_ago * 1e6), self._start_us or 0)
        date = datetime.now(UTC) - timedelta(seconds=seconds_ago)
        line = {"date": date.isoformat(), "file": self.files[-1].name, "t_us": t_us, "text": text}
        markers = self.path.with_suffix(".markers.jsonl")
        try:
            with open(markers, "a", encoding="utf-8") as file:
                file.write(json.dumps(line) + "\n")
        except OSError as error:
            raise RecordingError(f"the marker cannot be written ({error.strerror}): {markers}") from error
        self.markers += 1

    def close(self) -> None:
        """Write what waits and finish the file."""
        self._coming.put(None)
        self._thread.join()

    def _write_all(self) -> None:
        """Body of the thread."""
        safe_s = now_s()
        while (one := self._coming.get()) is not None:
            clock, events = one
            self._waiting_events -= len(events)
            if self._file is None:
                continue
            try:
                if EVENT_BYTES * self._waiting_events > WAITING_BYTES:
                    raise RecordingError("the disk is too slow for the camera")
                self._write(clock, events)
                is_due = now_s() - safe_s > TO_DISK_S
                self._file.flush(to_disk=is_due)
                safe_s = now_s() if is_due else safe_s
            except (OSError, RecordingError) as error:
                self._fail(error)
        if self._file is not None:
            try:
                self._file.close()
            except OSError as error:
                self._fail(error)

    def _write(self, clock: int, events: EventBatch) -> None:
        assert self._file is not None
        start_us = self._last_us if self._start_us is None else self._start_us
        is_full = self._most_bytes is not None and self._file.size_bytes >= self._most_bytes
        is_full = is_full or (self._most_us is not None and int(events.t_us[-1]) - start_us > self._most_us)
        if self._start_us is not None and (clock != self._clock or is_full):
            self._file.close()
            self._file, self._start_us = self._next_file(), None
        if self._start_us is None:
            self._clock, self._start_us = clock, int(events.t_us[0])
        self._file.write(events)
        self._last_us = int(events.t_us[-1])
        self.events += len(events)

    def _next_file(self) -> EventFile:
        self._number += 1
        path = self._path(self._number)
        try:
            file = self._open_file(path)
            for suffix, text in self._beside().items():
                path.with_suffix(suffix).write_text(text, encoding="utf-8")
        except OSError as error:
            why = "it exists" if isinstance(error, FileExistsError) else error.strerror
            raise RecordingError(f"recording cannot be written ({why}): give another name: {path}") from error
        self.files.append(path)
        return file

    def _path(self, number: int) -> Path:
        return self.path if number == 1 else self.path.with_name(f"{self.path.stem}-{number}{self.path.suffix}")

    def _fail(self, error: Exception) -> None:
        """End the recording with what is in its files."""
        why = getattr(error, "strerror", None) or str(error)
        self._has_failed = True
        self._on_notice("recording", f"recording ended ({why}), live goes on; what was recorded is in {self.files[-1]}")
        file, self._file = self._file, None
        try:
            if file is not None:
                file.close()
        except OSError:
            pass  # as full as before
