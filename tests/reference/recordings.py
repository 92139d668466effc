"""Slow, obvious decoders and encoders of recordings: whole files as lists, one word after the other."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.recordings import Triggers

Event = tuple[int, int, int, bool]  # t_us, x, y, on
Ints = NDArray[np.int64]
MAX_DISORDER_US = 10_000


@dataclass
class NaiveDecoded:
    """Events and triggers (t_us, value, id) as the words say, and what was wrong."""

    events: list[Event] = field(default_factory=list)
    triggers: list[tuple[int, int, int]] = field(default_factory=list)
    bad_words: int = 0
    time_jumps: int = 0
    untimed: int = 0
    outside: int = 0


class NaiveClock:
    """The rule for TIME_HIGH words, in plain numbers: `turn` values until it wraps."""

    def __init__(self, decoded: NaiveDecoded, turn: int, unit_us: int, free_steps: int) -> None:
        self.decoded, self.turn, self.unit_us, self.free_steps = decoded, turn, unit_us, free_steps
        self.high: int | None = None
        self.sure = False

    def take(self, value: int, later: list[int]) -> None:
        """A TIME_HIGH word with the values of the next ones in the file."""
        ahead = value if self.high is None else (value - self.high) % self.turn
        if self.high is None or ahead > self.free_steps:
            if later and not self.is_borne_out(value, later[:256]):
                self.decoded.time_jumps += 1
                return
            if not later and self.high is not None and ahead * self.unit_us > 1_000_000:
                self.decoded.time_jumps += 1
                self.sure = False
                return
        high = self.high or 0
        if ahead > self.turn // 2 and high + ahead - self.turn >= 0:
            ahead -= self.turn
        self.high, self.sure = high + ahead, True

    def is_borne_out(self, own: int, later: list[int]) -> bool:
        """Whether later values go on from this one, judged by the first that two more follow closely."""
        values = [own, *later]
        steps = [(b - a) % self.turn * self.unit_us for a, b in pairwise(values)]
        steady = [k for k, both in enumerate(pairwise(steps)) if max(both) <= 1 << 16]
        way = values[: steady[0] + 1] if steady else values
        if self.high is not None:
            way = [self.high, *way]
        if all((b - a) % self.turn <= self.turn // 4 for a, b in pairwise(way)):
            return True
        witness = values[steady[0]] if steady else later[0]
        if self.high is None:
            return witness == own if steady else (witness - own) % self.turn <= self.turn // 2
        is_present = bool(steady) and (self.high - witness) % self.turn * self.unit_us <= 1 << 16
        is_between = (witness - self.high) % self.turn < (own - self.high) % self.turn
        return (bool(steady) and witness == own) or not (is_present or is_between)


def later_highs(words: list[int], at: int, shift: int) -> list[int]:
    """Values of the TIME_HIGH words after the one at `at`."""
    return [word & ((1 << shift) - 1) for word in words[at + 1 :] if word >> shift == 0x8]


def naive_evt3(words: list[int]) -> NaiveDecoded:
    """EVT3, word by word."""
    out = NaiveDecoded()
    clock = NaiveClock(out, 4096, 4096, 1)
    low, row, base, on = 0, None, None, False
    for at, word in enumerate(words):
        kind, value = word >> 12, word & 0xFFF
        if kind == 0x0:
            row = value & 0x7FF
        elif kind == 0x2:
            if clock.sure and row is not None:
                out.events.append((clock.high * 4096 + low, value & 0x7FF, row, bool(value & 0x800)))
            else:
                out.untimed += 1
        elif kind == 0x3:
            base, on = value & 0x7FF, bool(value & 0x800)
        elif kind in (0x4, 0x5):
            width = 12 if kind == 0x4 else 8
            for bit in range(width):
                if value & (1 << bit):
                    if not clock.sure or row is None or base is None:
                        out.untimed += 1
                    elif base + bit >= 2048:
                        out.outside += 1
                    else:
                        out.events.append((clock.high * 4096 + low, base + bit, row, on))
            if base is not None:
                base += width
        elif kind == 0x6:
            low = value
        elif kind == 0x8:
            before = clock.high
            clock.take(value, later_highs(words, at, 12))
            if clock.high != before:
                low = 0
        elif kind == 0xA:
            if clock.sure:
                out.triggers.append((clock.high * 4096 + low, value & 1, value >> 8))
        elif kind not in (0x7, 0xE, 0xF):
            out.bad_words += 1
    return out


def naive_evt2(heads: list[int], masks: list[int] | None = None) -> NaiveDecoded:
    """EVT2, or EVT2.1 with the masks of the pixels behind x, word by word."""
    out = NaiveDecoded()
    clock = NaiveClock(out, 1 << 28, 64, 155)
    for at, word in enumerate(heads):
        kind, low = word >> 28, (word >> 22) & 0x3F
        if kind in (0x0, 0x1):
            mask = 1 if masks is None else masks[at]
            for bit in range(32):
                x = ((word >> 11) & 0x7FF) + bit
                if mask & (1 << bit):
                    if not clock.sure:
                        out.untimed += 1
                    elif x >= 2048:
                        out.outside += 1
                    else:
                        out.events.append((clock.high * 64 + low, x, word & 0x7FF, kind == 0x1))
        elif kind == 0x8:
            clock.take(word & 0xFFFFFFF, later_highs(heads, at, 28))
        elif kind == 0xA:
            if clock.sure:
                out.triggers.append((clock.high * 64 + low, word & 1, (word >> 8) & 0x1F))
        elif kind not in (0xE, 0xF):
            out.bad_words += 1
    return out


def naive_dat(words: list[tuple[int, int]]) -> NaiveDecoded:
    """Events of DAT words (time, pixel); a time far from the one before is taken if the next twelve go on from it."""
    out = NaiveDecoded()
    turn, now = 1 << 32, None
    for i, (value, pixel) in enumerate(words):
        if not _is_pixel(pixel):
            out.outside += 1
            continue
        followed = [value]
        for word, before in zip(words[i + 1 :], words[i:], strict=False):
            if word != before and _is_pixel(word[1]) and len(followed) <= 12:
                followed.append(word[0])
        if now is None:
            t, way, limit, near = value, 0, turn // 2, False
        else:
            way, limit = (value - now) % turn, turn - MAX_DISORDER_US
            back = way > turn // 2 and now + way >= turn
            t = now + way - turn * back
            near = way <= MAX_DISORDER_US or (back and way >= limit)
        believed = near or len(followed) > 1 or way <= 1_000_000
        for a, b in pairwise(followed):
            step = (b - a) % turn
            way += step - turn * (step > turn - MAX_DISORDER_US)
            believed &= near or way < limit
        if believed:
            out.events.append((t, pixel & 0x3FFF, (pixel >> 14) & 0x3FFF, pixel >> 28 != 0))
            now = t
        else:
            out.time_jumps += 1
    return out


def _is_pixel(pixel: int) -> bool:
    return pixel & 0x3FFF < 8192 and (pixel >> 14) & 0x3FFF < 8192


def write_evt2(
    path: Path, events: EventBatch, *, width_px: int, height_px: int, triggers: Triggers | None = None
) -> None:
    """Write RAW in EVT2, which Spinscope only reads; triggers go before events of the same time."""
    timed = [(t, 1, (on, x, y)) for t, x, y, on in columns(events)]
    if triggers is not None:
        edges = zip(triggers.t_us.tolist(), triggers.value.tolist(), triggers.id.tolist(), strict=True)
        timed += [(t, 0, (value, number)) for t, value, number in edges]
    words, high = [], None
    for t, is_event, content in sorted(timed, key=lambda item: item[:2]):
        if high is None:
            high = t // 64
            words.append(0x8 << 28 | high)
        while high < t // 64:
            high = min(high + (1 << 26), t // 64)  # quarter turns
            words.append(0x8 << 28 | high % (1 << 28))
        low = (t % 64) << 22
        if is_event:
            on, x, y = content
            words.append(int(on) << 28 | low | x << 11 | y)
        else:
            value, number = content
            words.append(0xA << 28 | low | number << 8 | value)
    if high is not None:
        words.append(0x8 << 28 | high % (1 << 28))  # confirms the last one
    header = f"% evt 2.0\n% format EVT2;height={height_px};width={width_px}\n% geometry {width_px}x{height_px}\n% end\n"
    path.write_bytes(header.encode() + np.array(words, "<u4").tobytes())


def columns(events: EventBatch) -> list[Event]:
    """Events of a batch one by one."""
    return list(zip(*(c.tolist() for c in (events.t_us, events.x_px, events.y_px, events.on)), strict=True))


def naive_order(events: list[Event]) -> tuple[list[Event], int, int]:
    """Events in order of time, how many were earlier than the one before, and how many too late to keep."""
    kept, latest, late = [], None, 0
    for event in events:
        latest = event[0] if latest is None else max(latest, event[0])
        if event[0] < latest - MAX_DISORDER_US:
            late += 1
        else:
            kept.append(event)
    backward = sum(b[0] < a[0] for a, b in pairwise(events))
    return sorted(kept, key=lambda event: event[0]), backward, late


def ecf_block(t: Ints, x: Ints, y: Ints, p: Ints, way: int) -> bytes:
    """A block of Prophesee's ECF: way 2 packs y, x, p together, 1 packs x and p, 0 none; times rise."""
    n = len(t)
    out = struct.pack("<IQ", n << 2 | way, int(t[0])) + _ecf_times([int(v) for v in t])
    events = [(int(a), int(b), int(c)) for a, b, c in zip(y, x, p, strict=True)] + [(0, 0, 0)] * (-n % 4)
    if way == 2:
        for k in range(0, len(events), 4):
            a, b, c, d = ((y << 12) | (x << 1) | p for y, x, p in events[k : k + 4])
            out += struct.pack("<3I", a << 8 | b & 0xFF, (b >> 8) << 16 | c & 0xFFFF, (c >> 16) << 24 | d)
        return out
    out += _ecf_runs([int(v) for v in y], "<H", 5)
    if way == 1:
        for k in range(0, len(events), 4):
            a, b, c, d = ((x << 1) | p for _, x, p in events[k : k + 4])
            out += struct.pack("<3H", a << 4 | b & 0xF, (b >> 4) << 8 | c & 0xFF, (c >> 8) << 12 | d)
        return out
    return out + _ecf_columns([int(v) for v in x]) + _ecf_runs([int(v) for v in p], "<B", 7)


