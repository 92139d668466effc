"""Contacts in a ball's path: a change test on its measured circles (bounce, hit).

A flight's circles lie on a smooth path; a contact puts a hinge into it, a jump of velocity. The generalised likelihood
ratio (Willsky and Jones 1976) compares the best path with a hinge, at any recent time, with the best one without.
Through the radius it sees a bounce from above that hardly changes the velocity in the image.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..kernels import hinged_path as kernels
from .track_path import (
    DRAG_1_M,
    GRAVITY_M_S2,
    JUMP_M_S,
    LIFT_1_M,
    HingedPath,
    PathPoint,
    Places,
    independent_points,
)

Floats = NDArray[np.float64]

# The change test looks for a hinge between the last circles of a path, over which one cubic describes any flight.
TESTED_US, RECENT_CIRCLES = 100_000, 8
# Two circles on one side of a hinge, and one more that tells a jump from an acceleration.
FEWEST_CIRCLES = 3
# Errors of the outline's edge ahead and of the circle's radius from tick to tick that the test must bear, in clutter.
EDGE_STD_PX, RADIUS_STD_PX = 0.1, 0.15
ERRORS_PX2 = np.array([EDGE_STD_PX, EDGE_STD_PX, RADIUS_STD_PX]) ** 2
ALLOWED = (GRAVITY_M_S2, LIFT_1_M, DRAG_1_M, JUMP_M_S)
# Gain in chi^2 that a hinge must bring. 300 simulated flights of 3 to 22 m/s and up to 120 rps without a contact stay
# below 33, whatever the time of the hinge; bounces reach 100 to 5000, hits 10^5.
LEAST_GAIN = 60.0
# And the jump of velocity: a table turns a fall from 15 mm round by this.
LEAST_JUMP_M_S = 1.0
# A camera may shake by more than stated: before one that shakes by 2 px 5 of 30 simulated flights without a contact
# show one by what is stated, none by this many times as much.
STRONGER = 2.0
# Steps of the hinge's time: of the test, and of its two refinements.
STEP_US, FINE_STEP_US, FINEST_STEP_US, REFINED_US = 2000, 250, 10, 8000
# A circle beside the hinge is a racket's or an arm's outline on the old path where the others, without it, are so many
# times nearer to theirs (in chi^2) and gain as much as by a contact. Before or after a bounce none is.
STRAY_RATIO = 4.0
# And off their path by so many radii, 2 mm: drag that is turned round with the ball (20 m/s^2 and more) bends by up to
# 1 mm what the others tell of it, and after a hit the outline is seen 0.1 px elsewhere than before.
STRAY_RADII = 0.1
# Circles that must be left on either side of it.
CIRCLES_ASIDE = 2
# The instant is good to so much, and what else it may have been lies within a cost so much higher (3 sigma).
INSTANT_US, DOUBTED_COST = 2000, 9.0
# A table's friction is at most this share of its push (0.25 to 0.5 published for rubber-free contact).
MOST_FRICTION = 0.6
# And its push at most turns round a fall from 3 m.
MOST_PUSH_M_S = 15.0
Kind = Literal["bounce", "hit"]


@dataclass(frozen=True, slots=True, eq=False)
class Contact:
    """A contact found in a path.

    Attributes
    ----------
    time_us : int
        When it was most likely (file time).
    earliest_us, latest_us : int
        Ends of the shots before and after it, INSTANT_US inside the span in which it may have been; both are time_us
        where that span is short. What lies between them may be of either shot.
    kind : str
        bounce or hit.
    is_certain : bool
        Whether it is no shaking of the camera.
    path : HingedPath
        The ball's path in space before and after it.
    stray_us : int, optional
        End of the tick whose circle is not the ball's, None where all are.
    """

    time_us: int
    earliest_us: int
    latest_us: int
    kind: Kind
    is_certain: bool
    path: HingedPath
    stray_us: int | None = None


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
    points = independent_points(path, TESTED_US, straddled_us)
    if len(points) < FEWEST_CIRCLES + least_after:
        return None
    hinges_us, gains = _gains_of_hinges(points, camera, ball_radius_m)
    if not hinges_us.size:
        return None
    coarse_us, gain, last_us = float(hinges_us[np.argmax(gains)]), float(gains.max()), points[-1].end_us
    if gain < LEAST_GAIN or coarse_us > min(points[-least_after].end_us, last_us - straddled_us):
        return None  # or not yet
    likely_us = hinges_us[gains > gain - DOUBTED_COST]
    from_us, to_us = max(likely_us[0] - REFINED_US, points[0].end_us), min(likely_us[-1] + REFINED_US, last_us)
    times_us = np.arange(from_us, to_us, FINE_STEP_US)
    straddling_us = coarse_us, coarse_us + straddled_us
    places, costs, stray_us = _places(points, straddling_us, times_us, camera, ball_radius_m)
    # Its kind is told at a step of the time: free to 10 us, it follows the radii's errors, and so does the jump.
    stepped = HingedPath(places, float(times_us[np.argmin(costs)]), camera, ball_radius_m)
    before, after = stepped.velocity_m_s(stepped.hinge_us - 1), stepped.velocity_m_s(stepped.hinge_us)
    if np.linalg.norm(after - before) < LEAST_JUMP_M_S:
        return None
    kind = _kind(before, after, stepped.unsure_m_s, np.array(camera.up))
    possible_us = times_us[costs < costs.min() + DOUBTED_COST * stepped.roughness]
    refined = HingedPath(places, _instant_us(places, times_us, costs), camera, ball_radius_m)
    time_us = round(refined.hinge_us)
    earliest_us = min(time_us, round(possible_us[0]) + INSTANT_US)
    latest_us = max(time_us, min(round(possible_us[-1]) - INSTANT_US, last_us - straddled_us))
    is_certain = _is_certain(points, camera, ball_radius_m)
    return Contact(time_us, earliest_us, latest_us, kind, is_certain, refined, stray_us)


def _places(
    points: list[PathPoint], straddling_us: tuple[float, float], times_us: Floats, camera: Camera, ball_radius_m: float
) -> tuple[Places, Floats, int | None]:
    """Places of the ball, their costs with a hinge at these times (m,), and the end of the tick that is a stray's."""
    places, stray_us = Places.of(points, straddling_us, camera, ball_radius_m), None
    costs = places.costs(times_us)
    before = sum(point.end_us < straddling_us[0] for point in points)
    for stray in (before - 1, before):
        others = points[:stray] + points[stray + 1 :]
        if not CIRCLES_ASIDE <= stray <= len(others) - CIRCLES_ASIDE:
            continue
        without = Places.of(others, straddling_us, camera, ball_radius_m)
        lower = without.costs(times_us)
        if not lower.min() < min(costs.min() - LEAST_GAIN, costs.min() / STRAY_RATIO):
            continue
        path = HingedPath(without, float(times_us[np.argmin(lower)]), camera, ball_radius_m)
        if _off_radii(points[stray], path) > STRAY_RADII:
            places, costs, stray_us = without, lower, points[stray].end_us
    return places, costs, stray_us


