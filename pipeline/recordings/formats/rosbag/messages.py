"""Messages with events of ROS1 and ROS2, decoded from their bytes."""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ....errors import RecordingError
from ...reader import UncheckedEvents

RECORDS = "records"  # encoding of messages with one structure an event
CDR_HEADER_BYTES = 4
CDR_LITTLE_ENDIAN = 1
# Event of dvs_msgs and its like: in ROS1 without gaps; in ROS2 numbers stand at multiples of their size.
ROS1_EVENT = np.dtype([("x", "<u2"), ("y", "<u2"), ("s", "<u4"), ("ns", "<u4"), ("on", "?")])
ROS2_EVENT = np.dtype(
    {
        "names": ["x", "y", "s", "ns", "on"],
        "formats": ["<u2", "<u2", "<u4", "<u4", "u1"],
        "offsets": [0, 2, 6, 10, 14],
        "itemsize": 16,
    }
)


class EventMessage(NamedTuple):
    """Events of one message.

    Attributes
    ----------
    width_px, height_px : int
        Size of the sensor.
    encoding : str
        RECORDS, or the encoding of an EventPacket.
    time_base_ns : int
        To be added to the times of the encoding `mono`.
    payload : bytes
        Events of an EventPacket.
    records : UncheckedEvents or None
        Events of a message with RECORDS.
    """

    width_px: int
    height_px: int
    encoding: str
    time_base_ns: int
    payload: bytes
    records: UncheckedEvents | None


class MessageFields:
    """Fields of a serialised message, one after the other; struct.error where it ends too early."""

    def __init__(self, raw: bytes, is_cdr: bool) -> None:
        if is_cdr and raw[1] != CDR_LITTLE_ENDIAN:
            raise RecordingError("messages of ROS2 in big-endian order are not read")
        self.raw, self.is_cdr = raw, is_cdr
        self._start = CDR_HEADER_BYTES if is_cdr else 0
        self.at = self._start

    def number(self, code: str) -> int:
        """Whole number of a struct code."""
        size = struct.calcsize(code)
        if self.is_cdr:
            self.at += -(self.at - self._start) % size
        (value,) = struct.unpack_from(f"<{code}", self.raw, self.at)
        self.at += size
        return int(value)

    def octets(self) -> bytes:
        """Sequence of bytes, or a text."""
        size = self.number("I")
        if self.at + size > len(self.raw):
            raise struct.error(f"{size} bytes are stated, {len(self.raw) - self.at} are there")
        self.at += size
        return self.raw[self.at - size : self.at]

    def skip_header(self) -> None:
        """Pass std_msgs/Header."""
        for _ in range(2 if self.is_cdr else 3):  # ROS1 has a sequence number, then both seconds and nanoseconds
            self.number("I")
        self.octets()


def event_array(raw: bytes, is_cdr: bool) -> EventMessage:
    """Decode an EventArray, as of dvs_msgs: one structure an event."""
    fields = MessageFields(raw, is_cdr)
    fields.skip_header()
    height_px, width_px, count = fields.number("I"), fields.number("I"), fields.number("I")
    rows = _ros2_rows(raw, fields.at, count) if is_cdr else np.frombuffer(raw, ROS1_EVENT, count, fields.at)
    t_us = rows["s"].astype(np.int64) * 1_000_000 + rows["ns"] // 1000
    events = UncheckedEvents(t_us, rows["x"], rows["y"], rows["on"] != 0)
    return EventMessage(width_px, height_px, RECORDS, 0, b"", events)


def _ros2_rows(raw: bytes, at: int, count: int) -> NDArray[Any]:
    """(count,) ROS2_EVENT: the second event and those after it follow a gap of one byte, the first has none inside."""
    if not count:
        return np.zeros(0, ROS2_EVENT)
    rows = np.frombuffer(raw + b"\0", ROS2_EVENT, count, at - 2).copy()
    rows["x"][0], rows["y"][0] = struct.unpack_from("<HH", raw, at)
    return rows


def event_packet(raw: bytes, is_cdr: bool) -> EventMessage:
    """Decode an EventPacket of event_camera_msgs: events in the camera's or another encoding."""
    fields = MessageFields(raw, is_cdr)
    fields.skip_header()
    height_px, width_px = fields.number("I"), fields.number("I")
    fields.number("Q")  # number of the message
    time_base_ns = fields.number("Q")
    encoding = fields.octets().rstrip(b"\0").decode("ascii", "replace")
    fields.number("B")  # is_bigendian: of the sending machine, all in use are not
    return EventMessage(width_px, height_px, encoding, time_base_ns, fields.octets(), None)


def mono_events(message: EventMessage) -> UncheckedEvents:
    """Events of the encoding `mono`: 64 bits each, nanoseconds (32), x (16), y (15) and polarity (1)."""
    words = np.frombuffer(message.payload, "<u8", len(message.payload) // 8)
    t_us = ((words & 0xFFFFFFFF).astype(np.int64) + message.time_base_ns) // 1000
    x, y = (words >> 32) & 0xFFFF, (words >> 48) & 0x7FFF
    return UncheckedEvents(t_us, x.astype(np.uint16), y.astype(np.uint16), words >> 63 != 0)


MESSAGES: dict[str, Callable[[bytes, bool], EventMessage]] = {
    "dvs_msgs/msg/EventArray": event_array,
    "prophesee_event_msgs/msg/EventArray": event_array,
    "dv_ros_msgs/msg/EventArray": event_array,
    "event_camera_msgs/msg/EventPacket": event_packet,
    "event_array_msgs/msg/EventArray": event_packet,  # the same under its older name
}
