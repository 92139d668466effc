"""Maximisation of the contrast score, by a grid search over all spins and Newton's method, and its stated error.

A spin of m rps turns the ball by a given part of a turn within segments of that part / m seconds. Scored over such
segments, every speed needs the same grid of directions and the same ratio from one magnitude to the next, and all
segments count together: no single moment needs to show the logo well. Then the best cells of the grid are halved
while the segments double, which is the usual doubling of the window without betting on one stretch of it.

Newton's method works on finite differences: the score is a sum over splats, smooth on the scale of its kernel, and
steps of half a kernel see its curvature rather than the map's cells.

The stated error is of the events' noise, the ball's place and its drift, and what the model lacks.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba
import numpy as np

from ...kernels.arrays import Floats, Integers
from ...kernels.order_statistics import median
from ...kernels.small_matrices import cholesky_solve
from ...kernels.sphere import spread_directions
from .events import BallUncertainty, ContrastSettings, EventColumns, SphereEvents, segmented_window
from .score import (
    CELLS_PER_SIGMA,
    TURN,
    Objective,
    changed_spin,
    derotate,
    difference_steps,
    score,
    scores_near,
    spin_axes,
)

SLOWEST_RPS = 3.0
# First pass: over a fifth of a turn, neighbours in a grid of 64 directions (0.44 rad) and of magnitudes 1.4 apart
# move an event by 0.14 rad at most, about the kernel's width.
SEARCH_TURNS = 0.2
SEARCH_SIGMA_RAD = 0.12
MAGNITUDE_RATIO = 1.4
# A spin a little above the highest asked for must not lose to an alias below.
BEYOND = 1.1
DIRECTIONS = 64
DIRECTION_SPACING_RAD = math.sqrt(4.0 * math.pi / DIRECTIONS)
# Halvings of the best cells, how many are kept, and how the kernel shrinks: four bring 0.2 to 3.2 turns.
HALVINGS = 4
KEPT = 48
CROWD = 6
SHRINK = 0.8
SEGMENT_EVENTS = 100  # more do not sharpen a coarse answer, they only cost time
# Spins nearer than this (relative) belong to one local maximum of the score, farther ones to two.
NEAR = 0.3
# Log magnitudes that share a segment length.
SHARED = 0.15
# The curvature of a likelihood is the covariance of its gradient: along an unknown it may differ from what the
# gradients say by this factor, else it is the finite difference that is wrong.
CURVATURE_TRUST = 2.0
LEAST_CURVATURE = 1.0  # usual ones are 1 to 4 times the gradient's covariance
NO_OFFSETS = np.zeros(0)
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
# A spin that brings the logo's visits to different places on the ball is told by one of them alone, and so is another
# spin at which they meet. Of 125 answers on simulated flights seven have a linked share below 0.3: six are wrong by
# more than 2 rps, and at the seventh's truth the visits meet. Of the others, at 0.52 and more, one is wrong.
LEAST_LINKED = 0.4
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


@numba.njit(cache=True, nogil=True)
def distinct(spins: Floats, apart: float, most: int, crowd: int) -> Integers:
    """Indices of at most `most` spins, in order, each farther than `apart` (relative to the faster) from those before.

    If `crowd` is not 0, no more than so many spins within NEAR of each other, or one broad maximum takes every place.
    """
    rows, count = np.empty(spins.shape[0], np.int64), 0
    squares = spins[:, 0] ** 2 + spins[:, 1] ** 2 + spins[:, 2] ** 2
    for row in range(spins.shape[0]):
        near, alone = 0, True
        for k in range(count):
            other = rows[k]
            gap2 = (
                (spins[row, 0] - spins[other, 0]) ** 2
                + (spins[row, 1] - spins[other, 1]) ** 2
                + (spins[row, 2] - spins[other, 2]) ** 2
            ) / max(squares[row], squares[other])
            near += gap2 < NEAR * NEAR
            if gap2 <= apart * apart:
                alone = False
                break
        if alone and (crowd == 0 or near < crowd):
            rows[count] = row
            count += 1
            if count == most:
                break
    return rows[:count].copy()


def last_of_grid_rps(rps: float) -> float:
    """The lowest magnitude of the search's grid that is BEYOND times this one or more."""
    return SLOWEST_RPS * MAGNITUDE_RATIO ** max(0, math.ceil(math.log(BEYOND * rps / SLOWEST_RPS, MAGNITUDE_RATIO)))


