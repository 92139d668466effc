"""Spins of a live run: the work of its child process, behind the tracker.

One thread sees the shots end, one tells their spins so far, tick by tick, one maximises contrast for these as fast as
it can, and one answers the whole shots as `analyze` does. The last one rests while a ball is in flight.
"""

from __future__ import annotations

import gc
import os
import queue
import sys
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Collection, Iterator
from functools import cache
from typing import Any, NamedTuple

from .cameras.clock import now_s
from .chain import Chain
from .child_process import pipes_to_parent, receive_value, send_value
from .errors import SpinscopeError
from .event_source import EventsInMemory
from .events import EventBatch
from .live_outputs import LiveShot, LiveSpin
from .niceness import lower_priority
from .registry import STAGES, Parameters, needed_stages, quick_stages
from .session import SAMPLES, Session
from .shots import Shot, ShotLog
from .spin_so_far import ContrastInFlight, SpinsInFlight
from .tick import Tick

# After a shot's last events the spin so far is told, which may be from somewhat older ones: 50 ms are promised, of
# which telling it takes up to 20 on a busy machine.
ANNOUNCED_S = 0.03
# The final spins rest for so long after a tick with a ball, while less flight waits for them: half as much as has the
# tracker wait.
REST_S, MOST_RESTING_US = 0.1, 1_500_000
LOOK_S = 0.005  # after which they look again whether they still rest
ARRIVALS_KEPT_US = 20_000_000  # whose ticks' arrival is remembered: longer than any shot's end takes to be known
# Python lets a thread run for 5 ms while another waits; with a tick's work in several threads that is many ticks.
SWITCH_S = 0.0005
# A half and a third of the tracker's share where they want one core; contrast so far has a third of the other methods'
# share, of which its thread comes.
SO_FAR_NICENESS, FINAL_NICENESS, CONTRAST_NICENESS = 3, 5, 5
# Of ticks without a ball that are shorter than this, several go together to the process and back.
TOGETHER_US = 5000
PARENT_GONE_EXIT = 3


class SpinRun(NamedTuple):
    """Request of a run: stages to answer, whether the spin of every tick is told, sensor's size, tick's length."""

    targets: tuple[str, ...]
    with_balls: bool
    width_px: int
    height_px: int
    tick_us: int


class SegmentStart(NamedTuple):
    """Beginning of a segment, ticks without gaps, with these parameters; the one before has ended."""

    parameters: Parameters


class TrackedTick(NamedTuple):
    """Tick with its track, and when it came (`clock.now_s`).

    Attributes
    ----------
    tick : Tick
        Its events and all that stages of one ball need only where it has a ball.
    clock : int
        Number of the camera's clock.
    first_s, last_s : float
        As of `ArrivedTick`.
    """

    tick: Tick
    clock: int
    first_s: float
    last_s: float


class Numbered(NamedTuple):
    """Message to the process, with its number in the run; None ends the run."""

    number: int
    message: SegmentStart | TrackedTick | None


class Answers(NamedTuple):
    """Answers to one message.

    Attributes
    ----------
    number : int
        That of the message.
    is_final : bool
        Whether they are of whole shots, in order; with them the message is done. Others come in any order.
    outputs : tuple of (float, LiveSpin or LiveShot)
        When the events came that each latency counts from, and the output without it.
    is_idle : bool
        Whether no shot is in flight, so that no further answer needs this message or an earlier one.
    """

    number: int
    is_final: bool
    outputs: tuple[tuple[float, LiveSpin | LiveShot], ...]
    is_idle: bool = False


class _EndedShot(NamedTuple):
    """Shot whose end is known, with the number of the message that told it, and when its last events came."""

    shot: Shot
    doubt: str | None
    number: int
    came_s: float
    spins: SpinsInFlight


