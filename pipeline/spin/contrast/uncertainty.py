"""Stated error of a contrast maximum: events' noise, the ball's place and its drift, and what the model lacks."""

from __future__ import annotations

import math
from typing import NamedTuple

import numba
import numpy as np

from ...kernels.arrays import Floats, Integers
from .events import BallUncertainty, ContrastSettings, SphereEvents
from .score import Objective, derotate, spin_axes
from .search import LocalModel

# What the model lacks (the logo's blurred edges look different from each side) leaves errors that more events do not
# lessen, as parts of the kernel: of the axis, and of the place on the ball over the stretch's spread in time, which is
# a larger turn the nearer the logo is to the axis. From the errors of two simulators' balls with exact tracks.
AXIS_FLOOR, TURN_FLOOR = 0.3, 0.036
# Where the camera looks at the surface at less than this cosine (60 degrees, 2.2 px inside a 16.5 px ball's outline) a
# blurred edge is that much farther off on the ball, and its axis is stated as less certain, at most by MOST_OBLIQUE.
RIM_COSINE, MOST_OBLIQUE = 0.5, 5.0
# Events within so many kernels of each other on the turned-back ball tell the spin together; of so many all pairs are
# looked at.
LINKED_KERNELS, LINKED_EVENTS = 2.0, 300
# Fewer events within this of one than this part of what the logo's densest moment has are strays.
BESIDE_S, STRAY = 0.0025, 0.05
TRACK_MEMORY_S = 0.01  # over which a track's errors hang together: two steps of the Kalman filter
# Refining leaves so much of the offsets' error: 0.43, 0.37 and 0.52 of 0.5 px on 87 spinners, less where the spin
# depends on it.
REFINED = 0.65
# An edge gives events as far as it lies across its motion in the image. A ball that flies fast moves all edges the same
# way: whatever turns about the logo's own middle, the edges seen keep their direction, and the spin's part along the
# middle's normal is found too small. Its relative error over the turns seen: 0.37, 0.16, 0.16, 0.12 and 0.07 (rms)
# at 0.15, 0.28, 0.42, 0.6 and 0.8 turns of 250 windows of our simulator's flights, nothing of it on the spinner.
TWIST = 0.06


class Stretch(NamedTuple):
    """Number of events in a stretch of time, its middle and its length."""

    events: int
    reference_s: float
    span_s: float


def view_cosine(events: SphereEvents) -> Floats:
    """Cosine (n,) of the angle at which the camera looks at the surface: 1 in the middle of the disc, 0 at its rim."""
    cosine: Floats = -np.sum(events.normals * events.facing, axis=0)
    return cosine


def spin_covariance(
    objective: Objective,
    model: LocalModel,
    events: SphereEvents,
    ball: BallUncertainty,
    settings: ContrastSettings,
    stretch: Stretch,
) -> Floats:
    """Covariance (3, 3) of the spin, rad^2/s^2, at the maximum that `model` was made at.

    `events` are those of the objective, thinned from those of the stretch. A stray event before the logo's first visit
    does not lengthen what it was followed over.
    """
    spin = model.spin_rad_s
    squared = float(spin @ spin)
    along = np.outer(spin, spin) / squared
    covariance = _sandwich(objective, model, settings.repeats * len(events) / stretch.events)
    # Events' speed on the ball, in radii a second, for one rad/s more about the axis.
    x, y, z = spin / math.sqrt(squared)
    nx, ny, nz = events.normals
    lever = np.stack([y * nz - z * ny, z * nx - x * nz, x * ny - y * nx])
    even_s = max(even_span_s(events), 1e-5)
    span_s = max(min(even_s, stretch.span_s), 1e-5)
    covariance += _drift(objective, events, ball, spin, lever, span_s)
    oblique = max(1.0, RIM_COSINE / max(float(view_cosine(events).mean()), RIM_COSINE / MOST_OBLIQUE))
    covariance += (AXIS_FLOOR * settings.sigma_rad * oblique) ** 2 * squared * (np.eye(3) - along)
    spread_s = even_s / math.sqrt(12.0) * float(np.sqrt(np.mean(np.sum(lever**2, axis=0))))
    covariance += (TURN_FLOOR * settings.sigma_rad / spread_s) ** 2 * along
    return covariance + _twist(events, ball, spin, span_s)


def linked_share(events: SphereEvents, spin_rad_s: Floats, settings: ContrastSettings) -> float:
    """Stretch over which the events confirm a spin, as a share of that over which there are events.

    Only events of one polarity that coincide on the turned-back ball tell how far it turned between them. So the root
    mean square of the time between two events is taken over the pairs that do, and over all: where a visit of the logo
    shows another part of it than the others, or the spin brings it elsewhere, the pairs that coincide are those within
    the visits.
    """
    some = without_strays(events).thinned(LINKED_EVENTS)
    turned = np.empty_like(some.normals)
    derotate(turned, spin_rad_s, some.t_s, some.normals)
    nearest = math.cos(LINKED_KERNELS * settings.sigma_rad)
    linked_s2 = _mean_square_gap(some.t_s, turned, some.polarity, nearest)
    return math.sqrt(linked_s2 / max(2.0 * float(np.var(some.t_s)), 1e-12))


