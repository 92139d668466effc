"""Contacts in a ball's path: a change test on its measured circles (bounce, hit), and the test for a rolling ball.

A flight's circles lie on a smooth path; a contact puts a hinge into it, a jump of velocity. The generalised likelihood
ratio (Willsky and Jones 1976) compares the best path with a hinge, at any recent time, with the best one without.
Through the radius it sees a bounce from above that hardly changes the velocity in the image.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..kernels import hinged_path as kernels
from ..results import Circle

Floats = NDArray[np.float64]

# A path is kept for so long, enough to tell that a ball rolls; the change test looks for a hinge in the last part of
# a shorter one, over which one cubic describes any flight.
PATH_US, TESTED_US, RECENT_US = 250_000, 120_000, 60_000
# Scatter of the measured centre and radius from tick to tick, in clutter; 0.03 to 0.08 px on clean scenes.
CENTRE_STD_PX, RADIUS_STD_PX = 0.1, 0.08
# Gain in chi^2 that a hinge must bring. 300 simulated flights of 3 to 22 m/s and up to 120 rps without a contact stay
# below 33, whatever the time of the hinge; bounces reach 100 to 5000, hits 10^5.
LEAST_GAIN = 60.0
# And the jump of velocity: a table turns a fall from 15 mm round by this.
LEAST_JUMP_M_S = 1.0
# Steps of the hinge's time: of the test, and of its refinement.
STEP_US, FINE_STEP_US, REFINED_US = 2000, 200, 8000
GRAVITY_M_S2 = 9.81
# Deceleration by drag over speed squared (median of 203 measured flights: 0.16), and the largest lift of spinning
# balls. Double their sum is the 1 sigma of what a flight's acceleration may be.
DRAG_1_M, LIFT_M_S2 = 0.16, 10.0
# 1 sigma of the jumps at a contact: velocity (a smash gives 30 m/s), acceleration (the spin, and with it the lift).
JUMP_M_S, JUMP_M_S2 = 30.0, 10.0
# A table's friction is at most this share of its push (0.25 to 0.5 published for rubber-free contact).
MOST_FRICTION = 0.6
# Balls faster than this do not roll.
ROLLING_M_S = 3.5
Kind = Literal["bounce", "hit"]


@dataclass(frozen=True, slots=True, eq=False)
class PathPoint:
    """One tick of a ball's path.

    Attributes
    ----------
    end_us : int
        The tick's end.
    circle : Circle, optional
        The measured circle, None if none was.
    noise : (3, 3) float64
        Covariance of its x, y and radius, px^2.
    """

    end_us: int
    circle: Circle | None
    noise: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Contact:
    """A contact found in a path.

    Attributes
    ----------
    time_us : int
        When it was (file time).
    kind : str
        bounce or hit.
    gain : float
        Gain in chi^2 of the path with the hinge.
    coefficients : (3, 6) float64
        The path (see kernels.hinged_path) in x, y and radius, px, over the seconds since origin_us.
    origin_us : int
    """

    time_us: int
    kind: Kind
    gain: float
    coefficients: Floats
    origin_us: int

    def state(self, time_us: float) -> Floats:
        """(5,) float64 [x_px, y_px, vx_px_s, vy_px_s, radius_px] of the path at a time after the contact."""
        s, hinge_s = ((time - self.origin_us) * 1e-6 for time in (time_us, self.time_us))
        (x, y, radius), (vx, vy, _) = _values(self.coefficients, s, hinge_s), _slopes(self.coefficients, s, hinge_s)
        return np.array([x, y, vx, vy, radius])


def find_contact(
    path: list[PathPoint], camera: Camera, ball_radius_m: float, straddled_us: int, least_after: int
) -> Contact | None:
    """The contact in a path's recent part, None if there is none.

    Parameters
    ----------
    straddled_us : int
        How far back the events of a circle reach: one that ends so soon after the contact shows both paths.
    least_after : int
        Circles that must have been measured after the contact.
    """
    points = [point for point in path if point.circle is not None and point.end_us > path[-1].end_us - TESTED_US]
    # Two circles on one side of the hinge and as many more as tell a jump from an acceleration.
    if len(points) < 3 + least_after:
        return None
    fit = _PathFit(points, camera, ball_radius_m)
    last_us = points[-1].end_us
    hinges_us = np.arange(max(points[1].end_us, last_us - RECENT_US) + 1, last_us, STEP_US, dtype=np.float64)
    gains = fit.gains(hinges_us)
    coarse_us, gain = float(hinges_us[np.argmax(gains)]), float(gains.max())
    if gain < LEAST_GAIN or coarse_us > min(points[-least_after].end_us, last_us - straddled_us):
        return None  # or not yet
    fit = fit.without(coarse_us - STEP_US / 2, coarse_us + straddled_us + STEP_US / 2)
    fine_us = np.arange(coarse_us - REFINED_US, coarse_us + REFINED_US, FINE_STEP_US)
    time_us = float(fine_us[np.argmax(fit.gains(fine_us))])
    coefficients, radius_jump_std_px_s = fit.path(time_us)
    before, after = _velocities(coefficients, fit.seconds(time_us), camera, ball_radius_m)
    if np.linalg.norm(after - before) < LEAST_JUMP_M_S:
        return None
    radius_px = _values(coefficients, fit.seconds(time_us), fit.seconds(time_us))[2]
    std_m_s = radius_jump_std_px_s * camera.focal_px * ball_radius_m / radius_px**2
    kind = _kind(before, after, std_m_s, np.array(camera.up))
    return Contact(round(time_us), kind, gain, coefficients, fit.origin_us)


class _PathFit:
    """Least-squares paths through measured circles.

    Parameters
    ----------
    points : list of PathPoint
        With circles.
    """

    def __init__(self, points: list[PathPoint], camera: Camera, ball_radius_m: float) -> None:
        self.origin_us = points[-1].end_us
        self._points, self._camera, self._ball_radius_m = points, camera, ball_radius_m
        self._times_s = np.array([(point.end_us - self.origin_us) * 1e-6 for point in points])
        self._circles = np.array([[c.x_px, c.y_px, c.radius_px] for point in points if (c := point.circle)])
        floor = np.array([CENTRE_STD_PX, CENTRE_STD_PX, RADIUS_STD_PX]) ** 2
        self._weights = 1.0 / (np.array([np.diag(point.noise) for point in points]) + floor)
        self._precisions = _precisions(self._times_s, self._circles, camera, ball_radius_m)

    def seconds(self, time_us: float) -> float:
        """Time since the origin, s."""
        return (time_us - self.origin_us) * 1e-6

    def without(self, start_us: float, end_us: float) -> _PathFit:
        """The fit without the circles of [start_us, end_us), if some are left after them; else this one."""
        kept = [point for point in self._points if not start_us <= point.end_us < end_us]
        if kept[-1].end_us < end_us:
            return self
        return _PathFit(kept, self._camera, self._ball_radius_m)

    def gains(self, hinges_us: Floats) -> Floats:
        """Gains (m,) in chi^2 by a hinge at these times (m,).

        In units of what then remains, where that is more than the stated noise: clutter is no contact.
        """
        costs = np.empty(1 + hinges_us.size)
        hinges_s = (hinges_us - self.origin_us) * 1e-6
        kernels.path_costs(costs, self._times_s, self._circles, self._weights, self._precisions, hinges_s)
        freedom = max(1, 3 * (self._times_s.size - kernels.SMOOTH_TERMS))
        gains: Floats = (costs[0] - costs[1:]) / np.maximum(1.0, costs[1:] / freedom)
        return gains

    def path(self, time_us: float) -> tuple[Floats, float]:
        """Coefficients (3, 6) of the path with a hinge at this time, 1 sigma of the radius' jump of velocity, px/s."""
        s = self._times_s
        after = np.maximum(s - self.seconds(time_us), 0.0)
        terms = np.stack([s**0, s, s**2, s**3, after, after**2], axis=1)
        spread = [
            np.linalg.inv((terms.T * weights) @ terms + np.diag(prior))
            for weights, prior in zip(self._weights.T, self._precisions, strict=True)
        ]
        moments = terms.T @ (self._weights * self._circles)
        coefficients = np.stack([spread[channel] @ moments[:, channel] for channel in range(3)])
        return coefficients, math.sqrt(spread[2][4, 4])


