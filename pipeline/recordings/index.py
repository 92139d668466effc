"""Index of a recording: what one pass over all of it found, and places in the file from which reading can go on."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import platformdirs
from numpy.typing import NDArray

from ..errors import RecordingError
from ..events import EventBatch
from ..files import atomic_file
from .clock_segments import ClockSegments
from .order import NO_TIME_US, TimeOrder
from .reader import FILE_ERRORS, Damage, Place, ReadPass, Triggers, UncheckedEvents
from .sensor import Resolution

# Between two places: 5 to 10 ms of decoding, and seldom less than the 10 ms that are read beyond a piece.
PLACE_EVENTS = 1 << 19
SAMPLED_EVENTS = 1 << 12  # every so many events a time is kept: a hundredth of what a pixel of an overview shows
INDEX_VERSION = 5  # to be raised whenever readers or the index change what they say of the same file
ARRAYS = ("sampled_us", "offsets", "states", "shifts_us", "cut_us", "before")
INDEXES_KEPT = 200  # of 1 MB for 100 million events


@dataclass(frozen=True, eq=False)
class RecordingIndex:
    """Findings of one pass over all of a recording.

    Attributes
    ----------
    sensor : Resolution
        Size of the sensor with which the pass was made.
    sensor_warning : str
        Assumption about it; empty where it is stated.
    events : int
        Number of events, those dropped left out.
    first_us, last_us : int
        Times of the first and the last event; 0 without events.
    sampled_us : (s,) int64
        Time of every SAMPLED_EVENTS-th event, from the first on.
    offsets, states : (n,) int64, (n, m) int64
        The places, in order; none where the format cannot begin anywhere but at the file's start.
    shifts_us : (n,) int64
        Added to the times of the file behind the place, see `ClockSegments`.
    cut_us : (n,) int64
        All events before the place are earlier than this.
    before : (n,) int64
        Number of events earlier than `cut_us`.
    damage, triggers
        As of `ReadPass`.
    """

    sensor: Resolution
    sensor_warning: str
    events: int
    first_us: int
    last_us: int
    sampled_us: NDArray[np.int64]
    offsets: NDArray[np.int64]
    states: NDArray[np.int64]
    shifts_us: NDArray[np.int64]
    cut_us: NDArray[np.int64]
    before: NDArray[np.int64]
    damage: Damage
    triggers: Triggers

    def place(self, start_us: int) -> tuple[Place | None, int, int]:
        """The last place with no event of `start_us` or later before it.

        Returns
        -------
        place : Place or None
            None for the start of the file.
        latest_us, shift_us : int
            Latest time there may be before, and what has to be added to the times of the file.
        """
        row = int(np.searchsorted(self.cut_us, start_us, side="right")) - 1
        if row < 0:
            return None, NO_TIME_US, 0
        state = tuple(self.states[row].tolist())
        return Place(int(self.offsets[row]), state), int(self.cut_us[row]) - 1, int(self.shifts_us[row])

    def counts_before(self, times_us: NDArray[np.int64]) -> NDArray[np.float64]:
        """Numbers of events before times, interpolated between the sampled ones."""
        rows = np.append(np.arange(self.sampled_us.size) * SAMPLED_EVENTS, self.events)
        times = np.append(self.sampled_us, self.last_us + 1)
        counts: NDArray[np.float64] = np.interp(times_us, times, rows, left=0)
        return counts

    def save(self, key: str) -> None:
        """Keep it in the user's cache, where that can be written to."""
        with suppress(OSError, RecordingError):
            _folder().mkdir(parents=True, exist_ok=True)
            with atomic_file(_file(key), "index") as part, open(part, "xb") as file:
                arrays: dict[str, Any] = {
                    **{name: getattr(self, name) for name in ARRAYS},
                    **{f"trigger_{number}": column for number, column in enumerate(self.triggers.columns)},
                    "numbers": np.array([self.events, self.first_us, self.last_us, *asdict(self.damage).values()]),
                    "sensor": np.array([self.sensor.width_px, self.sensor.height_px]),
                    "texts": np.array([self.sensor.origin, self.sensor_warning]),
                }
                np.savez(file, **arrays)
            kept = sorted(_folder().glob("*.npz"), key=lambda path: path.stat().st_mtime)
            for path in kept[:-INDEXES_KEPT]:
                path.unlink(missing_ok=True)

    @classmethod
    def load(cls, key: str) -> RecordingIndex | None:
        """The index kept under this key, None where there is none that can be read."""
        with suppress(*FILE_ERRORS), open(_file(key), "rb") as file, np.load(file, allow_pickle=False) as kept:
            events, first_us, last_us, *damage = kept["numbers"].tolist()
            (width_px, height_px), (origin, warning) = kept["sensor"].tolist(), kept["texts"].tolist()
            return cls(
                sensor=Resolution(width_px, height_px, origin),
                sensor_warning=warning,
                events=events,
                first_us=first_us,
                last_us=last_us,
                **{name: kept[name] for name in ARRAYS},
                damage=Damage(*damage),
                triggers=Triggers(*(kept[f"trigger_{number}"] for number in range(len(Triggers.KINDS)))),
            )
        return None


