"""Flow: the logo's optical flow in the ball's frame, by Triplet Matching and by local planes (section 3.3)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ..events import ColumnBatch
from ..kernels.plane_flow import plane_flow
from ..kernels.triplet import earlier_neighbours, triplet_flow
from ..parameters import ParameterGroup, choice, tunable
from ..results import Packet, ReadOnlyArrays
from ..stage import Context, Stage
from .logo import LogoResult
from .rate import RateResult
from .track_result import BallTrack

Floats = NDArray[np.float64]

SLICES_A_ROTATION = 10  # section 3.3
# Of t_acc: an edge at half the equator's speed crosses the reach of 3 px in 0.6 t_acc on the paper's 33 px ball; the
# robust fit starts with as wide a scale and ends with the time it takes the equator to move 1.5 px.
PLANE_REACH = 0.6
PLANE_SCALES = (0.6, 0.3, 0.15, 0.15)
PLANES_PER_MS = 20  # at most; a dense logo has 200 events/ms whose planes share nearly all of their neighbours
# Triplets: neighbours are at least a pixel away from each other, pixels are known to half a pixel, and jitter makes
# the two intervals differ by a fifth; twelve neighbours bound the work and more of them change nothing.
TRIPLET_NEAR_PX, TRIPLET_MISMATCH_PX, TRIPLET_MISMATCH_SHARE, TRIPLET_NEIGHBOURS = 0.7, 0.5, 0.2, 12


# The choices of t_acc_from: whether t_acc follows from a spin, and whether that may be the event rate's.
T_ACC_SPINS = {"expected": (True, False), "rate": (True, True), "fixed": (False, False)}


@dataclass(frozen=True, kw_only=True)
class FlowParameters(ParameterGroup):
    """Length of a slice, and limits of the matching."""

    t_acc_from: str = choice("rate", tuple(T_ACC_SPINS), "where t_acc = 1/(10 spin) takes the spin from")
    t_acc_us: int = tunable(2000, 100, 100_000, 100, "us", "length of a slice when t_acc_from = fixed")
    expected_spin_rps: float = tunable(50.0, 1.0, 500.0, 1.0, "rps", "median of the spins expected")
    reach_px: float = tunable(3.0, 1.5, 20.0, 0.1, "px", "how far apart neighbouring events of one edge may be")


@dataclass(frozen=True, slots=True, eq=False)
class FlowEvents(ColumnBatch):
    """Logo events as the flow takes them; see `LogoResult` for their columns."""

    KINDS: ClassVar = ("i8", "f8", "f8", "?", "3f8", "3f8", "?", "f8", "f8")
    t_us: NDArray[np.int64]
    x_px: Floats
    y_px: Floats
    on: NDArray[np.bool_]
    points_m: Floats
    normals: Floats
    of_outline: NDArray[np.bool_]
    centre_x_px: Floats
    centre_y_px: Floats

    @classmethod
    def of(cls, logo: LogoResult) -> FlowEvents:
        """The logo events of one tick."""
        return cls(*(getattr(logo.events if name in ("t_us", "on") else logo, name) for name in cls.__slots__))


@dataclass(frozen=True, slots=True, eq=False)
class FlowResult(ReadOnlyArrays):
    """The flow of the slices that ended in this tick.

    All positions and velocities are in the ball's frame: relative to the ball's centre at the event's own time.

    Attributes
    ----------
    t_acc_us : int, optional
        Length of the slices now begun; None without a ball.
    speed_bound_px_s : float
        Highest speed looked for, 2 pi max_spin radius; NaN without a ball.
    radius_px : float
        Radius of the ball; NaN without a ball.
    events : FlowEvents
        The n events that have flow by Triplet Matching.
    vx_px_s, vy_px_s : (n,) float64
        That flow.
    slice_index : (n,) int64
        Number of the slice, from the shot's start.
    normal_events : FlowEvents
        The m events with normal flow of a local plane; these come PLANE_REACH t_acc late, when their neighbours after
        them are known. Of a dense logo only a part of the events is tried (PLANES_PER_MS), and none that may be the
        outline's.
    normal_direction, normal_speed_px_s : (m, 2) and (m,) float64
        Unit vectors across the edge, and speed along them.
    normal_in_image : (m,) bool
        The plane was fitted in the image and the ball's motion taken off afterwards; an event can have both kinds.
        A logo that turns against the flight hardly moves in the image: few pixels then see it pass, too far apart
        in the ball's frame to be neighbours there.
    """

    t_acc_us: int | None
    speed_bound_px_s: float
    radius_px: float
    events: FlowEvents
    vx_px_s: Floats
    vy_px_s: Floats
    slice_index: NDArray[np.int64]
    normal_events: FlowEvents
    normal_direction: Floats
    normal_speed_px_s: Floats
    normal_in_image: NDArray[np.bool_]


# Rows (m,) of a slice's events that have flow, and its two components (m,), px/s.
SliceFlow = Callable[[FlowEvents], tuple[NDArray[np.int64], Floats, Floats]]


@dataclass(slots=True)
class FlowState:
    """Events of the shot that are still to be worked on; times are None before the first tick."""

    max_spin_rps: float
    events: FlowEvents = field(default_factory=FlowEvents.empty)
    slice_start_us: int | None = None
    slice_index: int = 0
    planes_until_us: float = 0.0


def start(parameters: FlowParameters, context: Context) -> FlowState:
    """No events yet."""
    return FlowState(context["spin.max_spin_rps"])


def absent(parameters: FlowParameters, reason: str) -> FlowResult:
    """No flow, because there is no ball."""
    no_flow = FlowEvents.empty(), np.empty(0), np.empty(0), np.empty(0, np.int64)
    no_normal_flow = FlowEvents.empty(), np.empty((0, 2)), np.empty(0), np.empty(0, np.bool_)
    return FlowResult(None, math.nan, math.nan, *no_flow, *no_normal_flow)


def step(
    parameters: FlowParameters, state: FlowState, packet: Packet, ball: BallTrack, logo: LogoResult, rate: RateResult
) -> FlowResult:
    """Flow of all slices that have ended, and normal flow of the events whose neighbourhood is complete.

    Slices follow each other without gaps from the start of the tick in which the shot began; a slice takes its length
    from the tick in which it ends, and may span several ticks. The last, unfinished slice of a shot is left out.

    t_acc = 1 / (10 spin): the paper prints ceil(omega / 10), which is not a time; "we divided each rotation into 10
    time slices" is. Until the event rate is periodic, t_acc_from = rate uses the expected spin.
    """
    if state.slice_start_us is None:
        state.slice_start_us, state.planes_until_us = packet.start_us, packet.start_us
    state.events = FlowEvents.concatenate([state.events, FlowEvents.of(logo)])
    t_acc_us = slice_us(parameters, rate)
    bound_px_s = 2 * math.pi * state.max_spin_rps * logo.radius_px
    triplets = ended_slices(
        state, packet.end_us, t_acc_us, lambda piece: _triplets(piece, parameters.reach_px, t_acc_us, bound_px_s)
    )
    planes = _planes(parameters, state, ball, packet.end_us, t_acc_us, bound_px_s)
    keep_us = min(state.slice_start_us, state.planes_until_us - PLANE_REACH * t_acc_us)
    state.events = state.events.between(keep_us, packet.end_us)
    return FlowResult(t_acc_us, bound_px_s, logo.radius_px, *triplets, *planes)


def slice_us(parameters: FlowParameters, rate: RateResult) -> int:
    """Length of a slice begun now."""
    from_spin, from_rate = T_ACC_SPINS[parameters.t_acc_from]
    if not from_spin:
        return parameters.t_acc_us
    spin_rps = parameters.expected_spin_rps
    if from_rate and rate.spin_rps is not None:
        spin_rps = rate.spin_rps
    return max(round(1e6 / (SLICES_A_ROTATION * spin_rps)), 1)


def ended_slices(
    state: FlowState, end_us: int, t_acc_us: int, flow_of: SliceFlow
) -> tuple[FlowEvents, Floats, Floats, NDArray[np.int64]]:
    """Events with flow of the slices that end by end_us, their flow and their slice; the state moves on to the next."""
    assert state.slice_start_us is not None
    own, vx, vy, index = [np.empty(0, np.int64)], [np.empty(0)], [np.empty(0)], [np.empty(0, np.int64)]
    while state.slice_start_us + t_acc_us <= end_us:
        first, last = state.events.t_us.searchsorted([state.slice_start_us, state.slice_start_us + t_acc_us])
        rows, flow_x, flow_y = flow_of(state.events[int(first) : int(last)])
        own.append(first + rows)
        vx.append(flow_x)
        vy.append(flow_y)
        index.append(np.full(rows.size, state.slice_index, np.int64))
        state.slice_start_us += t_acc_us
        state.slice_index += 1
    return state.events[np.concatenate(own)], np.concatenate(vx), np.concatenate(vy), np.concatenate(index)


def _triplets(
    piece: FlowEvents, reach_px: float, t_acc_us: int, bound_px_s: float
) -> tuple[NDArray[np.int64], Floats, Floats]:
    """Rows of a slice's events that end a triplet, and their flow."""
    neighbours = earlier_neighbours(
        (piece.t_us, piece.x_px, piece.y_px, piece.on), TRIPLET_NEAR_PX, reach_px, 0.5 * t_acc_us,
        bound_px_s, TRIPLET_NEIGHBOURS,
    )  # fmt: skip
    flow_x, flow_y, triplets = triplet_flow(
        piece.t_us, piece.x_px, piece.y_px, neighbours, TRIPLET_MISMATCH_PX, TRIPLET_MISMATCH_SHARE
    )
    rows = np.flatnonzero(triplets > 0)
    return rows, flow_x[rows], flow_y[rows]