def even_span_s(events: SphereEvents) -> float:
    """Length of a stretch filled evenly with events whose times spread as much as these, strays apart."""
    return math.sqrt(12.0) * float(np.std(without_strays(events).t_s))


def without_strays(events: SphereEvents) -> SphereEvents:
    """The events without those that hardly any others are near in time: noise between the logo's visits."""
    first, last = (np.searchsorted(events.t_s, events.t_s + beside_s) for beside_s in (-BESIDE_S, BESIDE_S))
    near = last - first
    return events.at(near >= STRAY * near.max())


@numba.njit(cache=True, nogil=True)
def _mean_square_gap(t_s: Floats, points: Floats, polarity: Integers, least_cosine: float) -> float:
    """Mean squared difference of the times of pairs of one polarity whose points (3, n) are so near each other."""
    total, pairs = 0.0, 0
    for i in range(t_s.size):
        for j in range(i):
            if polarity[i] != polarity[j]:
                continue
            cosine = points[0, i] * points[0, j] + points[1, i] * points[1, j] + points[2, i] * points[2, j]
            if cosine > least_cosine:
                total += (t_s[i] - t_s[j]) ** 2
                pairs += 1
    return total / max(pairs, 1)


def _sandwich(objective: Objective, model: LocalModel, repeats: float) -> Floats:
    """The events' noise and the ball's place, (3, 3) rad^2/s^2.

    An event's part of the gradient is twice the slope of its own share (it also is the neighbour of its neighbours):
    M = 4 repeats sum d_i d_i', with `repeats` events of one edge that tell the same. With A the score's curvature the
    events' noise gives A_ww^-1 M_ww A_ww^-1 (w: the spin). A ball that is d off its assumed place moves the maximum
    by -A_ww^-1 A_wp d; d has nearly the prior's covariance (REFINED), although offsets were refined with the spin:
    refining improves the spin, but the refined offsets are themselves hardly nearer to the truth.
    """
    inverse = np.linalg.inv(model.curvature[:3, :3])
    by_place = inverse @ model.curvature[:3, 3:] * (REFINED * objective.prior_px / model.steps[3:])
    whole = 4.0 * repeats * inverse @ model.scatter[:3, :3] @ inverse + by_place @ by_place.T
    back = spin_axes(model.spin_rad_s).T * model.steps[:3]
    covariance: Floats = back @ whole @ back.T
    return covariance


def _drift(
    objective: Objective, events: SphereEvents, ball: BallUncertainty, spin_rad_s: Floats, lever: Floats, span_s: float
) -> Floats:
    """A centre that drifts over the ball looks like a turn: (3, 3), rad^2/s^2.

    A track that is off by its sigma, anew every TRACK_MEMORY_S, looks like a ramp of sqrt(12) sigma over the stretch,
    less so the more often its errors change. So do latencies that differ between its ends. Across the spin's axis it is
    a turn about an axis in the image; about the axis itself the turn that fits how far each event's place on the ball
    is shifted (`offset_slopes`), in the sense of least squares: a pixel is more of the ball at the rim, and more of a
    turn near the axis. (Within less than a turn the axis takes a part of it; that much too large an error is stated
    then.)
    """
    changes = max(span_s / TRACK_MEMORY_S, 1.0)
    ramp_px_s = math.sqrt(12.0 / changes) * ball.track_std_px / span_s
    rate_px_s = math.hypot(min(ball.drift_std_px_s, ramp_px_s), ball.latency_std_px / span_s / math.sqrt(changes))
    axis = spin_rad_s / math.sqrt(spin_rad_s @ spin_rad_s)
    facing = events.facing.mean(axis=1)
    facing /= np.linalg.norm(facing)
    facing -= float(facing @ axis) * axis
    across = np.eye(3) - np.outer(axis, axis) - np.outer(facing, facing)
    squared_s2 = (events.t_s - events.t_s.mean()) ** 2
    turns = np.einsum("kin,in->k", objective.slopes[:2], lever * squared_s2)
    about_axis = float(turns @ turns) / max(float(squared_s2 @ np.sum(lever**2, axis=0)), 1e-18) ** 2
    spread: Floats = rate_px_s**2 * (across / float(np.mean(events.radius_px)) ** 2 + about_axis * np.outer(axis, axis))
    return spread


def _twist(events: SphereEvents, ball: BallUncertainty, spin_rad_s: Floats, span_s: float) -> Floats:
    """The error of the turn about the logo's middle where the flight moves its edges more than the spin does."""
    speed = float(np.linalg.norm(spin_rad_s))
    spun_px_s = speed * float(np.mean(events.radius_px))
    by_flight = ball.speed_px_s / max(ball.speed_px_s + spun_px_s, 1e-9)
    middle = events.normals.mean(axis=1)
    middle /= max(float(np.linalg.norm(middle)), 1e-9)
    turns = max(speed * span_s / (2.0 * math.pi), 1e-3)
    off = min(TWIST / turns, 1.0) * by_flight * float(spin_rad_s @ middle) * middle
    # The logo that has come back has told the magnitude, not the axis.
    axis = spin_rad_s / speed
    off -= min(max(2.0 * turns - 1.0, 0.0), 1.0) * float(off @ axis) * axis
    return np.outer(off, off)