def grid_search(events: EventColumns, fastest_rps: float, floor: float, max_events: int, keep: int) -> Floats:
    """At most `keep` distinct spins (k, 3) in rad/s of all directions and speeds up to fastest_rps, best first.

    The magnitudes are the same ones whatever the fastest is.
    """
    span_s = float(events.t_s[-1] - events.t_s[0])
    count = max(0, round(math.log(fastest_rps / SLOWEST_RPS, MAGNITUDE_RATIO)))
    magnitudes = SLOWEST_RPS * MAGNITUDE_RATIO ** np.arange(count + 1.0) * TURN
    spins = np.concatenate([spread_directions(DIRECTIONS) * magnitude for magnitude in magnitudes])
    turns, sigma_rad = SEARCH_TURNS, SEARCH_SIGMA_RAD
    values = _scores_over_turns(events, spins, turns, sigma_rad, floor, max_events, SEGMENT_EVENTS // 2)
    spins = spins[np.argsort(-values, kind="stable")][:KEPT]
    ratio, spacing_rad = math.log(MAGNITUDE_RATIO), DIRECTION_SPACING_RAD
    for _ in range(HALVINGS):
        turns, sigma_rad = 2.0 * turns, SHRINK * sigma_rad
        spins = _halved(spins, ratio, spacing_rad)
        values = _scores_over_turns(events, spins, turns, sigma_rad, floor, max_events, SEGMENT_EVENTS)
        spins = spins[np.argsort(-values, kind="stable")]
        ratio, spacing_rad = 0.5 * ratio, 0.5 * spacing_rad
        spins = spins[distinct(spins, 0.6 * spacing_rad, KEPT, CROWD)]
        if turns * TURN > span_s * np.linalg.norm(spins, axis=1).max():
            break
    return spins[distinct(spins, NEAR, keep, 0)]


@numba.njit(cache=True, nogil=True)
def _halved(spins: Floats, ratio: float, spacing_rad: float) -> Floats:
    """Middles (8 m, 3) of the eighths of the cells around spins (m, 3), whose log magnitudes are `ratio` wide."""
    parts, at = np.empty((8 * spins.shape[0], 3)), 0
    for k in range(spins.shape[0]):
        axes = spin_axes(spins[k])
        magnitude = math.sqrt(spins[k, 0] ** 2 + spins[k, 1] ** 2 + spins[k, 2] ** 2)
        for larger in (-0.25, 0.25):
            for right in (-0.25, 0.25):
                for up in (-0.25, 0.25):
                    square = 0.0
                    for i in range(3):
                        parts[at, i] = axes[0, i] + spacing_rad * (right * axes[1, i] + up * axes[2, i])
                        square += parts[at, i] ** 2
                    factor = magnitude * math.exp(larger * ratio) / math.sqrt(square)
                    for i in range(3):
                        parts[at, i] *= factor
                    at += 1
    return parts


@numba.njit(cache=True, nogil=True)
def _scores_over_turns(
    events: EventColumns,
    spins_rad_s: Floats,
    turns: float,
    sigma_rad: float,
    floor: float,
    max_events: int,
    segment_events: int,
) -> Floats:
    """Scores (m,) over segments of so many turns of each spin (m, 3), as if no events had been left out."""
    count = spins_rad_s.shape[0]
    values, done = np.full(count, -np.inf), np.zeros(count, np.bool_)
    speed = np.empty(count, np.int64)
    for k in range(count):
        squares = spins_rad_s[k, 0] ** 2 + spins_rad_s[k, 1] ** 2 + spins_rad_s[k, 2] ** 2
        speed[k] = math.floor(0.5 * math.log(squares) / SHARED + 0.5)
    for first in range(count):
        if done[first]:
            continue
        segment_s = turns * TURN / math.exp(speed[first] * SHARED)
        window = segmented_window(events, segment_s, max_events, segment_events)
        used = window.events.t_s.size
        log_ratios = np.empty(used)
        for k in range(first, count):
            if speed[k] != speed[first]:
                continue
            done[k] = True
            if used:
                one = score(log_ratios, spins_rad_s[k], window, sigma_rad * CELLS_PER_SIGMA, floor)
                values[k] = one * (events.t_s.size / used)
    return values


class LocalModel(NamedTuple):
    """Quadratic model of the score around a spin, in units of `steps` (c,): rad/s, then px.

    Attributes
    ----------
    spin_rad_s : (3,) float64
        Where the differences were taken.
    value, gradient, curvature : float, (c,), (c, c)
        Score and its derivatives (the curvature is positive at a maximum).
    scatter : (c, c) float64
        Sum of d_i d_i' with d_i the slope of an event's own share.
    """

    spin_rad_s: Floats
    steps: Floats
    value: float
    gradient: Floats
    curvature: Floats
    scatter: Floats


@numba.njit(cache=True, nogil=True)
def local_model(objective: Objective, spin_rad_s: Floats, offsets_px: Floats, scale: float) -> LocalModel:
    """Finite differences, 2 c + 1 scores, with the usual steps times `scale`.

    Where the score is a likelihood its curvature is proportional to the covariance of its gradient (Berndt, Hall,
    Hall and Hausman, 1974): the correlations are taken from there, the sizes from second differences, kept within a
    factor CURVATURE_TRUST of their median, since differences over a sharp maximum can go wrong, even negative.
    """
    steps = difference_steps(objective, spin_rad_s)
    for k in range(steps.size):
        steps[k] *= scale
    count, n = steps.size, objective.window.events.t_s.size
    changes = np.zeros((2 * count + 1, count))
    for k in range(count):
        changes[1 + k, k], changes[1 + count + k, k] = steps[k], -steps[k]
    shares = np.empty((2 * count + 1, n))
    values = scores_near(shares, objective, spin_rad_s, offsets_px, changes)
    scatter, sizes, gradient = np.empty((count, count)), np.empty(count), np.empty(count)
    for k in range(count):
        slopes, back = shares[1 + k], shares[1 + count + k]
        for i in range(n):
            slopes[i] = 0.5 * (slopes[i] - back[i])
        for j in range(k + 1):
            others, total = shares[1 + j], 0.0
            for i in range(n):
                total += slopes[i] * others[i]
            scatter[k, j] = scatter[j, k] = total
        scatter[k, k] = max(scatter[k, k], 1e-12)
        sizes[k] = (2.0 * values[0] - values[1 + k] - values[1 + count + k]) / scatter[k, k]
        gradient[k] = 0.5 * (values[1 + k] - values[1 + count + k])
    usual = max(median(sizes.copy()), LEAST_CURVATURE)
    curvature = np.empty((count, count))
    for k in range(count):
        sizes[k] = min(max(sizes[k], usual / CURVATURE_TRUST), usual * CURVATURE_TRUST)
        for j in range(k + 1):
            curvature[k, j] = curvature[j, k] = scatter[k, j] * math.sqrt(sizes[k] * sizes[j])
    return LocalModel(spin_rad_s, steps, values[0], gradient, curvature, scatter)


@numba.njit(cache=True, nogil=True)
def _newton_step(objective: Objective, model: LocalModel, offsets_px: Floats) -> Floats:
    """Change (c,), in units of the steps, to the maximum of the model of weighted score less the prior's cost."""
    curvature, gradient = model.curvature.copy(), model.gradient.copy()
    for k in range(gradient.size):
        gradient[k] *= objective.weight
        for j in range(gradient.size):
            curvature[k, j] *= objective.weight
    for k in range(offsets_px.size):
        precision = (model.steps[3 + k] / objective.prior_px[k]) ** 2
        curvature[3 + k, 3 + k] += precision
        gradient[3 + k] -= precision * offsets_px[k] / model.steps[3 + k]
    largest = 0.0
    for k in range(gradient.size):
        largest = max(largest, curvature[k, k])
    for k in range(gradient.size):
        curvature[k, k] += 0.02 * largest + 1e-12
    return cholesky_solve(curvature, gradient)


@numba.njit(cache=True, nogil=True)
def maximise(
    objective: Objective, spin_rad_s: Floats, offsets_px: Floats, iterations: int
) -> tuple[Floats, Floats, float, LocalModel]:
    """Spin, offsets and score after at most so many Newton steps, never lower than at the start; the last model.

    A step is tried whole and halved; where neither is higher, the next is looked for with finer differences.
    The model is that of whole steps: finer differences serve to climb, but are too rough for a covariance.
    """
    scale, shares = 1.0, np.empty((2, objective.window.events.t_s.size))
    usual = model = local_model(objective, spin_rad_s, offsets_px, scale)
    value = model.value
    for iteration in range(iterations):
        if iteration:
            model = local_model(objective, spin_rad_s, offsets_px, scale)
            if scale == 1.0:
                usual = model
        change = _newton_step(objective, model, offsets_px)
        square = 0.0
        for k in range(change.size):
            square += change[k] ** 2
        length = math.sqrt(square)
        whole = min(1.0, 2.0 / max(length, 1e-12))  # the model is not to be believed farther than a kernel
        changes, gains = np.empty((2, change.size)), np.empty(2)
        for k in range(change.size):
            changes[0, k], changes[1, k] = whole * change[k] * model.steps[k], 0.5 * whole * change[k] * model.steps[k]
        values = scores_near(shares, objective, spin_rad_s, offsets_px, changes)
        for m in range(2):
            gains[m] = objective.weight * (values[m] - model.value)
            for k in range(offsets_px.size):
                after_px = offsets_px[k] + changes[m, 3 + k]
                gains[m] -= 0.5 * (after_px**2 - offsets_px[k] ** 2) / objective.prior_px[k] ** 2
        pick = 0 if gains[0] >= gains[1] else 1
        if gains[pick] <= 0.0:
            if scale < 0.3:
                break
            scale *= 0.5
            continue
        value = values[pick]
        spin_rad_s = changed_spin(spin_rad_s, spin_axes(spin_rad_s), changes[pick, :3])
        offsets_px = offsets_px.copy()
        for k in range(offsets_px.size):
            offsets_px[k] += changes[pick, 3 + k]
        if length < 0.1:
            break
    return spin_rad_s, offsets_px, value, usual


def maximise_each(objective: Objective, spins_rad_s: Floats, iterations: int) -> tuple[Floats, Floats, Floats]:
    """Local maxima (k, 3) reached from spins (k, 3), their scores (k,) and each event's share (k, n)."""
    maxima, values = np.empty_like(spins_rad_s), np.empty(len(spins_rad_s))
    shares, here = np.empty((len(spins_rad_s), objective.window.events.t_s.size)), np.zeros((1, 3))
    for k, spin_rad_s in enumerate(spins_rad_s):
        maxima[k] = maximise(objective, spin_rad_s, NO_OFFSETS, iterations)[0]
        values[k] = scores_near(shares[k : k + 1], objective, maxima[k], NO_OFFSETS, here)[0]
    return maxima, values, shares


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
    even_s: float,
) -> Floats:
    """Covariance (3, 3) of the spin, rad^2/s^2, at the maximum that `model` was made at.

    `events` are those of the objective, thinned from those of the stretch, `even_s` is their `even_span_s`.
    """
    spin = model.spin_rad_s
    squared = float(spin @ spin)
    along = np.outer(spin, spin) / squared
    covariance = _sandwich(objective, model, settings.repeats * len(events) / stretch.events)
    # Events' speed on the ball, in radii a second, for one rad/s more about the axis.
    x, y, z = spin / math.sqrt(squared)
    nx, ny, nz = events.normals
    lever = np.stack([y * nz - z * ny, z * nx - x * nz, x * ny - y * nx])
    even_s = max(even_s, 1e-5)
    span_s = max(min(even_s, stretch.span_s), 1e-5)
    covariance += _drift(objective, events, ball, spin, lever, span_s)
    oblique = max(1.0, RIM_COSINE / max(float(view_cosine(events).mean()), RIM_COSINE / MOST_OBLIQUE))
    covariance += (AXIS_FLOOR * settings.sigma_rad * oblique) ** 2 * squared * (np.eye(3) - along)
    spread_s = even_s / math.sqrt(12.0) * float(np.sqrt(np.mean(np.sum(lever**2, axis=0))))
    covariance += (TURN_FLOOR * settings.sigma_rad / spread_s) ** 2 * along
    return covariance + _twist(events, ball, spin, span_s)


