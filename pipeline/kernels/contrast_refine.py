"""Climbing the contrast score: in magnitude and direction, and in the ball's place where the data know it better.

Newton's method on finite differences: the score is a sum over splats, smooth on the scale of its kernel, and steps of
half a kernel see its curvature rather than the map's cells.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from .contrast import CELLS_PER_SIGMA, score
from .contrast_search import axes_of
from .contrast_window import Window

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
STEP_SIGMAS = 0.5
OFFSET_STEP_PX = 0.3
NO_OFFSETS = np.zeros(0)


@numba.njit(cache=True, nogil=True)
def moved_normals(
    normals: Floats, facing: Floats, radius_px: Floats, x_px: float, y_px: float, wider_px: float
) -> Floats:
    """Normals (3, n) as they are if the ball's centre is (+x_px, +y_px) off the assumed one and its radius larger.

    facing : (3, n) unit vectors from the camera to the ball's centre
    radius_px : (n,) radius of the ball that the normals were made with
    Small offsets, ball far from the camera: the disc's coordinates shift and shrink, the normal stays on the sphere.
    """
    n = normals.shape[1]
    moved = np.empty((3, n))
    for i in range(n):
        ux, uy, uz = facing[0, i], facing[1, i], facing[2, i]
        # The image's axes as seen from the ball: across = x less its part along u, down = u cross across.
        length = math.sqrt(max(1.0 - ux * ux, 1e-12))
        ax, ay, az = (1.0 - ux * ux) / length, -ux * uy / length, -ux * uz / length
        dx, dy, dz = uy * az - uz * ay, uz * ax - ux * az, ux * ay - uy * ax
        across = ax * normals[0, i] + ay * normals[1, i] + az * normals[2, i]
        down = dx * normals[0, i] + dy * normals[1, i] + dz * normals[2, i]
        shrink = radius_px[i] / (radius_px[i] + wider_px)
        across, down = (across - x_px / radius_px[i]) * shrink, (down - y_px / radius_px[i]) * shrink
        rim = max(math.sqrt(across * across + down * down), 1.0)
        across, down = across / rim, down / rim
        depth = math.sqrt(max(1.0 - across * across - down * down, 0.0))
        moved[0, i] = across * ax + down * dx - depth * ux
        moved[1, i] = across * ay + down * dy - depth * uy
        moved[2, i] = across * az + down * dz - depth * uz
    return moved


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


@dataclass(slots=True, eq=False)
class Hill:
    """The score as a function of the spin and, if `prior_px` has entries, of the ball's offsets.

    part : the events, one window; others : rows of its exchanged events
    facing, radius_px : (3, n) and (n,) of the same events, see `moved_normals`
    sigma, floor : kernel in radians, density floor
    prior_px : (0,) or (3,) 1 sigma of the offsets of centre x, y and radius, px
    trust : weight of the score against the prior
    ratios : (n,) each event's share of the last value
    """

    part: Window
    others: Integers
    facing: Floats
    radius_px: Floats
    sigma: float
    floor: float
    prior_px: Floats
    trust: float
    ratios: Floats

    def score(self, spin_rad_s: Floats, offsets_px: Floats) -> float:
        """The score alone; each event's share goes to `ratios`."""
        part = self.part
        if offsets_px.size:
            x_px, y_px, wider_px = offsets_px
            moved = moved_normals(part.normals, self.facing, self.radius_px, x_px, y_px, wider_px)
            part = part._replace(normals=moved, other_normals=np.ascontiguousarray(moved[:, self.others]))
        return float(score(self.ratios, spin_rad_s, *part, self.sigma * CELLS_PER_SIGMA, self.floor))

    def value(self, spin_rad_s: Floats, offsets_px: Floats) -> float:
        """Trusted score less the prior's cost."""
        cost = 0.5 * float(np.sum((offsets_px / self.prior_px) ** 2))
        return self.trust * self.score(spin_rad_s, offsets_px) - cost

    def steps(self, spin_rad_s: Floats) -> Floats:
        """Step of each unknown that moves the events by about half a kernel: rad/s, then px."""
        spread_s = max(float(np.std(self.part.t_s)), 1e-5)
        magnitude = float(np.linalg.norm(spin_rad_s))
        along = min(STEP_SIGMAS * self.sigma / spread_s, 0.3 * magnitude)
        # Once the ball has turned round, an error of the axis moves events by that angle and no more.
        across = min(STEP_SIGMAS * self.sigma * max(1.0 / spread_s, magnitude), 0.3 * magnitude)
        return np.concatenate([[along, across, across], np.full(self.prior_px.size, OFFSET_STEP_PX)])


