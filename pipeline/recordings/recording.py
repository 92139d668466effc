"""One recording on disk, whatever its format."""

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
from .order import TimeOrder
from .sensor import Sensor, guessed_sensor, smallest_known
from .source import CHUNK_EVENTS, Columns, Damage, Pass, Progress, Source, Triggers

HASH_ALL_BYTES = 64 << 20
HASH_BLOCK_BYTES = 1 << 20
EVENT_BYTES = 13  # 8 + 2 + 2 + 1


def _memory_bytes() -> int:
    """Memory of the machine; 8 GB where the system does not say."""
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return 8 << 30


class Recording:
    """Events on disk, read in streams; made by `open_recording`.

    path, format : where it is and what it is, for people
    width_px, height_px : the sensor
    sensor_from : who says so: "file", "command line", "system_ID 49" or "guess"
    attributes : root attributes or header lines of the file; `camera.focal_length_mm` and the like among them
    t_offset_us : DSEC's offset of the file's time; reported, never added
    events : number of events in the file when it says so before it is read, None for RAW

    The file is opened anew for every pass and closed after it: nothing has to be closed.
    """

    def __init__(self, source: Source, asked: Sensor | None = None, on_progress: Progress | None = None) -> None:
        self._source = source
        self._asked = asked
        self._sensor_warnings: list[str] = []
        self._sensor = self._chosen_sensor(on_progress)
        self._pass: Pass | None = None
        self._whole = False  # whether _pass saw the whole file
        self.path: Path = source.path
        self.format: str = source.format
        self.attributes: dict[str, str | float] = dict(source.attributes)
        self.t_offset_us: int | None = source.t_offset_us
        self.events: int | None = source.events

    def __repr__(self) -> str:
        return f"Recording({self.format}, {self.width_px} x {self.height_px} px, {self.path})"

    @property
    def width_px(self) -> int:
        """Columns of the sensor."""
        return self._sensor.width_px

    @property
    def height_px(self) -> int:
        """Rows of the sensor."""
        return self._sensor.height_px

    @property
    def sensor_from(self) -> str:
        """Who says how large the sensor is."""
        return self._sensor.source

    @cached_property
    def truth(self) -> Truth | None:
        """The simulator's truth, None where the file has none; raises RecordingError when it is damaged.

        Its labels go with the events as they are in the file: with those of `read` if `damage` is all zero.
        """
        return self._source.truth()

    @property
    def warnings(self) -> list[str]:
        """What people should know: assumptions made on opening, then the damage the last pass met."""
        damage = self._pass.damage.sentences() if self._pass is not None else []
        return [*self._source.warnings, *self._sensor_warnings, *damage]

    @property
    def damage(self) -> Damage:
        """What is wrong in the whole file; makes a pass over it unless there was one."""
        return self._scanned().damage

    @property
    def triggers(self) -> Triggers:
        """The edges on the trigger input in the whole file; makes a pass over it unless there was one."""
        return Triggers.joined(self._scanned().triggers)

    def scan(self, on_progress: Progress | None = None) -> None:
        """Pass over the whole file, for `damage`, `triggers` and `warnings`."""
        for _ in self.chunks(on_progress=on_progress):
            pass

    def chunks(self, max_events: int = CHUNK_EVENTS, on_progress: Progress | None = None) -> Iterator[EventBatch]:
        """All events in order of time, 1 to max_events at once, in constant memory.

        Raises RecordingError on the way for what cannot be repaired; see `Damage` for what can.
        """
        return self._batches(Pass(max_events, on_progress=on_progress))

    def read(
        self, start_us: int | None = None, end_us: int | None = None, on_progress: Progress | None = None
    ) -> EventBatch:
        """All events of [start_us, end_us) in memory at once; RecordingError when they do not fit there."""
        reading = Pass(CHUNK_EVENTS, start_us, end_us, on_progress)
        most_events = _memory_bytes() // (3 * EVENT_BYTES)  # twice to join them, and room for the work on them
        parts: list[EventBatch] = []
        events = 0
        for batch in self._batches(reading):
            parts.append(batch)
            events += len(batch)
            if events > most_events:
                raise RecordingError(
                    f"more than {most_events / 1e6:.0f} million events do not fit in memory: read a part "
                    f"(--window START_US END_US): {self.path}"
                )
        return EventBatch.concatenate(parts)

    def identity(self) -> str:
        """Hash of the file's bytes (BLAKE2b, 32 hexadecimal digits).

        Of a file above 64 MB only size, time of change, and 1 MB each at start, middle and end are hashed.
        """
        digest = hashlib.blake2b(digest_size=16)
        try:
            with open(self.path, "rb") as file:
                size = file.seek(0, 2)
                if size <= HASH_ALL_BYTES:
                    places = list(range(0, size, HASH_BLOCK_BYTES))
                else:
                    digest.update(f"{size} {self.path.stat().st_mtime_ns}".encode())
                    places = [0, size // 2, size - HASH_BLOCK_BYTES]
                for place in places:
                    file.seek(place)
                    digest.update(file.read(HASH_BLOCK_BYTES))
        except OSError as error:
            raise RecordingError(f"recording can no longer be read ({error.strerror}): {self.path}") from error
        return digest.hexdigest()

    def _scanned(self) -> Pass:
        if self._pass is None or not self._whole:
            self.scan()
        assert self._pass is not None
        return self._pass

    def _chosen_sensor(self, on_progress: Progress | None) -> Sensor:
        if self._asked is not None:
            return self._asked
        if self._source.stated is not None:
            return self._source.stated
        extent = self._extent_px(on_progress)
        sensor = guessed_sensor(*extent)
        self._sensor_warnings.append(
            f"the file does not state its sensor: taken as {sensor.width_px} x {sensor.height_px}, the "
            f"smallest known one that holds the events (they reach over {extent[0]} x {extent[1]} pixels); "
            "--sensor WxH states it"
        )
        return sensor

    def _extent_px(self, on_progress: Progress | None) -> tuple[int, int]:
        """One more than the largest x and y of all events, (0, 0) without events; a pass over the file."""
        columns_px = rows_px = 0
        for block in self._source.columns(Pass(on_progress=on_progress)):
            columns_px = max(columns_px, int(block.x.max()) + 1)
            rows_px = max(rows_px, int(block.y.max()) + 1)
        return columns_px, rows_px

    def _batches(self, reading: Pass) -> Iterator[EventBatch]:
        order = TimeOrder(self.path, reading, self._source.order_is_law)
        whole = reading.start_us is None and reading.end_us is None
        start_us = -(2**63) if reading.start_us is None else reading.start_us
        end_us = 2**63 - 1 if reading.end_us is None else reading.end_us
        for columns in self._ordered(reading, order):
            batch = self._on_sensor(columns, reading).between(start_us, end_us) if columns else EventBatch.empty()
            for first in range(0, len(batch), reading.max_events):
                yield batch[first : first + reading.max_events]
            if columns and int(columns.t_us[-1]) >= end_us:
                break
        if whole or not self._whole:
            self._pass, self._whole = reading, whole

    def _ordered(self, reading: Pass, order: TimeOrder) -> Iterator[Columns | None]:
        for columns in self._source.columns(reading):
            yield order.push(columns)
        yield order.finish()

    def _on_sensor(self, columns: Columns, reading: Pass) -> EventBatch:
        """Events on the sensor; others are dropped as damage, or show that --sensor is too small."""
        if columns.x.max() < self.width_px and columns.y.max() < self.height_px:
            inside = columns
        else:
            stated = self._source.stated
            if self._asked is not None and not (
                stated is not None and self._asked.holds(stated.width_px, stated.height_px)
            ):
                self._refuse_small_sensor()
            mask = (columns.x < self.width_px) & (columns.y < self.height_px)
            inside = columns[mask]
            reading.damage.outside_events += int(np.count_nonzero(~mask))
        return EventBatch(
            inside.t_us,
            inside.x.astype(np.uint16, copy=False),
            inside.y.astype(np.uint16, copy=False),
            inside.on,
        )

    def _refuse_small_sensor(self) -> None:
        extent = self._extent_px(None)
        size = smallest_known(*extent) or extent
        raise RecordingError(
            f"--sensor {self.width_px}x{self.height_px} is too small, the events reach over {extent[0]} x "
            f"{extent[1]} pixels: {size[0]}x{size[1]} holds them: {self.path}"
        )
