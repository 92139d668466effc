"""Track: Hough circle and Kalman filter together (section 3.1).

The Hough transform finds the ball in the surface: anywhere while there is no track, near the prediction and
within the radii that the filter allows while there is one. Unlike the paper, which feeds the Hough circle to the
filter, the filter gets the circle refined on the ball's outline in the events (track_outline): an EROS surface
shows the outline one to two pixels late on fast balls, the events to a tenth of a pixel.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import ParameterError
from ..events import EventBatch
from ..parameters import ParameterGroup, choice, tunable
from ..results import Circle, Packet, ReadOnlyArrays
from ..stage import Context, Stage
from .filter import FilterResult
from .surface import SurfaceResult
from .track_hough import hough_near
from .track_kalman import OBSERVED, OBSERVED_BLOCK, BallFilter, load_filter
from .track_outline import VOTE_US, Edge, Limits, Sighting, measure
from .track_search import MOST_CANDIDATES, OtherBalls, agree, look

Status = Literal["searching", "starting", "tracking", "coasting", "lost"]
# How a shot began: across the border, at a contact, with the recording, or first seen in the middle of the view.
BeganBy = Literal["entered", "bounce", "hit", "start", "found"]
# How it ended: across the border, at a contact, with the recording, or out of sight.
EndedBy = Literal["left", "bounce", "hit", "end", "lost"]


@dataclass(frozen=True, kw_only=True)
class TrackParameters(ParameterGroup):
    """The tick, the search for the circle, and the Kalman filter."""

    ball: str = choice("flying", ("flying", "fixed"), "flying ball, or a ball spinner's ball that stays in place")
    tick_us: int = tunable(5000, 200, 100_000, 100, "us", "time between two steps of the pipeline (200 Hz)")
    radius_min_px: float = tunable(5.0, 2.0, 500.0, 0.5, "px", "smallest radius looked for")
    radius_max_px: float = tunable(40.0, 3.0, 500.0, 0.5, "px", "largest radius looked for")
    speed_min_m_s: float = tunable(1.0, 0.0, 100.0, 0.1, "m/s", "slowest ball that counts as a shot")
    speed_max_m_s: float = tunable(25.0, 1.0, 200.0, 1.0, "m/s", "fastest ball looked for")
    latency_us: float = tunable(40.0, 0.0, 10_000.0, 5.0, "us", "how late the pixels report an edge")
    lag_px: float = tunable(0.1, -2.0, 5.0, 0.05, "px", "how far the outline seems behind, at any speed")
    outline_px: float = tunable(0.5, 0.0, 5.0, 0.05, "px", "how far outside the ball the pixels see its edge")
    contour_us: int = tunable(3000, 500, 50_000, 100, "us", "how far back in time the outline's events are taken")
    acceleration_m_s2: float = tunable(15.0, 0.1, 1000.0, 1.0, "m/s^2", "Kalman: 1 sigma of the acceleration")
    approach_m_s: float = tunable(3.0, 0.1, 100.0, 0.5, "m/s", "Kalman: 1 sigma of the speed towards the camera")
    coast_us: int = tunable(20_000, 0, 1_000_000, 1000, "us", "how long an unseen ball is kept")
    fixed_x_px: float | None = tunable(None, 0.0, 10_000.0, 0.1, "px", "fixed ball: column of the centre")
    fixed_y_px: float | None = tunable(None, 0.0, 10_000.0, 0.1, "px", "fixed ball: row of the centre")
    fixed_radius_px: float | None = tunable(None, 1.0, 1000.0, 0.1, "px", "fixed ball: radius")
    fixed_std_px: float = tunable(0.5, 0.0, 100.0, 0.1, "px", "fixed ball: 1 sigma of centre and radius")


@dataclass(frozen=True, slots=True, eq=False)
class BallTrack(ReadOnlyArrays):
    """One ball at the end of the tick, as a robot would have had it.

    Attributes
    ----------
    shot : int
        Number of the shot, from 0.
    t_us : float
        Scene time of the state: the tick's end less the pixels' latency.
    latency_us : float
        That latency: an event stamped t shows the scene of t - latency_us.
    mean : (5,) float64
        Kalman state [x_px, y_px, vx_px_s, vy_px_s, radius_px].
    covariance : (5, 5) float64
        Its covariance.
    measured : Circle, optional
        The refined circle that entered the filter, None if none did: the ball is coasting.
    start_us : int
        Start of the shot (file time), at a contact to within 2 ms.
    began_by : str
        How the shot began: entered, bounce, hit, start (of the recording) or found (in the middle of the view).
    is_shot : bool
        Whether the ball is in free flight; False for one that rolls or lies, which is tracked without being a shot.
    earlier : tuple of BallTrack
        States at the ends of the ticks since start_us before this one, oldest first: a contact is known only some
        ticks later. Given in the one tick in which the shot is announced, else empty.
    """

    shot: int
    t_us: float
    latency_us: float
    mean: NDArray[np.float64]
    covariance: NDArray[np.float64]
    measured: Circle | None
    start_us: int
    began_by: BeganBy
    is_shot: bool = True
    earlier: tuple[BallTrack, ...] = ()

    def centre_px(
        self, event_t_us: NDArray[np.int64] | NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Centre (x, y) in px at the scene times behind these event times (section 3.2, eq. ball_pos)."""
        dt_s = (event_t_us - self.latency_us - self.t_us) * 1e-6
        return self.mean[0] + self.mean[2] * dt_s, self.mean[1] + self.mean[3] * dt_s


