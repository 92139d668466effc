"""Process of a live run's spins: what happens when it ends before its time."""

from __future__ import annotations

import queue
import threading
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from spinscope.pipeline import live_spins, spin_process
from spinscope.pipeline.cameras import ArrivedTick, EventStream, ReplayCamera
from spinscope.pipeline.child_process import ChildProcess
from spinscope.pipeline.errors import SpinscopeError
from spinscope.pipeline.live import LiveRun
from spinscope.pipeline.live_outputs import LiveNotice, LiveOutput, LiveShot, LiveSpin
from spinscope.pipeline.live_spins import (
    MOST_RESTING_US,
    REST_S,
    Answers,
    LiveSpins,
    Numbered,
    SegmentStart,
    SpinRun,
    TrackedTick,
    _EndedShot,
    _Ticks,
)
from spinscope.pipeline.results import SpinEstimate
from spinscope.pipeline.session import Session
from spinscope.pipeline.spin_process import MOST_FLYING_US
from spinscope.pipeline.spin_so_far import SpinsInFlight, SpinSoFar
from spinscope.pipeline.tick import Tick

QUICK = "triplet"


@pytest.fixture(scope="module")
def session(request: pytest.FixtureRequest) -> Session:
    samples: Path = request.getfixturevalue("samples")
    return Session.open(samples / "own/bounce.h5")


def live(session: Session, killed_at_us: int | None = None) -> list[LiveOutput]:
    """Outputs of a run whose process is killed when a tick has been tracked and a spin was told."""
    recording, has_told = session.recording, threading.Event()
    camera = ReplayCamera(recording.chunks, recording.width_px, recording.height_px, speed=float("inf"))  # type: ignore[union-attr]

    def on_tick(arrived: ArrivedTick, tick: Tick, latency_ms: float) -> None:
        if arrived.packet.end_us == killed_at_us:
            assert has_told.wait(60.0)
            run._spins._process.kill()

    def put(output: LiveOutput | BaseException | None) -> None:
        if isinstance(output, LiveSpin):
            has_told.set()
        run._put(output)

    run = LiveRun(
        lambda tick_us, on_notice: EventStream(camera, tick_us, on_notice=on_notice),
        session.parameters,
        QUICK,
        with_balls=True,
        on_tick=on_tick,
    )
    run._spins._put = put
    return list(run.outputs())


def with_ticks(session: Session, tick_us: int) -> Session:
    """The session in ticks of this length."""
    parameters = session.parameters.with_assignments([f"track.tick_us={tick_us}"])
    return Session(session.recording, session.source, parameters, session.chain)


def notices(outputs: list[LiveOutput]) -> list[str]:
    return [one.text for one in outputs if isinstance(one, LiveNotice)]


@pytest.mark.parametrize("tick_us", [5000, 1000])
def test_a_killed_process_loses_no_shot_and_repeats_none(session: Session, tick_us: int) -> None:
    session = with_ticks(session, tick_us)
    outputs = live(session, killed_at_us=90_000)  # 15 ms after the bounce is known
    shots, found = session.estimate(QUICK).shots, [one.shot for one in outputs if isinstance(one, LiveShot)]
    assert [shot.to_dict(session.camera, 0.02) for shot in found] == [
        shot.to_dict(session.camera, 0.02) for shot in shots
    ]
    told = [(one.shot, one.t_us, one.ended_by) for one in outputs if isinstance(one, LiveSpin)]
    assert len(told) == len(set(told))
    assert {one for one in told if one[2]} == {(shot.number, shot.end_us, shot.ended_by) for shot in shots}
    assert {one[1] for one in told if one[2] is None} == {
        tick.packet.end_us for tick in session.ticks(("track",)) if tick.balls
    }
    (notice,) = notices(outputs)
    assert ": another one works on the last" in notice


