"""Reader of ROS1 and ROS2 bags and MCAP."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any

from ....errors import RecordingError
from ....isolation import without_time_limit
from ...optional_packages import optional_module
from ...packets import foreign_errors, joined, undamaged
from ...reader import FormatReader, ReadingOptions, ReadPass, UncheckedEvents
from ...sensor import resolution_or_none
from ..prophesee_raw.reader import RawDecoder
from .messages import MESSAGES, EventMessage, mono_events
from .storages import MCAP, ROS1

EVT3, MONO = "evt3", "mono"
FED_BYTES = 1 << 20  # of EVT3 decoded at once


class RosbagReader(FormatReader):
    """Reader of the events of one topic."""

    strict_order = False
    takes = ("dataset",)

    def __init__(self, path: Path, options: ReadingOptions) -> None:
        super().__init__(path, options)
        with open(path, "rb") as file:
            head = file.read(len(MCAP))
        self._is_ros1 = head.startswith(ROS1)
        self.format = "ROS1 bag" if self._is_ros1 else "MCAP" if head == MCAP else "ROS2 bag (SQLite)"
        with foreign_errors(path, self.format), self._bag() as bag:
            found = {c.topic: c.msgtype for c in bag.connections if c.msgtype in MESSAGES}
            present = ", ".join(sorted({c.msgtype for c in bag.connections})[:8]) or "nothing"
        if not found:
            raise RecordingError(
                f"{self.format} holds no events (it has {present}): read are messages of {', '.join(MESSAGES)}: {path}"
            )
        if options.dataset is not None and options.dataset not in found:
            raise RecordingError(f"no events at --dataset {options.dataset}: give one of {', '.join(found)}: {path}")
        self._topic = options.dataset or next(iter(found))
        if len(found) > 1 and options.dataset is None:
            self.warnings.append(f"events are read from {self._topic} of {', '.join(found)}: --dataset TOPIC chooses")
        with foreign_errors(path, self.format):
            first = next(self._messages(ReadPass()), None)
        self._encoding = "none" if first is None else first.encoding
        if first is not None and first.width_px and first.height_px:
            self.stated = resolution_or_none(first.width_px, first.height_px, self.warnings)

    def columns(self, reading: ReadPass) -> Iterator[UncheckedEvents]:
        """Yield the events of the messages before the first damaged one."""
        with foreign_errors(self.path, self.format):
            parts = self._evt3(reading) if self._encoding == EVT3 else self._events(reading)
            yield from joined(parts, reading.max_events)
        reading.report(1, 1)

    def _events(self, reading: ReadPass) -> Iterator[UncheckedEvents]:
        for message in self._messages(reading):
            if message.records is not None:
                yield message.records
            elif message.encoding == MONO:
                yield mono_events(message)
            else:
                raise RecordingError(
                    f"events in the encoding {message.encoding[:20]!r} are not read ({EVT3} and {MONO} are): convert "
                    f"them: {self.path}"
                )

    def _evt3(self, reading: ReadPass) -> Iterator[UncheckedEvents]:
        """Yield the events of a stream of EVT3 words that the messages cut into pieces."""
        with without_time_limit():  # compiles
            list(RawDecoder("EVT3", False, ReadPass()).feed(bytes(4), final=True))
        # Places in the stream of words are none in the bag.
        decoder = RawDecoder("EVT3", False, replace(reading, place=None))
        waiting = b""
        for message in self._messages(reading):
            if message.encoding != EVT3:
                raise RecordingError(f"events in several encodings in one topic are not read: {self.path}")
            waiting += message.payload
            if len(waiting) >= FED_BYTES:
                yield from decoder.feed(waiting, final=False)
                waiting = b""
        yield from chain(decoder.feed(waiting, final=False), decoder.feed(b"", final=True))

    def _messages(self, reading: ReadPass) -> Iterator[EventMessage]:
        with self._bag() as bag:
            chosen = [c for c in bag.connections if c.topic == self._topic and c.msgtype in MESSAGES]
            total = sum(c.msgcount for c in chosen)
            decoded = (
                MESSAGES[connection.msgtype](raw, not self._is_ros1)
                for connection, _, raw in (bag.messages(chosen) if chosen else ())
            )
            for count, message in enumerate(undamaged(decoded, reading), 1):
                yield message
                reading.report(count, total)

    @contextmanager
    def _bag(self) -> Iterator[Any]:
        """Open the file with the reader of `rosbags` for its storage, whatever its suffix is."""
        if self._is_ros1:
            bag = optional_module("rosbags.rosbag1", "rosbags", self.format).Reader(self.path)
        elif self.format == "MCAP":
            bag = optional_module("rosbags.rosbag2.storage_mcap", "rosbags", self.format).McapReader(self.path)
        else:
            bag = optional_module("rosbags.rosbag2.storage_sqlite3", "rosbags", self.format).Sqlite3Reader(self.path)
        bag.open()
        try:
            yield bag
        finally:
            bag.close()
