"""Reader that runs in a process with limits, for formats read through a foreign library."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import astuple, dataclass, fields, replace
from pathlib import Path

from ..errors import RecordingError
from ..isolation import IsolationError, call, iterate, without_time_limit
from ..results import Truth
from .reader import CameraFrame, Damage, FormatReader, Place, ReadingOptions, ReadPass, Triggers, UncheckedEvents

ReaderOpener = Callable[[Path, ReadingOptions], FormatReader]

# What a reader says of its file once it is open.
STATEMENTS = (
    "format", "strict_order", "seeks", "takes", "attributes", "warnings", "time_doubt", "stated", "t_offset_us",
    "events",
)  # fmt: skip


class IsolatedReader(FormatReader):
    """Reader whose file a process with limits opens and reads; see `isolation`.

    Parameters
    ----------
    open : callable
        `open(path, options)` of the format, a function of a module.
    """

    def __init__(self, open: ReaderOpener, path: Path, options: ReadingOptions) -> None:
        super().__init__(path, options)
        with self._isolation_errors():
            statements, self._reader = call(_opened, open, path, options)
        vars(self).update(statements)

    def columns(self, reading: ReadPass) -> Iterator[UncheckedEvents]:
        """Yield the events that the process reads one part ahead."""
        request = replace(reading, on_progress=None, damage=Damage(), triggers=[], columns=None)
        with self._isolation_errors():
            for part in iterate(_parts, self._reader, request):
                part.note_in(reading)
                if part.events is not None:
                    yield part.events

    def frames(self, start_us: int, end_us: int) -> Iterator[CameraFrame]:
        """Yield the camera's pictures."""
        with self._isolation_errors():
            yield from iterate(_frames, self._reader, start_us, end_us)

    def truth(self) -> Truth | None:
        """Read the simulator's truth; None when the file has none."""
        with self._isolation_errors():
            return call(_truth, self._reader)

    @contextmanager
    def _isolation_errors(self) -> Iterator[None]:
        try:
            yield
        except IsolationError as error:
            raise RecordingError(
                f"{error}: the file is damaged or was made to do harm, copy or export it again: {self.path}"
            ) from error


@dataclass(frozen=True)
class ReadPart:
    """Events of one part, and what the reader found since the part before.

    Attributes
    ----------
    events : UncheckedEvents or None
        None behind the last part.
    damage : tuple of int
        Counts as in `Damage`.
    share : float
        Share of the file done.
    """

    events: UncheckedEvents | None
    place: Place | None
    first_row: int
    damage: tuple[int, ...]
    triggers: list[Triggers]
    share: float

    def note_in(self, reading: ReadPass) -> None:
        """Enter all but the events in the pass that the caller watches."""
        reading.place, reading.first_row = self.place, self.first_row
        for kind, count in zip(fields(Damage), self.damage, strict=True):
            setattr(reading.damage, kind.name, getattr(reading.damage, kind.name) + count)
        reading.triggers += self.triggers
        reading.report(self.share, 1.0)


def _opened(open: ReaderOpener, path: Path, options: ReadingOptions) -> tuple[dict[str, object], bytes]:
    """Statements of a reader, and the reader for the calls to come, pickled as the caller needs nothing else of it."""
    reader = open(path, options)
    return {name: getattr(reader, name) for name in STATEMENTS}, pickle.dumps(reader)


def _parts(pickled: bytes, reading: ReadPass) -> Iterator[ReadPart]:
    reader = _restored(pickled)
    shares = [0.0]
    reading.on_progress = shares.append
    damage, triggers = astuple(reading.damage), 0

    def part(events: UncheckedEvents | None) -> ReadPart:
        nonlocal damage, triggers
        before, damage = damage, astuple(reading.damage)
        new = tuple(now - then for now, then in zip(damage, before, strict=True))
        found, triggers = reading.triggers[triggers:], len(reading.triggers)
        return ReadPart(events, reading.place, reading.first_row, new, found, shares[-1])

    yield from map(part, reader.columns(reading))
    yield part(None)


def _frames(pickled: bytes, start_us: int, end_us: int) -> Iterator[CameraFrame]:
    yield from _restored(pickled).frames(start_us, end_us)


def _truth(pickled: bytes) -> Truth | None:
    return _restored(pickled).truth()


def _restored(pickled: bytes) -> FormatReader:
    with without_time_limit():  # loads the libraries
        reader: FormatReader = pickle.loads(pickled)
    return reader
