"""Live run: the chain over a running camera, its tracker ahead in one thread and the spin behind it in another.

The same stages with the same packets as for a recording, so that the same events give the same results. What the
machine cannot keep up with is left out in whole stretches and counted, and shots do not go on over such a gap.
"""

from __future__ import annotations

import os
import queue
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from itertools import chain as joined
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from .camera import Camera
from .cameras import ArrivedTick, EventCamera, EventStream
from .cameras.clock import now_s
from .chain import Chain, EventsInMemory, Tick
from .errors import CameraError, ParameterError
from .events import EventBatch
from .recordings import RawWriter
from .recordings.in_memory import RecordingInMemory
from .registry import STAGES, Parameters
from .results import Packet
from .session import SAMPLES, Choices, Session, method_targets
from .shots import Shot, ShotLog
from .stages.track_result import BallTrack

STATUS_S = 1.0
# Ticks with a ball that wait for their spins, at the most; then the tracker waits, too: 3 s of flight at 200 Hz, which
# at 5 Mev/s is some 600 MB. Ticks without a ball are next to nothing.
MOST_FLYING = 600
ARRIVALS_KEPT = 4000  # ticks whose arrival is remembered: 20 s at 200 Hz, longer than any shot's end takes to be known
SPIN_NICENESS = 5  # a third of the tracker's share where both want one core
# Results of the recording that stages of one ball need: a full frame a tick would fill the memory behind a slow spin.
NEEDED_BY_BALLS = frozenset({"track"}).union(*(stage.inputs for stage in STAGES if stage.scope == "ball"))


@dataclass(frozen=True, slots=True, eq=False)
class LiveBall:
    """A ball in view as soon as the tracker knows it, for robots.

    Attributes
    ----------
    track : BallTrack
        Its state.
    latency_ms : float
        From the arrival of the tick's first events to this.
    """

    track: BallTrack
    latency_ms: float

    def to_dict(self) -> dict[str, Any]:
        """The object of a line of JSON."""
        x, y, vx, vy, radius = self.track.mean.tolist()
        state = {"x_px": x, "y_px": y, "radius_px": radius, "vx_px_s": vx, "vy_px_s": vy}
        about = {"shot": self.track.shot, "t_us": self.track.t_us, "measured": self.track.measured is not None}
        return {"ball": {**about, **state, "latency_ms": self.latency_ms}}


@dataclass(frozen=True, slots=True, eq=False)
class LiveSpin:
    """Spin of a ball in flight, from its shot so far.

    Attributes
    ----------
    shot, t_us : int
        Number of the shot, and end of its tick.
    vector_rps : (3,) float64
        Of the method that is trusted.
    best : str
        That method.
    latency_ms : float
        From the arrival of the tick's first events to this.
    """

    shot: int
    t_us: int
    vector_rps: np.ndarray[Any, np.dtype[np.float64]]
    best: str
    latency_ms: float

    def to_dict(self) -> dict[str, Any]:
        """The object of a line of JSON."""
        spin = {"vector_rps": self.vector_rps.tolist(), "best": self.best, "latency_ms": self.latency_ms}
        return {"spin": {"shot": self.shot, "t_us": self.t_us, **spin}}


@dataclass(frozen=True, slots=True, eq=False)
class LiveShot:
    """A shot that has ended.

    Attributes
    ----------
    shot : Shot
        As of a recording.
    clock : int
        Number of the camera's clock, from 0, that its times are of.
    recorded_us : int
        Time up to which events had been taken when the end was known.
    latency_ms : float
        From the arrival of the shot's last events to this; 0 where the camera ended with the shot.
    """

    shot: Shot
    clock: int
    recorded_us: int
    latency_ms: float

    def to_dict(self, camera: Camera, ball_radius_m: float) -> dict[str, Any]:
        """The object of a line of JSON: as `analyze` writes a shot, with the attributes above."""
        written = self.shot.to_dict(camera, ball_radius_m)
        return {**written, "clock": self.clock, "recorded_us": self.recorded_us, "latency_ms": self.latency_ms}


@dataclass(frozen=True, slots=True)
class LiveStatus:
    """State of the last second.

    Attributes
    ----------
    events : int
        Events since the start.
    rate_mev_s : float
        Millions of events a second.
    dropped, outside, late, skipped : int
        As of `StreamCounts`, since the start.
    backlog_ms : float
        Events that came and are not tracked yet.
    spin_backlog_ms : float
        Those that are tracked and have no spin yet.
    p50_ms, p99_ms : float, optional
        Latencies from the arrival of a tick's first events to its track; None without ticks.
    """

    events: int
    rate_mev_s: float
    dropped: int
    outside: int
    late: int
    skipped: int
    backlog_ms: float
    spin_backlog_ms: float
    p50_ms: float | None
    p99_ms: float | None

    def to_dict(self) -> dict[str, Any]:
        """The object of a line of JSON."""
        return {"status": asdict(self)}


@dataclass(frozen=True, slots=True)
class LiveNotice:
    """Sentence for people about the camera or the work."""

    text: str

    def to_dict(self) -> dict[str, Any]:
        """The object of a line of JSON."""
        return {"notice": self.text}


LiveOutput = LiveBall | LiveSpin | LiveShot | LiveStatus | LiveNotice


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


def _without_events(packet: Packet) -> Packet:
    return replace(packet, events=EventBatch.empty())


