"""Track: Hough circle and Kalman filter together (section 3.1), for every ball in view.

The Hough transform finds the ball in the surface: anywhere while there is no track, near the prediction and
within the radii that the filter allows while there is one. Unlike the paper, which feeds the Hough circle to the
filter, the filter gets the circle refined on the ball's outline in the events (track_outline): an EROS surface
shows the outline one to two pixels late on fast balls, the events to a tenth of a pixel. A ball's track is cut into
shots where a contact bends its path (track_contact).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..errors import ParameterError
from ..events import EventBatch
from ..parameters import ParameterGroup, choice, tunable
from ..results import Circle, Packet
from ..stage import Context, Stage
from .filter import FilterResult
from .surface import SurfaceResult
from .track_background import SHAKING_US, background_moves
from .track_ball import Measuring, TrackedBall
from .track_contact import Contact, find_contact
from .track_extension import Past
from .track_hough import hough_near
from .track_limits import Limits
from .track_outline import VOTE_US, Edge, Sighting
from .track_path import PathPoint
from .track_result import BallTrack, BeganBy, EndedBy, ShotEnd, Status, TrackResult
from .track_search import (
    MOST_CANDIDATES,
    MOST_RIVALS,
    ROUTES,
    Route,
    agree,
    look,
    moved,
    outside_balls,
    removed_by_filter,
    support_times,
)


@dataclass(frozen=True, kw_only=True)
class TrackParameters(ParameterGroup):
    """The tick, the search for the circle, and the Kalman filter."""

    ball: str = choice("flying", ("flying", "fixed"), "flying ball, or a ball spinner's ball that stays in place")
    tick_us: int = tunable(5000, 200, 100_000, 100, "us", "time between two steps of the pipeline (200 Hz)")
    radius_min_px: float | None = tunable(
        None, 2.0, 500.0, 0.5, "px", "smallest radius looked for; none = a ball 6 m away"
    )
    radius_max_px: float | None = tunable(
        None, 3.0, 500.0, 0.5, "px", "largest radius looked for; none = a ball 0.3 m away"
    )
    speed_min_m_s: float = tunable(1.0, 0.0, 100.0, 0.1, "m/s", "slowest ball that counts as a shot")
    speed_max_m_s: float = tunable(25.0, 1.0, 200.0, 1.0, "m/s", "fastest ball looked for")
    latency_us: float = tunable(40.0, 0.0, 10_000.0, 5.0, "us", "how late the pixels report an edge")
    lag_px: float = tunable(0.1, -2.0, 5.0, 0.05, "px", "how far the outline seems behind, at any speed")
    outline_px: float = tunable(0.5, 0.0, 5.0, 0.05, "px", "how far outside the ball the pixels see its edge")
    contour_us: int = tunable(3000, 500, 50_000, 100, "us", "how far back in time the outline's events are taken")
    acceleration_m_s2: float = tunable(15.0, 0.1, 1000.0, 1.0, "m/s^2", "Kalman: 1 sigma of the acceleration")
    approach_m_s: float = tunable(3.0, 0.1, 100.0, 0.5, "m/s", "Kalman: 1 sigma of the speed towards the camera")
    shake_px: float = tunable(
        0.4, 0.0, 20.0, 0.1, "px", "1 sigma by which a shaking camera moves the ball while most of the background moves"
    )
    coast_us: int = tunable(20_000, 0, 1_000_000, 1000, "us", "how long an unseen ball is kept")
    fixed_x_px: float | None = tunable(None, 0.0, 10_000.0, 0.1, "px", "fixed ball: column of the centre")
    fixed_y_px: float | None = tunable(None, 0.0, 10_000.0, 0.1, "px", "fixed ball: row of the centre")
    fixed_radius_px: float | None = tunable(None, 1.0, 1000.0, 0.1, "px", "fixed ball: radius")
    fixed_std_px: float = tunable(0.5, 0.0, 100.0, 0.1, "px", "fixed ball: 1 sigma of centre and radius")


# Beside a track that is seen, other balls are looked for this often, in the surface and in the contour events by turns,
# or in both where few events outside the balls make it cheap: soon enough to find one within 15 ms.
LOOK_US, FEW_EVENTS = 5000, 300
# Shots come in across the border, within so many radii of it when first seen. A slow ball that turns up in the
# middle rather rolls about: it is watched for a while, in which a real shot may come.
COMING_IN, SLOW_M_S, WATCH_US = 5.0, 3.5, 20_000
# An outline that waits to be seen again may be missed for a few ticks: on low contrast it shows in every second one.
HELD_US = 15_000
# A ball that was outside the view, or the recording not yet begun, so long ago was not there before it was found.
BEFORE_US = 30_000
# What speaks against one free flight, in words for people.
CONTACT_UNCERTAIN = "the camera shakes so much that it is uncertain when, and whether, the ball touched something"
MAY_ROLL = "the ball is slow and was seen for too short a time to tell whether it flies or rolls"
# Circles measured after a contact until it is announced; fewer would not tell when it was. At a shot's end, the one
# there is.
AFTER_CONTACT, AFTER_CONTACT_AT_END = 3, 1


# States at the ends of ticks before the one in which a shot is announced, by shot.
Earlier = dict[int, tuple[BallTrack, ...]]


@dataclass(slots=True)
class TrackState:
    """State of the tracker from tick to tick."""

    context: Context
    limits: Limits
    measuring: Measuring
    last_us: NDArray[np.uint16]
    contour: EventBatch = field(default_factory=EventBatch.empty)
    past: Past = field(default_factory=Past)
    balls: list[TrackedBall] = field(default_factory=list)
    pending: list[tuple[int, Sighting]] = field(default_factory=list)
    first_us: int | None = None
    looked_us: int = 0
    shaken_us: int | None = None  # when most of the background was last seen to move
    shots: int = 0
    excluded: str | None = None  # the setting that excluded a circle since the last ball, in words


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
    return TrackState(context, limits, measuring, support_times(context.camera))


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
    lost, ended = None, []
    for ball in tuple(state.balls):
        lost, end = _follow(parameters, state, ball, packet)
        if end is not None:
            _let_go(state, ball)
            ended.append(end)
    for ball in _doubles(state.balls):
        _let_go(state, ball)
        ended.append(ShotEnd(ball.shot, packet.start_us, "lost"))
    waiting = None
    earlier: Earlier = {}
    if _is_search_due(state, packet):
        anywhere, waiting = _search(parameters, state, packet, surface, earlier)
        hough = hough or anywhere
    if _is_shaking(parameters, state, packet.end_us):
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
    balls = tuple(_ball_track(parameters, ball, packet.end_us, earlier.get(ball.shot, ())) for ball in state.balls)
    status: Status = "coasting"
    reason = None
    if balls:
        status = "coasting" if balls[0].measured is None else "tracking"
    elif ended:
        status, reason = "lost", lost
    elif waiting is not None:
        status, reason = "starting", "no ball yet: a circle moves like a ball, but it must be seen once more"
    else:
        status = "searching"
        circle = "no circle in the surface" if hough is None else "no circle moves like a ball"
        reason = f"no ball: {state.excluded or circle}"
    candidate = state.measuring.circle(waiting) if status == "starting" and waiting else None
    t_us = packet.end_us - parameters.latency_us
    return TrackResult(status, reason, t_us, balls, hough, candidate, (*ended, *contacts))


_STEPS = {"flying": _step_flying, "fixed": _step_fixed}


def _follow(
    parameters: TrackParameters, state: TrackState, ball: TrackedBall, packet: Packet
) -> tuple[str | None, ShotEnd | None]:
    """Measure a ball that was predicted; why and how its shot ends if it does."""
    start_us, end_us = packet.start_us, packet.end_us
    if _beyond(ball.filter.mean, state.context.camera):
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


def _let_go(state: TrackState, ball: TrackedBall) -> None:
    """Follow a ball no longer."""
    state.balls.remove(ball)
    state.past.gone.append(ball)


def _doubles(balls: list[TrackedBall]) -> list[TrackedBall]:
    """The balls that follow the same outline as one found before them."""
    return [ball for place, ball in enumerate(balls) if any(ball.shares_outline(other) for other in balls[:place])]


def _end(parameters: TrackParameters, state: TrackState, ball: TrackedBall, end_us: int, ended_by: EndedBy) -> ShotEnd:
    """End of a shot, at a contact if one came so late that the ball was hardly seen after it."""
    contact = _contact(parameters, state, ball, AFTER_CONTACT_AT_END)
    return ShotEnd(ball.shot, end_us, ended_by) if contact is None else _end_at(contact, ball)


def _end_at(contact: Contact, ball: TrackedBall) -> ShotEnd:
    doubt = None if contact.is_certain else CONTACT_UNCERTAIN
    return ShotEnd(ball.shot, contact.earliest_us, contact.kind, doubt)


def _contact(parameters: TrackParameters, state: TrackState, ball: TrackedBall, circles_after: int) -> Contact | None:
    context = state.context
    return find_contact(ball.path, context.camera, context.ball_radius_m, parameters.contour_us, circles_after)


def _announce_contacts(parameters: TrackParameters, state: TrackState, earlier: Earlier) -> list[ShotEnd]:
    """End the shots whose contact is known now; adds what comes before this tick of those that it began to `earlier`.

    A shot that is itself announced in this tick, with its own earlier states, ends in the next one at the soonest.
    """
    ended = []
    for place, ball in enumerate(state.balls):
        if ball.measured is None or ball.shot in earlier:
            continue
        contact = _contact(parameters, state, ball, AFTER_CONTACT)
        if contact is None:
            continue
        ended.append(_end_at(contact, ball))
        after = ball.after(contact, state.measuring, state.shots)
        after.doubt = ended[-1].doubt
        earlier[after.shot] = _follow_path(parameters, after, ball.path, after.start_us + parameters.contour_us)
        state.balls[place] = after
        state.past.gone.append(ball)
        state.shots += 1
    return ended


def _follow_path(
    parameters: TrackParameters, ball: TrackedBall, path: list[PathPoint], own_us: int
) -> tuple[BallTrack, ...]:
    """Lead a ball along a known path (see `TrackedBall.follow`); its states there but for the last."""
    return tuple(_ball_track(parameters, ball, point.end_us) for point in ball.follow(path, own_us))[:-1]


def _is_shaking(parameters: TrackParameters, state: TrackState, end_us: int) -> bool:
    """Whether the camera shakes, or did a moment ago."""
    if (
        state.balls
        and parameters.shake_px > 0.0
        and background_moves(state.contour, state.last_us, state.context.camera)
    ):
        state.shaken_us = end_us
    return state.shaken_us is not None and end_us - state.shaken_us < SHAKING_US


def _is_search_due(state: TrackState, packet: Packet) -> bool:
    """Whether to look for balls anywhere: always while one is missed, else every LOOK_US."""
    missed = not state.balls or any(ball.measured is None for ball in state.balls)
    return missed or packet.end_us - state.looked_us >= LOOK_US


def _search(
    parameters: TrackParameters, state: TrackState, packet: Packet, surface: SurfaceResult, earlier: Earlier
) -> tuple[Circle | None, Sighting | None]:
    """Begin tracks of sightings that are trusted, or promising for long enough; the best circle and what must wait.

    Adds what comes before this tick of the shots that begin to `earlier`.
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
    hough, found, excluded = look(surface, events, packet.end_us, camera, limits, state.last_us, most, routes, expected)
    if not (state.balls or found or excluded):
        excluded = removed_by_filter(state.context, packet, len(events), surface, limits)
    state.excluded = None if state.balls else excluded or state.excluded
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
            _begin(parameters, state, packet, sighting, earlier)
            hough = circle
    state.pending += [one for one in pending if packet.end_us - one[0] < HELD_US]
    return hough, state.pending[0][1] if state.pending else None


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
    parameters: TrackParameters, state: TrackState, packet: Packet, sighting: Sighting, earlier: Earlier
) -> None:
    """Follow a sighting: as the ball out of sight whose path it meets, else as a new shot.

    The new shot begins with the first tick in which its ball is measured; the states since then are in `earlier`.
    """
    for ball in state.balls:
        if ball.measured is None and ball.is_found(sighting, packet.end_us):
            ball.restart(state.measuring, sighting, packet.start_us, packet.end_us)
            return
    ball = TrackedBall.at(sighting, state.measuring, state.shots, packet, "found")
    path, first = state.past.path_before(ball, state.balls, state.measuring, parameters.coast_us)
    tick = state.past.ticks[-len(path)]
    if len(path) > 1:
        ball = ball.extended(path, tick.start_us, first, state.measuring)
    ball.began_by = _began_by(state, tick, first)
    if len(path) > 1:
        earlier[ball.shot] = _follow_path(parameters, ball, path, tick.end_us)
    state.balls.append(ball)
    state.shots += 1


