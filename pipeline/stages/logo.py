"""Logo: the events inside the moving ball (section 3.2)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ..events import ColumnBatch, EventBatch
from ..kernels.logo import logo_rows, outline_like
from ..kernels.sphere import intersect_ball
from ..kernels.take_events import take_events
from ..parameters import ParameterGroup, tunable
from ..results import Packet, ReadOnlyArrays
from ..stage import Context, Stage
from .filter import FilterResult
from .track_result import BallTrack

Floats = NDArray[np.float64]

# A centre that moves evenly in the image moves almost evenly in space: taking it as even over 16 px (f = 1646 px) is
# wrong by less than 0.01 px across the line of sight.
KNOT_SPACING_PX = 16.0
# The outline's events lie from so far inside to so far outside the ball. With so many of the polarity that a bright
# ball's outline has not, for each of the one that it has, the ground is brighter than the ball in places.
OUTLINE_INSIDE_PX, OUTLINE_OUTSIDE_PX, MIXED_OUTLINE = 1.0, 2.0, 0.25
# See _of_outline: from where on, and from which speed on: a slower ball, or the wobble of a ball spinner's, leaves
# no more than an event every 10 ms in a pixel's width of outline.
OUTLINE_SHARE, OUTLINE_SPEED_PX_S = 0.66, 100.0


@dataclass(frozen=True, kw_only=True)
class LogoParameters(ParameterGroup):
    """Distance from the outline (pad) and latency of the logo's events."""

    pad_px: float = tunable(2.5, 0.0, 100.0, 0.1, "px", "distance kept from the outline (pad of the paper)")
    # A ball that stays leaves no outline, only what its logo does: three more of 24 simulated spinners are answered
    # than with 2.5 px, those whose logo keeps to the rim, and the others' axes are a fifth better.
    fixed_pad_px: float = tunable(1.0, 0.0, 100.0, 0.1, "px", "pad of a fixed ball, whose outline makes no events")
    rim_pad_px: float = tunable(
        0.5,
        0.0,
        100.0,
        0.1,
        "px",
        "pad of events of the polarity that the moving outline does not make; for contrast alone",
    )
    # A mounted ball's place is known to a third or half of a pixel; a logo at its rim may seem to lie outside.
    fixed_rim_pad_px: float = tunable(
        -1.0, -10.0, 100.0, 0.1, "px", "pad of a fixed ball for contrast alone; below 0: outside of the outline"
    )
    # The outline is the stronger step and is seen by its first events. On two simulators' flights the axes are best
    # with 30 to 80 us; without it they lean against the flight by a degree.
    delay_us: float = tunable(50.0, 0.0, 10_000.0, 5.0, "us", "how much later than the outline the logo is reported")


@dataclass(frozen=True, slots=True, eq=False)
class TurningEvents(ColumnBatch):
    """Events that turn with the ball: none that its outline may have made, but also some nearer to it than pad.

    Attributes
    ----------
    t_us : (m,) int64
    on : (m,) bool
    normals : (m, 3) float64
        Outward unit normals where they lie on the ball (camera frame).
    centre_x_px, centre_y_px : (m,) float64
        The ball's centre when the event happened.
    """

    KINDS: ClassVar = ("i8", "?", "3f8", "f8", "f8")
    t_us: NDArray[np.int64]
    on: NDArray[np.bool_]
    normals: Floats
    centre_x_px: Floats
    centre_y_px: Floats