def _precisions(times_s: Floats, circles: Floats, camera: Camera, ball_radius_m: float) -> Floats:
    """(3, 6) float64 one over the variances of each channel's coefficients: what flight and contacts allow."""
    radius_px = float(np.median(circles[:, 2]))
    depth_m = camera.focal_px * ball_radius_m / radius_px
    across, along = radius_px / ball_radius_m, radius_px / depth_m  # px a metre across the view, and along it
    way_px = math.hypot(*(circles[-1, :2] - circles[0, :2]))
    speed_m_s = way_px / across / max(times_s[-1] - times_s[0], 1e-6)
    acceleration = 2.0 * (GRAVITY_M_S2 + LIFT_M_S2 + DRAG_1_M * speed_m_s**2)
    # Drag falls with the speed that it takes, and a depth that changes by gravity bends the path in perspective.
    jerk = 3.0 * acceleration * max(speed_m_s, 1.0) / depth_m + 2.0 * DRAG_1_M**2 * speed_m_s**3
    largest = np.array([1e6, 1e6, acceleration / 2, jerk / 6, JUMP_M_S, JUMP_M_S2 / 2])
    return 1.0 / np.outer([across, across, along], largest) ** 2


def _values(coefficients: Floats, s: float, hinge_s: float) -> Floats:
    after = max(s - hinge_s, 0.0)
    values: Floats = coefficients @ np.array([1.0, s, s**2, s**3, after, after**2])
    return values