def test_short_ticks_without_a_ball_go_together(session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    """None waits that has a ball or tells an end."""
    sent, send = list[list[Numbered]](), ChildProcess.send

    def noted(process: ChildProcess, value: object) -> None:
        if isinstance(value, list):
            sent.append(value)
        send(process, value)

    monkeypatch.setattr(ChildProcess, "send", noted)
    session = with_ticks(session, 1000)
    live(session)
    most = live_spins.TOGETHER_US // 1000
    assert {len(part) for part in sent} >= {1, most} and max(map(len, sent)) == most
    for part in sent:
        ticks = [one.message.tick.track for one in part if isinstance(one.message, TrackedTick)]
        is_quiet = len(ticks) == len(part) and not any(track.balls or track.ended for track in ticks)
        assert len(part) == most or not is_quiet
    messages = [one.message for part in sent for one in part]
    assert sum(isinstance(one, TrackedTick) for one in messages) == len(list(session.ticks(("track",))))


def test_events_that_end_two_processes_are_left_out_and_the_third_end_is_an_error(
    session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    ends, real = 2, spin_process._process

    def ending() -> ChildProcess:
        nonlocal ends
        ends -= 1
        return real() if ends < 0 else ChildProcess("import sys; sys.stdin.buffer.read(1)")

    monkeypatch.setattr(spin_process, "_process", ending)
    first, second = notices(live(session))
    assert "(exit status 0): another one" in first and "ended (exit status 0) again over the same events" in second
    ends = 3
    with pytest.raises(SpinscopeError, match="3 times without an answer"):
        live(session)


@pytest.mark.parametrize("tick_us", [1000, 5000])
def test_final_spins_rest_in_a_flight_and_never_for_long(monkeypatch: pytest.MonkeyPatch, tick_us: int) -> None:
    """Until no ball is in view, or many ticks wait; where nothing comes any more, for a time that ends by itself."""
    spins, clock_s, looks = LiveSpins(SpinRun((QUICK,), False, 4, 4, tick_us), lambda answers: None), 0.0, 0

    def look(seconds: float) -> None:
        nonlocal clock_s, looks
        clock_s, looks = clock_s + seconds, looks + 1
        if looks == calm_after:
            spins._resting_until_s = 0.0

    monkeypatch.setattr(live_spins, "now_s", lambda: clock_s)
    monkeypatch.setattr(live_spins, "time", SimpleNamespace(sleep=look))

    def seconds_rested(*, waiting: int) -> float:
        nonlocal looks
        begin_s, looks = clock_s, 0
        spins._handed_on = spins._taken + waiting
        spins._for_final.put(Numbered(waiting, None))
        assert spins._take_rested().number == waiting
        return clock_s - begin_s

    calm_after = -1
    assert seconds_rested(waiting=0) == 0.0  # before the first ball
    spins._resting_until_s = clock_s + REST_S
    assert seconds_rested(waiting=1) == pytest.approx(REST_S, abs=live_spins.LOOK_S)
    assert seconds_rested(waiting=1) == 0.0  # no more until another tick has a ball
    spins._resting_until_s = clock_s + REST_S
    most = MOST_RESTING_US // tick_us
    assert seconds_rested(waiting=most) == 0.0 and MOST_RESTING_US < MOST_FLYING_US  # for which the tracker waits
    calm_after = 3
    assert seconds_rested(waiting=most - 1) == pytest.approx(3 * live_spins.LOOK_S)


def test_final_spins_are_to_rest_from_a_shots_first_tick_to_its_last(samples: Path) -> None:
    session = Session.open(samples / "own/rally.h5").clip(3_200_000, 3_400_000)
    run = SpinRun((QUICK,), False, 1280, 720, session.parameters.track.tick_us)
    spins, ticks = LiveSpins(run, lambda answers: None), list(session.ticks(("track",)))
    rests = list[tuple[bool, bool]]()

    class Final:
        def put(self, one: Numbered) -> None:
            assert isinstance(one.message, TrackedTick)
            rests.append((bool(one.message.tick.balls), spins._resting_until_s > 0.0))

    spins._for_final = Final()  # type: ignore[assignment]
    messages = [TrackedTick(tick, 0, 0.0, 0.0) for tick in ticks]
    coming = iter([Numbered(number, message) for number, message in enumerate((*messages, None), 1)])
    spins._spins[0] = SpinsInFlight()
    spins._tell(_Ticks(Numbered(0, SegmentStart(session.parameters)), lambda: next(coming)))
    assert len(rests) == len(ticks) and set(rests) == {(True, True), (False, False)}
    assert spins._handed_on == sum(bool(tick.balls) for tick in ticks)
    spins._for_final, spins._resting_until_s = queue.SimpleQueue(), 0.0
    for message in messages:
        spins._for_final.put(Numbered(0, message))
        spins._take_rested()
    assert spins._taken == spins._handed_on


def test_an_error_in_the_process_comes_out(session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    run = LiveRun(
        lambda tick_us, on_notice: EventStream(
            ReplayCamera(list, 4, 4, speed=float("inf")), tick_us, on_notice=on_notice
        ),
        session.parameters,
        QUICK,
    )
    monkeypatch.setattr(run._spins, "_run", run._spins._run._replace(targets=("no such stage",)))
    with pytest.raises(SpinscopeError, match="no such stage"):
        list(run.outputs())


def test_a_shot_is_announced_once_and_as_soon_as_there_is_a_spin(session: Session) -> None:
    shots, spins, sent = session.estimate(QUICK).shots, SpinsInFlight(), list[Answers | Exception]()
    live_spins = LiveSpins(SpinRun((QUICK,), False, 4, 4, 5000), sent.append)
    live_spins._ended = [_EndedShot(shot, None, 7 + number, 1.5, spins) for number, shot in enumerate(shots)]
    first, second = shots
    spins._answers = {first.number: {}, second.number: {}}
    refused = SpinEstimate.refused(QUICK, "too few events")
    spins.add(second.number, SpinSoFar(second.end_us, refused))
    live_spins._announce(8)
    assert not sent  # their ticks are still to be answered
    spins.add(first.number, SpinSoFar(first.end_us - 10_000, SpinEstimate(QUICK, np.ones(3), np.eye(3), None)))
    live_spins._announce(6)
    assert not sent
    for is_complete in (False, True, True):
        live_spins._announce(8, is_complete=is_complete)
    found = [(one.number, one.is_final, one.outputs) for one in sent if isinstance(one, Answers)]
    assert [(number, is_final, len(outputs)) for number, is_final, outputs in found] == [(7, False, 1), (8, False, 1)]
    for (_, _, ((came_s, spin),)), shot in zip(found, shots, strict=True):
        assert isinstance(spin, LiveSpin) and (came_s, spin.shot, spin.t_us) == (1.5, shot.number, shot.end_us)
    assert not live_spins._ended
