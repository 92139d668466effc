"""Reader of Prophesee RAW files: a header of text lines, then EVT2, EVT2.1 or EVT3 words."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....errors import RecordingError
from ...prophesee_header import MAX_HEADER_BYTES, parse_header
from ...reader import FormatReader, Place, ReadingOptions, ReadPass, Triggers, UncheckedEvents, file_errors
from ...sensor import SENSOR_OF_SYSTEM_ID, Resolution, geometry_or_none, resolution_or_none
from .decoding import BAD_WORDS, EVENTS, OUTSIDE, TIME_HIGH, TIME_JUMPS, TRIGGERS, UNTIMED, Decoded, initial_state
from .evt2 import HIGH_BITS, HIGH_MASK, decode_evt2
from .evt3 import decode_evt3

READ_BYTES = 512 << 10  # which the processor's caches hold, with the events that are decoded from it
TRIGGER_ROOM = 1 << 14  # triggers decoded at once
STEADY_STEPS = 16  # of 64 us between two TIME_HIGH words: sensors send one each 16 us to 1 ms
WORD_BYTES = {"EVT2": 4, "EVT2.1": 8, "EVT3": 2}


class RawReader(FormatReader):
    """Reader of one RAW recording."""

    strict_order = False
    seeks = True

    def __init__(self, path: Path, options: ReadingOptions) -> None:
        super().__init__(path, options)
        with file_errors(path, "RAW"), open(path, "rb") as file:
            head = file.read(MAX_HEADER_BYTES)
        header, self._start = parse_header(head)
        self.attributes |= header
        format_said = format_options(header)
        self._encoding = _encoding(header, format_said, path)
        self.format = f"{self._encoding} RAW"
        self.stated = _stated_sensor(header, format_said, self.warnings)
        two_halves = self._encoding == "EVT2.1"
        self._legacy = two_halves and self._is_legacy(format_said.get("endianness", ""), head[self._start :])

    def columns(self, reading: ReadPass) -> Iterator[UncheckedEvents]:
        """Yield the events; only the words before, or a decoder's state there, tell the time."""
        reading.place = reading.place or Place(self._start, tuple(initial_state().tolist()))
        decoder = RawDecoder(self._encoding, self._legacy, reading)
        with file_errors(self.path, "RAW"), open(self.path, "rb", buffering=0) as file:
            size = file.seek(0, 2)
            file.seek(reading.place.offset)
            while block := file.read(READ_BYTES):
                yield from decoder.feed(block, final=False)
                reading.report(file.tell(), size)
            yield from decoder.feed(b"", final=True)

    def _is_legacy(self, endianness: str, data: bytes) -> bool:
        """Whether the half with the type comes first (IMX636): by the header, else by the words' times."""
        if endianness in ("legacy", "little"):
            return endianness == "legacy"
        if endianness:
            raise RecordingError(
                f"EVT2.1 with endianness {endianness[:20]!r} is not read: little and legacy are: {self.path}"
            )
        halves = np.frombuffer(data[: len(data) // 8 * 8], "<u4").reshape(-1, 2)
        steady = []
        for head in (halves[:, 0], halves[:, 1]):
            times = (head[head >> HIGH_BITS == TIME_HIGH] & HIGH_MASK).astype(np.int64)
            steps = np.diff(times)
            steady.append(int(np.count_nonzero((steps > 0) & (steps <= STEADY_STEPS))))
        legacy = steady[0] >= steady[1]
        order = "legacy" if legacy else "little"
        self.warnings.append(f"the EVT2.1 header states no endianness: taken as {order}, in which time is steady")
        return legacy


class RawDecoder:
    """Stream decoder of EVT2, EVT2.1 or EVT3 from `reading.place` on: bytes in blocks of any size in, events out.

    `legacy` is EVT2.1 with the half that holds the type first. Damage and triggers are added to `reading`, whose place
    goes with the events.
    """

    def __init__(self, encoding: str, legacy: bool, reading: ReadPass) -> None:
        self._encoding, self._legacy, self._reading = encoding, legacy, reading
        self._word_bytes = WORD_BYTES[encoding]
        place = reading.place or Place(0, tuple(initial_state().tolist()))
        self._offset, self._state = place.offset, np.array(place.state)
        self._rest = b""

    def feed(self, block: bytes, final: bool) -> Iterator[UncheckedEvents]:
        """Yield the events of the next bytes of the file; final: there are no more."""
        data = self._rest + block if self._rest else block
        heads, masks = self._words(data)
        done = 0
        while done < heads.size:
            used, columns = self._decode(heads[done:], masks[done:], final)
            done += used
            self._reading.place = Place(self._offset + done * self._word_bytes, tuple(self._state.tolist()))
            if len(columns):
                yield columns
            if not used:
                break  # the last TIME_HIGH waits for the next one
        self._rest = data[done * self._word_bytes :]
        self._offset += done * self._word_bytes
        damage, state = self._reading.damage, self._state.tolist()
        damage.bad_words, damage.time_jumps = state[BAD_WORDS], state[TIME_JUMPS]
        damage.untimed_events = state[UNTIMED]
        if final:
            damage.outside_events += state[OUTSIDE]
            damage.lost_bytes = len(self._rest)

    def _words(self, data: bytes) -> tuple[NDArray[Any], NDArray[np.uint32]]:
        """All whole words, the masks of EVT2.1 apart; no masks in other encodings.

        All are read-only: for others the decoder would be compiled once more.
        """
        count = len(data) // self._word_bytes
        if self._encoding != "EVT2.1":
            return np.frombuffer(data, f"<u{self._word_bytes}", count), np.frombuffer(b"", np.uint32)
        halves = np.ascontiguousarray(np.frombuffer(data, "<u4", 2 * count).reshape(-1, 2).T)
        halves.flags.writeable = False
        first, second = halves
        return (first, second) if self._legacy else (second, first)

    def _decode(self, heads: NDArray[Any], masks: NDArray[np.uint32], final: bool) -> tuple[int, UncheckedEvents]:
        room = self._reading.room(max(self._reading.max_events, 4096))
        edges = (np.empty(TRIGGER_ROOM, dtype) for dtype in (np.int64, np.uint8, np.uint8))
        out = Decoded._make([*room, *edges, self._state])
        if self._encoding == "EVT3":
            used = int(decode_evt3(out, heads, final))
        else:
            used = int(decode_evt2(out, heads, masks, final))
        events, triggers = int(self._state[EVENTS]), int(self._state[TRIGGERS])
        if triggers:
            t_us, value, number = out.trigger_t_us, out.trigger_value, out.trigger_id
            self._reading.triggers.append(Triggers(t_us[:triggers], value[:triggers], number[:triggers]))
        return used, self._reading.decoded(room, events)


def format_options(header: dict[str, str]) -> dict[str, str]:
    """Split "EVT3;height=720;width=1280": {"": "EVT3", "height": "720", "width": "1280"}."""
    name, *rest = header.get("format", "").split(";")
    pairs = (item.partition("=") for item in rest)
    return {"": name.strip(), **{key.strip(): value.strip() for key, _, value in pairs}}


def _encoding(header: dict[str, str], options: dict[str, str], path: Path) -> str:
    names = {"EVT2": "EVT2", "EVT21": "EVT2.1", "EVT3": "EVT3", "2.0": "EVT2", "2.1": "EVT2.1", "3.0": "EVT3"}
    said = options[""] or header.get("evt", "")
    if said in names:
        return names[said]
    missing = "its header names no encoding (no line '% evt 3.0' or '% format EVT3')"
    why = f"its encoding is {said[:40]!r}" if said else missing
    raise RecordingError(
        f"RAW file cannot be decoded, {why}: EVT2, EVT2.1 and EVT3 are read; export it as HDF5: {path}"
    )


def _stated_sensor(header: dict[str, str], options: dict[str, str], warnings: list[str]) -> Resolution | None:
    if "geometry" in header:
        return geometry_or_none(header["geometry"], warnings)
    if "width" in options and "height" in options:
        return resolution_or_none(options["width"], options["height"], warnings)
    number = header.get("system_ID", "")
    if number.isdecimal() and int(number) in SENSOR_OF_SYSTEM_ID:
        return Resolution(*SENSOR_OF_SYSTEM_ID[int(number)], f"system_ID {number}")
    return None