class IndexBuilder:
    """Builder of an index during a pass over a whole file."""

    def __init__(self) -> None:
        self._places: list[Place] = []
        self._shifts_us: list[int] = []
        self._cut_us: list[int] = []
        self._before: list[int] = []
        self._sampled_us: list[NDArray[np.int64]] = []
        self._events = 0
        self._first_us = self._last_us = 0

    def noting_places(
        self, parts: Iterable[UncheckedEvents], reading: ReadPass, segments: ClockSegments, order: TimeOrder
    ) -> Iterator[UncheckedEvents]:
        """Hand a reader's parts on to `segments` and with these to `order`, noting places behind them."""
        since = 0
        for part in parts:
            yield part
            since += len(part)
            if since >= PLACE_EVENTS and reading.place is not None and segments.is_settled:
                since = 0
                self._places.append(reading.place)
                self._shifts_us.append(segments.shift_us)
                self._cut_us.append(order.latest_us + 1)

    def add(self, batch: EventBatch) -> None:
        """Count the next events in order of time, at least one."""
        t_us = batch.t_us
        self._last_us = int(t_us[-1])
        if not self._events:
            self._first_us = int(t_us[0])
        for cut_us in self._cut_us[len(self._before) :]:
            if cut_us > self._last_us:
                break
            self._before.append(self._events + int(np.searchsorted(t_us, cut_us)))
        self._sampled_us.append(t_us[-self._events % SAMPLED_EVENTS :: SAMPLED_EVENTS].copy())
        self._events += len(batch)

    def index(self, reading: ReadPass, sensor: Resolution, sensor_warning: str) -> RecordingIndex:
        """The index, after the last batch."""
        places = len(self._places)
        return RecordingIndex(
            sensor=sensor,
            sensor_warning=sensor_warning,
            events=self._events,
            first_us=self._first_us,
            last_us=self._last_us,
            sampled_us=np.concatenate([np.empty(0, np.int64), *self._sampled_us]),
            offsets=np.array([place.offset for place in self._places], np.int64),
            states=np.array([place.state for place in self._places], np.int64).reshape(places, -1 if places else 0),
            shifts_us=np.array(self._shifts_us, np.int64),
            cut_us=np.array(self._cut_us, np.int64),
            before=np.array([*self._before, *[self._events] * (places - len(self._before))], np.int64),
            damage=reading.damage,
            triggers=Triggers.concatenate(reading.triggers),
        )


def _folder() -> Path:
    return platformdirs.user_cache_path("spinscope") / "indexes"


def _file(key: str) -> Path:
    return _folder() / f"{key}-{INDEX_VERSION}.npz"
