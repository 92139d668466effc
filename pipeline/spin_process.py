"""Child process for the spins of a live run, which share neither Python's lock nor a core with the tracker.

Where the process ends before its time another one takes over from the last moment without a shot in flight.
"""

from __future__ import annotations

import signal
import threading
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from itertools import islice

from .cameras.clock import now_s
from .child_process import ChildProcess, IdleProcesses
from .errors import SpinscopeError
from .live_outputs import LiveNotice, LiveOutput, LiveShot, LiveSpin
from .live_spins import TOGETHER_US, Answers, Numbered, SegmentStart, SpinRun, TrackedTick, serve

# Flight that waits for its spins, at the most; then the tracker waits, too: at 5 Mev/s it takes some 600 MB. Ticks
# without a ball take 5 kB each.
MOST_FLYING_US = 3_000_000
MOST_WAITING_US = 30_000_000
# Of shots in flight that another process could go on from: longer than most shots.
MOST_REPEATED_US = 1_000_000
MOST_ENDS = 3  # of processes without an answer between

_Key = tuple[int, str, int, bool]

_idle = IdleProcesses[ChildProcess](1)


def _process() -> ChildProcess:
    """A process that waits for a run; raises SpinscopeError."""
    try:
        return _idle.take() or ChildProcess(f"from {serve.__module__} import serve; serve()")
    except OSError as error:
        raise SpinscopeError(
            f"the process for the spins does not start ({error.strerror}): close other programs"
        ) from error


@contextmanager
def loaded_kernels() -> Iterator[None]:
    """Have a process for the next run load its kernels meanwhile; raises SpinscopeError."""
    process = _process()
    try:
        process.send(None)
        yield
        try:
            process.receive()
        except EOFError as error:
            raise SpinscopeError(f"the process for the spins ended ({_status_words(process)})") from error
    except BaseException:
        process.end()
        raise
    _idle.keep(process)


def _status_words(process: ChildProcess) -> str:
    status = process.exit_status()
    return signal.Signals(-status).name if status < 0 else f"exit status {status}"