def linked_share(events: SphereEvents, spin_rad_s: Floats, settings: ContrastSettings) -> float:
    """Stretch over which events, without strays, confirm a spin, as a share of that over which there are events.

    Only events of one polarity that coincide on the turned-back ball tell how far it turned between them. So the root
    mean square of the time between two events is taken over the pairs that do, and over all: where a visit of the logo
    shows another part of it than the others, or the spin brings it elsewhere, the pairs that coincide are those within
    the visits.
    """
    some = events.thinned(LINKED_EVENTS)
    turned = np.empty_like(some.normals)
    derotate(turned, spin_rad_s, some.t_s, some.normals)
    nearest = math.cos(LINKED_KERNELS * settings.sigma_rad)
    linked_s2 = _mean_square_gap(some.t_s, turned, some.polarity, nearest)
    return math.sqrt(linked_s2 / max(2.0 * float(np.var(some.t_s)), 1e-12))


def even_span_s(events: SphereEvents) -> float:
    """Length of a stretch filled evenly with events whose times spread as much as these, which are without strays."""
    return math.sqrt(12.0) * float(np.std(events.t_s))


def without_strays(events: SphereEvents) -> SphereEvents:
    """The events without those that hardly any others are near in time: noise between the logo's visits.

    A stray event before the first visit does not lengthen what the logo was followed over.
    """
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
