"""ROS1 and ROS2 bags and MCAP, written and serialised by `rosbags`."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.recordings import open_recording, write_recording
from tests.pipeline.recordings.test_recordings_raw import assert_same_events, moving_edge

KINDS = ("bag", "db3", "mcap")
EVENT = "uint16 x\nuint16 y\ntime ts\nbool polarity"
EVENT_ARRAY = "std_msgs/Header header\nuint32 height\nuint32 width\nEvent[] events"
EVENT_PACKET = (
    "std_msgs/Header header\nuint32 height\nuint32 width\nuint64 seq\nuint64 time_base\nstring encoding\n"
    "bool is_bigendian\nuint8[] events"
)
EPOCH_US = 1_790_000_000_000_000  # a ROS clock's time in 2026
PARTS = ((0, 1), (1, 1), (1, 4), (4, 150), (150, 300))  # events of each message


def store(kind: str) -> Any:
    types = get_typestore(Stores.ROS1_NOETIC if kind == "bag" else Stores.ROS2_HUMBLE)
    for package in ("dvs_msgs", "prophesee_event_msgs"):
        event = EVENT if kind == "bag" else EVENT.replace("time ts", "builtin_interfaces/Time ts")
        types.register(get_types_from_msg(event, f"{package}/msg/Event"))
        types.register(get_types_from_msg(EVENT_ARRAY, f"{package}/msg/EventArray"))
    types.register(get_types_from_msg(EVENT_PACKET, "event_camera_msgs/msg/EventPacket"))
    return types


def header(types: Any, kind: str, number: int) -> Any:
    stamp = types.types["builtin_interfaces/msg/Time"](sec=7, nanosec=number)
    number_of = {"seq": number} if kind == "bag" else {}
    return types.types["std_msgs/msg/Header"](**number_of, stamp=stamp, frame_id="c" * number)


def arrays(types: Any, kind: str, events: EventBatch, package: str = "dvs_msgs") -> list[Any]:
    one, time = types.types[f"{package}/msg/Event"], types.types["builtin_interfaces/msg/Time"]
    messages = []
    for number, (first, upto) in enumerate(PARTS):
        part = events[first:upto]
        columns = zip(*(c.tolist() for c in (part.t_us, part.x_px, part.y_px, part.on)), strict=True)
        content = [
            one(x=x, y=y, ts=time(sec=t // 10**6, nanosec=t % 10**6 * 1000 + 999), polarity=on)
            for t, x, y, on in columns
        ]
        kind_of = types.types[f"{package}/msg/EventArray"]
        messages.append(kind_of(header=header(types, kind, number), height=720, width=1280, events=content))
    return messages


def packets(types: Any, kind: str, encoding: str, payloads: list[tuple[int, bytes]]) -> list[Any]:
    kind_of = types.types["event_camera_msgs/msg/EventPacket"]
    return [
        kind_of(
            header=header(types, kind, number),
            height=720,
            width=1280,
            seq=number,
            time_base=base_ns,
            encoding=encoding,
            is_bigendian=False,
            events=np.frombuffer(payload, np.uint8),
        )
        for number, (base_ns, payload) in enumerate(payloads)
    ]


def write_bag(folder: Path, kind: str, topics: dict[str, list[Any]]) -> Path:
    """A bag with these messages, one millisecond apart."""
    types = store(kind)
    path = folder / "a.bag"
    if kind == "bag":
        writer: Any = Writer1(path)
    else:
        storage = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
        writer = Writer2(folder / "bag", version=9, storage_plugin=storage)
    with writer:
        clock = itertools.count(7 * 10**9, 10**6)
        for topic, messages in topics.items():
            name = messages[0].__msgtype__
            connection = writer.add_connection(topic, name, typestore=types)
            for message in messages:
                serialize = types.serialize_ros1 if kind == "bag" else types.serialize_cdr
                writer.write(connection, next(clock), serialize(message, name))
    return path if kind == "bag" else next((folder / "bag").glob(f"*.{kind}"))


def mono(events: EventBatch) -> list[tuple[int, bytes]]:
    payloads = []
    for first, upto in PARTS:
        part, base_us = events[first:upto], int(events.t_us[first]) - 5
        words = 0
        columns = zip(*(c.tolist() for c in (part.t_us, part.x_px, part.y_px, part.on)), strict=True)
        words = [int(on) << 63 | y << 48 | x << 32 | (t - base_us) * 1000 for t, x, y, on in columns]
        payloads.append((base_us * 1000, np.array(words, "<u8").tobytes()))
    return payloads


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("package", ["dvs_msgs", "prophesee_event_msgs"])
def test_messages_of_one_structure_an_event_are_read(tmp_path: Path, kind: str, package: str) -> None:
    edge = moving_edge(300)
    events = EventBatch(edge.t_us + EPOCH_US, *edge.columns[1:])
    path = write_bag(tmp_path, kind, {"/camera": arrays(store(kind), kind, events, package)})
    recording = open_recording(path)
    assert_same_events(recording.read(), events)
    assert (recording.width_px, recording.height_px, recording.sensor_from) == (1280, 720, "file")
    assert not recording.damage.sentences()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("encoding", ["mono", "evt3"])
def test_packets_of_encoded_events_are_read(tmp_path: Path, kind: str, encoding: str) -> None:
    events = moving_edge(300)
    payloads = mono(events)
    if encoding == "evt3":
        write_recording(tmp_path / "a.raw", events, width_px=1280, height_px=720)
        _, _, words = (tmp_path / "a.raw").read_bytes().partition(b"% end\n")
        payloads = [(0, words[at : at + 35]) for at in range(0, len(words), 35)]  # cut within words, too
    path = write_bag(tmp_path, kind, {"/camera": packets(store(kind), kind, encoding, payloads)})
    assert_same_events(open_recording(path).read(), events)


@pytest.mark.parametrize("kind", KINDS)
def test_one_of_several_topics_is_chosen(tmp_path: Path, kind: str) -> None:
    left, right = moving_edge(300), moving_edge(300, seed=5)
    types = store(kind)
    topics = {"/left": arrays(types, kind, left), "/right": arrays(types, kind, right, "prophesee_event_msgs")}
    path = write_bag(tmp_path, kind, topics)
    first = open_recording(path)
    assert any("of /left, /right: --dataset TOPIC" in warning for warning in first.warnings)
    assert_same_events(first.read(), left)
    assert_same_events(open_recording(path, dataset="/right").read(), right)
    with pytest.raises(RecordingError, match="no events at --dataset /up: give one of /left, /right"):
        open_recording(path, dataset="/up")


@pytest.mark.parametrize("kind", KINDS)
def test_other_messages_and_encodings_are_named(tmp_path: Path, kind: str) -> None:
    types = store(kind)
    path = write_bag(tmp_path, kind, {"/camera": packets(types, kind, "libcaer_cmp", [(0, b"1234")])})
    with pytest.raises(RecordingError, match="encoding 'libcaer_cmp' are not read"):
        open_recording(path).read()
    (tmp_path / "other").mkdir()
    path = write_bag(tmp_path / "other", kind, {"/text": [types.types["std_msgs/msg/String"](data="hello")]})
    with pytest.raises(RecordingError, match=r"holds no events \(it has std_msgs/msg/String.*dvs_msgs/msg/EventArray"):
        open_recording(path)