@dataclass(frozen=True, slots=True, eq=False)
class LogoResult(ReadOnlyArrays):
    """The logo events of the tick, each with the ball at its own time.

    Attributes
    ----------
    events : EventBatch
        The n events inside the circle less pad.
    centre_x_px, centre_y_px : (n,) float64
        The ball's centre when the event happened, by the logo's latency.
    x_px, y_px : (n,) float64
        The event relative to that centre, the lens's distortion undone.
    radius_px : float
        Radius of the ball in this tick; NaN without a ball.
    pad_px : float
        What the mask leaves out along the outline.
    points_m : (n, 3) float64
        Where the events' camera rays meet the ball (camera frame).
    normals : (n, 3) float64
        Outward unit normals e_r of the ball's surface there (the visible side has e_r . c < 0).
    of_outline : (n,) bool
        The event may well be the moving ball's own outline, see `_of_outline`.
    turning : TurningEvents
        What is left of them without those, and the rim's that are not the outline's either: `_logo_events`.
    is_bright : bool
        Whether the outline is that of a moving ball brighter than all of the ground; what its pixels report late, with
        the ball over them, is ON.
    position_std_px : float
        1 sigma of the centre across one axis, NaN without a ball.
    radius_std_px : float
        1 sigma of the radius, NaN without a ball.
    velocity_std_px_s : float
        1 sigma of the centre's velocity along one axis, NaN without a ball.
    """

    events: EventBatch
    centre_x_px: Floats
    centre_y_px: NDArray[np.float64]
    x_px: NDArray[np.float64]
    y_px: NDArray[np.float64]
    radius_px: float
    pad_px: float
    points_m: NDArray[np.float64]
    normals: NDArray[np.float64]
    of_outline: NDArray[np.bool_]
    turning: TurningEvents
    is_bright: bool
    position_std_px: float
    radius_std_px: float
    velocity_std_px_s: float


def start(parameters: LogoParameters, context: Context) -> Context:
    """The state is the context alone: every tick stands on its own."""
    return context


def absent(parameters: LogoParameters, reason: str) -> LogoResult:
    """No logo events, because there is no ball."""
    none, nowhere, no = np.empty(0), np.empty((0, 3)), np.empty(0, np.bool_)
    empty = (EventBatch.empty(), none, none, none, none)
    return LogoResult(
        *empty, math.nan, parameters.pad_px, nowhere, nowhere, no, TurningEvents.empty(), False, *(math.nan,) * 3
    )


def step(
    parameters: LogoParameters, state: Context, packet: Packet, filtered: FilterResult, ball: BallTrack
) -> LogoResult:
    """The tick's logo events. A coasting ball counts.

    Deviations from equation ball_pos: the paper carries the ball forward from the previous update to the event; here
    the tick is complete before its events are sorted out, so the ball is carried back from this tick's update, which
    has seen it. Both ends carry the pixels' latency: the outline's for the mask, which keeps the outline out, and
    `delay_us` more for the place on the ball.
    """
    radius_px, moving = float(ball.mean[4]), bool(ball.mean[2:4].any())
    pad_px = parameters.pad_px if moving else parameters.fixed_pad_px
    rim_pad_px = parameters.rim_pad_px if moving else parameters.fixed_rim_pad_px
    own = filtered.logo_events.between(packet.start_us, packet.end_us)  # none from before the shot
    events, inside, is_bright = _logo_events(own, ball, radius_px - pad_px, radius_px - rim_pad_px)
    centre_x, centre_y = ball.centre_px(events.t_us.astype(np.float64) - parameters.delay_us)
    camera = state.camera
    rays = camera.rays(events.x_px, events.y_px)
    middles = camera.rays(centre_x, centre_y)
    x, y = (rays[:, 0] - middles[:, 0]) * camera.focal_px, (rays[:, 1] - middles[:, 1]) * camera.focal_px
    knots_m = _knots_m(packet, ball, parameters.delay_us, state)
    points, normals = intersect_ball(rays, events.t_us, packet.start_us, packet.end_us, knots_m, state.ball_radius_m)
    of_outline = _of_outline(x, y, events.on, ball)
    rows, turning = np.flatnonzero(inside), np.flatnonzero(~of_outline)
    return LogoResult(
        events=events[rows],
        centre_x_px=centre_x[rows],
        centre_y_px=centre_y[rows],
        x_px=x[rows],
        y_px=y[rows],
        radius_px=radius_px,
        pad_px=pad_px,
        points_m=points[rows],
        normals=normals[rows],
        of_outline=of_outline[rows],
        turning=TurningEvents(events.t_us, events.on, normals, centre_x, centre_y)[turning],
        is_bright=is_bright,
        position_std_px=math.sqrt(0.5 * (ball.covariance[0, 0] + ball.covariance[1, 1])),
        radius_std_px=math.sqrt(ball.covariance[4, 4]),
        velocity_std_px_s=math.sqrt(0.5 * (ball.covariance[2, 2] + ball.covariance[3, 3])),
    )


