"""Live run: the chain over a running camera, its tracker ahead in one thread and the spins behind it in others.

The same stages with the same packets as for a recording, so that the same events give the same results. What the
machine cannot keep up with is left out in whole stretches and counted, and shots do not go on over such a gap. The spin
of a shot so far is told while the ball flies and as soon as its end is known; the shot's final one follows.
"""

from __future__ import annotations

import os
import queue
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from itertools import chain as joined
from itertools import groupby
from pathlib import Path
from typing import NamedTuple

import numpy as np

from .cameras import ArrivedTick, EventCamera, EventStream
from .cameras.clock import now_s
from .chain import Chain
from .errors import CameraError, ParameterError
from .event_source import EventsInMemory
from .events import EventBatch
from .live_outputs import LiveBall, LiveNotice, LiveOutput, LiveShot, LiveSpin, LiveStatus
from .recordings import RawWriter
from .recordings.in_memory import RecordingInMemory
from .registry import STAGES, Parameters, needed_stages, quick_stages
from .results import Packet
from .session import SAMPLES, Choices, Session, method_targets
from .shots import ShotLog
from .spin_so_far import ContrastInFlight, SpinsInFlight
from .stages.track_result import EndedBy
from .tick import Tick

STATUS_S = 1.0
# Ticks with a ball that wait for their spins, at the most; then the tracker waits, too: 3 s of flight at 200 Hz, which
# at 5 Mev/s is some 600 MB. Ticks without a ball are next to nothing.
MOST_FLYING = 600
MOST_HELD = 100  # ticks held back from the final spins while a ball is in flight: longer than most shots
ROOM_S = 0.1  # between two looks whether the run is over while the tracker waits for room
ARRIVALS_KEPT = 4000  # ticks whose arrival is remembered: 20 s at 200 Hz, longer than any shot's end takes to be known
# Python lets a thread run for 5 ms while another waits; with the tick's work in five threads that is many ticks.
SWITCH_S = 0.0005
# A half and a third of the tracker's share where they want one core.
SO_FAR_NICENESS, FINAL_NICENESS = 3, 5
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
    """Run all stages over shots with a contact and with two balls, so that no kernel is loaded in the first shot."""
    for sample in ("bounce.h5", "two_balls.h5"):
        Session.open(SAMPLES / "own" / sample).estimate()


def _yield_to_others(niceness: int) -> None:
    """Let threads that matter more go first on a busy machine, where that can be said of this thread alone."""
    if sys.platform == "linux":
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), niceness)


def _without_events(packet: Packet) -> Packet:
    return replace(packet, events=EventBatch.empty())


