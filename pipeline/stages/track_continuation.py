"""Continuation of a ball's path by a ball that is found elsewhere: it was hit in between.

A racket's outline on the old path can be taken for the ball's until the ball that it sent back is found.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..results import Circle
from .track_ball import FIRST_SPEED_STD_M_S, Measuring, TrackedBall
from .track_contact import Contact, find_contact
from .track_outline import Sighting
from .track_parameters import TrackParameters
from .track_path import PathPoint
from .track_result import ShotEnd
from .track_state import TrackState

# What speaks against one free flight, in words for people.
CONTACT_UNCERTAIN = (
    "the camera shakes, or a print at the ball's outline moves it, so much that it is uncertain when, and whether, "
    "the ball touched something"
)
# A ball that is hit leaves from where it was: after 10 ms, the longest until it is found, the velocity of one outline
# (0.2 m/s, 1 sigma) and drag (30 m/s^2 at 14 m/s) leave a tenth of its radius open.
SAME_PLACE = 0.3


def continued(
    parameters: TrackParameters,
    state: TrackState,
    balls: list[TrackedBall],
    sighting: Sighting,
    path: list[PathPoint],
    first: NDArray[np.float64],
) -> tuple[TrackedBall, Contact] | None:
    """The one of these balls whose path that of a ball sighted now continues, and the contact between; None without.

    Parameters
    ----------
    path : list of PathPoint
        That of the sighted ball from the first tick in which it is measured to this one.
    first : (5,) float64
        Its state at the end of the first.
    """
    camera, ball_radius_m = state.context.camera, state.context.ball_radius_m
    ahead = _place_ahead(path[-1], state.measuring.edge.ball(sighting.ring), state.measuring)
    for ball in balls:
        if not ball.has_size(sighting) or not ball.path[0].end_us < path[0].end_us <= ball.path[-1].end_us:
            continue
        before = [point for point in ball.path if point.end_us < path[0].end_us]
        contact = find_contact([*before, *path, ahead], camera, ball_radius_m, parameters.contour_us, 1)
        if contact is None or contact.latest_us >= path[-1].end_us:
            continue  # or that would be after the sighting
        left_px = first[:2] - (path[0].end_us - contact.time_us) * 1e-6 * first[2:4]
        missed_px = np.hypot(*(left_px - contact.path.state(contact.time_us - 1.0)[:2]))
        if missed_px < SAME_PLACE * first[4]:
            return ball, contact
    return None


def _place_ahead(point: PathPoint, ball: NDArray[np.float64], measuring: Measuring) -> PathPoint:
    """Place of a ball of this state (5,) a while after a point: one outline tells a velocity, as two circles do."""
    x, y, vx, vy, radius = ball.tolist()
    ahead_s = measuring.contour_us * 1e-6
    std_px = FIRST_SPEED_STD_M_S * ahead_s * radius / measuring.ball_radius_m
    circle = Circle(x + vx * ahead_s, y + vy * ahead_s, radius, 1.0)
    return replace(point, end_us=point.end_us + measuring.contour_us, circle=circle, shake_px=std_px)


def ended_at(contact: Contact, ball: TrackedBall) -> ShotEnd:
    """End of a ball's shot at a contact."""
    doubt = None if contact.is_certain else CONTACT_UNCERTAIN
    return ShotEnd(ball.shot, contact.earliest_us, contact.kind, doubt)
