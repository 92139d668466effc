"""Process of a live run's spins: what happens when it ends before its time."""

from __future__ import annotations

from pathlib import Path

import pytest

from spinscope.pipeline import spin_process
from spinscope.pipeline.cameras import ArrivedTick, EventStream, ReplayCamera
from spinscope.pipeline.child_process import ChildProcess
from spinscope.pipeline.errors import SpinscopeError
from spinscope.pipeline.live import LiveRun
from spinscope.pipeline.live_outputs import LiveNotice, LiveOutput, LiveShot, LiveSpin
from spinscope.pipeline.session import Session
from spinscope.pipeline.tick import Tick

QUICK = "triplet"


@pytest.fixture(scope="module")
def session(request: pytest.FixtureRequest) -> Session:
    samples: Path = request.getfixturevalue("samples")
    return Session.open(samples / "own/bounce.h5")


def live(session: Session, killed_at_us: int | None = None) -> list[LiveOutput]:
    """Outputs of a run whose process is killed when a tick has been tracked."""
    recording = session.recording
    camera = ReplayCamera(recording.chunks, recording.width_px, recording.height_px, speed=float("inf"))  # type: ignore[union-attr]

    def on_tick(arrived: ArrivedTick, tick: Tick, latency_ms: float) -> None:
        if arrived.packet.end_us == killed_at_us:
            run._spins._process.kill()

    run = LiveRun(
        lambda tick_us, on_notice: EventStream(camera, tick_us, on_notice=on_notice),
        session.parameters,
        QUICK,
        with_balls=True,
        on_tick=on_tick,
    )
    return list(run.outputs())


def told(outputs: list[LiveOutput]) -> list[tuple[int, int, str | None]]:
    return [(one.shot, one.t_us, one.ended_by) for one in outputs if isinstance(one, LiveSpin)]


def notices(outputs: list[LiveOutput]) -> list[str]:
    return [one.text for one in outputs if isinstance(one, LiveNotice)]


def test_a_killed_process_loses_no_shot_and_repeats_none(session: Session) -> None:
    whole, outputs = live(session), live(session, killed_at_us=90_000)  # 15 ms after the bounce is known
    for found in (whole, outputs):
        assert [one.shot.to_dict(session.camera, 0.02) for one in found if isinstance(one, LiveShot)] == [
            shot.to_dict(session.camera, 0.02) for shot in session.estimate(QUICK).shots
        ]
    assert told(outputs) == told(whole)
    (notice,) = notices(outputs)
    assert ": another one works on the last" in notice


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
