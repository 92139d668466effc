"""Spin of balls in flight, from their shots so far: by each method what it last answered.

The quick methods answer every tick. Contrast maximisation takes longer than a tick: whenever it has answered it goes on
with all that came meanwhile, so that at the end of a shot an answer is there which is no older than it takes. The
estimate of the whole shot, as of a recording, follows behind.
"""

from __future__ import annotations

import math
import queue
import threading
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass

from .chain import Chain
from .registry import Parameters
from .results import SpinEstimate
from .spin.contrast import stage as contrast
from .spin.contrast.stage import FLOW_METHOD
from .tick import BallTick

# The methods by accuracy on the evaluation's flights, best first.
ROLLING_METHODS = ("contrast", "normal_flow", "triplet")
# Of a shot since contrast maximisation has last answered: 20 ms at 200 Hz. More often, and the stages of every tick,
# which share Python's lock, come too late.
FEWEST_TICKS = 4
ANSWERS_KEPT = 40  # of each method: 200 ms, longer than any shot's end takes to be known


@dataclass(frozen=True, slots=True, eq=False)
class SpinSoFar:
    """Estimate from the events of a shot up to a time.

    Attributes
    ----------
    t_us : int
        That time.
    estimate : SpinEstimate
        By the most accurate method that answers, or its refusal where none does.
    """

    t_us: int
    estimate: SpinEstimate


class SpinsInFlight:
    """Last answers of all methods for the shots in flight; from any thread."""

    def __init__(self) -> None:
        self._answers: dict[int, dict[str, deque[SpinSoFar]]] = {}
        self._lock = threading.Lock()

    def add_tick(self, ball: BallTick) -> None:
        """Take the answers of the methods that were run in a tick, and in the ticks before its shot was known."""
        with self._lock:
            self._answers.setdefault(ball.track.shot, {})
            for one in (*ball.earlier, ball):
                for estimate in one.estimates.values():
                    self._add(ball.track.shot, SpinSoFar(one.packet.end_us, estimate))

    def add(self, shot: int, spin: SpinSoFar) -> None:
        """Take the answer of one method, in order of time; that of a shot which has ended comes too late."""
        with self._lock:
            if shot in self._answers:
                self._add(shot, spin)

    def _add(self, shot: int, spin: SpinSoFar) -> None:
        self._answers[shot].setdefault(spin.estimate.method, deque(maxlen=ANSWERS_KEPT)).append(spin)

    def newest(self, shot: int, end_us: int, doubt: str | None) -> SpinSoFar | None:
        """The estimate from the shot's events up to a time at the latest; None where no method has answered yet.

        A doubt about its track (`TrackEvidence.doubt`) refuses it.
        """
        with self._lock:
            answers = self._answers.get(shot, {})
            last = [
                next((one for one in reversed(answers.get(method, ())) if one.t_us <= end_us), None)
                for method in ROLLING_METHODS
            ]
        asked = [one for one in last if one is not None]
        if doubt is not None and asked:
            return SpinSoFar(asked[0].t_us, SpinEstimate.refused(asked[0].estimate.method, doubt))
        return next((one for one in asked if one.estimate.status == "ok"), asked[0] if asked else None)

    def keep_only(self, shots: Iterable[int]) -> None:
        """Forget all shots but these."""
        with self._lock:
            for shot in self._answers.keys() - set(shots):
                del self._answers[shot]


class ContrastInFlight:
    """Contrast maximisation for the shots in flight, which takes all ticks that wait at once.

    Parameters
    ----------
    parameters : Parameters
        Values of all stages.
    chain : Chain
        Gives camera and ball.
    spins : SpinsInFlight
        Where the answers go.
    """

    def __init__(self, parameters: Parameters, chain: Chain, spins: SpinsInFlight) -> None:
        self._parameters, self._spins = parameters.contrast, spins
        self._context = chain.context(parameters, contrast.STAGE)
        self._states: dict[int, contrast.ContrastState] = {}
        self._rows: dict[int, list[BallTick]] = {}  # the ticks of each shot since its last answer
        self._waiting: queue.SimpleQueue[tuple[BallTick, ...] | None] = queue.SimpleQueue()

    def put(self, balls: tuple[BallTick, ...]) -> None:
        """Hand over the balls of a tick, with the results of the stages that contrast maximisation needs."""
        self._waiting.put(balls)

    def close(self) -> None:
        """Have `work` end."""
        self._waiting.put(None)

    def work(self) -> None:
        """Body of a thread: answer until `close`."""
        while (ticks := self._taken()) is not None:
            for ball in (ball for balls in ticks for ball in balls):
                self._rows.setdefault(ball.track.shot, []).extend((*ball.earlier, ball))
            flying = {ball.track.shot for ball in ticks[-1]}
            self._states = {shot: state for shot, state in self._states.items() if shot in flying}
            self._rows = {shot: rows for shot, rows in self._rows.items() if shot in flying}
            for shot in [shot for shot, rows in self._rows.items() if len(rows) >= FEWEST_TICKS]:
                self._answer(shot, self._rows.pop(shot))

    def _taken(self) -> list[tuple[BallTick, ...]] | None:
        """The ticks that wait, at least one; None at the end."""
        ticks = [self._waiting.get()]
        while not self._waiting.empty():
            ticks.append(self._waiting.get())
        return None if ticks[-1] is None else [balls for balls in ticks if balls is not None]

    def _answer(self, shot: int, rows: list[BallTick]) -> None:
        state = self._states.setdefault(shot, contrast.start(self._parameters, self._context))
        if contrast.is_settled(self._parameters, state):
            state.full_us = math.inf  # following an answer without rivals takes a tenth of another full estimate
        *skipped, last = rows
        for ball in skipped:
            contrast.take(self._parameters, state, ball.packet, ball.track, ball.results["logo"])
        inputs = [last.results[name] for name in ("rate", "logo", FLOW_METHOD)]
        result = contrast.step(self._parameters, state, last.packet, last.track, *inputs)
        self._spins.add(shot, SpinSoFar(last.packet.end_us, result.estimate))
