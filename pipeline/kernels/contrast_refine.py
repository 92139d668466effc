"""Climbing the contrast score: in magnitude and direction, and in the ball's place where the data know it better.

Newton's method on finite differences: the score is a sum over splats, smooth on the scale of its kernel, and steps of
half a kernel see its curvature rather than the map's cells.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from .contrast import CELLS_PER_SIGMA, score
from .contrast_place import moved_normals
from .contrast_search import axes_of
from .contrast_window import Window

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
STEP_SIGMAS = 0.5
OFFSET_STEP_PX = 0.3
NO_OFFSETS = np.zeros(0)
# The curvature of a likelihood is the covariance of its gradient: along an unknown it may differ from what the
# gradients say by this factor, else it is the finite difference that is wrong.
BEND_TRUST = 2.0
LEAST_BEND = 1.0  # usual ones are 1 to 4 times the noise
# Refining leaves so much of the offsets' error: 0.43, 0.37 and 0.52 of 0.5 px on 87 spinners, less where the spin
# depends on it.
REFINED = 0.65


@numba.njit(cache=True, nogil=True)
def shifted_spin(spin: Floats, axes: Floats, change: Floats) -> Floats:
    """The spin with its magnitude changed by change[0] and its direction turned by change[1:3] / |spin| (radians)."""
    magnitude = math.sqrt(spin[0] ** 2 + spin[1] ** 2 + spin[2] ** 2)
    across = math.hypot(change[1], change[2])
    angle = across / magnitude
    ahead, sideways = math.cos(angle), math.sin(angle) / max(across, 1e-12)
    direction = ahead * axes[0] + sideways * (change[1] * axes[1] + change[2] * axes[2])
    turned: Floats = direction * max(magnitude + change[0], 1e-3)
    return turned


class Hill(NamedTuple):
    """The score as a function of the spin and, if `prior_px` has entries, of the ball's offsets.

    part : the events, one window; others : rows of its exchanged events
    slopes_px : (3, 3, n) of the same events, see `contrast_place`; (3, 3, 0) where no offsets are looked at
    sigma, floor : kernel in radians, density floor
    prior_px : (0,) or (3,) 1 sigma of the offsets of centre x, y and radius, px
    trust : weight of the score against the prior
    """

    part: Window
    others: Integers
    slopes_px: Floats
    sigma: float
    floor: float
    prior_px: Floats
    trust: float


class Slopes(NamedTuple):
    """The score around a spin, in units of `steps` (c,): value, gradient (c,), curvature (c, c), noise (c, c).

    noise is sum d_i d_i' with d_i the slope of an event's own share.
    """

    spin: Floats
    steps: Floats
    value: float
    gradient: Floats
    bend: Floats
    noise: Floats


@numba.njit(cache=True, nogil=True)
def scores_near(shares: Floats, hill: Hill, spin: Floats, offsets_px: Floats, changes: Floats) -> Floats:
    """(m,) scores at m changes (m, 3 or 6) of spin and offsets; each event's share goes to `shares` (m, n).

    changes : rad/s as in `shifted_spin`, then px
    """
    values, axes, part = np.empty(changes.shape[0]), axes_of(spin), hill.part
    moved, other_moved, at_px = part.normals, part.other_normals, np.zeros(3)
    for m in range(changes.shape[0]):
        if hill.prior_px.size:
            place_px = offsets_px + changes[m, 3:]
            if place_px[0] != at_px[0] or place_px[1] != at_px[1] or place_px[2] != at_px[2]:
                at_px = place_px
                moved = moved_normals(part.normals, hill.slopes_px, at_px)
                other_moved = np.empty_like(part.other_normals)
                for row in range(3):
                    for i in range(hill.others.size):
                        other_moved[row, i] = moved[row, hill.others[i]]
        values[m] = score(
            shares[m],
            shifted_spin(spin, axes, changes[m, :3]),
            part.t_s,
            moved,
            part.layers,
            part.starts,
            part.other_t_s,
            other_moved,
            part.other_layers,
            part.other_starts,
            hill.sigma * CELLS_PER_SIGMA,
            hill.floor,
        )
    return values


@numba.njit(cache=True, nogil=True)
def steps_of(hill: Hill, spin: Floats) -> Floats:
    """(c,) step of each unknown that moves the events by about half a kernel: rad/s, then px."""
    mean, square = 0.0, 0.0
    for t in hill.part.t_s:
        mean += t / hill.part.t_s.size
    for t in hill.part.t_s:
        square += (t - mean) ** 2 / hill.part.t_s.size
    spread_s = max(math.sqrt(square), 1e-5)
    magnitude = math.sqrt(spin[0] ** 2 + spin[1] ** 2 + spin[2] ** 2)
    steps = np.empty(3 + hill.prior_px.size)
    steps[0] = min(STEP_SIGMAS * hill.sigma / spread_s, 0.3 * magnitude)
    # Once the ball has turned round, an error of the axis moves events by that angle and no more.
    steps[1] = min(STEP_SIGMAS * hill.sigma * max(1.0 / spread_s, magnitude), 0.3 * magnitude)
    steps[2] = steps[1]
    for k in range(hill.prior_px.size):
        steps[3 + k] = OFFSET_STEP_PX
    return steps


@numba.njit(cache=True, nogil=True)
def slopes_at(hill: Hill, spin: Floats, offsets_px: Floats, scale: float) -> Slopes:
    """Finite differences, 2 c + 1 scores, with the usual steps times `scale`.

    Where the score is a likelihood its curvature is proportional to the covariance of its gradient (Berndt, Hall,
    Hall and Hausman, 1974): the correlations are taken from there, the sizes from second differences, kept within a
    factor BEND_TRUST of their median, since finite differences over a sharp top can go wrong, even negative.
    """
    steps = steps_of(hill, spin)
    count, n = steps.size, hill.part.t_s.size
    changes = np.zeros((2 * count + 1, count))
    for k in range(count):
        steps[k] *= scale
        changes[1 + k, k], changes[1 + count + k, k] = steps[k], -steps[k]
    shares = np.empty((2 * count + 1, n))
    values = scores_near(shares, hill, spin, offsets_px, changes)
    noise, bends, gradient = np.empty((count, count)), np.empty(count), np.empty(count)
    for k in range(count):
        for i in range(n):
            shares[1 + k, i] = 0.5 * (shares[1 + k, i] - shares[1 + count + k, i])
        for j in range(k + 1):
            total = 0.0
            for i in range(n):
                total += shares[1 + k, i] * shares[1 + j, i]
            noise[k, j] = noise[j, k] = total
        noise[k, k] = max(noise[k, k], 1e-12)
        bends[k] = (2.0 * values[0] - values[1 + k] - values[1 + count + k]) / noise[k, k]
        gradient[k] = 0.5 * (values[1 + k] - values[1 + count + k])
    ranked = np.sort(bends)
    usual = max(0.5 * (ranked[(count - 1) // 2] + ranked[count // 2]), LEAST_BEND)
    bend = np.empty((count, count))
    for k in range(count):
        bends[k] = min(max(bends[k], usual / BEND_TRUST), usual * BEND_TRUST)
        for j in range(k + 1):
            bend[k, j] = bend[j, k] = noise[k, j] * math.sqrt(bends[k] * bends[j])
    return Slopes(spin, steps, values[0], gradient, bend, noise)


@numba.njit(cache=True, nogil=True)
def solved(matrix: Floats, right: Floats) -> Floats:
    """x of matrix x = right, by Cholesky's factors; the matrix (c, c) is positive definite."""
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
def _newton_step(hill: Hill, seen: Slopes, offsets_px: Floats) -> Floats:
    """(c,) change, in units of the steps, to the top of the parabola of trusted score less the prior's cost."""
    count = seen.gradient.size
    bend, gradient, largest = np.empty((count, count)), np.empty(count), 0.0
    for k in range(count):
        gradient[k] = hill.trust * seen.gradient[k]
        for j in range(count):
            bend[k, j] = hill.trust * seen.bend[k, j]
    for k in range(offsets_px.size):
        precision = (seen.steps[3 + k] / hill.prior_px[k]) ** 2
        bend[3 + k, 3 + k] += precision
        gradient[3 + k] -= precision * offsets_px[k] / seen.steps[3 + k]
    for k in range(count):
        largest = max(largest, bend[k, k])
    for k in range(count):
        bend[k, k] += 0.02 * largest + 1e-12
    return solved(bend, gradient)


