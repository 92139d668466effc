"""ROS1 and ROS2 bags and MCAP, read through the package `rosbags`."""

from __future__ import annotations

from pathlib import Path

from ....isolation import without_time_limit
from ...reader import FormatReader, ReadingOptions
from ..registry import FORMATS, RecordingFormat
from .storages import MCAP, ROS1, SQLITE


def _open(path: Path, options: ReadingOptions) -> FormatReader:
    with without_time_limit():
        from .reader import RosbagReader  # loads numba

    return RosbagReader(path, options)


FORMATS.register(
    RecordingFormat(
        name="rosbag",
        label="ROS bag or MCAP",
        suffixes=(".bag", ".db3", ".mcap"),
        sniff=lambda path, head: head.startswith((ROS1, SQLITE, MCAP)),
        open=_open,
        isolated=True,
    )
)
