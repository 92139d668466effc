"""A live run: the same shots as of the recording, bit for bit, whatever happens to camera and clock."""

from __future__ import annotations

import gc
import json
import threading
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from spinscope.pipeline.cameras import ArrivedTick, EventStream, ReplayCamera
from spinscope.pipeline.errors import CameraError, ParameterError
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.live import LiveRun, _HeldTicks
from spinscope.pipeline.live_outputs import LiveBall, LiveNotice, LiveOutput, LiveShot, LiveSpin, LiveStatus
from spinscope.pipeline.live_spins import TrackedTick
from spinscope.pipeline.results import Packet
from spinscope.pipeline.session import Session
from spinscope.pipeline.spin_so_far import ROLLING_METHODS
from spinscope.pipeline.tick import Tick

QUICK = "triplet"  # contrast has the same code behind it and takes ten times as long


def live(session: Session, method: str = QUICK, *, with_balls: bool = False, **replay: Any) -> list[LiveOutput]:
    """What a live run of a session's recording gives, at once."""
    recording = session.recording
    options = {"speed": float("inf"), **replay}
    camera = ReplayCamera(recording.chunks, recording.width_px, recording.height_px, **options)  # type: ignore[union-attr]
    run = LiveRun(
        lambda tick_us, on_notice: EventStream(camera, tick_us, reopen=lambda _: camera, on_notice=on_notice),
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


def test_a_slow_consumer_is_told_the_state_and_its_shots_are_needed_until_it_has_done_with_them(
    samples: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A second passes with each output, so that there is always another one."""
    monkeypatch.setattr("spinscope.pipeline.live.STATUS_S", 1e-9)
    session = Session.open(samples / "own/bounce.h5")
    recording = session.recording
    camera = ReplayCamera(recording.chunks, recording.width_px, recording.height_px, speed=float("inf"))  # type: ignore[union-attr]
    run = LiveRun(lambda tick_us, on_notice: EventStream(camera, tick_us), session.parameters, QUICK)
    is_after_status = False
    for one in run.outputs():
        assert isinstance(one, LiveStatus) or is_after_status
        is_after_status = isinstance(one, LiveStatus)
        if isinstance(one, LiveShot):
            assert run.needed_since is not None and run.needed_since <= (one.clock, one.shot.start_us)
    assert run.needed_since is None


def test_ticks_without_a_ball_go_with_events_where_a_shot_found_later_begins_in_them() -> None:
    """In order, and 50 ms later at the latest; the tick in which a shot ends goes at once, and whole."""

    def tick(number: int, balls: tuple[Any, ...] = (), ended: tuple[Any, ...] = ()) -> TrackedTick:
        event = EventBatch(np.array([5000 * number]), *np.zeros((2, 1), np.uint16), np.ones(1, np.bool_))
        packet = Packet(number, 5000 * number, 5000 * number + 5000, event)
        return TrackedTick(Tick({"track": SimpleNamespace(balls=balls, ended=ended)}, packet, ()), 0, 0.0, 0.0)

    def told(ticks: Any) -> list[tuple[int, int]]:
        return [(one.tick.packet.index, len(one.tick.packet.events)) for one in ticks]

    held = _HeldTicks()
    assert [told(held.passed(tick(number))) for number in range(12)] == 10 * [[]] + [[(0, 0)], [(1, 0)]]
    ball = SimpleNamespace(earlier=("a state",), start_us=50_000)
    assert told(held.passed(tick(12, (ball,)))) == [(n, 0) for n in range(2, 10)] + [(10, 1), (11, 1), (12, 1)]
    assert told(held.passed(tick(13, (), ("an end",)))) == [(13, 1)]
    assert told(held.passed(tick(14))) == [] and told(held.rest()) == [(14, 0)]


def test_all_methods_balls_and_spins_for_robots(samples: Path) -> None:
    session = Session.open(samples / "own/bounce.h5")
    outputs = live(session, "all", with_balls=True)
    result = session.estimate_keeping_ticks()
    assert written(session, outputs) == [shot.to_dict(session.camera, session.ball_radius_m) for shot in result.shots]
    balls = [one for one in outputs if isinstance(one, LiveBall)]
    spins = [one for one in outputs if isinstance(one, LiveSpin)]
    assert [one.track.t_us for one in balls] == [ball.t_us for tick in result.ticks for ball in tick.track.balls]
    flying, announced = ([one for one in spins if (one.ended_by is None) == is_flying] for is_flying in (True, False))
    assert [(one.shot, one.t_us) for one in flying] == [
        (ball.track.shot, ball.packet.end_us) for tick in result.ticks for ball in tick.balls
    ]
    assert sorted((one.shot, one.t_us, one.ended_by) for one in announced) == sorted(
        (shot.number, shot.end_us, shot.ended_by) for shot in result.shots
    )
    assert all(one.spin.t_us <= one.t_us for one in spins)
    answered = [one.spin.estimate for one in announced if one.spin.estimate.vector_rps is not None]
    assert answered and {one.method for one in answered} <= set(ROLLING_METHODS)
    states = [one for one in outputs if isinstance(one, LiveStatus)]
    lines: list[LiveBall | LiveSpin | LiveStatus] = [*balls, *spins, *states]
    for one in lines:
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


def test_an_abandoned_run_leaves_no_thread_and_no_frozen_objects(samples: Path, request: pytest.FixtureRequest) -> None:
    session, before = Session.open(samples / "own/bounce.h5"), set(threading.enumerate())
    recording = session.recording
    camera = ReplayCamera(recording.chunks, recording.width_px, recording.height_px, loops=True)  # type: ignore[union-attr]
    run = LiveRun(lambda tick_us, on_notice: EventStream(camera, tick_us), session.parameters, QUICK)
    outputs = run.outputs()
    gc.unfreeze()  # what these tests have frozen
    request.addfinalizer(gc.freeze)
    next(outputs)
    assert gc.get_freeze_count() > 0, "no search through all that is there while the camera runs"
    outputs.close()  # type: ignore[attr-defined]
    assert set(threading.enumerate()) <= before
    assert gc.get_freeze_count() == 0


def test_what_the_program_has_frozen_itself_stays_frozen(samples: Path) -> None:
    session = Session.open(samples / "own/bounce.h5")
    recording = session.recording
    camera = ReplayCamera(recording.chunks, recording.width_px, recording.height_px, loops=True)  # type: ignore[union-attr]
    run = LiveRun(lambda tick_us, on_notice: EventStream(camera, tick_us), session.parameters, QUICK)
    gc.freeze()
    outputs = run.outputs()
    next(outputs)
    outputs.close()  # type: ignore[attr-defined]
    assert gc.get_freeze_count() > 0


def test_a_camera_s_error_comes_out(samples: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("spinscope.pipeline.cameras.replay.FAULT_US", 20_000)
    session = Session.open(samples / "own/bounce.h5")
    recording = session.recording
    camera = ReplayCamera(
        recording.chunks,  # type: ignore[union-attr]
        recording.width_px,
        recording.height_px,
        speed=float("inf"),
        loops=True,
        fault="disconnect",
    )
    run = LiveRun(lambda tick_us, on_notice: EventStream(camera, tick_us), session.parameters, QUICK)
    with pytest.raises(CameraError, match="unplugged"):
        list(run.outputs())


def test_other_parameters_act_from_now_on(samples: Path) -> None:
    session = Session.open(samples / "own/bounce.h5")
    recording, ticks = session.recording, list[int]()
    other = session.parameters.with_assignments(["logo.pad_px=6"])

    def on_tick(arrived: ArrivedTick, tick: Tick, latency_ms: float) -> None:
        ticks.append(arrived.packet.end_us)
        if arrived.packet.end_us == 30_000:
            run.take_parameters(other)

    camera = ReplayCamera(recording.chunks, recording.width_px, recording.height_px, speed=float("inf"))  # type: ignore[union-attr]
    run = LiveRun(lambda tick_us, on_notice: EventStream(camera, tick_us), session.parameters, QUICK, on_tick=on_tick)
    shots = [one.shot for one in run.outputs() if isinstance(one, LiveShot)]
    assert ticks == sorted(set(ticks)) and run.stream.counts.skipped == 0
    assert shots[0].ended_by == "end" and shots[0].end_us == 30_000 and shots[1].start_us >= 30_000
    with pytest.raises(ParameterError, match="while the camera runs"):
        run.take_parameters(session.parameters.with_assignments(["track.tick_us=1000"]))