def _began_by(state: TrackState, tick: Packet, ball: NDArray[np.float64]) -> BeganBy:
    """Whether a ball (5,) first seen at a tick's end came in across the border, or was there from the beginning."""
    first_us = tick.start_us if state.first_us is None else state.first_us
    since_us = max(first_us, tick.end_us - BEFORE_US)
    if _beyond(moved(ball, since_us - tick.end_us), state.context.camera):
        return "entered"
    return "start" if since_us == first_us else "found"


def _hough_near(state: TrackState, ball: TrackedBall, surface: SurfaceResult) -> Circle | None:
    x, y, _, _, radius = state.measuring.edge.outline(ball.filter.mean)
    span = max(2.0, 3.0 * math.sqrt(ball.filter.covariance[4, 4]))
    return hough_near(surface, x, y, radius - span, radius + span)


def _beyond(mean: NDArray[np.float64], camera: Camera) -> bool:
    """Whether hardly anything of the ball is in the image."""
    x, y, margin = mean[0], mean[1], 0.8 * mean[4]
    return bool(x < -margin or y < -margin or x > camera.width_px - 1 + margin or y > camera.height_px - 1 + margin)


def _fixed_ring(parameters: TrackParameters) -> NDArray[np.float64]:
    x, y, radius = parameters.fixed_x_px, parameters.fixed_y_px, parameters.fixed_radius_px
    if x is None or y is None or radius is None:
        raise ParameterError(
            "track.ball = fixed needs the ball's place: give --fixed-ball X_PX Y_PX RADIUS_PX or --fixed-ball "
            "auto (track.fixed_x_px, track.fixed_y_px, track.fixed_radius_px)"
        )
    return np.array([x, y, 0.0, 0.0, radius])


def _ball_track(
    parameters: TrackParameters, ball: TrackedBall, end_us: int, earlier: tuple[BallTrack, ...] = ()
) -> BallTrack:
    """The ball's present state."""
    return BallTrack(
        ball.shot,
        end_us - parameters.latency_us,
        parameters.latency_us,
        ball.filter.mean,
        ball.total_covariance(),
        ball.measured,
        ball.start_us,
        ball.began_by,
        ball.is_shot,
        earlier,
        ball.doubt,
    )


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
