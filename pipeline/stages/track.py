"""Track: Hough circle and Kalman filter together (section 3.1), for every ball in view.

The Hough transform finds the ball in the surface: anywhere while there is no track, near the prediction and
within the radii that the filter allows while there is one. Unlike the paper, which feeds the Hough circle to the
filter, the filter gets the circle refined on the ball's outline in the events (track_outline): an EROS surface
shows the outline one to two pixels late on fast balls, the events to a tenth of a pixel. A ball's track is cut into
shots where a contact bends its path (track_contact).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..errors import ParameterError
from ..events import EventBatch
from ..results import Circle, Packet
from ..stage import Context, Stage
from .filter import FilterResult
from .surface import SurfaceResult
from .track_background import SHAKING_US, background_moves
from .track_ball import Measuring, TrackedBall
from .track_contact import Contact, find_contact
from .track_continuation import CONTACT_UNCERTAIN, ended_at
from .track_hough import hough_near
from .track_initiation import begin_tracks, is_search_due
from .track_limits import Limits
from .track_outline import VOTE_US, Edge
from .track_parameters import TrackParameters
from .track_path import PathPoint
from .track_result import BallTrack, EndedBy, ShotEnd, Status, TrackResult
from .track_search import SearchMemory
from .track_state import Earlier, TrackState, ball_track, follow_path, is_beyond

# What speaks against one free flight, in words for people.
MAY_ROLL = "the ball is slow and was seen for too short a time to tell whether it flies or rolls"
# Circles measured after a contact until it is announced; fewer would not tell when it was. At a shot's end, the one
# there is.
AFTER_CONTACT, AFTER_CONTACT_AT_END = 3, 1


def start(parameters: TrackParameters, context: Context) -> TrackState:
    """Fresh state; raises ParameterError for a fixed ball without a place or radii the wrong way round."""
    if parameters.ball == "fixed":
        _fixed_ring(parameters)
    limits = Limits.of(
        context,
        parameters.radius_min_px,
        parameters.radius_max_px,
        parameters.speed_min_m_s,
        parameters.speed_max_m_s,
    )
    measuring = Measuring(
        context.camera,
        context.ball_radius_m,
        Edge(parameters.outline_px, parameters.lag_px),
        parameters.contour_us,
        parameters.acceleration_m_s2,
        parameters.approach_m_s,
    )
    return TrackState(context, limits, measuring, SearchMemory.of(context.camera))


def step(
    parameters: TrackParameters,
    state: TrackState,
    packet: Packet,
    filtered: FilterResult,
    surface: SurfaceResult,
) -> TrackResult:
    """One tick: the balls at its end."""
    return _STEPS[parameters.ball](parameters, state, packet, filtered, surface)


def _step_fixed(
    parameters: TrackParameters, state: TrackState, packet: Packet, filtered: FilterResult, surface: SurfaceResult
) -> TrackResult:
    """A ball spinner's ball: the stated circle."""
    variance = np.array([1.0, 1.0, 0.0, 0.0, 1.0]) * parameters.fixed_std_px**2
    if state.first_us is None:
        state.first_us = packet.start_us
    t_us = packet.end_us - parameters.latency_us
    ball = BallTrack(
        0, t_us, parameters.latency_us, _fixed_ring(parameters), np.diag(variance), None, state.first_us, "start"
    )
    return TrackResult("tracking", None, t_us, (ball,), None)


def _step_flying(
    parameters: TrackParameters, state: TrackState, packet: Packet, filtered: FilterResult, surface: SurfaceResult
) -> TrackResult:
    """Flying balls: followed from tick to tick, cut into shots at contacts, and others searched for."""
    since_us, events = packet.end_us - max(parameters.contour_us, VOTE_US), filtered.contour_events
    if since_us < packet.start_us:
        events = EventBatch.concatenate([state.contour, events])
    state.contour = events.between(since_us, packet.end_us)
    state.past.add(replace(packet, events=filtered.contour_events))
    state.first_us = packet.start_us if state.first_us is None else state.first_us
    for ball in state.balls:
        ball.filter.predict((packet.end_us - packet.start_us) * 1e-6)
    hough = _hough_near(state, state.balls[0], surface) if state.balls else None
    lost: str | None = None
    ended: list[ShotEnd] = []
    for ball in tuple(state.balls):
        lost, end = _follow(parameters, state, ball, packet)
        if end is not None:
            state.let_go(ball)
            ended.append(end)
    for ball in _doubles(state.balls):
        state.let_go(ball)
        ended.append(ShotEnd(ball.shot, packet.start_us, "lost"))
    earlier: Earlier = {}
    if is_search_due(parameters, state, packet):
        anywhere = begin_tracks(parameters, state, packet, surface, earlier, ended)
        hough = hough or anywhere
        if parameters.shake_px > 0.0 and state.balls and _background_moves(state):
            state.shaken_us = packet.end_us
    if state.shaken_us is not None and packet.end_us - state.shaken_us < SHAKING_US:
        for ball in state.balls:
            ball.add_shake(parameters.shake_px, ball.start_us if ball.shot in earlier else packet.start_us)
    contacts = _announce_contacts(parameters, state, earlier)
    for ball in state.balls:
        if ball.is_shot:
            is_shadow, rolls = any(ball.is_shadow_of(other) for other in state.balls), ball.rolls(state.measuring)
            ball.is_shot = not is_shadow and rolls is not True
            if ball.doubt != CONTACT_UNCERTAIN:  # which stays
                ball.doubt = MAY_ROLL if rolls is None else None
    state.balls.sort(key=lambda ball: not ball.is_shot)
    balls = tuple(ball_track(parameters, ball, packet.end_us, earlier.get(ball.shot, ())) for ball in state.balls)
    status: Status = "coasting"
    reason = None
    if balls:
        status = "coasting" if balls[0].measured is None else "tracking"
    elif ended:
        status, reason = "lost", lost
    elif state.pending:
        status, reason = "starting", "no ball yet: a circle moves like a ball, but it must be seen once more"
    else:
        status = "searching"
        circle = "no circle moves like a ball" if state.has_circle else "no circle in the surface"
        reason = f"no ball: {state.excluded or circle}"
    candidate = state.measuring.circle(state.pending[0][1]) if status == "starting" else None
    t_us = packet.end_us - parameters.latency_us
    return TrackResult(status, reason, t_us, balls, hough, candidate, (*ended, *contacts))