class _Ticks:
    """Ticks of a stretch as they come.

    Attributes
    ----------
    begin : Numbered
        The message that begins the stretch.
    end : Numbered
        The message after its last tick; `begin` until that has come.
    """

    def __init__(self, begin: Numbered, get: Callable[[], Numbered]) -> None:
        self.begin = self.end = begin
        self._get = get
        # The end of each tick, and when it was complete.
        self._arrivals: deque[tuple[int, float]] = deque(maxlen=ARRIVALS_KEPT_US // self.parameters.track.tick_us)

    @property
    def parameters(self) -> Parameters:
        """Values of all stages."""
        assert isinstance(self.begin.message, SegmentStart)
        return self.begin.message.parameters

    def __iter__(self) -> Iterator[tuple[int, TrackedTick]]:
        while isinstance((one := self._get()).message, TrackedTick):
            self._arrivals.append((one.message.tick.packet.end_us, one.message.last_s))
            yield one.number, one.message
        self.end = one

    def came_s(self, end_us: int) -> float:
        """Arrival of the last events before a time of these ticks."""
        return next((last_s for upto_us, last_s in self._arrivals if upto_us >= end_us), self._arrivals[-1][1])


class LiveSpins:
    """Spins of one run.

    Parameters
    ----------
    run : SpinRun
        Request.
    send : callable
        Takes `Answers`, or the error that ends the run, from any thread.
    """

    def __init__(self, run: SpinRun, send: Callable[[Answers | Exception], None]) -> None:
        self._run, self._send = run, send
        self._for_so_far: queue.SimpleQueue[Numbered] = queue.SimpleQueue()
        self._for_final: queue.SimpleQueue[Numbered] = queue.SimpleQueue()
        self._resting_until_s = 0.0
        self._handed_on = self._taken = 0  # ticks with a ball for the final spins; each is counted by one thread
        self._spins: dict[int, SpinsInFlight] = {}  # by the number of the message that begins the stretch
        self._ended: list[_EndedShot] = []  # not announced yet
        self._lock = threading.Lock()

    def work(self, get: Callable[[], Numbered]) -> None:
        """Answer the messages that `get` waits for, up to the run's end."""
        threads = [
            threading.Thread(target=self._guarded, args=(work, niceness), name=name)
            for name, work, niceness in (
                ("spin so far", self._tell_all, SO_FAR_NICENESS),
                ("spin", self._answer_all, FINAL_NICENESS),
            )
        ]
        for thread in threads:
            thread.start()
        for ticks in _stretches(get):
            self._see_ends(ticks)
            if ticks.end.message is None:
                self._for_so_far.put(ticks.end)
        for thread in threads:
            thread.join()

    def _guarded(self, work: Callable[[], None], niceness: int) -> None:
        """Body of a thread that lets those go first that matter more; its error ends the run."""
        lower_priority(niceness)
        try:
            work()
        except SpinscopeError as error:
            self._send(error)
        except Exception:  # noqa: BLE001  raised in the parent
            self._send(RuntimeError(traceback.format_exc()))

    def _see_ends(self, ticks: _Ticks) -> None:
        """See the shots of a stretch end, which then are announced in time, and hand its ticks on."""
        spins = self._spins[ticks.begin.number] = SpinsInFlight()
        self._for_so_far.put(ticks.begin)
        log, doubts = ShotLog(), dict[int, str | None]()
        for number, one in self._answered(self._new_chain(), ticks, ("track",)):
            log.add(one.tick)
            doubts |= {end.shot: end.doubt for end in one.tick.track.ended if end.doubt is not None}
            self._take_ended(log, doubts, number, ticks, spins)
            doubts = {ball.track.shot: ball.evidence.doubt for ball in one.tick.balls}
            self._for_so_far.put(Numbered(number, one))
        log.close()
        self._take_ended(log, doubts, ticks.end.number, ticks, spins)

    def _take_ended(
        self, log: ShotLog, doubts: dict[int, str | None], number: int, ticks: _Ticks, spins: SpinsInFlight
    ) -> None:
        """Have the shots announced whose end is known now."""
        for shot in log.take_ended():
            came_s = ticks.came_s(shot.end_us)
            with self._lock:
                self._ended.append(_EndedShot(shot, doubts.get(shot.number), number, came_s, spins))
            timer = threading.Timer(came_s + ANNOUNCED_S - now_s(), self._announce, (number,))
            timer.daemon = True
            timer.start()

    def _announce(self, number: int, *, is_complete: bool = False) -> None:
        """Tell the spins so far of the shots that ended by a message, as far as they are known.

        Parameters
        ----------
        number : int
            That of the message.
        is_complete : bool
            Whether all ticks so far are answered: then a refusal is told, too.
        """
        with self._lock:  # until they are sent: none is on its way when the run has ended
            for one in [one for one in self._ended if one.number <= number]:
                shot = one.shot
                spin = one.spins.newest(shot.number, shot.end_us, one.doubt)
                if spin is not None and (is_complete or spin.estimate.status == "ok"):
                    output = LiveSpin(shot.number, shot.end_us, spin, shot.ended_by, 0.0)
                    self._send(Answers(one.number, False, ((one.came_s, output),)))
                    self._ended.remove(one)
                elif is_complete:
                    self._ended.remove(one)

    def _tell_all(self) -> None:
        """Tell the spins so far, and hand the messages on."""
        for ticks in _stretches(self._for_so_far.get):
            self._for_final.put(ticks.begin)
            self._tell(ticks)
            if ticks.end.message is None:
                self._for_final.put(ticks.end)

    def _tell(self, ticks: _Ticks) -> None:
        """Tell the spins so far of a stretch, and hand its ticks on."""
        needed = {stage.name for stage in needed_stages(self._run.targets)}
        has_contrast = "contrast" in needed
        # Beside contrast maximisation only what it asks for: each further stage has it come later.
        so_far = STAGES["contrast"].inputs if has_contrast else needed
        quick = tuple(stage.name for stage in needed_stages(so_far) if stage.name in quick_stages())
        chain, spins = self._new_chain(), self._spins.pop(ticks.begin.number)
        contrast = ContrastInFlight(ticks.parameters, chain, spins)
        thread = threading.Thread(target=self._guarded, args=(contrast.work, CONTRAST_NICENESS), name="contrast so far")
        thread.start()
        for number, one in self._answered(chain, ticks, quick):
            self._resting_until_s = now_s() + REST_S if one.tick.balls else 0.0
            for ball in one.tick.balls:
                spins.add_tick(ball)
            if has_contrast:
                contrast.put(one.tick.balls)
            if self._run.with_balls and one.tick.balls:
                self._tell_tick(number, one, spins)
            self._announce(number, is_complete=True)
            spins.keep_only(ball.track.shot for ball in one.tick.balls)
            self._handed_on += bool(one.tick.balls)
            self._for_final.put(Numbered(number, one))
        self._announce(ticks.end.number, is_complete=True)
        contrast.close()
        thread.join()

    def _tell_tick(self, number: int, one: TrackedTick, spins: SpinsInFlight) -> None:
        """Tell the spins so far of the balls of a tick."""
        newest = [
            (ball.track.shot, spins.newest(ball.track.shot, ball.packet.end_us, ball.evidence.doubt))
            for ball in one.tick.balls
        ]
        end_us = one.tick.packet.end_us
        outputs = [(one.first_s, LiveSpin(shot, end_us, spin, None, 0.0)) for shot, spin in newest if spin is not None]
        self._send(Answers(number, False, tuple(outputs)))

    def _take_rested(self) -> Numbered:
        """The next message for the final spins, which would hold up tracker and spins so far in a flight.

        They rest for REST_S after the last tick with a ball at the longest: nothing need come for them to go on.
        """
        one, most = self._for_final.get(), MOST_RESTING_US // self._run.tick_us
        while now_s() < self._resting_until_s and self._handed_on - self._taken < most:
            time.sleep(LOOK_S)
        self._taken += isinstance(one.message, TrackedTick) and bool(one.message.tick.balls)
        return one

    def _answer_all(self) -> None:
        """Answer the shots as of a recording."""
        together = max(TOGETHER_US // self._run.tick_us, 1)
        for ticks in _stretches(self._take_rested):
            log, last = ShotLog(), None
            for number, one in self._answered(self._new_chain(), ticks, self._run.targets):
                log.add(one.tick)
                last, outputs = one, _ended(log, ticks, one)
                if outputs or one.tick.balls or number % together == 0:
                    self._send(Answers(number, True, outputs, not one.tick.balls))
            log.close()
            outputs = () if last is None else _ended(log, ticks, last)
            self._send(Answers(ticks.end.number, True, outputs, is_idle=True))

    def _new_chain(self) -> Chain:
        """A chain for one stretch."""
        return Chain(EventsInMemory(("live",), EventBatch.empty(), self._run.width_px, self._run.height_px, 0, 0))

    def _answered(self, chain: Chain, ticks: _Ticks, targets: Collection[str]) -> Iterator[tuple[int, TrackedTick]]:
        """The ticks of a stretch with the results of stages of one ball."""
        at_work = deque[tuple[int, TrackedTick]]()

        def tracked() -> Iterator[Tick]:
            for number, one in ticks:
                at_work.append((number, one))
                yield one.tick

        for tick in chain.answer(ticks.parameters, tracked(), targets, forget=STAGES.names):
            number, one = at_work.popleft()
            yield number, one._replace(tick=tick)


def _one_by_one(get: Callable[[], list[Numbered]]) -> Callable[[], Numbered]:
    """Function that waits for the next of the messages, of which `get` waits for several."""
    come = deque[Numbered]()

    def one() -> Numbered:
        while not come:
            come.extend(get())
        return come.popleft()

    return one


def _stretches(get: Callable[[], Numbered]) -> Iterator[_Ticks]:
    """The stretches of a run; the ticks of each are to be taken before the next is asked for."""
    begin = get()
    while begin.message is not None:
        ticks = _Ticks(begin, get)
        yield ticks
        begin = ticks.end


def _ended(log: ShotLog, ticks: _Ticks, one: TrackedTick) -> tuple[tuple[float, LiveSpin | LiveShot], ...]:
    """The shots whose end is known in a tick."""
    return tuple(
        (ticks.came_s(shot.end_us), LiveShot(shot, one.clock, one.tick.packet.end_us, 0.0)) for shot in log.take_ended()
    )


@cache
def load_stages(stages: tuple[str, ...] | None = None) -> None:
    """Run stages, all by default, over shots with a contact and with two balls: no kernel is loaded in a shot."""
    for sample in ("bounce.h5", "two_balls.h5"):
        session = Session.open(SAMPLES / "own" / sample)
        for _ in session.ticks(stages, forget=STAGES.names):
            pass


def serve() -> None:
    """Answer runs until the parent ends; the main program of the process."""
    requests, answers = pipes_to_parent()
    sys.setswitchinterval(SWITCH_S)
    lock = threading.Lock()

    def send(value: Any) -> None:
        with lock:
            send_value(answers, value)

    try:
        while True:
            run: SpinRun | None = receive_value(requests)
            if run is None:
                load_stages()
                gc.freeze()  # as in `LiveRun.outputs`
            else:
                LiveSpins(run, send).work(_one_by_one(lambda: receive_value(requests)))
            send(None)
    except (EOFError, BrokenPipeError):
        os._exit(PARENT_GONE_EXIT)