@dataclass(frozen=True, slots=True)
class ShotEnd:
    """End of a shot.

    Attributes
    ----------
    shot : int
        Number of the shot.
    end_us : int
        When it ended (file time), at a contact to within 2 ms; before the tick's start where it is known late. No
        result of the shot from ticks that end later counts.
    ended_by : str
        left (across the border), bounce, hit, end (of the recording) or lost.
    """

    shot: int
    end_us: int
    ended_by: EndedBy


NO_STATE, NO_COVARIANCE = np.full(5, np.nan), np.full((5, 5), np.nan)


@dataclass(frozen=True, slots=True, eq=False)
class TrackResult:
    """The balls at the end of the tick, and why there is none.

    Attributes
    ----------
    status : str
        searching (nothing yet), starting (candidates, not yet trusted), tracking (measured now), coasting (predicted,
        not measured), lost (just given up); of the followed ball where there is one.
    reason : str, optional
        Why there is no ball (searching, starting, lost), in words for people; None while there is one.
    t_us : float
        Scene time: the tick's end less the pixels' latency.
    balls : tuple of BallTrack
        Every ball in flight. The first one is followed by the detail views.
    hough : Circle, optional
        Circle of the Hough transform on the surface, before refinement and gating.
    candidate : Circle, optional
        The tick's best circle while the track is not trusted yet.
    ended : tuple of ShotEnd
        The shots whose end became known in this tick.
    """

    status: Status
    reason: str | None
    t_us: float
    balls: tuple[BallTrack, ...]
    hough: Circle | None
    candidate: Circle | None = None
    ended: tuple[ShotEnd, ...] = ()

    @property
    def ball(self) -> BallTrack | None:
        """The followed ball; None without one."""
        return self.balls[0] if self.balls else None

    @property
    def has_ball(self) -> bool:
        """Whether there is a ball that later stages may use."""
        return bool(self.balls)

    @property
    def shot(self) -> int | None:
        """Shot of the followed ball; None without one."""
        return self.balls[0].shot if self.balls else None

    @property
    def measured(self) -> Circle | None:
        """Measured circle of the followed ball; None without one."""
        return self.balls[0].measured if self.balls else None

    @property
    def mean(self) -> NDArray[np.float64]:
        """(5,) float64 Kalman state of the followed ball; NaN without one."""
        return self.balls[0].mean if self.balls else NO_STATE

    @property
    def covariance(self) -> NDArray[np.float64]:
        """(5, 5) float64 covariance of the followed ball; NaN without one."""
        return self.balls[0].covariance if self.balls else NO_COVARIANCE