def _slopes(coefficients: Floats, s: float, hinge_s: float) -> Floats:
    after = max(s - hinge_s, 0.0)
    slopes: Floats = coefficients @ np.array([0.0, 1.0, 2 * s, 3 * s**2, float(s >= hinge_s), 2 * after])
    return slopes


def _velocities(coefficients: Floats, hinge_s: float, camera: Camera, ball_radius_m: float) -> tuple[Floats, Floats]:
    """Velocities (3,) in m/s, camera frame, before and after the contact."""
    dt_s = 1e-4
    circle = _values(coefficients, hinge_s, hinge_s)
    jump = coefficients[:, 4]
    after = _slopes(coefficients, hinge_s, hinge_s)
    moved = np.stack([circle, circle + (after - jump) * dt_s, circle + after * dt_s])
    here, before, later = camera.ball_centre_m(moved[:, 0], moved[:, 1], moved[:, 2], ball_radius_m)
    return (before - here) / dt_s, (later - here) / dt_s


def _kind(before_m_s: Floats, after_m_s: Floats, std_m_s: float, up: Floats) -> Kind:
    """What the ball met: a table pushes up a ball that falls, and rubs it along by no more than its friction.

    std_m_s is 1 sigma of the jump's depth, all else is known far better.
    """
    jump = after_m_s - before_m_s
    push = float(jump @ up)
    rubbed = float(np.linalg.norm(jump - push * up))
    margin_m_s = 2.0 * std_m_s
    falls = before_m_s @ up < margin_m_s and push > -margin_m_s
    return "bounce" if falls and rubbed <= MOST_FRICTION * max(push, 0.0) + margin_m_s else "hit"


def rolls(path: list[PathPoint], camera: Camera, ball_radius_m: float) -> bool | None:
    """Whether a ball rolls, which no force bends, or flies, which gravity does; None while it cannot be told.

    Judged by the size of the acceleration, whatever its direction: camera.up may be unknown.
    """
    points = [point for point in path if point.circle is not None]
    if len(points) < 4:
        return None
    circles = np.array([[c.x_px, c.y_px, c.radius_px] for point in points if (c := point.circle)])
    s = np.array([(point.end_us - points[0].end_us) * 1e-6 for point in points])
    middle, half = (s[0] + s[-1]) / 2, (s[-1] - s[0]) / 2
    design = np.vander((s - middle) / half, 3)
    coefficients = np.linalg.lstsq(design, circles)[0]
    noise_px = np.maximum([CENTRE_STD_PX, CENTRE_STD_PX, RADIUS_STD_PX], (circles - design @ coefficients).std(axis=0))
    bend_px = noise_px * math.sqrt(np.linalg.inv(design.T @ design)[0, 0])
    circle = coefficients[2]

    def acceleration_m_s2(bent: Floats) -> Floats:
        ends = np.stack([circle + bent - coefficients[1], circle, circle + bent + coefficients[1]])
        start, centre, end = camera.ball_centre_m(ends[:, 0], ends[:, 1], ends[:, 2], ball_radius_m)
        bend: Floats = (start - 2 * centre + end) / half**2
        return bend

    here = acceleration_m_s2(coefficients[0])
    spread = [acceleration_m_s2(coefficients[0] + step) - here for step in np.diag(bend_px)]
    sure_m_s2 = 3.0 * float(np.linalg.norm(spread))
    size_m_s2 = float(np.linalg.norm(here))
    if size_m_s2 + sure_m_s2 < GRAVITY_M_S2 / 2:
        return True
    return False if size_m_s2 - sure_m_s2 > GRAVITY_M_S2 / 2 else None
