"""Logo: the events inside the moving ball (section 3.2)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..camera import Setting
from ..events import EventBatch
from ..kernels.logo import outline_like, rows_inside
from ..kernels.rows import taken
from ..kernels.sphere import meet_ball
from ..parameters import ParameterGroup, tunable
from ..results import Packet, frozen
from .filter import FilterResult
from .track import TrackResult

INPUTS = ("packet", "filter", "track")

Floats = NDArray[np.float64]

# A centre that moves evenly in the image moves almost evenly in space: taking it as even over 16 px (f = 1646 px) is
# wrong by less than 0.01 px across the line of sight.
KNOT_SPACING_PX = 16.0
# See _of_outline: from where on, and from which speed on: a slower ball, or the wobble of a ball spinner's, leaves
# no more than an event every 10 ms in a pixel's width of outline.
OUTLINE_SHARE, OUTLINE_SPEED_PX_S = 0.66, 100.0


@dataclass(frozen=True, kw_only=True)
class LogoParameters(ParameterGroup):
    """How far from the outline an event must be to count as the logo's."""

    pad_px: float = tunable(2.5, 0.0, 100.0, 0.1, "px", "distance kept from the outline (pad of the paper)")
    # A ball that stays leaves no outline, only what its logo does: three more of 24 simulated spinners are answered
    # than with 2.5 px, those whose logo keeps to the rim, and the others' axes are a fifth better.
    fixed_pad_px: float = tunable(1.0, 0.0, 100.0, 0.1, "px", "the same of a fixed ball, whose outline stays dark")


@dataclass(frozen=True, slots=True, eq=False)
class LogoResult:
    """The logo events of the tick, each with the ball at its own time.

    events : the n events inside the circle less pad
    centre_x_px, centre_y_px : (n,) float64, the ball's centre when the event happened
    x_px, y_px : (n,) float64, the event relative to that centre, the lens's distortion undone
    radius_px : radius of the ball in this tick; NaN without a ball
    pad_px : what the mask leaves out along the outline
    points_m : (n, 3) float64, where the events' camera rays meet the ball (camera frame)
    normals : (n, 3) float64, outward unit normals e_r of the ball's surface there (the visible side has e_r . c < 0)
    of_outline : (n,) bool, the event may well be the moving ball's own outline, see `_of_outline`
    position_std_px : 1 sigma of the centre across one axis, NaN without a ball
    radius_std_px : 1 sigma of the radius, NaN without a ball
    velocity_std_px_s : 1 sigma of the centre's velocity along one axis, NaN without a ball
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
    position_std_px: float
    radius_std_px: float
    velocity_std_px_s: float


def start(parameters: LogoParameters, setting: Setting) -> Setting:
    """The state is the setting alone: every tick stands on its own."""
    return setting


def step(
    parameters: LogoParameters, state: Setting, packet: Packet, filtered: FilterResult, track: TrackResult
) -> LogoResult:
    """The tick's logo events; empty without a ball. A coasting ball counts.

    Deviation from equation ball_pos: the paper carries the ball forward from the previous update to the event; here
    the tick is complete before its events are sorted out, so the ball is carried back from this tick's update, which
    has seen it. Both ends carry the pixels' latency.
    """
    if not track.has_ball:
        none = frozen(np.empty(0))
        empty, no = frozen(np.empty((0, 3))), frozen(np.empty(0, np.bool_))
        return LogoResult(
            EventBatch.empty(), none, none, none, none, math.nan, parameters.pad_px, empty, empty, no, *(math.nan,) * 3
        )
    radius_px = float(track.mean[4])
    pad_px = parameters.pad_px if track.mean[2:4].any() else parameters.fixed_pad_px
    events = _inside(filtered.logo_events, track, radius_px - pad_px)
    centre_x, centre_y = track.centre_px(events.t_us)
    camera = state.camera
    rays = camera.rays(events.x_px, events.y_px)
    middles = camera.rays(centre_x, centre_y)
    x, y = (rays[:, 0] - middles[:, 0]) * camera.focal_px, (rays[:, 1] - middles[:, 1]) * camera.focal_px
    points, normals = meet_ball(
        rays, events.t_us, packet.start_us, packet.end_us, _knots_m(packet, track, state), state.ball_radius_m
    )
    return LogoResult(
        events=events,
        centre_x_px=frozen(centre_x),
        centre_y_px=frozen(centre_y),
        x_px=frozen(x),
        y_px=frozen(y),
        radius_px=radius_px,
        pad_px=pad_px,
        points_m=frozen(points),
        normals=frozen(normals),
        of_outline=frozen(_of_outline(x, y, events.on, track)),
        position_std_px=math.sqrt(0.5 * (track.covariance[0, 0] + track.covariance[1, 1])),
        radius_std_px=math.sqrt(track.covariance[4, 4]),
        velocity_std_px_s=math.sqrt(0.5 * (track.covariance[2, 2] + track.covariance[3, 3])),
    )


def _inside(events: EventBatch, track: TrackResult, mask_radius_px: float) -> EventBatch:
    """The events inside the mask."""
    x, y, vx, vy, _ = track.mean.tolist()
    reference_us = track.t_us + track.latency_us
    rows = rows_inside(events.t_us, events.x_px, events.y_px, reference_us, (x, y), (vx, vy), mask_radius_px)
    return EventBatch(*taken(rows, *events.columns))


def _of_outline(x_px: Floats, y_px: Floats, on: NDArray[np.bool_], track: TrackResult) -> NDArray[np.bool_]:
    """(n,) whether events look like the shaded rim of a bright ball that moves over a darker ground.

    A ball lit from above dims towards its rim, by a contrast threshold of 25 % at two thirds of the radius (the
    cosine there is 0.75). So the pixels that the rear half sweeps over start to report OFF well inside the mask, and
    those before the front half are still reporting ON there; both stand still in the ball's frame and so look like a
    logo that does not turn. They lie within 60 degrees of the direction of motion.
    """
    _, _, vx, vy, radius_px = track.mean.tolist()
    if math.hypot(vx, vy) < OUTLINE_SPEED_PX_S:
        return np.zeros(on.size, np.bool_)
    return outline_like(x_px, y_px, on, (vx, vy), OUTLINE_SHARE * radius_px)


def _knots_m(packet: Packet, track: TrackResult, setting: Setting) -> NDArray[np.float64]:
    """(k, 3) the ball's centre at k times spread evenly over the packet."""
    _, _, vx, vy, radius_px = track.mean.tolist()
    span_us = packet.end_us - packet.start_us
    count = 1 + math.ceil(math.hypot(vx, vy) * span_us * 1e-6 / KNOT_SPACING_PX)
    times_us = packet.start_us + np.arange(count, dtype=np.float64) * (span_us / max(count - 1, 1))
    x_px, y_px = track.centre_px(times_us)
    return setting.camera.ball_centre_m(x_px, y_px, np.full(count, radius_px), setting.ball_radius_m)