# Share of the half outline ahead that a tracked ball must show to be measured: a third pins down its circle.
LEAST_AHEAD = 0.3
# Squared Mahalanobis distance (three degrees of freedom) beyond which an outline is not the ball's: 5 sigma.
MOST_SURPRISE = 25.0
# Scatter of an outline's centre and radius from tick to tick beyond the statistical one, on the samples.
OUTLINE_STD_PX = 0.05
OUTLINE_COVARIANCE = OUTLINE_STD_PX**2 * np.eye(3)
# What no filtering takes away: the calibration of latency, place and radius. The first two differ from shot to shot;
# how far outside the outline is seen, from sensor to sensor: two simulators with the same biases are 0.3 px apart.
LATENCY_STD_US = 12.0
PLACE_STD_PX, RADIUS_STD_PX = 0.06, 0.3
COMMON_COVARIANCE = np.diag([PLACE_STD_PX**2, PLACE_STD_PX**2, 0.0, 0.0, RADIUS_STD_PX**2])
# A second ball takes the track over only when this much faster (a slower one rolls back), or while the first
# is out of sight and when not much slower (a ball that was hit).
RIVAL_SPEED, RIVAL_SPEED_UNSEEN = 1.5, 0.7
# Shots come in across the border, within so many radii of it when first seen. A slow ball that turns up in the
# middle rather rolls about: it is watched for a while, in which a real shot may come.
COMING_IN, SLOW_M_S, WATCH_US = 5.0, 3.5, 20_000
FREE = np.full(5, 1e9)


@dataclass(slots=True)
class TrackState:
    """State of the tracker from tick to tick."""

    context: Context
    limits: Limits
    contour: EventBatch = field(default_factory=EventBatch.empty)
    ball: BallFilter | None = None
    pending: tuple[int, Sighting] | None = None
    others: OtherBalls = field(default_factory=OtherBalls)
    seen_us: int = 0
    shots: int = 0
    start_us: int = 0
    began_by: BeganBy = "start"


def start(parameters: TrackParameters, context: Context) -> TrackState:
    """Fresh state; raises ParameterError for a fixed ball without a place or radii the wrong way round."""
    if parameters.ball == "fixed":
        _fixed_ring(parameters)
    if parameters.radius_min_px >= parameters.radius_max_px:
        raise ParameterError(
            f"track.radius_min_px = {parameters.radius_min_px:g} must be below "
            f"track.radius_max_px = {parameters.radius_max_px:g}"
        )
    per_m = 1.0 / context.ball_radius_m
    limits = Limits(
        parameters.radius_min_px,
        parameters.radius_max_px,
        parameters.speed_min_m_s * per_m,
        parameters.speed_max_m_s * per_m,
    )
    if parameters.ball == "flying":
        load_filter()  # loaded now and not in the middle of a shot
    return TrackState(context, limits)


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
    if state.shots == 0:
        state.shots, state.start_us = 1, packet.start_us
    return _ball(parameters, state, packet, "tracking", 0, _fixed_ring(parameters), np.diag(variance))


def _step_flying(
    parameters: TrackParameters, state: TrackState, packet: Packet, filtered: FilterResult, surface: SurfaceResult
) -> TrackResult:
    """A flying ball: searched for, then followed."""
    since_us, events = packet.end_us - max(parameters.contour_us, VOTE_US), filtered.logo_events
    if since_us < packet.start_us:
        events = EventBatch.concatenate([state.contour, events])
    state.contour = events.between(since_us, packet.end_us)
    if state.ball is None:
        return _search(parameters, state, packet, surface)
    return _follow(parameters, state, state.ball, packet, surface)


_STEPS = {"flying": _step_flying, "fixed": _step_fixed}


def _search(parameters: TrackParameters, state: TrackState, packet: Packet, surface: SurfaceResult) -> TrackResult:
    """A tick without a track: start one from a sighting that is trusted, or promising for long enough."""
    camera = state.context.camera
    hough, found = look(surface, state.contour, packet.end_us, camera, state.limits, MOST_CANDIDATES)
    pending, state.pending = state.pending, None
    if not found:
        reason = "no ball: no circle in the surface" if hough is None else "no ball: no circle moves like a ball"
        return _no_ball(parameters, packet, "searching", reason, hough)
    best, hough = found[0]
    since_us, first = pending or (packet.end_us, best)
    apart_us = packet.end_us - since_us
    same = agree(first, best, apart_us)
    wait_us = _wait_us(parameters, state, best)
    if wait_us == 0 or (same and apart_us >= wait_us):
        return _begin(parameters, state, packet, best, hough, state.shots)
    state.pending = (since_us, first) if same else (packet.end_us, best)
    return _no_ball(
        parameters,
        packet,
        "starting",
        "no ball yet: a circle moves like a ball, but it must be seen once more",
        hough,
        _circle(parameters, best),
    )


