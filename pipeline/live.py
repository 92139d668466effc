"""Live run: the chain over a running camera, its tracker in a thread and the spins in a process behind it.

The same stages with the same packets as for a recording, so that the same events give the same results. What the
machine cannot keep up with is left out in whole stretches and counted, and shots do not go on over such a gap. The spin
of a shot so far is told while the ball flies and as soon as its end is known; the shot's final one follows.
"""

from __future__ import annotations

import gc
import queue
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from itertools import chain as joined
from pathlib import Path

import numpy as np

from .cameras import ArrivedTick, EventCamera, EventStream, Notice
from .cameras.clock import now_s
from .chain import Chain
from .errors import CameraError, ParameterError
from .event_source import EventsInMemory
from .events import EventBatch
from .live_outputs import LiveBall, LiveNotice, LiveOutput, LiveShot, LiveStatus
from .live_spins import SWITCH_S, SegmentStart, SpinRun, TrackedTick, load_stages
from .recordings.formats.prophesee_raw.writer import RawWriter
from .recordings.in_memory import RecordingInMemory
from .registry import STAGES, Parameters
from .results import Packet
from .session import Choices, Session, method_targets
from .spin_process import SpinProcess, loaded_kernels
from .stages.track_extension import EXTENDED_US
from .tick import Tick

STATUS_S = 1.0
# Results of the recording that stages of one ball need: a full frame a tick would fill the memory behind a slow spin.
NEEDED_BY_BALLS = frozenset({"track"}).union(*(stage.inputs for stage in STAGES if stage.scope == "ball"))


def session_of(camera: EventCamera, choices: Choices) -> Session:
    """A session without events for a camera: parameters, optics and ball as they are for a recording."""
    nothing = RecordingInMemory(EventBatch.empty(), camera.width_px, camera.height_px)
    source = EventsInMemory(("live",), EventBatch.empty(), camera.width_px, camera.height_px, 0, 0)
    session = Session(nothing, source, choices.parameters(), Chain(source))
    if choices.fixed_ball == "auto":
        raise ParameterError("a running camera needs the fixed ball's circle: give --fixed-ball X_PX Y_PX RADIUS_PX")
    session.place_fixed_ball(choices.fixed_ball)
    return session


def raw_file(path: Path, width_px: int, height_px: int, attributes: Mapping[str, str | float]) -> RawWriter:
    """A new RAW file for a `Recorder`; raises OSError or RecordingError."""
    return RawWriter(path, path, width_px, height_px, attributes)


def load_kernels() -> None:
    """Have the kernels in memory before the first shot: the tracker's here, all in the process of the spins."""
    with loaded_kernels():
        load_stages(("track",))


def _needed_by_balls(tick: Tick) -> Tick:
    """The part of a tick that the spins of its balls need."""
    return Tick({name: tick.results[name] for name in tick.results if name in NEEDED_BY_BALLS}, tick.packet, ())


def _of_no_ball(one: TrackedTick) -> TrackedTick:
    """The part of a tick that is needed where no shot has part in it."""
    track, packet = one.tick.track, replace(one.tick.packet, events=EventBatch.empty())
    return one._replace(tick=Tick({"track": track}, packet, ()))


class _HeldTicks:
    """Ticks without a ball that are held until it is known whether a shot found later begins in them."""

    def __init__(self) -> None:
        self._ticks = deque[TrackedTick]()

    def passed(self, one: TrackedTick) -> Iterator[TrackedTick]:
        """The ticks up to the next one that are held no longer, with events where a shot has part in them."""
        self._ticks.append(one)
        track, end_us = one.tick.track, one.tick.packet.end_us
        if track.balls or track.ended:
            begins_us = min((ball.start_us for ball in track.balls if ball.earlier), default=end_us)
            while len(self._ticks) > 1:
                held = self._ticks.popleft()
                yield held if held.tick.packet.end_us > begins_us else _of_no_ball(held)
            yield self._ticks.popleft()
        while self._ticks and self._ticks[0].tick.packet.end_us <= end_us - EXTENDED_US:
            yield _of_no_ball(self._ticks.popleft())

    def rest(self) -> Iterator[TrackedTick]:
        """The ticks that are still held: no ball comes any more."""
        while self._ticks:
            yield _of_no_ball(self._ticks.popleft())


