"""Choice of the ball that the detail views follow, and of what is known of each tick in the end."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

from spinscope.pipeline.shots import Shot
from spinscope.pipeline.stages.track_result import Status
from spinscope.pipeline.tick import BallTick, Tick

Absent = Callable[[str, str], Any]


def followed_ticks(ticks: Sequence[Tick], shots: Sequence[Shot], followed: Shot | None, absent: Absent) -> list[Tick]:
    """The ticks as they are known in the end, the followed shot's ball first where it is in flight.

    A contact is known only some ticks later: in the ticks in between the shot before it is replaced by the one after
    it, so that no tick shows results of two shots. A ball that was found late is shown from its first tick on.

    Parameters
    ----------
    ticks : sequence of Tick
        In order of time, without gaps.
    shots : sequence of Shot
        Found in the ticks.
    followed : Shot, optional
        One of them; elsewhere, or where there is none, the tracker's first ball is followed.
    absent : callable
        `absent(stage, reason)` is the stage's result without a ball.
    """
    number = None if followed is None else followed.number
    contacts_us = {shot.number: shot.end_us for shot in shots if shot.ended_by in ("bounce", "hit")}
    late: dict[int, list[tuple[int, BallTick]]] = {}
    for tick in ticks:
        for place, ball in enumerate(tick.balls):
            for earlier in ball.earlier:
                late.setdefault(earlier.packet.index, []).append((place, earlier))
    known = []
    for tick in ticks:
        end_us, balls = tick.packet.end_us, late.get(tick.packet.index, [])
        balls += [(n, b) for n, b in enumerate(tick.balls) if end_us <= contacts_us.get(b.track.shot, end_us)]
        balls.sort(key=lambda one: (one[1].track.shot != number, one[0]))
        known.append(_with_balls(tick, tuple(ball for _, ball in balls), absent))
    return known


def _with_balls(tick: Tick, balls: tuple[BallTick, ...], absent: Absent) -> Tick:
    """The tick with these balls, the first of which is followed."""
    if balls == tick.balls:
        return tick
    if balls:
        hough = tick.track.hough if balls[0].track.shot == tick.track.shot else None  # it is of the first ball
        status: Status = "coasting" if balls[0].track.measured is None else "tracking"
        tracks = tuple(ball.track for ball in balls)
        track = dataclasses.replace(tick.track, status=status, reason=None, balls=tracks, hough=hough)
        return Tick({**tick.results, "track": track, **balls[0].results}, tick.packet, balls)
    reason = "no ball: it bounced or was hit, and is not found again yet"
    track = dataclasses.replace(tick.track, status="lost", reason=reason, balls=())
    results = {name: absent(name, reason) for name in tick.balls[0].results}
    return Tick({**tick.results, "track": track, **results}, tick.packet, ())