def _wait_us(parameters: TrackParameters, state: TrackState, sighting: Sighting) -> int:
    """Time for which such a sighting must have been seen before it is a shot, us."""
    camera, (x, y, _, _, radius) = state.context.camera, sighting.ring
    inside = min(x, y, camera.width_px - 1 - x, camera.height_px - 1 - y)
    if sighting.speed_px_s / radius * state.context.ball_radius_m < SLOW_M_S and inside > COMING_IN * radius:
        return WATCH_US
    # What is not trusted at once counts when seen again in events that it does not share with the first time.
    return 0 if sighting.trusted else parameters.contour_us


def _follow(
    parameters: TrackParameters, state: TrackState, ball: BallFilter, packet: Packet, surface: SurfaceResult
) -> TrackResult:
    """A tick with a track: predict, measure near the prediction, update; let a better ball take over."""
    ball.predict((packet.end_us - packet.start_us) * 1e-6)
    camera = state.context.camera
    expected = ball.mean
    if _beyond(expected, camera.width_px, camera.height_px):
        return _end(parameters, state, packet, "the ball left the view")
    expected = _edge(parameters).outline(expected)
    spread = np.sqrt(np.diag(ball.covariance))
    span = max(2.0, 3.0 * spread[4])
    hough = hough_near(surface, expected[0], expected[1], expected[4] - span, expected[4] + span)
    measured = _update(parameters, state, ball, packet, expected, spread)
    if measured is None:
        bounced = measure(state.contour, packet.end_us, camera, expected, 0.5 * expected[4], FREE)
        if bounced is not None and bounced.trusted and abs(bounced.ring[4] / expected[4] - 1) < 0.1:
            return _begin(parameters, state, packet, bounced, hough, state.shots - 1)
    now = ball.mean
    if measured is None or state.others.due(packet.end_us):
        least = (RIVAL_SPEED if measured else RIVAL_SPEED_UNSEEN) * math.hypot(now[2], now[3])
        other = state.others.fastest(
            surface, state.contour, packet.end_us, camera, state.limits, now if measured else None
        )
        if other is not None and other[0].speed_px_s > least:
            return _begin(parameters, state, packet, *other, state.shots)
    if measured is None and packet.end_us - state.seen_us > parameters.coast_us:
        return _end(parameters, state, packet, f"the ball was not seen for {parameters.coast_us / 1000:g} ms")
    status: Status = "tracking" if measured else "coasting"
    return _ball(parameters, state, packet, status, state.shots - 1, now, _total_covariance(ball), hough, measured)


def _update(
    parameters: TrackParameters,
    state: TrackState,
    ball: BallFilter,
    packet: Packet,
    expected: NDArray[np.float64],
    spread: NDArray[np.float64],
) -> Circle | None:
    """Measure the outline near the expected ring (5,) with 1 sigma spread (5,) and give it to the filter."""
    # The velocity may leave the prediction by ten radii a second and the radius by half a pixel: loose for a
    # ball wholly in view, and it keeps the fit sane on short arcs.
    loose = np.array([1e9, 1e9, 10 * expected[4] + spread[2], 10 * expected[4] + spread[3], 0.5])
    gate = 2.0 + 3.0 * max(spread[0], spread[1])
    sighting = measure(state.contour, packet.end_us, state.context.camera, expected, gate, loose)
    if sighting is None or sighting.ahead < LEAST_AHEAD:
        return None
    observed = _edge(parameters).ball(sighting.ring)[OBSERVED]
    # Outlines taken further back than one tick share events with the tick before and so count for less.
    shared = max(1.0, parameters.contour_us / (packet.end_us - packet.start_us))
    noise = sighting.covariance[OBSERVED_BLOCK] + OUTLINE_COVARIANCE
    if not ball.update(observed, noise * shared, MOST_SURPRISE):
        return None
    state.seen_us = packet.end_us
    return _circle(parameters, sighting)