def _run_lengths(values: list[int]) -> list[tuple[int, int]]:
    runs: list[tuple[int, int]] = []
    for value in values:
        if runs and runs[-1][0] == value:
            runs[-1] = (value, runs[-1][1] + 1)
        else:
            runs.append((value, 1))
    return runs


def _ecf_times(t: list[int]) -> bytes:
    out, now = b"", t[0]
    for value, count in _run_lengths(t):
        step = value - now
        if step >= 15:
            while step:
                out += bytes([0xF0 | step & 15])
                step >>= 4
        now = value
        out += bytes([step << 4 | min(count, 15)]) + (struct.pack("<H", count) if count >= 15 else b"")
    return out


def _ecf_runs(values: list[int], word: str, bits: int) -> bytes:
    full, out = (1 << bits) - 1, b""
    for value, count in _run_lengths(values):
        out += struct.pack(word, value << bits | min(count, full))
        out += struct.pack("<H", count) if count >= full else b""
    return out


def _ecf_columns(x: list[int]) -> bytes:
    out, k = b"", 0
    while k < len(x):
        first, word = x[k], x[k] << 5
        k += 1
        for step in range(1, 6):
            if k < len(x) and x[k] == first + step:
                word |= 1 << (5 - step)
                k += 1
        out += struct.pack("<H", word)
    return out


