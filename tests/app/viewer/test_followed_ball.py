"""Contacts, several balls, and the choice of the ball that is followed, as the viewer shows them."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from spinscope.app.viewer import entities
from spinscope.app.viewer.followed_ball import followed_ticks
from spinscope.app.viewer.rrd import write_rrd
from spinscope.app.viewer.run import ViewedRun
from spinscope.pipeline.registry import STAGES
from spinscope.pipeline.session import Choices, Result, Session
from spinscope.pipeline.stage import Stage
from spinscope.pipeline.stages.track_result import ShotEnd, TrackResult
from tests.app.viewer.reading import Rows, read_back

CONTACT_US, KNOWN_US, OTHER_US = 52_000, 65_000, (30_000, 80_000)


def bouncing(tracker: Stage) -> Stage:
    """The tracker, telling of a bounce in the middle of its flight three ticks late, and of a second ball beside it."""

    def step(parameters: Any, state: Any, packet: Any, *inputs: Any) -> TrackResult:
        told: TrackResult = tracker.step(parameters, state[0], packet, *inputs)
        if told.ball is None:
            return told
        after = dataclasses.replace(told.ball, shot=2, start_us=CONTACT_US, began_by="bounce")
        ball = told.ball if packet.end_us <= KNOWN_US else after
        ended: tuple[ShotEnd, ...] = ()
        if CONTACT_US < packet.end_us <= KNOWN_US:
            state[1].append(after)
        elif state[1]:
            ball, ended = dataclasses.replace(after, earlier=tuple(state[1])), (ShotEnd(0, CONTACT_US, "bounce"),)
            state[1].clear()
        balls = [ball]
        if OTHER_US[0] < packet.end_us <= OTHER_US[1]:
            beside = np.add(told.ball.mean, [0, 100, 0, 0, 0])
            other = dataclasses.replace(told.ball, shot=1, mean=beside, start_us=OTHER_US[0], began_by="found")
            balls.append(other)
        return dataclasses.replace(told, balls=tuple(balls), ended=ended)

    def start(parameters: Any, context: Any) -> Any:
        return tracker.start(parameters, context), []

    return dataclasses.replace(tracker, start=start, step=step)


@pytest.fixture(scope="module")
def result(samples: Path) -> Iterator[Result]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(STAGES._entries, "track", bouncing(STAGES["track"]))
        yield Session.open(samples / "flight_fast_top.h5", Choices()).estimate_keeping_ticks()


@pytest.fixture(scope="module")
def run(result: Result) -> ViewedRun:
    return ViewedRun.of(result)


@pytest.fixture(scope="module")
def logged(run: ViewedRun, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Rows]:
    path = tmp_path_factory.mktemp("rrd") / "run.rrd"
    write_rrd(run, path, "all")
    return read_back(path)


def test_the_shots_before_and_after_a_bounce_are_two_with_a_spin_each(result: Result) -> None:
    before, other, after = result.shots
    assert (before.end_us, before.ended_by, after.start_us, after.began_by) == (CONTACT_US, "bounce", 52_000, "bounce")
    assert (other.start_us, other.end_us) == OTHER_US
    true_rps = result.session.truth.spin_rps[0]  # type: ignore[union-attr]
    for shot in (before, after):
        assert shot.best is not None
        vector_rps = shot.estimates[shot.best].vector_rps
        assert vector_rps is not None
        assert np.linalg.norm(vector_rps - true_rps) < 6, "both are of the same flight"


def test_no_tick_shows_a_shot_after_its_contact(result: Result, run: ViewedRun) -> None:
    for raw, tick in zip(result.ticks, run.ticks, strict=True):
        if not tick.balls:
            continue
        assert tick.track.shot == (0 if tick.packet.end_us <= CONTACT_US else 2)
        assert tick.track.balls == tuple(ball.track for ball in tick.balls)
        assert tick.logo is tick.balls[0].results["logo"]
        in_between = CONTACT_US < tick.packet.end_us <= KNOWN_US
        assert (tick is raw) is not in_between
    after_us = np.concatenate([tick.logo.events.t_us for tick in run.ticks if tick.track.shot == 2])
    assert after_us.min() >= CONTACT_US


def test_another_shot_is_followed_while_it_flies_without_a_stage_run_again(result: Result) -> None:
    seconds = dict(result.session.chain.seconds)
    other = ViewedRun.of(result, followed=2)
    for tick in other.ticks:
        if OTHER_US[0] < tick.packet.end_us <= OTHER_US[1]:
            assert tick.track.shot == 1
            assert len(tick.balls) == 2
        elif tick.balls:
            assert tick.track.shot in (0, 2)
    assert result.session.chain.seconds == seconds
    assert OTHER_US[0] < other.opening_us <= OTHER_US[1], "the viewer opens where it flies"
    assert [number for _, number in ViewedRun.of(result).seen_shots] == [1, 3]
    assert [number for _, number in other.seen_shots] == [1, 2, 3]
    assert ViewedRun.of(result, followed=9).followed is None


def test_after_a_contact_without_a_new_shot_there_is_no_ball(result: Result) -> None:
    bounced = [shot for shot in result.shots if shot.number == 0]
    ticks = [tick for tick in result.ticks if not tick.balls or tick.packet.end_us <= KNOWN_US]
    alone = [dataclasses.replace(tick, balls=tick.balls[:1]) for tick in ticks]
    known = followed_ticks(alone, bounced, None, lambda stage, reason: (stage, reason))
    (after,) = {tick.logo for tick in known if CONTACT_US < tick.packet.end_us <= KNOWN_US}
    assert after[0] == "logo" and "not found again" in after[1]
    assert all(not tick.track.has_ball for tick in known if tick.packet.end_us > CONTACT_US)


def test_the_timeline_marks_shots_and_contacts(run: ViewedRun, logged: dict[str, Rows]) -> None:
    first, second = logged[f"{entities.SHOTS}/1"], logged[f"{entities.SHOTS}/2"]
    assert first.at("state", CONTACT_US - 1) != first.at("state", CONTACT_US) == ["from a bounce"]
    assert second.at("state", OTHER_US[0]) == ["found in view"]
    assert second.at("state", OTHER_US[1]) == ["no shot"]
    (text,) = logged[entities.CONTACTS].at("text", CONTACT_US)
    assert "shot 1 ends: bounced" in str(text) and "shot 3 begins: from a bounce" in str(text)
    assert run.contacts_us.tolist() == [CONTACT_US]
    for plot in (entities.SPIN_MAGNITUDE, f"{entities.PLOT}/radius"):
        assert CONTACT_US in logged[f"{plot}/contacts"].t_us["scalars"]


def test_every_ball_has_its_circle_its_number_and_its_track(run: ViewedRun, logged: dict[str, Rows]) -> None:
    assert logged[entities.BALLS].at("labels", 45_000) == ["1", "2"]
    assert logged[entities.BALLS].at("labels", 60_000) == ["3", "2"]
    assert logged[entities.BALLS].at("labels", 90_000) == ["3"]
    tracks = logged[entities.TRACKS].at("strips", 60_000)
    assert [len(strip) for strip in tracks] == [2, 6]


def test_the_summary_has_all_shots_side_by_side(run: ViewedRun, logged: dict[str, Rows]) -> None:
    (text,) = logged[entities.SUMMARY].at("text", 50_000)
    assert "shot 1 of 3" in str(text), "the last tick before the contact has the whole shot's result"
    rows = [line for line in str(text).splitlines() if line.startswith(("| 1 |", "| 2 |", "| 3 |"))]
    assert "bounced" in rows[0] and "from a bounce" in rows[2]
    assert all("±" in row for row in (rows[0], rows[2]))