def _begin(
    parameters: TrackParameters,
    state: TrackState,
    packet: Packet,
    sighting: Sighting,
    hough: Circle | None,
    shot: int,
) -> TrackResult:
    """Start the filter at a sighting."""
    per_m = sighting.ring[4] / state.context.ball_radius_m
    mean = _edge(parameters).ball(sighting.ring)
    covariance = sighting.covariance.copy()
    covariance[OBSERVED, OBSERVED] += OUTLINE_STD_PX**2
    # The paper: high enough to converge fast. The fit bends by what the ball accelerates within its window.
    covariance[[2, 3], [2, 3]] += (0.2 * per_m) ** 2
    growth = parameters.approach_m_s * per_m * mean[4] / state.context.camera.focal_px
    state.ball = BallFilter(mean, covariance, parameters.acceleration_m_s2 * per_m, growth)
    state.pending, state.others = None, OtherBalls()
    state.seen_us = packet.end_us
    state.shots = shot + 1
    state.start_us, state.began_by = packet.start_us, "found"
    measured = _circle(parameters, sighting)
    return _ball(parameters, state, packet, "tracking", shot, mean, _total_covariance(state.ball), hough, measured)


def _end(parameters: TrackParameters, state: TrackState, packet: Packet, reason: str) -> TrackResult:
    state.ball = None
    return _no_ball(parameters, packet, "lost", reason)


def _total_covariance(ball: BallFilter) -> NDArray[np.float64]:
    """The filter's covariance plus the errors that every tick has in common."""
    late = ball.mean[2:4] * LATENCY_STD_US * 1e-6
    covariance = ball.covariance + COMMON_COVARIANCE
    covariance[:2, :2] += late[:, None] * late
    return covariance


def _edge(parameters: TrackParameters) -> Edge:
    return Edge(parameters.outline_px, parameters.lag_px)


def _circle(parameters: TrackParameters, sighting: Sighting) -> Circle:
    """The ball's silhouette as sighted."""
    x, y, _, _, radius = _edge(parameters).ball(sighting.ring).tolist()
    return Circle(x, y, radius, sighting.score)


def _beyond(mean: NDArray[np.float64], width_px: int, height_px: int) -> bool:
    """Whether hardly anything of the ball is in the image."""
    x, y, margin = mean[0], mean[1], 0.8 * mean[4]
    return bool(x < -margin or y < -margin or x > width_px - 1 + margin or y > height_px - 1 + margin)


def _fixed_ring(parameters: TrackParameters) -> NDArray[np.float64]:
    x, y, radius = parameters.fixed_x_px, parameters.fixed_y_px, parameters.fixed_radius_px
    if x is None or y is None or radius is None:
        raise ParameterError(
            "track.ball = fixed needs the ball's place: give --fixed-ball X_PX Y_PX RADIUS_PX or --fixed-ball "
            "auto (track.fixed_x_px, track.fixed_y_px, track.fixed_radius_px)"
        )
    return np.array([x, y, 0.0, 0.0, radius])


def _ball(
    parameters: TrackParameters,
    state: TrackState,
    packet: Packet,
    status: Status,
    shot: int,
    mean: NDArray[np.float64],
    covariance: NDArray[np.float64],
    hough: Circle | None = None,
    measured: Circle | None = None,
) -> TrackResult:
    t_us = packet.end_us - parameters.latency_us
    ball = BallTrack(shot, t_us, parameters.latency_us, mean, covariance, measured, state.start_us, state.began_by)
    return TrackResult(status, None, t_us, (ball,), hough)


def _no_ball(
    parameters: TrackParameters,
    packet: Packet,
    status: Status,
    reason: str,
    hough: Circle | None = None,
    candidate: Circle | None = None,
) -> TrackResult:
    return TrackResult(status, reason, packet.end_us - parameters.latency_us, (), hough, candidate)


STAGE = Stage(
    name="track",
    label="Tracker",
    help="Hough circle in the surface, refined on the ball's outline, and Kalman filter: the ball's place and speed.",
    scope="recording",
    inputs=("packet", "filter", "surface"),
    parameters=TrackParameters,
    start=start,
    step=step,
)