_STEPS = {"flying": _step_flying, "fixed": _step_fixed}


def _follow(
    parameters: TrackParameters, state: TrackState, ball: TrackedBall, packet: Packet
) -> tuple[str | None, ShotEnd | None]:
    """Measure a ball that was predicted; why and how its shot ends if it does."""
    start_us, end_us = packet.start_us, packet.end_us
    if is_beyond(ball.filter.mean, state.context.camera):
        return "the ball left the view", _end(parameters, state, ball, start_us, "left")
    others = [other for other in state.balls if other is not ball]
    events = ball.own_events(state.contour, others, end_us)
    seen = ball.measure(state.measuring, events, start_us, end_us)
    if seen is None and events is state.contour:  # not while another ball's outline may be taken for its own
        seen = ball.measure_off_path(state.measuring, events, start_us, end_us)
    if seen is None:
        ball.coast(end_us)
        if end_us - ball.seen_us > parameters.coast_us:
            reason = f"the ball was not seen for {parameters.coast_us / 1000:g} ms"
            return reason, _end(parameters, state, ball, ball.seen_us, "lost")
    return None, None


def _doubles(balls: list[TrackedBall]) -> list[TrackedBall]:
    """The balls that follow the same outline as one found before them."""
    return [ball for place, ball in enumerate(balls) if any(ball.shares_outline(other) for other in balls[:place])]


def _end(parameters: TrackParameters, state: TrackState, ball: TrackedBall, end_us: int, ended_by: EndedBy) -> ShotEnd:
    """End of a shot, at a contact if one came so late that the ball was hardly seen after it."""
    contact = _contact(parameters, state, ball.path, AFTER_CONTACT_AT_END)
    return ShotEnd(ball.shot, end_us, ended_by) if contact is None else ended_at(contact, ball)


def _contact(
    parameters: TrackParameters, state: TrackState, path: list[PathPoint], circles_after: int
) -> Contact | None:
    context = state.context
    return find_contact(path, context.camera, context.ball_radius_m, parameters.contour_us, circles_after)


def _announce_contacts(parameters: TrackParameters, state: TrackState, earlier: Earlier) -> list[ShotEnd]:
    """End the shots whose contact is known now; adds what comes before this tick of those that it began to `earlier`.

    A shot that is itself announced in this tick, with its own earlier states, ends in the next one at the soonest.
    """
    ended = []
    for place, ball in enumerate(state.balls):
        if ball.measured is None or ball.shot in earlier:
            continue
        contact = _contact(parameters, state, ball.path, AFTER_CONTACT)
        if contact is None:
            continue
        ended.append(ended_at(contact, ball))
        after = ball.after(contact, state.measuring, state.shots)
        after.doubt = ended[-1].doubt
        path = [replace(point, circle=None) if point.end_us == contact.stray_us else point for point in ball.path]
        earlier[after.shot] = follow_path(parameters, after, path, after.start_us + parameters.contour_us)
        state.balls[place] = after
        state.past.gone.append(ball)
        state.shots += 1
    return ended


def _background_moves(state: TrackState) -> bool:
    return background_moves(state.contour, state.memory.last_us, state.context.camera)


def _hough_near(state: TrackState, ball: TrackedBall, surface: SurfaceResult) -> Circle | None:
    x, y, _, _, radius = state.measuring.edge.outline(ball.filter.mean)
    span = max(2.0, 3.0 * math.sqrt(ball.filter.covariance[4, 4]))
    return hough_near(surface, x, y, radius - span, radius + span)


def _fixed_ring(parameters: TrackParameters) -> NDArray[np.float64]:
    x, y, radius = parameters.fixed_x_px, parameters.fixed_y_px, parameters.fixed_radius_px
    if x is None or y is None or radius is None:
        raise ParameterError(
            "track.ball = fixed needs the ball's place: give --fixed-ball X_PX Y_PX RADIUS_PX or --fixed-ball "
            "auto (track.fixed_x_px, track.fixed_y_px, track.fixed_radius_px)"
        )
    return np.array([x, y, 0.0, 0.0, radius])


STAGE = Stage(
    name="track",
    label="Tracker",
    help="Hough circle in the surface, refined on the ball's outline, and Kalman filter: each ball's place and speed.",
    scope="recording",
    inputs=("packet", "filter", "surface"),
    reads=("filter.contour_mode",),
    parameters=TrackParameters,
    start=start,
    step=step,
)