@numba.njit(cache=True, nogil=True)
def climb(hill: Hill, spin: Floats, offsets_px: Floats, iterations: int) -> tuple[Floats, Floats, float, Slopes]:
    """Spin, offsets and score after at most so many Newton steps, never lower than at the start; slopes last seen.

    A step is tried whole and halved; where neither is higher, the next is looked for with finer differences.
    The slopes are those of whole steps: finer differences serve to climb, but are too rough for a covariance.
    """
    scale, shares = 1.0, np.empty((2, hill.part.t_s.size))
    usual = seen = slopes_at(hill, spin, offsets_px, scale)
    value = seen.value
    for iteration in range(iterations):
        if iteration:
            seen = slopes_at(hill, spin, offsets_px, scale)
            if scale == 1.0:
                usual = seen
        change = _newton_step(hill, seen, offsets_px)
        square = 0.0
        for k in range(change.size):
            square += change[k] ** 2
        length = math.sqrt(square)
        whole = min(1.0, 2.0 / max(length, 1e-12))  # the parabola is not to be believed farther than a kernel
        changes, gains = np.empty((2, change.size)), np.empty(2)
        for k in range(change.size):
            changes[0, k], changes[1, k] = whole * change[k] * seen.steps[k], 0.5 * whole * change[k] * seen.steps[k]
        values = scores_near(shares, hill, spin, offsets_px, changes)
        for m in range(2):
            gains[m] = hill.trust * (values[m] - seen.value)
            for k in range(offsets_px.size):
                after_px = offsets_px[k] + changes[m, 3 + k]
                gains[m] -= 0.5 * (after_px**2 - offsets_px[k] ** 2) / hill.prior_px[k] ** 2
        pick = 0 if gains[0] >= gains[1] else 1
        if gains[pick] <= 0.0:
            if scale < 0.3:
                break
            scale *= 0.5
            continue
        value = values[pick]
        spin = shifted_spin(spin, axes_of(spin), changes[pick, :3])
        offsets_px = offsets_px + changes[pick, 3:]
        if length < 0.1:
            break
    return spin, offsets_px, value, usual


