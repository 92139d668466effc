"""A live run: the same shots as of the recording, bit for bit, whatever happens to camera and clock."""

from __future__ import annotations

import json
import threading
from pathlib import Path
from typing import Any

import pytest

from spinscope.pipeline.cameras import EventStream, ReplayCamera
from spinscope.pipeline.errors import CameraError
from spinscope.pipeline.live import (
    LiveBall,
    LiveNotice,
    LiveOutput,
    LiveRun,
    LiveShot,
    LiveSpin,
    LiveStatus,
)
from spinscope.pipeline.session import Session

QUICK = "triplet"  # contrast has the same code behind it and takes ten times as long


def live(session: Session, method: str = QUICK, *, with_balls: bool = False, **replay: Any) -> list[LiveOutput]:
    """What a live run of a session's recording gives, at once."""
    recording = session.recording
    options = {"speed": float("inf"), **replay}
    camera = ReplayCamera(recording.chunks, recording.width_px, recording.height_px, **options)  # type: ignore[union-attr]
    run = LiveRun(
        lambda tick_us, on_notice: EventStream(camera, tick_us, reopen=lambda: camera, on_notice=on_notice),
        session.parameters,
        method,
        with_balls=with_balls,
    )
    return list(run.outputs())


def written(session: Session, outputs: list[LiveOutput]) -> list[dict[str, Any]]:
    shots = [one.shot for one in outputs if isinstance(one, LiveShot)]
    return [shot.to_dict(session.camera, session.ball_radius_m) for shot in sorted(shots, key=lambda s: s.start_us)]


@pytest.mark.parametrize("name", ["flight_two_balls.h5", "own/spinner_top.h5"])
def test_shots_are_those_of_the_recording(samples: Path, name: str) -> None:
    session = Session.open(samples / name)
    result = session.estimate(QUICK)
    outputs = live(session)
    assert written(session, outputs) == [shot.to_dict(session.camera, session.ball_radius_m) for shot in result.shots]
    status = outputs[-1]
    assert isinstance(status, LiveStatus)
    assert status.events == session.source.event_count and status.skipped == status.late == status.outside == 0


def test_all_methods_balls_and_spins_for_robots(samples: Path) -> None:
    session = Session.open(samples / "own/bounce.h5")
    outputs = live(session, "all", with_balls=True)
    result = session.estimate_keeping_ticks()
    assert written(session, outputs) == [shot.to_dict(session.camera, session.ball_radius_m) for shot in result.shots]
    balls = [one for one in outputs if isinstance(one, LiveBall)]
    spins = [one for one in outputs if isinstance(one, LiveSpin)]
    assert [one.track.t_us for one in balls] == [ball.t_us for tick in result.ticks for ball in tick.track.balls]
    trusted = [ball for tick in result.ticks for ball in tick.balls if ball.best is not None]
    assert [(one.shot, one.t_us, one.best) for one in spins] == [
        (ball.track.shot, ball.packet.end_us, ball.best) for ball in trusted
    ]
    for one in (*balls, *spins, *(one for one in outputs if isinstance(one, LiveStatus))):
        assert json.loads(json.dumps(one.to_dict(), allow_nan=False))


@pytest.mark.parametrize(("fault", "said"), [("clock-reset", "clock went from"), ("disconnect", "is back")])
def test_a_new_clock_ends_a_shot_and_begins_another(
    samples: Path, monkeypatch: pytest.MonkeyPatch, fault: str, said: str
) -> None:
    monkeypatch.setattr("spinscope.pipeline.cameras.replay.FAULT_US", 75_000)
    session = Session.open(samples / "own/bounce.h5")
    outputs = live(session, fault=fault)
    shots = [one for one in outputs if isinstance(one, LiveShot)]
    # In flight at the reset, 12 ms after the bounce and 45 ms before the recording's end.
    assert [(one.clock, one.shot.ended_by) for one in shots][-2:] == [(0, "end"), (1, "end")]
    assert shots[-1].shot.start_us < 10_000 and 40_000 < shots[-1].shot.end_us < 50_000
    assert any(said in one.text for one in outputs if isinstance(one, LiveNotice))


def test_an_abandoned_run_leaves_no_thread(samples: Path) -> None:
    session, before = Session.open(samples / "own/bounce.h5"), set(threading.enumerate())
    recording = session.recording
    camera = ReplayCamera(recording.chunks, recording.width_px, recording.height_px, loops=True)  # type: ignore[union-attr]
    run = LiveRun(lambda tick_us, on_notice: EventStream(camera, tick_us), session.parameters, QUICK)
    outputs = run.outputs()
    next(outputs)
    outputs.close()  # type: ignore[attr-defined]
    assert set(threading.enumerate()) <= before


def test_a_camera_s_error_comes_out(samples: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("spinscope.pipeline.cameras.replay.FAULT_US", 20_000)
    session = Session.open(samples / "own/bounce.h5")
    recording = session.recording
    camera = ReplayCamera(
        recording.chunks,
        recording.width_px,
        recording.height_px,
        speed=float("inf"),
        loops=True,
        fault="disconnect",  # type: ignore[union-attr]
    )
    run = LiveRun(lambda tick_us, on_notice: EventStream(camera, tick_us), session.parameters, QUICK)
    with pytest.raises(CameraError, match="unplugged"):
        list(run.outputs())
