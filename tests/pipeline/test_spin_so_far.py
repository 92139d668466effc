"""Spin of balls in flight: the newest answer of the most accurate method, never from events after the shot's end."""

from __future__ import annotations

import threading
from pathlib import Path

import numpy as np
import pytest

from spinscope.pipeline.registry import quick_stages
from spinscope.pipeline.results import SpinEstimate, spin_errors
from spinscope.pipeline.session import Session
from spinscope.pipeline.spin_so_far import ANSWERS_KEPT, ContrastInFlight, SpinsInFlight, SpinSoFar
from spinscope.pipeline.tick import BallTick


@pytest.fixture(scope="module")
def session(request: pytest.FixtureRequest) -> Session:
    samples: Path = request.getfixturevalue("samples")
    return Session.open(samples / "flight_fast_top.h5")


@pytest.fixture(scope="module")
def flying(session: Session) -> list[BallTick]:
    """A ball's ticks with the results of the quick stages."""
    return [ball for tick in session.ticks(quick_stages()) for ball in tick.balls]


def spin(t_us: int, method: str, rps: float | None) -> SpinSoFar:
    if rps is None:
        return SpinSoFar(t_us, SpinEstimate.refused(method, "too few events"))
    return SpinSoFar(t_us, SpinEstimate(method, np.array([rps, 0.0, 0.0]), np.eye(3), None))


def test_the_most_accurate_method_that_answers_in_time(flying: list[BallTick]) -> None:
    ball = flying[-1]
    assert ball.evidence.doubt is None
    shot, end_us, spins = ball.track.shot, ball.packet.end_us, SpinsInFlight()
    assert spins.newest(shot, end_us, None) is None
    spins.add(shot, spin(end_us, "contrast", 9.0))  # of a shot that is not in flight
    assert spins.newest(shot, end_us, None) is None
    spins.add_tick(ball)
    first = spins.newest(shot, end_us, None)
    assert first is not None and first.estimate is ball.estimates["normal_flow"]
    for answer in (spin(100, "contrast", 1.0), spin(200, "contrast", 2.0), spin(end_us + 1, "contrast", 3.0)):
        spins.add(shot, answer)
    newest = spins.newest(shot, end_us, None)
    assert newest is not None and newest.t_us == 200
    spins.add(shot, spin(end_us + 2, "contrast", None))  # a refusal is an answer, too
    newest = spins.newest(shot, end_us + 2, None)
    assert newest is not None and newest.estimate.method == "normal_flow"
    spins.keep_only([shot + 1])
    assert spins.newest(shot, end_us, None) is None


def test_a_doubtful_track_has_no_spin(flying: list[BallTick]) -> None:
    ball, spins = flying[0], SpinsInFlight()
    assert ball.evidence.doubt is not None
    spins.add_tick(ball)
    found = spins.newest(ball.track.shot, ball.packet.end_us, ball.evidence.doubt)
    assert found is not None and found.estimate.reason == ball.evidence.doubt


def test_a_ball_that_never_leaves_takes_no_more_memory(flying: list[BallTick]) -> None:
    spins = SpinsInFlight()
    for _ in range(3 * ANSWERS_KEPT):
        spins.add_tick(flying[-1])
    (methods,) = spins._answers.values()
    assert {len(answers) for answers in methods.values()} == {ANSWERS_KEPT}


class AwaitedSpins(SpinsInFlight):
    """The same, and what contrast maximisation has answered up to a time."""

    def __init__(self, until_us: int) -> None:
        super().__init__()
        self.given: list[SpinSoFar] = []
        self.done = threading.Event()
        self._until_us = until_us

    def add(self, shot: int, spin: SpinSoFar) -> None:
        super().add(shot, spin)
        self.given.append(spin)
        if spin.t_us == self._until_us:
            self.done.set()


def test_ticks_that_wait_are_taken_up_at_once(session: Session, flying: list[BallTick]) -> None:
    end_us = flying[-1].packet.end_us
    spins = AwaitedSpins(end_us)
    contrast = ContrastInFlight(session.parameters, session.chain, spins)
    for ball in flying:
        spins.add_tick(ball)
        contrast.put((ball,))
    thread = threading.Thread(target=contrast.work)
    thread.start()
    assert spins.done.wait(60.0)
    contrast.close()
    thread.join()
    (answer,) = spins.given
    newest = spins.newest(flying[-1].track.shot, end_us, None)
    assert newest is not None and newest.estimate is answer.estimate and answer.estimate.vector_rps is not None
    assert session.truth is not None
    apart_rps, apart_deg = spin_errors(answer.estimate.vector_rps, session.truth.spin_rps[0])
    assert apart_rps < 1.0 and apart_deg < 5.0