@numba.njit(cache=True, nogil=True)
def climb_all(hill: Hill, spins: Floats, iterations: int) -> tuple[Floats, Floats, Floats]:
    """Tops (k, 3) from spins (k, 3), their scores (k,) and each event's share (k, n)."""
    tops, values, none = np.empty_like(spins), np.empty(spins.shape[0]), np.empty(0)
    shares, here = np.empty((spins.shape[0], hill.part.t_s.size)), np.zeros((1, 3))
    for k in range(spins.shape[0]):
        tops[k] = climb(hill, spins[k], none, iterations)[0]
        values[k] = scores_near(shares[k : k + 1], hill, tops[k], none, here)[0]
    return tops, values, shares


def spread_of_estimate(hill: Hill, seen: Slopes, repeats: float) -> Floats:
    """(3, 3) covariance of the spin, rad^2/s^2, at the top of the hill: sandwich plus the ball's place.

    An event's part of the gradient is twice the slope of its own share (it also is the neighbour of its neighbours):
    M = 4 repeats sum d_i d_i', with `repeats` events of one edge that tell the same. With A the score's curvature the
    events' noise gives A_ww^-1 M_ww A_ww^-1 (w: the spin). A ball that is d off its assumed place moves the top by
    -A_ww^-1 A_wp d; d has nearly the prior's covariance (REFINED), although offsets were refined with the spin:
    refining improves the spin, but the refined offsets are themselves hardly nearer to the truth.
    """
    inverse = np.linalg.inv(seen.bend[:3, :3])
    lever = inverse @ seen.bend[:3, 3:] * (REFINED * hill.prior_px / seen.steps[3:])
    whole = 4.0 * repeats * inverse @ seen.noise[:3, :3] @ inverse + lever @ lever.T
    back = axes_of(seen.spin).T * seen.steps[:3]
    covariance: Floats = back @ whole @ back.T
    return covariance
