"""The paper's spin with the optical flows that it names beside Triplet Matching (section 2).

Slices of t_acc, spin from flow and magnitude from the event rate are those of the method `triplet`; only the flow of
a slice is another. None of them states an uncertainty.

References
----------
B. D. Lucas, T. Kanade, "An iterative image registration technique with an application to stereo vision", IJCAI 1981.
M. T. Aung, R. Teo, G. Orchard, "Event-based plane-fitting optical flow for dynamic vision sensors in FPGA", ISCAS 2018.
J. Nagata, Y. Sekikawa, Y. Aoki, "Optical flow estimation by matching time surface with event-based cameras", Sensors
21(4), 2021.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ...kernels.patch_matching import patch_displacements
from ...kernels.plane_flow import plane_flow
from ...results import Packet, SpinEstimate
from ...stage import Context, SpinMethod
from ...stages.flow import PLANE_SCALES, FlowEvents, FlowParameters, FlowResult, FlowState, ended_slices, slice_us
from ...stages.logo import LogoResult
from ...stages.rate import RateResult
from ..parameters import SpinParameters
from ..triplet import TripletSpin
from .rival import rival

Floats = NDArray[np.float64]
Rows = NDArray[np.int64]
FlowOfSlice = Callable[[FlowEvents, int, float, float], tuple[Rows, Floats, Floats]]

# Of a slice, so many events spread evenly over it: neighbours share their patches.
POINTS = 100
# In half a slice the equator of a 33 px ball moves 5 px.
REACH_PX, HALF_PATCH_PX, MARGIN_PX = 7, 3, 12
# Patches whose best match is hardly better than any place are those of blank ball.
WORST_MATCH = 0.5
# Grey values: a pixel without events, and what an event adds (ON) or takes (OFF).
GREY, A_EVENT = 128.0, 40.0
# Lucas-Kanade: window and pyramid; two levels reach the 5 px.
WINDOW_PX, LEVELS, SMOOTHING_PX = 9, 2, 1.0


def lucas_kanade(piece: FlowEvents, t_acc_us: int, radius_px: float, reach_px: float) -> tuple[Rows, Floats, Floats]:
    """Flow by Lucas and Kanade between the accumulated frames of the slice's halves, at events of the first.

    The frames hold ON less OFF events in the ball's frame, smoothed. Deviates: frames of t_acc each would be 10 px
    apart, a third of the ball.
    """
    import cv2  # only needed here; 60 ms to load

    first, size, half_s = _first_half(piece, t_acc_us, radius_px)
    frames = []
    for part in (piece[:first], piece[first:]):
        columns, rows = _pixels(part, size)
        frame = np.full((size, size), GREY)
        np.add.at(frame, (rows, columns), np.where(part.on, A_EVENT, -A_EVENT))
        frames.append(cv2.GaussianBlur(np.clip(frame, 0, 255).astype(np.uint8), (0, 0), SMOOTHING_PX))
    points = _points(first)
    if not points.size:
        return points, np.empty(0), np.empty(0)
    places = np.stack([piece.x_px[points], piece.y_px[points]], axis=1) + size // 2
    start = places.astype(np.float32)
    moved, status, _ = cv2.calcOpticalFlowPyrLK(
        frames[0], frames[1], start, start.copy(), winSize=(WINDOW_PX, WINDOW_PX), maxLevel=LEVELS
    )
    has = np.asarray(status)[:, 0] == 1
    flow = (np.asarray(moved, np.float64)[has] - places[has]) / half_s
    return points[has], flow[:, 0], flow[:, 1]


def planes(piece: FlowEvents, t_acc_us: int, radius_px: float, reach_px: float) -> tuple[Rows, Floats, Floats]:
    """Normal flow of local planes, taken for full flow as every flow is in the paper.

    Deviates: the fit is the robust one of the stage `flow`, in floating point.
    """
    scales_us = np.array(PLANE_SCALES) * t_acc_us
    rows, directions, speeds = plane_flow(
        (piece.t_us, piece.x_px, piece.y_px, piece.on), 0, len(piece), max(1, len(piece) // POINTS), reach_px,
        0.5 * t_acc_us, scales_us, np.inf,
    )  # fmt: skip
    return rows, directions[:, 0] * speeds, directions[:, 1] * speeds


def time_surfaces(piece: FlowEvents, t_acc_us: int, radius_px: float, reach_px: float) -> tuple[Rows, Floats, Floats]:
    """Flow by matching the time surfaces of the slice's halves, patch by patch, at events of the first.

    A surface a polarity, exp(-age / t_acc) of the latest event of each pixel. Deviates: the displacement of each patch
    is searched over whole pixels and refined by a parabola; there one loss over all patches, with smoothness between
    neighbours, goes down its gradient.
    """
    first, size, half_s = _first_half(piece, t_acc_us, radius_px)
    surfaces = np.zeros((2, 2, size, size))
    for surface, part in zip(surfaces, (piece[:first], piece[first:]), strict=True):
        if len(part):
            columns, rows = _pixels(part, size)
            surface[part.on.astype(np.int64), rows, columns] = np.exp((part.t_us - part.t_us[-1]) / t_acc_us)
    points = _points(first)
    columns, rows = _pixels(piece[points], size)
    moved_px, match = patch_displacements(surfaces[0], surfaces[1], columns, rows, HALF_PATCH_PX, REACH_PX)
    has = match < WORST_MATCH
    return points[has], moved_px[has, 0] / half_s, moved_px[has, 1] / half_s


def _first_half(piece: FlowEvents, t_acc_us: int, radius_px: float) -> tuple[int, int, float]:
    """Number of the events in the first half of the slice, width of a picture of the ball, and the half in seconds."""
    start_us = piece.t_us[0] if len(piece) else 0
    return int(np.searchsorted(piece.t_us, start_us + t_acc_us / 2)), _picture_px(radius_px), t_acc_us * 0.5e-6


def _picture_px(radius_px: float) -> int:
    return 2 * (math.ceil(radius_px) + MARGIN_PX) + 1


def _pixels(events: FlowEvents, size: int) -> tuple[Rows, Rows]:
    """Column and row of each event in a picture around the ball's centre, within its margins."""
    low, high = HALF_PATCH_PX + REACH_PX, size - 1 - HALF_PATCH_PX - REACH_PX
    columns, rows = (np.rint(place).astype(np.int64) + size // 2 for place in (events.x_px, events.y_px))
    return np.clip(columns, low, high), np.clip(rows, low, high)


def _points(count: int) -> Rows:
    """Rows of about POINTS of the first events."""
    return np.arange(0, count, max(1, count // POINTS))


FLOW = tuple(f"flow.{name}" for name in FlowParameters.tunables())


class SliceFlowSpin:
    """The paper's spin of one shot with another flow."""

    def __init__(self, flow_of: FlowOfSlice, name: str, parameters: SpinParameters, context: Context) -> None:
        self.flow_of = flow_of
        self.spin = TripletSpin(parameters, context, name)
        self.slices = FlowState(parameters.max_spin_rps)
        self.parameters = FlowParameters(**{name.partition(".")[2]: context[name] for name in FLOW})

    def estimate(self, packet: Packet, logo: LogoResult, rate: RateResult) -> SpinEstimate:
        """The estimate at the end of a tick; as of `TripletSpin`, without its uncertainty."""
        if self.slices.slice_start_us is None:
            self.slices.slice_start_us = packet.start_us
        self.slices.events = FlowEvents.concatenate([self.slices.events, FlowEvents.of(logo)])
        t_acc_us, radius_px, reach_px = slice_us(self.parameters, rate), logo.radius_px, self.parameters.reach_px
        bound_px_s = 2 * math.pi * self.slices.max_spin_rps * radius_px

        def flow_of(piece: FlowEvents) -> tuple[Rows, Floats, Floats]:
            rows, vx, vy = self.flow_of(piece, t_acc_us, radius_px, reach_px)
            slow = np.hypot(vx, vy) <= bound_px_s
            return rows[slow], vx[slow], vy[slow]

        found = ended_slices(self.slices, packet.end_us, t_acc_us, flow_of)
        self.slices.events = self.slices.events.between(self.slices.slice_start_us, packet.end_us)
        no_planes = FlowEvents.empty(), np.empty((0, 2)), np.empty(0), np.empty(0, np.bool_)
        flow = FlowResult(t_acc_us, bound_px_s, radius_px, *found, *no_planes)
        return replace(self.spin.estimate(packet.end_us, flow, rate), covariance_rps2=None)


def _slice_flow(name: str, label: str, help: str, colour: tuple[int, int, int], flow_of: FlowOfSlice) -> SpinMethod:
    state = partial(SliceFlowSpin, flow_of)
    return rival(name, label, help, colour, inputs=("packet", "logo", "rate"), state=state, reads=FLOW)


LUCAS_KANADE = _slice_flow(
    "lucas_kanade",
    "Lucas-Kanade",
    "the paper's spin with Lucas-Kanade's flow on accumulated frames (IJCAI 1981).",
    (141, 110, 99),
    lucas_kanade,
)
PLANES = _slice_flow(
    "plane_flow",
    "Plane fitting",
    "the paper's spin with the flow of local planes (Aung 2018).",
    (120, 144, 156),
    planes,
)
TIME_SURFACES = _slice_flow(
    "time_surface",
    "Time-surface matching",
    "the paper's spin with flow by matching time surfaces (Nagata 2021).",
    (220, 231, 117),
    time_surfaces,
)
