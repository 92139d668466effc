"""Events of a running camera as ticks: a thread of its own reads, cuts by time, and never waits for the work behind."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..errors import CameraError
from ..events import EventBatch
from ..kernels.time_order import is_in_order
from ..results import Packet
from .clock import now_s
from .event_camera import CameraPacket, EventCamera

# Ticks that wait for the work behind: more than this and the next ones are left out of it, never out of a recording.
MOST_WAITING_US = 2_000_000
RETRY_S = 0.5  # between two attempts to open a camera that was unplugged
# A clock that runs so far ahead of its own last time was set anew: nothing moved for as long is no shot either.
LARGEST_JUMP_US = 60_000_000
# Nothing at all from a camera for so long is said. Before its first event it may be dark, or just have been opened.
LONGEST_SILENCE_S, LONGEST_FIRST_SILENCE_S = 0.4, 2.0
SAID_US = 10_000_000  # between two notices of a fault that goes on

Sink = Callable[[int, EventBatch], None]  # number of the clock and events, from the reading thread
NoticeKind = Literal["unplugged", "back", "clock", "behind", "biases", "recording", "spins", "stall", "size", "lost"]
Notice = Callable[[NoticeKind, str], None]


@dataclass(frozen=True, slots=True, eq=False)
class ArrivedTick:
    """The events of one tick, with when they came.

    Attributes
    ----------
    segment : int
        Number of the stretch without gaps, from 0: another begins with the camera's clock, or after ticks left out.
    clock : int
        Number of the camera's clock, from 0: times of another one say nothing of these.
    first_s, last_s : float
        When the first packet of the tick came and when the tick was complete (`clock.now_s`).
    """

    packet: Packet
    segment: int
    clock: int
    first_s: float
    last_s: float


@dataclass(slots=True)
class StreamCounts:
    """Counts since the start.

    Attributes
    ----------
    events : int
        Events that came.
    dropped : int
        Packets that driver or ring lost.
    outside, late : int
        Events left out because they are beyond the sensor or came after their tick.
    skipped : int
        Ticks left out of the work because it could not keep up.
    end_us : int
        All events before this time have come.
    """

    events: int = 0
    dropped: int = 0
    outside: int = 0
    late: int = 0
    skipped: int = 0
    end_us: int = 0


class EventStream:
    """Reads a camera in a thread of its own.

    Parameters
    ----------
    camera : EventCamera
        Open; the thread alone talks to it from `start` on, and closes it.
    tick_us : int
        Length of a tick.
    reopen : callable, optional
        `reopen(camera) -> EventCamera` opens it anew, as it was, after it was unplugged; without it the stream ends
        with the camera's error.
    sinks : sequence of callable
        `sink(clock, events)` gets all events as they come, in the reading thread: it must not wait.
    on_notice : callable
        Told what kind of thing happens to the camera, and in words.

    Attributes
    ----------
    camera : EventCamera
        The one that is read: another one after it was unplugged. Others may look at its name, biases and options.
    """

    def __init__(
        self,
        camera: EventCamera,
        tick_us: int,
        *,
        reopen: Callable[[EventCamera], EventCamera] | None = None,
        sinks: tuple[Sink, ...] = (),
        on_notice: Notice = lambda kind, text: None,
    ) -> None:
        self.width_px, self.height_px = camera.width_px, camera.height_px
        self.counts = StreamCounts()
        self.camera, self._tick_us, self._reopen, self._sinks = camera, tick_us, reopen, sinks
        self._on_notice = on_notice
        self._most_waiting = max(MOST_WAITING_US // tick_us, 2)
        self._ticks: queue.Queue[ArrivedTick | None] = queue.Queue(self._most_waiting if camera.can_wait else 0)
        self._commands: queue.SimpleQueue[Mapping[str, int]] = queue.SimpleQueue()
        self._error: BaseException | None = None
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._read_all, name="camera", daemon=True)
        self._segment, self._clock, self._skipping = 0, 0, False
        self._said_us: dict[NoticeKind, int] = {}  # when a fault that goes on was said
        self._begin_segment()

    def start(self) -> None:
        """Begin to read."""
        self._thread.start()

    def stop(self) -> None:
        """Have it stop reading; the ticks so far can still be taken."""
        self._stop.set()

    @property
    def is_stopped(self) -> bool:
        """Whether it was told to stop."""
        return self._stop.is_set()

    def set_biases(self, biases: Mapping[str, int]) -> int:
        """Have the reading thread change biases before its next read; what goes wrong becomes a notice.

        Returns the camera's time up to which events had come, us.
        """
        self._commands.put(biases)
        return self.counts.end_us

    @property
    def waiting(self) -> int:
        """Number of ticks that nobody has taken yet."""
        return self._ticks.qsize()

    def ticks(self) -> Iterator[ArrivedTick]:
        """Yield the ticks as they are complete, without gaps within a segment; raises CameraError at a camera's end."""
        while (tick := self._ticks.get()) is not None:
            yield tick
        if self._error is not None:
            raise self._error

    def _begin_segment(self) -> None:
        self._pending: list[EventBatch] = []  # not before the next tick's start
        self._next_us: int | None = None  # start of the next tick; None before the first event
        self._end_us: int | None = None  # of the segment's last packet
        self._first_s: float | None = None  # when the first packet of the next tick came
        self._silent_s, self._is_silence_said = 0.0, False

    def join(self) -> None:
        """Wait until the camera is closed."""
        self._thread.join()

    def _read_all(self) -> None:
        """Body of the thread."""
        try:
            while not self._stop.is_set():
                self._obey()
                asked_s = now_s()
                try:
                    packet = self.camera.read()
                except CameraError as error:
                    if self._reopen is None:
                        raise
                    self._wait_for_return(error)
                    continue
                if packet is None:
                    break
                self._mind_silence(packet, now_s() - asked_s)
                self._take(packet)
            self._obey()  # what was asked for before the end: a sweep's former biases
        except Exception as error:  # noqa: BLE001  handed to the thread that takes the ticks
            self._error = error
        finally:
            self._finish_segment()
            self._ticks.put(None)
            self.camera.close()

    def _obey(self) -> None:
        while not self._commands.empty():
            try:
                self.camera.set_biases(self._commands.get())
            except CameraError as error:
                self._on_notice("biases", str(error))

    def _wait_for_return(self, error: CameraError) -> None:
        """Open the camera anew as soon as it is back."""
        assert self._reopen is not None
        self._on_notice("unplugged", f"{error}; waiting for it")
        self._next_clock()
        self.camera.close()
        while not self._stop.wait(RETRY_S):
            try:
                self.camera = self._reopen(self.camera)
            except CameraError:
                continue
            self._on_notice("back", "the camera is back")
            return

    def _mind_silence(self, packet: CameraPacket, seconds: float) -> None:
        """Say it when nothing comes from the camera, not even the time, and when it sends again."""
        self._silent_s += seconds
        is_over = self._end_us is None or packet.end_us != self._end_us
        most_s = LONGEST_FIRST_SILENCE_S if self._next_us is None else LONGEST_SILENCE_S
        if self._silent_s > most_s:
            where = "its cable" if self._next_us is not None else "its lens cap, its cable"
            # By this computer's clock: the camera's stands still.
            self._is_silence_said |= self._say_fault(
                "stall",
                round(now_s() * 1e6),
                f"nothing came from the camera for {self._silent_s:.1f} s: look at {where} and what else keeps this "
                "computer busy",
            )
        if is_over:
            if self._is_silence_said:
                self._on_notice("back", f"the camera sends again, after {self._silent_s:.1f} s")
            self._silent_s, self._is_silence_said = 0.0, False

    def _say_fault(self, kind: NoticeKind, now_us: int, text: str) -> bool:
        """Say a fault of the camera, not each time that it shows; whether it was said."""
        said_us = self._said_us.get(kind)
        if said_us is None or not 0 <= now_us - said_us < SAID_US:
            self._said_us[kind] = now_us
            self._on_notice(kind, text)
            return True
        return False

    def _take(self, packet: CameraPacket) -> None:
        """Take a packet of the camera: hand it to the sinks, and cut it into ticks."""
        came_s, counts, events = now_s(), self.counts, packet.events
        count = len(events)
        if self._end_us is not None and not 0 <= packet.end_us - self._end_us <= LARGEST_JUMP_US:
            self._on_notice(
                "clock",
                f"the camera's clock went from {self._end_us} to {packet.end_us} us: a shot in flight ends here",
            )
            self._next_clock()
        counts.dropped += packet.dropped
        counts.outside += packet.outside
        counts.events += count
        if packet.dropped:
            self._say_fault(
                "lost",
                packet.end_us,
                f"packets that the driver lost: {counts.dropped} so far, gaps in track and recording: have fewer "
                "events by biases, --roi or --most-mev-s",
            )
        if packet.outside:
            self._say_fault(
                "size",
                packet.end_us,
                f"events beyond the sensor of {self.width_px} x {self.height_px} px, left out: {counts.outside} so "
                "far: the camera states a wrong size: unplug it and plug it in again",
            )
        if not is_in_order(events.t_us):
            events = events[np.argsort(events.t_us, kind="stable")]
        for sink in self._sinks:
            sink(self._clock, events)
        if count:
            self._keep_for_ticks(events)
        if self._first_s is None:
            self._first_s = came_s
        self._end_us = counts.end_us = packet.end_us
        while self._next_us is not None and packet.end_us >= self._next_us + self._tick_us:
            self._cut(self._next_us + self._tick_us, came_s)

    def _keep_for_ticks(self, events: EventBatch) -> None:
        """Keep events until their tick is complete; those of a tick that is over are left out and counted."""
        counts = self.counts
        if self._next_us is None:
            self._next_us = int(events.t_us[0]) // self._tick_us * self._tick_us
        if events.t_us[0] < self._next_us:
            on_time = events.between(self._next_us, 2**63 - 1)
            counts.late += len(events) - len(on_time)
            events = on_time
        if len(events):
            self._pending.append(events)

    def _cut(self, end_us: int, came_s: float) -> None:
        """Hand over the tick that ends at a time."""
        start_us = self._next_us
        assert start_us is not None
        events = EventBatch.concatenate(self._pending)
        count = int(events.t_us.searchsorted(end_us))
        own, rest = events[:count], events[count:]
        first_s = came_s if self._first_s is None else self._first_s
        self._pending, self._first_s = ([rest], came_s) if len(rest) else ([], None)
        self._next_us = end_us
        is_behind = not self.camera.can_wait and self.waiting > self._most_waiting
        if is_behind or (self._skipping and self.waiting):
            if not self._skipping:
                self._on_notice("behind", "the work cannot keep up: events are left out of it until it has caught up")
                self._segment += 1  # what follows the gap
            self._skipping = True
            self.counts.skipped += 1
            return
        self._skipping = False
        packet = Packet(start_us // self._tick_us, start_us, end_us, own)
        self._ticks.put(ArrivedTick(packet, self._segment, self._clock, first_s, came_s))

    def _finish_segment(self) -> None:
        """Hand over what is left of a segment as its last tick, cut short after the last event."""
        if self._next_us is not None and self._pending:
            last_us = int(self._pending[-1].t_us[-1])
            while last_us >= self._next_us + self._tick_us:
                self._cut(self._next_us + self._tick_us, now_s())
            if self._pending:
                self._cut(last_us + 1, now_s())
        self._begin_segment()

    def _next_clock(self) -> None:
        self._finish_segment()
        self._segment += 1
        self._clock += 1
