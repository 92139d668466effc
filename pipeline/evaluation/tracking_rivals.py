"""Other publications' trackers of a ball in events, for comparison with ours in the suite `detector`.

Both begin with the first Hough circle of a track, as the paper's filter does, and again where the tracker lost it.

Notes
-----
They deviate in being run once a tick, at its end, so that they see what ours sees; there they run as often as they can.

References
----------
L. Gava, M. Monforte, M. Iacono, C. Bartolozzi, A. Glover, "PUCK: parallel surface and convolution-kernel tracking for
event-based cameras", 2022.
F. Barranco, C. Fermuller, E. Ros, "Real-time clustering and multi-target tracking using event-based sensors", IROS
2018.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod

import cv2
import numpy as np
from numpy.typing import NDArray

from ..events import EventBatch
from ..results import Circle
from ..stages.surface import SurfaceResult
from ..tick import Tick

BallState = NDArray[np.float64]  # (5,) x, y, vx, vy, radius in px and px/s; NaN where there is none

FASTEST_PX_S = 20_000.0  # 25 m/s of the paper's 33 px ball: how far the next place is looked for
# PUCK's kernel: a ring as wide as the surface's edge, with as much negative weight inside.
RING_PX = 1.5
SCALES = (0.95, 1.0, 1.05)  # the ball comes nearer or goes away
# Mean shift: the latest events, in which a ball of 10 m/s moves half its radius; a flat kernel around the outline.
LATEST_US, REACH_RADII, STEPS = 1000, 1.5, 20
FEWEST_EVENTS = 5


class FollowedCircle(ABC):
    """A circle that is followed from tick to tick."""

    def __init__(self) -> None:
        self.circle: Circle | None = None

    def step(self, tick: Tick) -> BallState | None:
        """The ball at the tick's end, None while there is no track."""
        if not tick.track.has_ball:
            self.circle = None
        elif self.circle is None:
            self.circle = tick.track.hough
        else:
            self.circle = self.next_circle(tick, self.circle)
        return ball_state(self.circle)

    @abstractmethod
    def next_circle(self, tick: Tick, last: Circle) -> Circle:
        """The circle at the tick's end, from that of the tick before."""


class ConvolutionPeak(FollowedCircle):
    """Circle at the peak of the surface's convolution with a ring (PUCK)."""

    def next_circle(self, tick: Tick, last: Circle) -> Circle:
        """See `peak_circle`."""
        return peak_circle(tick.surface, last, FASTEST_PX_S * _length_s(tick))


def peak_circle(surface: SurfaceResult, last: Circle, reach_px: float) -> Circle:
    """The circle where a ring's convolution with the surface is largest, of about the last one's radius.

    Whole pixels; the last circle where the surface is empty around it.
    """
    margin = math.ceil(reach_px + max(SCALES) * last.radius_px + RING_PX)
    left, top = round(last.x_px) - margin, round(last.y_px) - margin
    window = surface.cleaned(left, top, left + 2 * margin + 1, top + 2 * margin + 1).astype(np.float32)
    if not window.any():
        return last
    best = last
    highest = -math.inf
    for scale in SCALES:
        answer = cv2.filter2D(window, -1, ring_kernel(scale * last.radius_px), borderType=cv2.BORDER_CONSTANT)
        row, column = np.unravel_index(int(np.argmax(answer)), answer.shape)
        if answer[row, column] > highest:
            highest = float(answer[row, column])
            x_px, y_px = float(max(left, 0) + column), float(max(top, 0) + row)
            best = Circle(x_px, y_px, scale * last.radius_px, highest)
    return best


def ring_kernel(radius_px: float) -> NDArray[np.float32]:
    """Ring of weight 1 in all around a disc of weight -1."""
    half = math.ceil(radius_px + RING_PX)
    y, x = np.mgrid[-half : half + 1, -half : half + 1]
    distance = np.hypot(x, y)
    ring, disc = np.abs(distance - radius_px) <= RING_PX, distance < radius_px - RING_PX
    kernel: NDArray[np.float32] = (ring / max(ring.sum(), 1) - disc / max(disc.sum(), 1)).astype(np.float32)
    return kernel


class MeanShift(FollowedCircle):
    """Mean of the latest events around the ball, shifted until it stays; the radius is the first circle's."""

    def next_circle(self, tick: Tick, last: Circle) -> Circle:
        """See `shifted_circle`."""
        end_us = tick.packet.end_us
        return shifted_circle(tick.filter.contour_events.between(end_us - LATEST_US, end_us), last)


def shifted_circle(events: EventBatch, last: Circle) -> Circle:
    """The last circle moved to the mean of the events around it, again and again; where it is if there are few."""
    x, y = events.x_px.astype(np.float64), events.y_px.astype(np.float64)
    centre_x, centre_y = last.x_px, last.y_px
    for _ in range(STEPS):
        near = np.hypot(x - centre_x, y - centre_y) < REACH_RADII * last.radius_px
        if near.sum() < FEWEST_EVENTS:
            break
        moved = float(x[near].mean()), float(y[near].mean())
        stays = math.hypot(moved[0] - centre_x, moved[1] - centre_y) < 0.01
        centre_x, centre_y = moved
        if stays:
            break
    return Circle(centre_x, centre_y, last.radius_px, last.score)


def ball_state(circle: Circle | None) -> BallState | None:
    """State of a circle, without velocity."""
    return None if circle is None else np.array([circle.x_px, circle.y_px, np.nan, np.nan, circle.radius_px])


def _length_s(tick: Tick) -> float:
    return (tick.packet.end_us - tick.packet.start_us) * 1e-6