def _planes(
    parameters: FlowParameters, state: FlowState, ball: BallTrack, end_us: int, t_acc_us: int, bound_px_s: float
) -> tuple[FlowEvents, Floats, Floats, NDArray[np.bool_]]:
    """Events that are PLANE_REACH t_acc old and have normal flow, its directions and speeds, and in which frame.

    Without the events of the outline: they would be taken for a logo that stands still.
    """
    events, own, reach_us = state.events, np.flatnonzero(~state.events.of_outline), PLANE_REACH * t_acc_us
    t_us, x_px, y_px, on = events.t_us[own], events.x_px[own], events.y_px[own], events.on[own]
    until_us = max(end_us - reach_us, state.planes_until_us)
    first, last = (int(row) for row in np.searchsorted(t_us, [state.planes_until_us, until_us]))
    most = max(PLANES_PER_MS * (until_us - state.planes_until_us) * 1e-3, 1.0)
    stride = max(1, math.ceil((last - first) / most))
    state.planes_until_us = until_us
    scales_us, ball_px_s = np.array(PLANE_SCALES) * t_acc_us, ball.mean[2:4]
    ball_speed_px_s = float(np.linalg.norm(ball_px_s))
    rows, directions, speeds = plane_flow(
        (t_us, x_px, y_px, on), first, last, stride, parameters.reach_px, reach_us, scales_us, bound_px_s
    )
    if ball_speed_px_s == 0.0:
        return events[own[rows]], directions, speeds, np.zeros(rows.size, np.bool_)
    in_image = t_us, x_px + events.centre_x_px[own], y_px + events.centre_y_px[own], on
    image_rows, along, absolute = plane_flow(
        in_image, first, last, stride, parameters.reach_px, reach_us, scales_us, bound_px_s + ball_speed_px_s
    )
    relative = absolute - along @ ball_px_s
    sense = np.where(relative < 0, -1.0, 1.0)
    fit = (relative * sense > 0) & (relative * sense <= bound_px_s)
    return (
        events[own[np.concatenate([rows, image_rows[fit]])]],
        np.concatenate([directions, (along * sense[:, None])[fit]]),
        np.concatenate([speeds, (relative * sense)[fit]]),
        np.arange(rows.size + int(fit.sum())) >= rows.size,
    )


STAGE = Stage(
    name="flow",
    label="t_acc and flow",
    help="Optical flow of the logo in the ball's frame, by Triplet Matching and by local planes.",
    inputs=("packet", "ball", "logo", "rate"),
    reads=("spin.max_spin_rps",),
    parameters=FlowParameters,
    start=start,
    step=step,
    absent=absent,
)