def _logo_events(
    events: EventBatch, ball: BallTrack, mask_px: float, rim_px: float
) -> tuple[EventBatch, NDArray[np.bool_], bool]:
    """The events inside the mask and those of the rim that are not the outline's; which (n,) are inside the mask.

    And whether the outline is that of a moving ball brighter than all of the ground.

    A bright ball over a darker ground turns pixels ON ahead and OFF behind, whatever its logo does: on simulated
    flights 3 in 100,000 of its events are of the other polarity, and nearly all OFF events ahead and ON events behind
    are the logo's, up to the outline itself. A fixed ball's outline is silent.
    """
    x, y, vx, vy, radius_px = ball.mean.tolist()
    rows, inside, likes, others = logo_rows(
        events.columns,
        ball.t_us + ball.latency_us,
        (x, y),
        (vx, vy),
        mask_px,
        rim_px,
        (radius_px - OUTLINE_INSIDE_PX, radius_px + OUTLINE_OUTSIDE_PX),
    )
    is_moving, is_mixed = bool(vx or vy), others > MIXED_OUTLINE * likes
    if is_moving and is_mixed:
        rows, inside = rows[inside], inside[inside]
    return EventBatch(*take_events(rows, events.columns)), inside, is_moving and not is_mixed


def _of_outline(x_px: Floats, y_px: Floats, on: NDArray[np.bool_], ball: BallTrack) -> NDArray[np.bool_]:
    """(n,) whether events look like the shaded rim of a bright ball that moves over a darker ground.

    A ball lit from above dims towards its rim, by a contrast threshold of 25 % at two thirds of the radius (the
    cosine there is 0.75). So the pixels that the rear half sweeps over start to report OFF well inside the mask, and
    those before the front half are still reporting ON there; both stand still in the ball's frame and so look like a
    logo that does not turn. They lie within 60 degrees of the direction of motion.
    """
    _, _, vx, vy, radius_px = ball.mean.tolist()
    if math.hypot(vx, vy) < OUTLINE_SPEED_PX_S:
        return np.zeros(on.size, np.bool_)
    return outline_like(x_px, y_px, on, (vx, vy), OUTLINE_SHARE * radius_px)


def _knots_m(packet: Packet, ball: BallTrack, delay_us: float, context: Context) -> NDArray[np.float64]:
    """(k, 3) the ball's centre at k times spread evenly over the packet, as the logo's events tell it."""
    _, _, vx, vy, radius_px = ball.mean.tolist()
    span_us = packet.end_us - packet.start_us
    count = 1 + math.ceil(math.hypot(vx, vy) * span_us * 1e-6 / KNOT_SPACING_PX)
    times_us = packet.start_us + np.arange(count, dtype=np.float64) * (span_us / max(count - 1, 1))
    x_px, y_px = ball.centre_px(times_us - delay_us)
    return context.camera.ball_centre_m(x_px, y_px, np.full(count, radius_px), context.ball_radius_m)


STAGE = Stage(
    name="logo",
    label="Logo",
    help="Events inside the moving ball less a pad, each placed on the ball at its own time.",
    inputs=("packet", "filter", "ball"),
    parameters=LogoParameters,
    start=start,
    step=step,
    absent=absent,
)