class SpinProcess:
    """Spins of one run.

    Parameters
    ----------
    run : SpinRun
        Request.
    put : callable
        Takes each output, and at last None or the error that ended the run, in a thread of this class.
    """

    def __init__(self, run: SpinRun, put: Callable[[LiveOutput | BaseException | None], None]) -> None:
        self._run, self._put = run, put
        self._changed = threading.Condition()
        self._kept = deque[Numbered]()  # from the first message on that another process would need
        self._segment: Numbered | None = None  # to which the first of them belongs
        self._next = 0  # number of the next one to be sent
        self._is_urgent = False  # whether one that waits to be sent is not to wait for others
        self._done = 0  # number of the first one without its final answers
        self._flying = 0  # ticks with a ball from there on
        self._furthest = 0  # the same of all processes so far
        self._given = set[_Key]()  # outputs of the messages that are kept
        self._ends = 0  # of processes before their time since the last new answer
        self._is_over = False
        self._threads = [
            threading.Thread(target=work, name=name, daemon=True)
            for name, work in (("spin requests", self._send), ("spin answers", self._receive))
        ]

    def start(self) -> None:
        """Begin to work; raises SpinscopeError when no process starts."""
        self._process = self._begun()
        for thread in self._threads:
            thread.start()

    def put(self, message: SegmentStart | TrackedTick | None) -> None:
        """Hand over a message, as soon as there is room for it; None ends the run."""
        tick_us = self._run.tick_us
        with self._changed:
            self._changed.wait_for(
                lambda: (
                    (self._flying < MOST_FLYING_US // tick_us and self.waiting < MOST_WAITING_US // tick_us)
                    or self._is_over
                )
            )
            number = self._kept[-1].number + 1 if self._kept else self._done
            self._kept.append(Numbered(number, message))
            self._flying += _has_ball(message)
            self._is_urgent |= not isinstance(message, TrackedTick) or _has_ball(message) or _has_end(message)
            if self._is_due():
                self._changed.notify_all()

    def _is_due(self) -> bool:
        """Whether messages are to be sent: ticks without a ball go several at a time where they are short."""
        unsent = self._kept[-1].number + 1 - self._next if self._kept else 0
        return unsent > 0 and (self._is_urgent or unsent * self._run.tick_us >= TOGETHER_US)

    @property
    def waiting(self) -> int:
        """Number of messages without their final answers."""
        with self._changed:
            return self._kept[-1].number + 1 - self._done if self._kept else 0

    @property
    def shots_waiting(self) -> int:
        """Number of shots in the messages without their final answers."""
        shots, segment = set[tuple[int, int]](), 0
        with self._changed:
            for one in self._kept:
                if isinstance(one.message, SegmentStart):
                    segment = one.number  # numbers of shots begin anew with it
                elif one.message is not None and one.number >= self._done:
                    shots |= {(segment, ball.shot) for ball in one.message.tick.track.balls}
        return len(shots)

    @property
    def unanswered(self) -> TrackedTick | None:
        """The oldest tick without its final answers."""
        with self._changed:
            waiting = (one.message for one in self._kept if one.number >= self._done)
            return next((message for message in waiting if isinstance(message, TrackedTick)), None)

    def abandon(self) -> None:
        """End the run without the answers that are still to come."""
        with self._changed:
            if not self._is_over:
                self._is_over = True
                self._changed.notify_all()
                self._process.kill()

    def join(self) -> None:
        """Wait for the end of the run."""
        for thread in self._threads:
            thread.join()

    def _begun(self) -> ChildProcess:
        """A process that has begun with the run and its present segment."""
        process = _process()
        process.send(self._run)
        if self._segment is not None:
            process.send([self._segment])
        return process

    def _send(self) -> None:
        """Body of a thread: send the messages until the run is over."""
        most = max(TOGETHER_US // self._run.tick_us, 1)
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._is_over or self._is_due())
                if self._is_over:
                    return
                first = self._next - self._kept[0].number
                messages, process = list(islice(self._kept, first, first + most)), self._process
                self._next += len(messages)
                self._is_urgent &= self._next <= self._kept[-1].number
            process.send(messages)

    def _receive(self) -> None:
        """Body of a thread: hand on the outputs until the run is over."""
        end: BaseException | None = None
        try:
            while (answer := self._answer()) is not None:
                self._take(answer)
        except Exception as error:  # noqa: BLE001  handed on
            end = error
        with self._changed:
            is_abandoned, self._is_over = self._is_over, True
            self._changed.notify_all()
        if is_abandoned or end is not None:
            self._process.end()
        else:
            _idle.keep(self._process)
        self._put(end)

    def _answer(self) -> Answers | None:
        """The next answers, perhaps of another process; None at the end of the run. Raises what ended it."""
        while True:
            try:
                answer = self._process.receive()
            except EOFError:
                with self._changed:
                    if self._is_over:
                        return None
                    self._begin_anew()
                continue
            if isinstance(answer, Exception):
                raise answer
            assert answer is None or isinstance(answer, Answers)
            return answer

    def _begin_anew(self) -> None:
        """Have another process go on, the second time without what the two before did not answer; raises the third."""
        ended = f"the process for the spins ended ({_status_words(self._process)})"
        self._process.end()
        self._ends += 1
        if self._ends == MOST_ENDS:
            raise SpinscopeError(f"{ended} {MOST_ENDS} times without an answer: please report this")
        ticks = sum(isinstance(one.message, TrackedTick) and one.number < self._next for one in self._kept)
        if self._ends == 1:
            self._put(LiveNotice("spins", f"{ended}: another one works on the last {ticks} ticks again"))
        else:
            self._forget(self._next)
            self._put(
                LiveNotice("spins", f"{ended} again over the same events: the spins of {ticks} ticks are left out")
            )
        self._next = self._done = self._kept[0].number if self._kept else self._next
        self._flying = sum(_has_ball(one.message) for one in self._kept)
        self._is_urgent = True
        self._process = self._begun()
        self._changed.notify_all()

    def _take(self, answers: Answers) -> None:
        """Hand on the outputs of a message, unless a process before did."""
        for came_s, output in answers.outputs:
            if (key := _key(answers.number, output)) not in self._given:
                self._given.add(key)
                self._put(replace(output, latency_ms=(now_s() - came_s) * 1e3))
        if not answers.is_final:
            return
        with self._changed:
            while self._done <= answers.number:
                self._flying -= _has_ball(self._kept[self._done - self._kept[0].number].message)
                self._done += 1
            if self._done > self._furthest:
                self._furthest, self._ends = self._done, 0
            self._forget(self._done - (0 if answers.is_idle else MOST_REPEATED_US // self._run.tick_us))
            self._changed.notify_all()

    def _forget(self, number: int) -> None:
        """Keep the messages no longer that come before one, the end of the run excepted."""
        while self._kept and self._kept[0].number < number and self._kept[0].message is not None:
            one = self._kept.popleft()
            if isinstance(one.message, SegmentStart):
                self._segment = one
        self._given = {key for key in self._given if key[0] >= number}


def _key(number: int, output: LiveSpin | LiveShot) -> _Key:
    """Identity of an output of a message: kind, shot and, of a spin, whether the shot has ended."""
    if isinstance(output, LiveShot):
        return number, "shot", output.shot.number, True
    return number, "spin", output.shot, output.ended_by is not None


def _has_ball(message: SegmentStart | TrackedTick | None) -> bool:
    return isinstance(message, TrackedTick) and message.tick.track.has_ball


def _has_end(message: TrackedTick) -> bool:
    return len(message.tick.track.ended) > 0
