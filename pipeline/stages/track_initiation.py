"""Initiation of tracks: balls are searched for and, once seen well enough, followed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..results import Circle, Packet
from .surface import SurfaceResult
from .track_ball import TrackedBall
from .track_continuation import continued, ended_at
from .track_outline import Sighting
from .track_parameters import TrackParameters
from .track_result import BeganBy, ShotEnd
from .track_search import (
    MOST_CANDIDATES,
    MOST_RIVALS,
    ROUTES,
    Excluded,
    Route,
    agree,
    look,
    moved,
    outside_balls,
    removed_by_filter,
)
from .track_state import Earlier, TrackState, follow_path, is_beyond

# Balls are looked for this often: soon enough to find one within 15 ms. Beside a track that is seen, in the surface and
# in the contour events by turns, or in both where few events outside the balls make it cheap.
LOOK_US, FEW_EVENTS = 5000, 300
# Shots come in across the border, within so many radii of it when first seen. A slow ball that turns up in the
# middle rather rolls about: it is watched for a while, in which a real shot may come.
COMING_IN, SLOW_M_S, WATCH_US = 5.0, 3.5, 20_000
# An outline that waits to be seen again may be missed for a few ticks: on low contrast it shows in every second one.
HELD_US = 15_000
# A ball that was outside the view, or the recording not yet begun, so long ago was not there before it was found.
BEFORE_US = 30_000


def is_search_due(parameters: TrackParameters, state: TrackState, packet: Packet) -> bool:
    """Whether to look for balls anywhere: every LOOK_US, without a ball a tick sooner; always while one is missed."""
    since_us = packet.end_us - state.looked_us
    if not state.balls:
        return since_us > LOOK_US - parameters.tick_us
    return since_us >= LOOK_US or any(ball.measured is None for ball in state.balls)


def begin_tracks(
    parameters: TrackParameters,
    state: TrackState,
    packet: Packet,
    surface: SurfaceResult,
    earlier: Earlier,
    ended: list[ShotEnd],
) -> Circle | None:
    """Begin tracks of sightings that are trusted, or promising for long enough; the best circle.

    Adds what comes before this tick of the shots that begin to `earlier`, and the shots that end with them to `ended`.
    """
    state.looked_us = packet.end_us
    measured = [ball.filter.mean for ball in state.balls if ball.measured is not None]
    events = outside_balls(state.contour, measured, packet.end_us)
    most = MOST_RIVALS if state.balls else MOST_CANDIDATES
    routes: tuple[Route, ...] = ROUTES
    if state.balls and len(events) >= FEW_EVENTS:
        routes = (ROUTES[packet.end_us // LOOK_US % 2],)
    camera, limits = state.context.camera, state.limits
    expected = tuple(_circle_at(packet.end_us, since_us, sighting) for since_us, sighting in state.pending)
    hough, found, excluded = look(surface, events, packet.end_us, camera, limits, state.memory, most, routes, expected)
    if not (state.balls or found or excluded):
        excluded = removed_by_filter(state.context, packet, len(events), surface, limits, state.memory)
    _note_excluded(parameters, state, packet, excluded)
    pending, state.pending = state.pending, []
    for sighting, circle in found:
        if any(ball.covers(sighting) for ball in state.balls if ball.measured is not None):
            continue
        since = next((one for one in pending if agree(one[1], sighting, packet.end_us - one[0])), None)
        if since is None:
            since = packet.end_us, sighting
        else:
            pending.remove(since)
        if packet.end_us - since[0] < _wait_us(parameters, state, sighting):
            state.pending.append(since)
        else:
            _begin(parameters, state, packet, sighting, earlier, ended)
            hough = circle
    state.pending += [one for one in pending if packet.end_us - one[0] < HELD_US]
    state.has_circle = hough is not None
    return hough


def _note_excluded(parameters: TrackParameters, state: TrackState, packet: Packet, excluded: Excluded) -> None:
    """Note the setting that excludes a ball: one that is seen again, as is asked of one within the limits.

    A mark of its print on a ball moves like a ball for a tick as well.
    """
    if state.balls:
        state.excluded, state.shut_out = None, []
        return
    before, state.shut_out = state.shut_out, []
    for sighting, reason in excluded:
        since = next((one for one in before if agree(one[1], sighting, packet.end_us - one[0])), None)
        if since is None:
            since = packet.end_us, sighting
        else:
            before.remove(since)
        if packet.end_us - since[0] >= parameters.contour_us:
            state.excluded = reason
        state.shut_out.append(since)
    state.shut_out += [one for one in before if packet.end_us - one[0] < HELD_US]


def _circle_at(end_us: int, since_us: int, sighting: Sighting) -> Circle:
    """The circle at which an outline sighted then must be now."""
    x, y, _, _, radius = moved(sighting.ring, end_us - since_us).tolist()
    return Circle(x, y, radius, sighting.score)


def _wait_us(parameters: TrackParameters, state: TrackState, sighting: Sighting) -> int:
    """Time for which such a sighting must have been seen before it is a shot, us."""
    camera, (x, y, _, _, radius) = state.context.camera, sighting.ring
    inside = min(x, y, camera.width_px - 1 - x, camera.height_px - 1 - y)
    if sighting.speed_px_s / radius * state.context.ball_radius_m < SLOW_M_S and inside > COMING_IN * radius:
        return WATCH_US
    # What is not trusted at once counts when seen again in events that it does not share with the first time.
    return 0 if sighting.trusted else parameters.contour_us


def _begin(
    parameters: TrackParameters,
    state: TrackState,
    packet: Packet,
    sighting: Sighting,
    earlier: Earlier,
    ended: list[ShotEnd],
) -> None:
    """Follow a sighting: as the ball out of sight whose path it meets, else as a new shot.

    The new shot begins at the contact where its path continues another ball's, which then ends there, else with the
    first tick in which its ball is measured; the states since then are in `earlier`.
    """
    for ball in state.balls:
        if ball.measured is None and ball.is_found(sighting, packet.end_us):
            ball.restart(state.measuring, sighting, packet.start_us, packet.end_us)
            return
    ball = TrackedBall.at(sighting, state.measuring, state.shots, packet, "found")
    path, first = state.past.path_before(ball, state.balls, state.measuring, parameters.coast_us)
    tick = state.past.ticks[-len(path)]
    known = [other for other in state.balls if other.shot not in earlier]
    continuation = continued(parameters, state, known, sighting, path, first)
    if continuation is not None:
        other, contact = continuation
        state.let_go(other)
        ended.append(ended_at(contact, other))
        # What was measured on the old path since is not the ball.
        since = [replace(point, circle=None) for point in other.path if contact.latest_us < point.end_us]
        path = [*(point for point in since if point.end_us < path[0].end_us), *path]
        ball = replace(ball, path=path).after(contact, state.measuring, state.shots)
        ball.doubt = ended[-1].doubt
        earlier[ball.shot] = follow_path(parameters, ball, path, ball.start_us + parameters.contour_us)
    else:
        if len(path) > 1:
            ball = ball.extended(path, tick.start_us, first, state.measuring)
        ball.began_by = _began_by(state, tick, first)
        if len(path) > 1:
            earlier[ball.shot] = follow_path(parameters, ball, path, tick.end_us)
    state.balls.append(ball)
    state.shots += 1


def _began_by(state: TrackState, tick: Packet, ball: NDArray[np.float64]) -> BeganBy:
    """Whether a ball (5,) first seen at a tick's end came in across the border, or was there from the beginning."""
    first_us = tick.start_us if state.first_us is None else state.first_us
    since_us = max(first_us, tick.end_us - BEFORE_US)
    if is_beyond(moved(ball, since_us - tick.end_us), state.context.camera):
        return "entered"
    return "start" if since_us == first_us else "found"