def _instant_us(places: Places, times_us: Floats, costs: Floats) -> float:
    """Time of the least cost, between the times (m,) of these costs (m,) around the least of them.

    A ball that a racket sends back at 15 m/s between both velocities is 1.5 mm elsewhere where it turned 0.1 ms sooner.
    """
    around_us = times_us[int(np.argmin(costs))] + np.arange(-FINE_STEP_US, FINE_STEP_US + 1, FINEST_STEP_US)
    within_us = around_us[(around_us >= times_us[0]) & (around_us <= times_us[-1])]
    return float(within_us[np.argmin(places.costs(within_us))])


def _off_radii(point: PathPoint, path: HingedPath) -> float:
    """Distance of a point's circle from a path, in radii."""
    x, y, _, _, radius = path.state(point.end_us)
    assert point.circle is not None
    return math.hypot(point.circle.x_px - x, point.circle.y_px - y) / float(radius)


def _is_certain(points: list[PathPoint], camera: Camera, ball_radius_m: float) -> bool:
    """Whether a camera that shakes STRONGER times as much as stated would not explain the bend of a path either."""
    if not any(point.shake_px for point in points):
        return True
    shaken = [replace(point, shake_px=STRONGER * point.shake_px) for point in points]
    _, gains = _gains_of_hinges(shaken, camera, ball_radius_m)
    return bool(np.any(gains >= LEAST_GAIN))


