"""What a reader of one format hands to `Recording`, and what a pass over the file counts on the way."""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..errors import RecordingError
from ..results import Truth
from .sensor import Sensor

Progress = Callable[[float], None]  # called with the share done, 0 to 1

CHUNK_EVENTS = 1 << 20  # events handed on at once: 13 MB
MAX_DISORDER_US = 10_000  # events up to this far behind an earlier one are put in order; see `order.py`

# Whatever the libraries below throw at damaged files; none of it may reach the user as a traceback.
FILE_ERRORS = (
    *(
        OSError,
        RuntimeError,
        KeyError,
        ValueError,
        TypeError,
        MemoryError,
        OverflowError,
        NotImplementedError,
    ),
    *(AttributeError, IndexError, EOFError, SystemError, zlib.error, zipfile.BadZipFile),
)


@dataclass(slots=True)
class Damage:
    """What a full pass over a recording found wrong; all zero in a sound file.

    bad_words : RAW words of no known type (skipped)
    backward_steps : events earlier than the event before them in the file
    late_events : of these, events of RAW files more than 10 ms behind (dropped; other files are refused)
    time_jumps : RAW time words that the next one contradicts (ignored)
    untimed_events : RAW events before the first time or row, or under an unconfirmed time (dropped)
    outside_events : events outside the sensor (dropped)
    lost_bytes : bytes at the file's end that make no whole word (a cut file)
    """

    bad_words: int = 0
    backward_steps: int = 0
    late_events: int = 0
    time_jumps: int = 0
    untimed_events: int = 0
    outside_events: int = 0
    lost_bytes: int = 0

    def as_dict(self) -> dict[str, int]:
        """Name and count of every kind."""
        return asdict(self)

    def sentences(self) -> list[str]:
        """One sentence for people for every kind that occurred."""
        said = {
            "bad_words": "{} words of no known type were skipped",
            "backward_steps": "time steps backwards {} times; events up to 10 ms late were put in order",
            "late_events": "{} events more than 10 ms behind earlier ones were dropped",
            "time_jumps": "{} time words that the next one contradicts were ignored",
            "untimed_events": "{} events without a sure time or row were dropped",
            "outside_events": "{} events outside the sensor were dropped",
            "lost_bytes": "{} bytes at the end make no whole word: the file was cut",
        }
        return [said[name].format(count) for name, count in self.as_dict().items() if count]


@dataclass(frozen=True, slots=True, eq=False)
class Triggers:
    """Edges on the camera's trigger input: t_us (n,) int64, value (n,) uint8 (1 = rising), id (n,) uint8."""

    t_us: NDArray[np.int64]
    value: NDArray[np.uint8]
    id: NDArray[np.uint8]

    @classmethod
    def joined(cls, parts: list[Triggers]) -> Triggers:
        """One after the other."""
        return cls(
            np.concatenate([np.empty(0, np.int64), *(p.t_us for p in parts)]),
            np.concatenate([np.empty(0, np.uint8), *(p.value for p in parts)]),
            np.concatenate([np.empty(0, np.uint8), *(p.id for p in parts)]),
        )

    def __len__(self) -> int:
        return self.t_us.size


@dataclass(frozen=True, slots=True, eq=False)
class Columns:
    """Events as a reader found them: (n,) each; t_us int64 in file order, x and y any integers, on bool."""

    t_us: NDArray[np.int64]
    x: NDArray[Any]
    y: NDArray[Any]
    on: NDArray[np.bool_]

    def __len__(self) -> int:
        return self.t_us.size

    def __getitem__(self, rows: slice | NDArray[Any]) -> Columns:
        return Columns(self.t_us[rows], self.x[rows], self.y[rows], self.on[rows])

    @classmethod
    def joined(cls, parts: list[Columns]) -> Columns:
        """One after the other; at least one."""
        if len(parts) == 1:
            return parts[0]
        return cls(
            np.concatenate([p.t_us for p in parts]),
            np.concatenate([p.x for p in parts]),
            np.concatenate([p.y for p in parts]),
            np.concatenate([p.on for p in parts]),
        )


@dataclass(slots=True)
class Pass:
    """One pass over a file: what it is asked for, and what it counted so far.

    start_us, end_us : a reader may leave out events that lie surely outside [start_us, end_us)
    first_row : number of the first event that the reader gave; set by the reader
    """

    max_events: int = CHUNK_EVENTS
    start_us: int | None = None
    end_us: int | None = None
    on_progress: Progress | None = None
    first_row: int = 0
    damage: Damage = field(default_factory=Damage)
    triggers: list[Triggers] = field(default_factory=list)

    def report(self, done: float, of: float) -> None:
        """Tell the share done."""
        if self.on_progress is not None:
            self.on_progress(min(done / of, 1.0) if of else 1.0)


class Source(Protocol):
    """A reader of one format.

    order_is_law : whether events far behind others make the file unreadable (columns) or are dropped (RAW)
    events : number of events in the file when it tells without a pass
    """

    path: Path
    format: str
    attributes: dict[str, str | float]
    stated: Sensor | None
    t_offset_us: int | None
    warnings: list[str]
    order_is_law: bool
    events: int | None

    def columns(self, reading: Pass) -> Iterator[Columns]:
        """The events in file order in parts that are never empty; counts damage and triggers on the way."""

    def truth(self) -> Truth | None:
        """The simulator's truth, if the file has it."""


@contextmanager
def translated(path: Path, kind: str) -> Iterator[None]:
    """Turn what libraries throw at a damaged file into one line."""
    try:
        yield
    except FILE_ERRORS as error:
        why = " ".join(str(error).split())[:200] or type(error).__name__
        raise RecordingError(f"{kind} file is damaged or was cut ({why}): copy or export it again: {path}") from error
