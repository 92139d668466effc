"""Maximisation of the contrast score: a grid search over all spins, and Newton's method.

A spin of m rps turns the ball by a given part of a turn within segments of that part / m seconds. Scored over such
segments, every speed needs the same grid of directions and the same ratio from one magnitude to the next, and all
segments count together: no single moment needs to show the logo well. Then the best cells of the grid are halved
while the segments double, which is the usual doubling of the window without betting on one stretch of it.

Newton's method works on finite differences: the score is a sum over splats, smooth on the scale of its kernel, and
steps of half a kernel see its curvature rather than the map's cells.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba
import numpy as np

from ...kernels.arrays import Floats, Integers
from ...kernels.order_statistics import median
from .events import EventColumns, segmented_window
from .score import (
    CELLS_PER_SIGMA,
    TURN,
    Objective,
    changed_spin,
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


def spread_directions(count: int) -> Floats:
    """Unit vectors (count, 3) spread evenly over the sphere (Fibonacci's spiral)."""
    i = np.arange(count) + 0.5
    z = 1.0 - 2.0 * i / count
    angle = math.pi * (1.0 + math.sqrt(5.0)) * i
    across = np.sqrt(1.0 - z * z)
    return np.stack([across * np.cos(angle), across * np.sin(angle), z], axis=1)


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


def grid_search(events: EventColumns, fastest_rps: float, floor: float, max_events: int, keep: int) -> Floats:
    """At most `keep` distinct spins (k, 3) in rad/s of all directions and speeds up to fastest_rps, best first."""
    span_s = float(events.t_s[-1] - events.t_s[0])
    count = max(1, math.ceil(math.log(fastest_rps / SLOWEST_RPS) / math.log(MAGNITUDE_RATIO)))
    magnitudes = np.geomspace(min(SLOWEST_RPS, fastest_rps), fastest_rps, count + 1) * TURN
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
def cholesky_solve(matrix: Floats, right: Floats) -> Floats:
    """Solution x (c,) of matrix x = right; the matrix (c, c) is positive definite."""
    count = right.size
    lower, x = np.zeros((count, count)), right.copy()
    for k in range(count):
        for j in range(k + 1):
            total = matrix[k, j]
            for i in range(j):
                total -= lower[k, i] * lower[j, i]
            lower[k, j] = math.sqrt(max(total, 1e-300)) if k == j else total / lower[j, j]
    for k in range(count):
        for i in range(k):
            x[k] -= lower[k, i] * x[i]
        x[k] /= lower[k, k]
    for k in range(count - 1, -1, -1):
        for i in range(k + 1, count):
            x[k] -= lower[i, k] * x[i]
        x[k] /= lower[k, k]
    return x


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


@numba.njit(cache=True, nogil=True)
def maximise_each(objective: Objective, spins_rad_s: Floats, iterations: int) -> tuple[Floats, Floats, Floats]:
    """Local maxima (k, 3) reached from spins (k, 3), their scores (k,) and each event's share (k, n)."""
    maxima, values, none = np.empty_like(spins_rad_s), np.empty(spins_rad_s.shape[0]), np.empty(0)
    shares, here = np.empty((spins_rad_s.shape[0], objective.window.events.t_s.size)), np.zeros((1, 3))
    for k in range(spins_rad_s.shape[0]):
        best = maximise(objective, spins_rad_s[k], none, iterations)[0]
        maxima[k, 0], maxima[k, 1], maxima[k, 2] = best[0], best[1], best[2]
        values[k] = scores_near(shares[k : k + 1], objective, maxima[k], none, here)[0]
    return maxima, values, shares
