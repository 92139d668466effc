"""A recording on disk, independent of its format."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path

import numpy as np

from ..errors import RecordingError
from ..events import EventBatch
from ..results import Truth
from .clock_segments import ClockSegments
from .growing_columns import GrowingColumns
from .index import IndexBuilder, RecordingIndex
from .order import NO_TIME_US, TimeOrder
from .reader import (
    CHUNK_EVENTS,
    CameraFrame,
    Damage,
    FormatReader,
    Place,
    Progress,
    ReadPass,
    Triggers,
    UncheckedEvents,
)
from .sensor import KNOWN_SENSORS, Resolution, check_resolution, smallest_known

HASH_ALL_BYTES = 64 << 20  # larger files are large: half a second and more to read
HASH_BLOCK_BYTES = 1 << 20
EVENT_BYTES = 13  # 8 + 2 + 2 + 1
LAST_COORDINATE = (1 << 16) - 1  # larger ones are broken, whatever they say
MAX_STRAY_SHARE = 1e-3  # of events that lie outside every known sensor and do not count for its size
LEAST_EVENT_BYTES = 2  # an event of its own in EVT3; room that nothing is written to costs no memory


def file_identity(path: Path) -> str:
    """Hash a file's bytes (BLAKE2b, 32 hexadecimal digits); raises RecordingError.

    Of a file above 64 MB only size, time of change, and 1 MB each at start, middle and end are hashed.
    """
    digest = hashlib.blake2b(digest_size=16)
    try:
        with open(path, "rb") as file:
            size = file.seek(0, 2)
            if size <= HASH_ALL_BYTES:
                places = list(range(0, size, HASH_BLOCK_BYTES))
            else:
                digest.update(f"{size} {path.stat().st_mtime_ns}".encode())
                places = [0, size // 2, size - HASH_BLOCK_BYTES]
            for place in places:
                file.seek(place)
                digest.update(file.read(HASH_BLOCK_BYTES))
    except OSError as error:
        raise RecordingError(f"recording can no longer be read ({error.strerror}): {path}") from error
    return digest.hexdigest()


def _memory_bytes() -> int:
    """Memory of the machine; 8 GB where the system does not say."""
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return 8 << 30


class TooManyEvents(RecordingError):
    """More events than are to be held in memory."""


class Recording:
    """Events on disk, read in streams; made by `open_recording`.

    The file is opened anew for every pass and closed after it: nothing has to be closed.

    Attributes
    ----------
    format : str
        Format and encoding for people, like "EVT3 RAW".
    width_px, height_px : int
        Size of the sensor.
    sensor_from : str
        Origin of this size: "file", "command line", "system_ID 49" or "guess".
    attributes : dict of str to str or float
        Root attributes or header lines of the file; `camera.focal_length_mm` and the like among them.
    time_doubt : str
        As of `FormatReader`.
    seeks : bool
        Whether reading can begin anywhere in the file, once there is an index.
    t_offset_us : int or None
        DSEC's offset of the file's time; reported, never added.
    events : int or None
        Number of events when the file tells before it is read, None for RAW.
    """

    def __init__(
        self, reader: FormatReader, asked: Resolution | None = None, on_progress: Progress | None = None
    ) -> None:
        self._reader = reader
        self._asked = asked
        self._pass: ReadPass | None = None
        self._index: RecordingIndex | None = None
        self.path, self.format, self.seeks = reader.path, reader.format, reader.seeks
        self._sensor_warning = ""
        self._sensor = self._chosen_sensor(on_progress)
        self.width_px, self.height_px = self._sensor.width_px, self._sensor.height_px
        self.sensor_from = self._sensor.origin
        self.attributes, self.time_doubt = dict(reader.attributes), reader.time_doubt
        self.t_offset_us, self.events = reader.t_offset_us, reader.events

    def __repr__(self) -> str:
        return f"Recording({self.format}, {self.width_px} x {self.height_px} px, {self.path})"

    @cached_property
    def truth(self) -> Truth | None:
        """Simulator's truth, None where the file has none; raises RecordingError when it is damaged.

        Its labels go with the events as they are in the file: with those of `read` if `damage` is all zero.
        """
        return self._reader.truth()

    @property
    def warnings(self) -> list[str]:
        """Assumptions made on opening, then the damage met so far, in sentences."""
        met = self._index or self._pass
        damage = met.damage.sentences() if met is not None else []
        return [*self._reader.warnings, *filter(None, [self._sensor_warning]), *damage]

    @property
    def damage(self) -> Damage:
        """Counts of what is wrong in the whole file; makes a pass over it unless there was one."""
        return self.index().damage

    @property
    def triggers(self) -> Triggers:
        """Edges on the trigger input in the whole file; makes a pass over it unless there was one."""
        return self.index().triggers

    @cached_property
    def is_large(self) -> bool:
        """Whether the file is so large that its index is kept in the user's cache."""
        return self.path.stat().st_size > HASH_ALL_BYTES

    def known_index(self) -> RecordingIndex | None:
        """The index as far as it is known without a pass: from an earlier one, or from the user's cache."""
        if self._index is None and self.is_large:
            self._index = RecordingIndex.load(self._index_key())
        return self._index

    def index(self, on_progress: Progress | None = None) -> RecordingIndex:
        """The index of the whole file; makes a pass over it unless it is known."""
        known = self.known_index()
        if known is None:
            self.scan(on_progress)
            known = self._index
        assert known is not None
        return known

    def scan(self, on_progress: Progress | None = None) -> None:
        """Read the whole file once, for its index."""
        for _ in self.chunks(on_progress=on_progress):
            pass

    def chunks(
        self,
        start_us: int | None = None,
        end_us: int | None = None,
        *,
        max_events: int = CHUNK_EVENTS,
        on_progress: Progress | None = None,
    ) -> Iterator[EventBatch]:
        """Yield the events of [start_us, end_us), or all, in order of time and in constant memory.

        Parameters
        ----------
        start_us, end_us : int, optional
            In the file's time; from the start, or to the end, without them.
        max_events : int
            Most events at once.
        on_progress : callable, optional
            Called with the share done, 0..1.

        Yields
        ------
        EventBatch
            Never empty.

        Raises
        ------
        RecordingError
            On the way, for what cannot be repaired; `Damage` counts what can.
        """
        return self._batches(ReadPass(max_events, start_us, end_us, on_progress))

    def read(
        self,
        start_us: int | None = None,
        end_us: int | None = None,
        on_progress: Progress | None = None,
        max_events: int | None = None,
    ) -> EventBatch:
        """Read events into memory.

        Parameters
        ----------
        start_us, end_us : int, optional
            Only events of [start_us, end_us), in the file's time; from the start, or to the end, without them.
        on_progress : callable, optional
            As of `chunks`.
        max_events : int, optional
            Most events that are held; by default what fits in memory.

        Raises
        ------
        TooManyEvents
            There are more.
        RecordingError
            The events cannot be read.
        """
        # Half of the memory, and twice while a column grows.
        most = _memory_bytes() // (4 * EVENT_BYTES) if max_events is None else max_events
        whole = start_us is None and end_us is None
        expected = self.events or self.path.stat().st_size // LEAST_EVENT_BYTES
        columns = GrowingColumns(min(expected, most) if whole else CHUNK_EVENTS)
        reading = ReadPass(start_us=start_us, end_us=end_us, on_progress=on_progress, columns=columns)
        for batch in self._batches(reading):
            columns.append(batch)
            if columns.events > most:
                raise TooManyEvents(
                    f"more than {most / 1e6:.0f} million events do not fit in memory: read a part "
                    f"(--window START_US END_US): {self.path}"
                )
        return columns.batch()

    def frames(self, start_us: int, end_us: int) -> Iterator[CameraFrame]:
        """Yield the pictures of [start_us, end_us) that the camera took besides the events; most take none."""
        return self._reader.frames(start_us, end_us)

    def identity(self) -> str:
        """Hash of the file (see `file_identity`) and of the statements about its events, 32 hexadecimal digits."""
        options = self._reader.options
        stated = f"{file_identity(self.path)} {options.dataset} {options.time_unit}"
        return hashlib.blake2b(stated.encode(), digest_size=16).hexdigest()

    def _chosen_sensor(self, on_progress: Progress | None) -> Resolution:
        if self._asked is not None:
            return self._asked
        if self._reader.stated is not None:
            check_resolution(self._reader.stated)
            return self._reader.stated
        known = RecordingIndex.load(self._index_key()) if self.is_large else None
        if known is not None:
            self._index, self._sensor_warning = known, known.sensor_warning
            return known.sensor
        columns_px, rows_px = self._extent_px(on_progress)
        size = smallest_known(columns_px, rows_px)
        if size is None:
            largest = KNOWN_SENSORS[-1]
            raise RecordingError(
                f"the events reach over {columns_px} x {rows_px} pixels, more than the largest known sensor "
                f"({largest[0]} x {largest[1]}): state it with --sensor WxH"
            )
        self._sensor_warning = (
            f"the file does not state its sensor: taken as {size[0]} x {size[1]}, the smallest known one that holds "
            f"the events (they reach over {columns_px} x {rows_px} pixels); --sensor WxH states it"
        )
        return Resolution(*size, "guess")

    def _extent_px(self, on_progress: Progress | None) -> tuple[int, int]:
        """One more than the largest x and y of all events, (0, 0) without events; a pass over the file.

        Few events that no known sensor holds are broken, and left out.
        """
        extents_px = np.zeros((2, 2), np.int64)  # of all events, and of those that some known sensor holds
        events = strays = 0
        largest_px = np.max(KNOWN_SENSORS, axis=0)
        for block in self._reader.columns(ReadPass(on_progress=on_progress)):
            held = block[(block.x < largest_px[0]) & (block.y < largest_px[1])]
            events, strays = events + len(block), strays + len(block) - len(held)
            for extent_px, part in zip(extents_px, (block, held), strict=True):
                if len(part):
                    most = (min(int(column.max()), LAST_COORDINATE) + 1 for column in (part.x, part.y))
                    extent_px[:] = np.maximum(extent_px, tuple(most))
        return tuple(extents_px[int(strays <= MAX_STRAY_SHARE * events)].tolist())

    def _index_key(self) -> str:
        """Name of the index in the cache: content of the file, and size of the sensor where the user states it."""
        asked = "" if self._asked is None else f"-{self._asked.width_px}x{self._asked.height_px}"
        return f"{self.identity()}{asked}"

    def _start(self, reading: ReadPass) -> tuple[Place | None, int, int]:
        """Place to begin at, the latest time there may be before it, and the shift of times; see `RecordingIndex`."""
        if reading.start_us is None or not self.seeks:
            return None, NO_TIME_US, 0
        index = self.known_index()
        if index is None:
            if not self.is_large:
                return None, NO_TIME_US, 0
            index = self.index(reading.on_progress)
        return index.place(reading.start_us)

    def _batches(self, reading: ReadPass) -> Iterator[EventBatch]:
        reading.place, latest_us, shift_us = self._start(reading)
        segments = ClockSegments(reading, latest_us, shift_us)
        order = TimeOrder(self.path, reading, self._reader.strict_order, latest_us)
        whole = reading.start_us is None and reading.end_us is None
        start_us = NO_TIME_US if reading.start_us is None else reading.start_us
        end_us = 2**63 - 1 if reading.end_us is None else reading.end_us
        builder = IndexBuilder()
        parts = builder.noting_places(self._reader.columns(reading), reading, segments, order)
        for columns in order.sorted(segments.joined(parts)):
            batch = self._on_sensor(columns, reading).between(start_us, end_us)
            for first in range(0, len(batch), reading.max_events):
                part = batch[first : first + reading.max_events]
                builder.add(part)
                yield part
            if int(columns.t_us[-1]) >= end_us:
                break
        self._pass = reading
        if whole:
            self._index = builder.index(reading, self._sensor, self._sensor_warning)
            if self.is_large:
                self._index.save(self._index_key())

    def _on_sensor(self, columns: UncheckedEvents, reading: ReadPass) -> EventBatch:
        """Events on the sensor; others are dropped as damage, or show that --sensor is too small."""
        if columns.x.max() >= self.width_px or columns.y.max() >= self.height_px:
            stated = self._reader.stated
            holds_stated = stated and stated.width_px <= self.width_px and stated.height_px <= self.height_px
            extent = (0, 0) if self._asked is None or holds_stated else self._extent_px(None)
            if extent[0] > self.width_px or extent[1] > self.height_px:
                size = smallest_known(*extent) or extent
                raise RecordingError(
                    f"--sensor {self.width_px}x{self.height_px} is too small, the events reach over {extent[0]} x "
                    f"{extent[1]} pixels: {size[0]}x{size[1]} holds them: {self.path}"
                )
            inside = (columns.x < self.width_px) & (columns.y < self.height_px)
            reading.damage.outside_events += int(np.count_nonzero(~inside))
            columns = columns[inside]
        x, y = (column.astype(np.uint16, copy=False) for column in (columns.x, columns.y))
        return EventBatch(columns.t_us, x, y, columns.on)