def _gains_of_hinges(points: list[PathPoint], camera: Camera, ball_radius_m: float) -> tuple[Floats, Floats]:
    """Times (m,) of hinges between the last circles of a path, and their gains (m,); empty where none can gain enough.

    The points have circles.
    """
    fit = _PathFit(points, camera, ball_radius_m)
    if fit.smooth_cost < LEAST_GAIN:
        return np.empty(0), np.empty(0)  # no hinge can gain more
    first_us = points[max(1, len(points) - RECENT_CIRCLES)].end_us
    hinges_us = np.arange(first_us + 1, points[-1].end_us, STEP_US, dtype=np.float64)
    return hinges_us, fit.gains(hinges_us)


class _PathFit:
    """Least-squares paths through measured circles, in the channels of `kernels.smooth_path`.

    Parameters
    ----------
    points : list of PathPoint
        With circles.
    """

    def __init__(self, points: list[PathPoint], camera: Camera, ball_radius_m: float) -> None:
        self.origin_us = points[-1].end_us
        rows = [
            ((point.end_us - self.origin_us) * 1e-6, c.x_px, c.y_px, c.radius_px, point.shake_px)
            for point in points
            if (c := point.circle)
        ]
        noises = np.concatenate([point.noise for point in points]).reshape(-1, 3, 3)
        self._times_s, self._values, self._weights, self._precisions, self.smooth_cost = kernels.smooth_path(
            np.array(rows), noises, ERRORS_PX2, camera.focal_px, ball_radius_m, ALLOWED
        )

    def gains(self, hinges_us: Floats) -> Floats:
        """Gains (m,) in chi^2 by a hinge at these times (m,).

        In units of what then remains, where that is more than the stated noise: clutter is no contact.
        """
        costs = self._costs((hinges_us - self.origin_us) * 1e-6)
        freedom = max(1, 3 * (self._times_s.size - kernels.SMOOTH_TERMS))
        gains: Floats = (costs[0] - costs[1:]) / np.maximum(1.0, costs[1:] / freedom)
        return gains

    def _costs(self, hinges_s: Floats) -> Floats:
        costs = np.empty(1 + hinges_s.size)
        kernels.path_costs(costs, self._times_s, self._values, self._weights, self._precisions, hinges_s)
        return costs


def _kind(before_m_s: Floats, after_m_s: Floats, unsure_m_s: Floats, up: Floats) -> Kind:
    """Kind of the contact: a table pushes up a ball that falls, and rubs it along by no more than its friction.

    unsure_m_s (3,) is 2 sigma of the jump along its least known direction, that of the view; the rest is known well.
    """
    jump = after_m_s - before_m_s
    push, unsure_push = float(jump @ up), abs(float(unsure_m_s @ up))
    rubbed = float(np.linalg.norm(jump - push * up))
    unsure_rubbed = math.sqrt(max(float(unsure_m_s @ unsure_m_s) - unsure_push**2, 0.0))
    falls = before_m_s @ up < unsure_push and push > -unsure_push
    most_push = min(max(push + unsure_push, 0.0), MOST_PUSH_M_S)
    return "bounce" if falls and rubbed - unsure_rubbed <= MOST_FRICTION * most_push else "hit"