class _Ticks:
    """A stream's ticks, segment by segment; `ended` when there are no more."""

    def __init__(self, ticks: Iterator[ArrivedTick]) -> None:
        self._ticks, self._next = ticks, deque[ArrivedTick]()
        self.ended = False

    def segment(self, is_over: Callable[[], bool] = lambda: False) -> Iterator[ArrivedTick]:
        """Yield the ticks up to the next gap or the end, or until `is_over`."""
        number = None
        for one in joined(tuple(self._next), self._ticks):
            self._next.clear()
            if number is not None and (one.segment != number or is_over()):
                self._next.append(one)
                return
            number = one.segment
            yield one
        self.ended = True


class LiveRun:
    """The chain over a stream of events.

    Parameters
    ----------
    stream : callable
        `stream(tick_us, on_notice) -> EventStream`, not started yet.
    parameters : Parameters
        Values of all stages.
    method : str
        Name of one spin method, or "all".
    with_balls : bool
        Whether to give every tick's balls and spins, too.
    on_tick : callable, optional
        `on_tick(arrived, tick, latency_ms)` gets every tracked tick, in the tracker's thread: it must not wait.
    """

    def __init__(
        self,
        stream: Callable[[int, Notice], EventStream],
        parameters: Parameters,
        method: str = "all",
        *,
        with_balls: bool = False,
        on_tick: Callable[[ArrivedTick, Tick, float], None] | None = None,
    ) -> None:
        self._outputs: queue.SimpleQueue[LiveOutput | BaseException | None] = queue.SimpleQueue()
        self.stream = stream(parameters.track.tick_us, lambda kind, text: self._outputs.put(LiveNotice(kind, text)))
        self.parameters = parameters
        self._with_balls, self._on_tick = with_balls, on_tick
        size, tick_us = (self.stream.width_px, self.stream.height_px), parameters.track.tick_us
        spin_run = SpinRun(method_targets(method), with_balls, *size, tick_us)
        self._spins = SpinProcess(spin_run, self._put)
        self._untaken: deque[LiveShot] = deque()  # which the consumer of the outputs has not done with yet
        self._latencies_ms: deque[float] = deque()
        self._events_before = 0
        self._abandoned = threading.Event()

    def outputs(self) -> Iterator[LiveOutput]:
        """Run until the camera ends or `stop`, yielding what becomes known; raises CameraError at a camera's end."""
        tracker = threading.Thread(target=self._guarded, args=(self._track,), name="tracker", daemon=True)
        self._spins.start()
        switch_s = sys.getswitchinterval()
        sys.setswitchinterval(SWITCH_S)
        # Nobody looks for garbage among what is there already: that takes 0.1 s in which no thread works.
        was_frozen = gc.get_freeze_count() > 0
        gc.collect()
        gc.freeze()
        self.stream.start()
        tracker.start()
        last_status_s = now_s()
        next_status_s = last_status_s + STATUS_S
        try:
            while True:
                if (now := now_s()) >= next_status_s:  # also when outputs wait: their consumer may be slow
                    yield self._status(now - last_status_s)
                    last_status_s = now
                    next_status_s += STATUS_S * (1 + (now - next_status_s) // STATUS_S)
                output: LiveOutput | BaseException | None = None
                try:
                    output = self._outputs.get(timeout=max(next_status_s - now_s(), 0.0))
                except queue.Empty:
                    continue
                if output is None:
                    break
                if isinstance(output, BaseException):
                    raise output
                yield output
                if isinstance(output, LiveShot):
                    self._untaken.popleft()
        finally:
            self.stop()
            if sys.exc_info()[0] is not None:  # nobody takes the rest
                self.abandon()
            tracker.join()
            self._spins.join()
            self.stream.join()
            if not was_frozen:  # what the program has frozen itself stays so
                gc.unfreeze()
            sys.setswitchinterval(switch_s)
        yield self._status(now_s() - last_status_s)

    def stop(self) -> None:
        """Have the run end after what has come so far."""
        self.stream.stop()

    def abandon(self) -> None:
        """Have the run end at once, with what is answered so far."""
        self._abandoned.set()
        self.stop()
        self._spins.abandon()

    def end(self) -> None:
        """Have the run end after what has come so far; at once where it does already."""
        if self.is_ending:
            self.abandon()
        else:
            self.stop()

    @property
    def is_ending(self) -> bool:
        """Whether it ends after what has come so far, as `stop` has it, or as no more comes."""
        return self.stream.is_stopped and not self._abandoned.is_set()

    @property
    def shots_waiting(self) -> int:
        """Number of the shots so far, as the tracker has them, without their final spin."""
        return self._spins.shots_waiting

    @property
    def needed_since(self) -> tuple[int, int] | None:
        """Clock and time from which on shots are without their final spin, or not taken from the outputs yet."""
        times = list[tuple[int, int]]()
        if (tick := self._spins.unanswered) is not None:
            times.append((tick.clock, tick.tick.packet.start_us))
        with suppress(IndexError):
            times.append((self._untaken[0].clock, self._untaken[0].shot.start_us))
        return min(times, default=None)

    def _put(self, output: LiveOutput | BaseException | None) -> None:
        """Hand over an output of the spins."""
        if isinstance(output, LiveShot):
            self._untaken.append(output)
        self._outputs.put(output)

    def take_parameters(self, parameters: Parameters) -> None:
        """Have the run go on with other parameters from its next tick on; a shot in flight ends there.

        Raises ParameterError for values that do not go together, and for ticks of another length.
        """
        tick_us = self.parameters.track.tick_us
        if parameters.track.tick_us != tick_us:
            raise ParameterError(
                f"track.tick_us = {parameters.track.tick_us} cannot be changed while the camera runs: it is {tick_us}"
            )
        self._new_chain().check(parameters)
        self.parameters = parameters

    def _guarded(self, work: Callable[[], None]) -> None:
        """Body of a thread; its error ends the run."""
        try:
            work()
        except Exception as error:  # noqa: BLE001  handed to the thread that takes the outputs
            self._abandoned.set()
            self._outputs.put(error)

    def _track(self) -> None:
        """Track the balls, tick by tick; whatever comes, the stream is emptied and the spins' end is told."""
        coming = _Ticks(self.stream.ticks())
        try:
            while not (coming.ended or self._abandoned.is_set()):
                self._track_segment(coming)
        finally:
            self.stop()
            with suppress(CameraError):
                while not coming.ended:
                    for _ in coming.segment():
                        pass
            self._spins.put(None)

    def _new_chain(self) -> Chain:
        """A chain for one segment."""
        width_px, height_px = self.stream.width_px, self.stream.height_px
        return Chain(EventsInMemory(("live",), EventBatch.empty(), width_px, height_px, 0, 0))

    def _track_segment(self, coming: _Ticks) -> None:
        """Track the ticks up to the next gap. The stages' memory is there before the first one comes."""
        at_work, chain, parameters = deque[ArrivedTick](), self._new_chain(), self.parameters
        held = _HeldTicks()
        self._spins.put(SegmentStart(parameters))

        def packets() -> Iterator[Packet]:
            for one in coming.segment(lambda: self.parameters is not parameters):
                if self._abandoned.is_set():
                    return
                at_work.append(one)
                yield one.packet

        for tick in chain.follow(parameters, packets(), ("track",), forget=STAGES.names):
            one = at_work.popleft()
            latency_ms = (now_s() - one.first_s) * 1e3
            self._latencies_ms.append(latency_ms)
            for tracked in held.passed(TrackedTick(_needed_by_balls(tick), one.clock, one.first_s, one.last_s)):
                self._spins.put(tracked)
            if self._with_balls:
                for ball in tick.track.balls:
                    self._outputs.put(LiveBall(ball, latency_ms))
            if self._on_tick is not None:
                self._on_tick(one, tick, latency_ms)
        for tracked in held.rest():
            self._spins.put(tracked)

    def _status(self, seconds: float) -> LiveStatus:
        counts, tick_ms = self.stream.counts, self.parameters.track.tick_us / 1e3
        events, before, self._events_before = counts.events, self._events_before, counts.events
        latencies = [self._latencies_ms.popleft() for _ in range(len(self._latencies_ms))]
        p50_ms, p99_ms = np.percentile(latencies, [50, 99]).tolist() if latencies else (None, None)
        return LiveStatus(
            events=events,
            rate_mev_s=(events - before) * 1e-6 / max(seconds, 1e-3),
            dropped=counts.dropped,
            outside=counts.outside,
            late=counts.late,
            skipped=counts.skipped,
            backlog_ms=self.stream.waiting * tick_ms,
            spin_backlog_ms=self._spins.waiting * tick_ms,
            p50_ms=p50_ms,
            p99_ms=p99_ms,
        )