def climb(hill: Hill, spin_rad_s: Floats, offsets_px: Floats, iterations: int) -> tuple[Floats, Floats, float]:
    """Spin, offsets and value after at most so many Newton steps; never lower than at the start."""
    spin, offsets, scale = spin_rad_s, offsets_px, 1.0
    count = 3 + hill.prior_px.size
    unit = np.eye(count)
    best = hill.value(spin, offsets)
    for _ in range(iterations):
        axes, steps = axes_of(spin), hill.steps(spin) * scale

        def at(
            change: Floats,
            axes: Floats = axes,
            steps: Floats = steps,
            spin: Floats = spin,
            offsets: Floats = offsets,
        ) -> float:
            moved = change * steps
            return hill.value(shifted_spin(spin, axes, moved[:3]), offsets + moved[3:])

        above = np.array([at(unit[k]) for k in range(count)])
        below = np.array([at(-unit[k]) for k in range(count)])
        bend = np.diag(above + below - 2.0 * best)
        for k in range(count):
            for j in range(k):
                bend[j, k] = bend[k, j] = at(unit[j] + unit[k]) - above[j] - above[k] + best
        values, vectors = np.linalg.eigh(-bend)
        values = np.maximum(np.abs(values), 0.02 * np.abs(values).max() + 1e-12)
        change = vectors @ ((vectors.T @ ((above - below) / 2.0)) / values)
        length = float(np.linalg.norm(change))
        change *= min(1.0, 2.0 / max(length, 1e-12))  # the parabola is not to be believed farther than a kernel
        changes = [change, *unit, *-unit]
        gains = [at(change), *above, *below]
        pick = int(np.argmax(gains))
        if gains[pick] <= best:
            if scale < 0.3:
                break
            scale *= 0.5
            continue
        best = gains[pick]
        offsets = offsets + changes[pick][3:] * steps[3:]
        spin = shifted_spin(spin, axes, changes[pick][:3] * steps[:3])
        if pick == 0 and length < 0.05:
            break
    return spin, offsets, best


def bend_and_noise(hill: Hill, spin_rad_s: Floats, offsets_px: Floats, repeats: float) -> tuple[Floats, Floats]:
    """Curvature A and covariance M of the score's gradient at the top of the hill, in units of its steps.

    An event's part of the gradient is twice the slope of its own share (it also is the neighbour of its neighbours):
    M = 4 repeats sum d_i d_i', with `repeats` events of one edge that tell the same. Where the score is a likelihood
    A is proportional to M; finite differences over a sharp top can break that, even to negative curvature, so A's
    eigenvalues relative to M are kept within a factor of three of their median.
    """
    count = 3 + hill.prior_px.size
    axes, steps, unit = axes_of(spin_rad_s), hill.steps(spin_rad_s), np.eye(count)

    def at(change: Floats) -> float:
        moved = change * steps
        return hill.score(shifted_spin(spin_rad_s, axes, moved[:3]), offsets_px + moved[3:])

    middle = at(np.zeros(count))
    above, below = np.empty(count), np.empty(count)
    slopes = np.empty((count, hill.ratios.size))
    for k in range(count):
        above[k] = at(unit[k])
        slopes[k] = hill.ratios
        below[k] = at(-unit[k])
        slopes[k] = (slopes[k] - hill.ratios) / 2.0
    bend = np.diag(2.0 * middle - above - below)
    for k in range(count):
        for j in range(k):
            both = at(unit[j] + unit[k]) + at(-unit[j] - unit[k])
            bend[j, k] = bend[k, j] = -(both - above[j] - above[k] - below[j] - below[k] + 2.0 * middle) / 2.0
    noise = 4.0 * repeats * (slopes @ slopes.T)
    values, vectors = np.linalg.eigh(noise)
    root = vectors * np.sqrt(np.maximum(values, 1e-6 * values[-1]))
    inverse = np.linalg.inv(root)
    values, vectors = np.linalg.eigh(inverse @ bend @ inverse.T)
    usual = max(float(np.median(values)), 1e-3)
    values = np.clip(values, usual / 3.0, usual * 3.0)
    rooted = root @ vectors
    return rooted @ (values[:, None] * rooted.T), noise


def spread_of_estimate(hill: Hill, spin_rad_s: Floats, bend: Floats, noise: Floats) -> Floats:
    """(3, 3) covariance of the spin, rad^2/s^2, at the top of the hill: sandwich plus the ball's place.

    With A the score's curvature and M the covariance of its gradient, the events' noise gives A_ww^-1 M_ww A_ww^-1
    (w: the spin). A ball that is d off its assumed place moves the top by -A_ww^-1 A_wp d; d has the prior's
    covariance, although offsets were refined with the spin: refining improves the spin, but the refined offsets are
    themselves no nearer to the truth (they absorb what the model lacks), so no certainty is drawn from them.
    """
    steps = hill.steps(spin_rad_s)
    inverse = np.linalg.inv(bend[:3, :3])
    lever = inverse @ bend[:3, 3:] * (hill.prior_px / steps[3:])
    whole = inverse @ noise[:3, :3] @ inverse + lever @ lever.T
    back = axes_of(spin_rad_s).T * steps[:3]
    covariance: Floats = back @ whole @ back.T
    return covariance