class _Tracked(NamedTuple):
    """A tick with its track, and what it was tracked with: another chain for each segment and set of parameters."""

    arrived: ArrivedTick
    chain: Chain
    parameters: Parameters
    tick: Tick


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
        stream: Callable[[int, Callable[[str], None]], EventStream],
        parameters: Parameters,
        method: str = "all",
        *,
        with_balls: bool = False,
        on_tick: Callable[[ArrivedTick, Tick, float], None] | None = None,
    ) -> None:
        self._outputs: queue.SimpleQueue[LiveOutput | BaseException | None] = queue.SimpleQueue()
        self.stream = stream(parameters.track.tick_us, lambda text: self._outputs.put(LiveNotice(text)))
        self.parameters = parameters
        self._targets, self._with_balls, self._on_tick = method_targets(method), with_balls, on_tick
        needed = {stage.name for stage in needed_stages(self._targets)}
        self._has_contrast = "contrast" in needed
        # Beside contrast maximisation only what it asks for: each further stage has it come later.
        so_far = STAGES["contrast"].inputs if self._has_contrast else needed
        self._quick = tuple(stage.name for stage in needed_stages(so_far) if stage.name in quick_stages())
        self._tracked: queue.SimpleQueue[_Tracked | None] = queue.SimpleQueue()
        self._told: queue.SimpleQueue[_Tracked | None] = queue.SimpleQueue()
        self._room = threading.Semaphore(MOST_FLYING)
        self._latencies_ms: deque[float] = deque()
        self._arrivals: deque[tuple[int, float]] = deque(maxlen=ARRIVALS_KEPT)  # (end of the tick, its arrival)
        self._events_before = 0
        self._abandoned = threading.Event()

    def outputs(self) -> Iterator[LiveOutput]:
        """Run until the camera ends or `stop`, yielding what becomes known; raises CameraError at a camera's end."""
        threads = [
            threading.Thread(target=self._guarded, args=(work,), name=name, daemon=True)
            for name, work in (("tracker", self._track), ("spin so far", self._spin_so_far), ("spin", self._spin))
        ]
        switch_s = sys.getswitchinterval()
        sys.setswitchinterval(SWITCH_S)
        self.stream.start()
        for thread in threads:
            thread.start()
        next_status_s = now_s() + STATUS_S
        try:
            while True:
                output: LiveOutput | BaseException | None = None
                try:
                    output = self._outputs.get(timeout=max(next_status_s - now_s(), 0.0))
                except queue.Empty:
                    next_status_s += STATUS_S
                    yield self._status(STATUS_S)
                    continue
                if output is None:
                    break
                if isinstance(output, BaseException):
                    raise output
                yield output
        finally:
            self.stop()
            if sys.exc_info()[0] is not None:  # nobody takes the rest
                self._abandoned.set()
            for thread in threads:
                thread.join()
            self.stream.join()
            sys.setswitchinterval(switch_s)
        yield self._status(STATUS_S - max(next_status_s - now_s(), 0.0))

    def stop(self) -> None:
        """Have the run end after what has come so far."""
        self.stream.stop()

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
        """Track the balls, tick by tick; whatever comes, the stream is emptied and the spin's thread ended."""
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
            self._tracked.put(None)

    def _new_chain(self) -> Chain:
        """A chain for one segment."""
        width_px, height_px = self.stream.width_px, self.stream.height_px
        return Chain(EventsInMemory(("live",), EventBatch.empty(), width_px, height_px, 0, 0))

    def _track_segment(self, coming: _Ticks) -> None:
        """Track the ticks up to the next gap. The stages' memory is there before the first one comes."""
        at_work, chain, parameters = deque[ArrivedTick](), self._new_chain(), self.parameters

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
            self._arrivals.append((one.packet.end_us, one.last_s))
            if self._with_balls:
                for ball in tick.track.balls:
                    self._outputs.put(LiveBall(ball, latency_ms))
            if self._on_tick is not None:
                self._on_tick(one, tick, latency_ms)
            arrived = replace(one, packet=_without_events(one.packet))
            self._tracked.put(_Tracked(arrived, chain, parameters, self._kept(tick)))

    def _kept(self, tick: Tick) -> Tick:
        """The part of a tick that the spins need, as soon as there is room for it."""
        if not tick.track.balls:
            return Tick({"track": tick.track}, _without_events(tick.packet), ())
        while not self._room.acquire(timeout=ROOM_S) and not self._abandoned.is_set():
            pass
        needed = {name: tick.results[name] for name in tick.results if name in NEEDED_BY_BALLS}
        return Tick(needed, tick.packet, ())

    def _spin_so_far(self) -> None:
        """Tell the spins of shots in flight, and of those that end; hands its ticks on, whatever comes."""
        _yield_to_others(SO_FAR_NICENESS)
        coming = iter(self._tracked.get, None)
        try:
            for _, rows in groupby(coming, lambda row: row.chain):
                self._follow_segment(rows)
        finally:
            for row in coming:
                self._told.put(row)
            self._told.put(None)

    def _follow_segment(self, rows: Iterator[_Tracked]) -> None:
        first = next(rows)
        spins = SpinsInFlight()
        contrast = ContrastInFlight(first.parameters, first.chain, spins)
        thread = threading.Thread(target=self._contrast_so_far, args=(contrast,), name="contrast so far", daemon=True)
        thread.start()
        try:
            self._tell(first, rows, spins, contrast)
        finally:
            contrast.close()
            thread.join()

    def _tell(
        self, first: _Tracked, rows: Iterator[_Tracked], spins: SpinsInFlight, contrast: ContrastInFlight
    ) -> None:
        """Tell the spins so far of one segment, and hand its ticks on."""
        log, row, held = ShotLog(), first, list[_Tracked]()
        for row in self._answered(first, rows, first.chain, self._quick):
            for ball in row.tick.balls:
                spins.add_tick(ball)
                if self._with_balls:
                    latency_ms = (now_s() - row.arrived.first_s) * 1e3
                    self._put_spin(spins, ball.track.shot, ball.packet.end_us, None, latency_ms)
            if self._has_contrast:
                contrast.put(row.tick.balls)
            log.add(row.tick)
            self._announce(log, spins, row.arrived)
            spins.keep_only(ball.track.shot for ball in row.tick.balls)
            held.append(row)
            if not row.tick.balls or len(held) == MOST_HELD:
                self._hand_on(held)
        log.close()
        self._announce(log, spins, row.arrived)
        self._hand_on(held)

    def _hand_on(self, held: list[_Tracked]) -> None:
        """Let the final spins be worked on, which share Python's lock, when no ball is in flight."""
        for row in held:
            self._told.put(row)
        held.clear()

    def _contrast_so_far(self, contrast: ContrastInFlight) -> None:
        _yield_to_others(SO_FAR_NICENESS)
        self._guarded(contrast.work)

    def _answered(
        self, first: _Tracked, rows: Iterator[_Tracked], chain: Chain, targets: tuple[str, ...]
    ) -> Iterator[_Tracked]:
        """The rows of one segment with the results of stages of one ball."""
        at_work = deque[_Tracked]()

        def tracked() -> Iterator[Tick]:
            for row in joined([first], rows):
                if self._abandoned.is_set():
                    return
                at_work.append(row)
                yield row.tick

        for tick in chain.answer(first.parameters, tracked(), targets, forget=STAGES.names):
            yield at_work.popleft()._replace(tick=tick)

    def _announce(self, log: ShotLog, spins: SpinsInFlight, arrived: ArrivedTick) -> None:
        for shot in log.take_ended():
            self._put_spin(spins, shot.number, shot.end_us, shot.ended_by, self._since_end_ms(shot.end_us, arrived))

    def _put_spin(
        self, spins: SpinsInFlight, shot: int, end_us: int, ended_by: EndedBy | None, latency_ms: float
    ) -> None:
        spin = spins.newest(shot, end_us)
        if spin is not None:
            self._outputs.put(LiveSpin(shot, end_us, spin, ended_by, latency_ms))

    def _spin(self) -> None:
        """Answer the shots' spins, segment by segment; whatever comes, the tracker does not wait for ever."""
        _yield_to_others(FINAL_NICENESS)
        coming = self._taken()
        try:
            for _, rows in groupby(coming, lambda row: row.chain):
                self._spin_segment(rows)
        finally:
            for _ in coming:
                pass
            self._outputs.put(None)

    def _taken(self) -> Iterator[_Tracked]:
        """The ticks whose spins so far are told, in order."""
        while (row := self._told.get()) is not None:
            if row.tick.track.balls:
                self._room.release()
            yield row

    def _spin_segment(self, rows: Iterator[_Tracked]) -> None:
        first = next(rows)
        log, row = ShotLog(), first
        for row in self._answered(first, rows, self._new_chain(), self._targets):
            log.add(row.tick)
            self._put_shots(log, row.arrived)
        log.close()
        self._put_shots(log, row.arrived)

    def _put_shots(self, log: ShotLog, arrived: ArrivedTick) -> None:
        for shot in log.take_ended():
            latency_ms = self._since_end_ms(shot.end_us, arrived)
            self._outputs.put(LiveShot(shot, arrived.clock, arrived.packet.end_us, latency_ms))

    def _since_end_ms(self, end_us: int, arrived: ArrivedTick) -> float:
        """Milliseconds since the last events of a shot came."""
        came_s = next((last_s for upto_us, last_s in list(self._arrivals) if upto_us >= end_us), arrived.last_s)
        return (now_s() - came_s) * 1e3

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
            spin_backlog_ms=(self._tracked.qsize() + self._told.qsize()) * tick_ms,
            p50_ms=p50_ms,
            p99_ms=p99_ms,
        )
