"""AEDAT4 of DAVIS and DVXplorer cameras, read through the package `aedat`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import RecordingError
from ..optional_packages import optional_module
from ..packets import foreign_errors, joined, undamaged
from ..reader import LAST_US, CameraFrame, FormatReader, ReadingOptions, ReadPass, Triggers, UncheckedEvents
from ..sensor import resolution_or_none
from .registry import FORMATS, RecordingFormat

MAGIC, MAGIC_4 = b"#!AER-DAT", b"#!AER-DAT4"
RGB = 3  # channels; a fourth is opacity
# Sources of AEDAT4's triggers that are rising edges, pulses or beginnings; the others are falling edges or ends.
RISING_SOURCES = (0, 1, 3, 4, 6, 8)


class AedatReader(FormatReader):
    """Reader of one AEDAT4 recording.

    The number of a trigger is that of its source: 1 and 2 rising and falling edge of the input, 3 pulse, 4 and 5 edges
    of the generator, 6 to 9 begin and end of a frame and of its exposure.
    """

    format = "AEDAT4"
    strict_order = False
    takes = ("dataset",)

    def __init__(self, path: Path, options: ReadingOptions) -> None:
        super().__init__(path, options)
        with open(path, "rb") as file:
            version = file.read(len(MAGIC_4)).decode("ascii", "replace")
        if version != MAGIC_4.decode():
            raise RecordingError(
                f"AEDAT of version {version.removeprefix(MAGIC.decode())} is not read: convert it to AEDAT4 (with the "
                f"software of the camera): {path}"
            )
        streams = self._decoder().id_to_stream()
        found = {str(number): stream for number, stream in streams.items() if stream["type"] == "events"}
        if not found:
            present = ", ".join(sorted({stream["type"] for stream in streams.values()})) or "nothing"
            raise RecordingError(f"AEDAT4 file holds no events (it has {present}): record them, too: {path}")
        if options.dataset is not None and options.dataset not in found:
            raise RecordingError(f"no events at --dataset {options.dataset}: give one of {', '.join(found)}: {path}")
        chosen = options.dataset or next(iter(found))
        if len(found) > 1 and options.dataset is None:
            self.warnings.append(f"events are read from stream {chosen} of {', '.join(found)}: --dataset chooses")
        self._stream = int(chosen)
        self.stated = resolution_or_none(found[chosen]["width"], found[chosen]["height"], self.warnings)

    def columns(self, reading: ReadPass) -> Iterator[UncheckedEvents]:
        """Yield the events of the packets before the first damaged one; packed files are only read from their start."""
        with foreign_errors(self.path, self.format):
            yield from joined(self._events(reading), reading.max_events)
        reading.report(1, 1)

    def frames(self, start_us: int, end_us: int) -> Iterator[CameraFrame]:
        """Yield the pictures before the first damaged packet."""
        with foreign_errors(self.path, self.format):
            for packet in undamaged(self._decoder(), ReadPass()):
                if "frame" not in packet:
                    continue
                frame = packet["frame"]
                t_us = (frame["exposure_begin_t"] + frame["exposure_end_t"]) // 2
                if start_us <= t_us < end_us:
                    yield CameraFrame(t_us, frame["offset_x"], frame["offset_y"], _colours(frame["pixels"]))

    def _events(self, reading: ReadPass) -> Iterator[UncheckedEvents]:
        for packet in undamaged(self._decoder(), reading):
            if "triggers" in packet:
                reading.triggers.append(_triggers(packet["triggers"]))
            elif "events" in packet and packet["stream_id"] == self._stream:
                found = packet["events"]
                events = UncheckedEvents(found["t"].astype(np.int64), found["x"], found["y"], found["on"])
                good = (events.t_us > -LAST_US) & (events.t_us < LAST_US)
                reading.damage.broken_events += int(np.count_nonzero(~good))
                yield events[good]

    def _decoder(self) -> Any:
        aedat = optional_module("aedat", "aedat", "AEDAT4")
        with foreign_errors(self.path, self.format):
            return aedat.Decoder(str(self.path))


def _colours(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return pixels if pixels.ndim == 2 else np.ascontiguousarray(pixels[..., :RGB])


def _triggers(found: Any) -> Triggers:
    rising = np.isin(found["source"], RISING_SOURCES).astype(np.uint8)
    return Triggers(found["t"].astype(np.int64), rising, found["source"].astype(np.uint8))


FORMATS.register(
    RecordingFormat(
        name="aedat",
        label="AEDAT4",
        suffixes=(".aedat4", ".aedat"),
        sniff=lambda path, head: head.startswith(MAGIC),
        open=AedatReader,
        isolated=True,
    )
)