class _Ticks:
    """A stream's ticks, segment by segment; `ended` when there are no more."""

    def __init__(self, ticks: Iterator[ArrivedTick]) -> None:
        self._ticks, self._next = ticks, deque[ArrivedTick]()
        self.ended = False

    def segment(self) -> Iterator[ArrivedTick]:
        """Yield the ticks up to the next gap or the end."""
        number = None
        for one in joined(tuple(self._next), self._ticks):
            self._next.clear()
            if number is not None and one.segment != number:
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
        self._tracked: queue.SimpleQueue[tuple[ArrivedTick, Chain, Tick] | None] = queue.SimpleQueue()
        self._room = threading.Semaphore(MOST_FLYING)
        self._latencies_ms: deque[float] = deque()
        self._arrivals: deque[tuple[int, float]] = deque(maxlen=ARRIVALS_KEPT)  # (end of the tick, its arrival)
        self._events_before = 0
        self._abandoned = threading.Event()

    def outputs(self) -> Iterator[LiveOutput]:
        """Run until the camera ends or `stop`, yielding what becomes known; raises CameraError at a camera's end."""
        threads = [
            threading.Thread(target=self._guarded, args=(work,), name=name, daemon=True)
            for name, work in (("tracker", self._track), ("spin", self._spin))
        ]
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
        yield self._status(STATUS_S - max(next_status_s - now_s(), 0.0))

    def stop(self) -> None:
        """Have the run end after what has come so far."""
        self.stream.stop()

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

    def _track_segment(self, coming: _Ticks) -> None:
        """Track the ticks up to the next gap. The stages' memory is there before the first one comes."""
        at_work = deque[ArrivedTick]()
        width_px, height_px = self.stream.width_px, self.stream.height_px
        chain = Chain(EventsInMemory(("live",), EventBatch.empty(), width_px, height_px, 0, 0))

        def packets() -> Iterator[Packet]:
            for one in coming.segment():
                if self._abandoned.is_set():
                    return
                at_work.append(one)
                yield one.packet

        for tick in chain.follow(self.parameters, packets(), ("track",), forget=STAGES.names):
            one = at_work.popleft()
            latency_ms = (now_s() - one.first_s) * 1e3
            self._latencies_ms.append(latency_ms)
            self._arrivals.append((one.packet.end_us, one.last_s))
            if self._with_balls:
                for ball in tick.track.balls:
                    self._outputs.put(LiveBall(ball, latency_ms))
            if self._on_tick is not None:
                self._on_tick(one, tick, latency_ms)
            self._tracked.put((replace(one, packet=_without_events(one.packet)), chain, self._kept(tick)))

    def _kept(self, tick: Tick) -> Tick:
        """The part of a tick that the spins need, as soon as there is room for it."""
        if not tick.track.balls:
            return Tick({"track": tick.track}, _without_events(tick.packet), ())
        self._room.acquire()
        needed = {name: tick.results[name] for name in tick.results if name in NEEDED_BY_BALLS}
        return Tick(needed, tick.packet, ())

    def _taken(self) -> Iterator[tuple[ArrivedTick, Chain, Tick]]:
        """The tracked ticks, in order."""
        while (row := self._tracked.get()) is not None:
            if row[2].track.balls:
                self._room.release()
            yield row

    def _spin(self) -> None:
        """Answer the shots' spins, segment by segment; whatever comes, the tracker does not wait for ever."""
        if sys.platform == "linux":  # where it is of this thread alone: on a busy machine the tracker goes first
            os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), SPIN_NICENESS)
        coming = self._taken()
        try:
            for _, rows in groupby(coming, lambda row: row[0].segment):
                self._spin_segment(rows)
        finally:
            for _ in coming:
                pass
            self._outputs.put(None)

    def _spin_segment(self, rows: Iterator[tuple[ArrivedTick, Chain, Tick]]) -> None:
        log, at_work = ShotLog(), deque[ArrivedTick]()
        first = next(rows)
        one, chain, _ = first

        def tracked() -> Iterator[Tick]:
            for arrived, _, tick in joined([first], rows):
                if self._abandoned.is_set():
                    return
                at_work.append(arrived)
                yield tick

        for tick in chain.answer(self.parameters, tracked(), self._targets, forget=STAGES.names):
            one = at_work.popleft()
            log.add(tick)
            self._put_shots(log, one)
            if self._with_balls:
                self._put_spins(tick, one)
        log.close()
        self._put_shots(log, one)

    def _put_shots(self, log: ShotLog, arrived: ArrivedTick) -> None:
        for shot in log.take_ended():
            came_s = next((last_s for end_us, last_s in list(self._arrivals) if end_us >= shot.end_us), arrived.last_s)
            latency_ms = (now_s() - came_s) * 1e3
            self._outputs.put(LiveShot(shot, arrived.clock, arrived.packet.end_us, latency_ms))

    def _put_spins(self, tick: Tick, arrived: ArrivedTick) -> None:
        for ball in tick.balls:
            vector_rps = None if ball.best is None else ball.estimates[ball.best].vector_rps
            if ball.best is not None and vector_rps is not None:
                latency_ms = (now_s() - arrived.first_s) * 1e3
                self._outputs.put(LiveSpin(ball.track.shot, tick.packet.end_us, vector_rps, ball.best, latency_ms))

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
            spin_backlog_ms=self._tracked.qsize() * tick_ms,
            p50_ms=p50_ms,
            p99_ms=p99_ms,
        )