def write_event_stream(path: Path, events: list[Event], *, width_px: int, height_px: int, is_atis: bool) -> None:
    """Write Event Stream 2.0, with five resets between events now and then, and exposure measurements in ATIS."""
    out = bytearray(b"Event Stream" + bytes([2, 0, 0, 2 if is_atis else 1]) + struct.pack("<2H", width_px, height_px))
    now, full = 0, 63 if is_atis else 127
    for number, (t, x, y, on) in enumerate(events):
        if number % 10 == 3:
            out += bytes([0xFC if is_atis else 0xFE]) * 5
        if is_atis and number % 10 == 5:
            out += struct.pack("<BHH", 0b11, 1, 2)
        overflows, left = divmod(t - now, full)
        if is_atis:
            out += bytes([0xFF]) * (overflows // 3) + (bytes([0xFC | overflows % 3]) if overflows % 3 else b"")
            out += struct.pack("<BHH", left << 2 | int(on) << 1, x, y)
        else:
            out += bytes([0xFF]) * overflows + struct.pack("<BHH", left << 1 | int(on), x, y)
        now = t
    path.write_bytes(bytes(out))


AEDAT4_STREAMS = """<dv version="2.0"><node name="outInfo" path="/mainloop/Recorder/outInfo/">
<node name="0" path="/mainloop/Recorder/outInfo/0/"><attr key="compression" type="string">NONE</attr>
<attr key="originalModuleName" type="string">capture</attr><attr key="originalOutputName" type="string">events</attr>
<attr key="typeDescription" type="string">Array of events (polarity ON/OFF).</attr>
<attr key="typeIdentifier" type="string">EVTS</attr><node name="info" path="/mainloop/Recorder/outInfo/0/info/">
<attr key="sizeX" type="int">{}</attr><attr key="sizeY" type="int">{}</attr>
<attr key="source" type="string">DAVIS</attr></node></node></node></dv>"""


def write_aedat4(path: Path, events: list[Event], width_px: int, height_px: int) -> None:
    """Write AEDAT4 without compression, 100 events a packet: FlatBuffers as their specification lays them out."""
    streams = AEDAT4_STREAMS.format(width_px, height_px).encode() + b"\0"
    # Offset of the root, identifier; table of field places; table: compression, place of a table of packets, string.
    head = struct.pack("<I4s5H6xiiiqII", 24, b"IOHE", 10, 24, 4, 12, 20, 16, 0, 0, -1, 4, len(streams) - 1) + streams
    out = bytearray(b"#!AER-DAT4.0\r\n" + struct.pack("<I", len(head)) + head)
    for first in range(0, len(events), 100):
        part = events[first : first + 100]
        packet = struct.pack("<I4s3H2xiII", 16, b"EVTS", 6, 8, 4, 8, 4, len(part))
        packet += b"".join(struct.pack("<qhh?3x", t, x, y, on) for t, x, y, on in part)
        out += struct.pack("<III", 0, len(packet) + 4, len(packet)) + packet
    path.write_bytes(bytes(out))


def naive_segments(events: list[Event], run: int) -> tuple[list[Event], int, int]:
    """Events of segments joined to one, how many were stale, and how often the clock was set back."""
    out: list[Event] = []
    stale = resets = shift = count = at = 0
    latest = None  # of the segment, times as in the file
    some_late = False  # of the segment
    while at < len(events):
        t = events[at][0]
        if latest is not None and t < latest - MAX_DISORDER_US:
            following = [event[0] for event in events[at : at + run]]
            in_order = all(b >= max(following[: k + 1]) - MAX_DISORDER_US for k, b in enumerate(following))
            in_order = in_order and sum(b < a for a, b in pairwise(following)) <= run // 2
            if len(following) == run and in_order and max(following) < latest - MAX_DISORDER_US:
                if resets == 0 and count < run and not some_late:
                    stale, out = stale + count, []
                else:
                    resets, shift = resets + 1, shift + latest - t
                latest, count, some_late = t, 0, False
            else:  # late ones, which stay where they are; then the next are looked at
                upto, some_late = min(at + run, len(events)), True
                while at < upto and events[at][0] < latest - MAX_DISORDER_US:
                    out.append((events[at][0] + shift, *events[at][1:]))
                    count, at = count + 1, at + 1
                continue
        latest = t if latest is None else max(latest, t)
        out.append((t + shift, *events[at][1:]))
        count, at = count + 1, at + 1
    return out, stale, resets


def naive_hot_pixels(pixels: list[list[int]]) -> tuple[int, int]:
    """Pixels with 10 events or more and over 10 times those of their second busiest neighbour, and their events."""
    hot = []
    for y, row in enumerate(pixels):
        for x, events in enumerate(row):
            around = [
                pixels[v][u]
                for v in (y - 1, y, y + 1)
                for u in (x - 1, x, x + 1)
                if (v, u) != (y, x) and 0 <= v < len(pixels) and 0 <= u < len(row)
            ]
            if events >= 10 and events > 10 * sorted([0, 0, *around])[-2]:
                hot.append(events)
    return len(hot), sum(hot)
