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
from .contrast_window import Window

Floats = NDArray[np.float64]
STEP_SIGMAS = 0.5
OFFSET_STEP_PX = 0.3


@numba.njit(cache=True, nogil=True)
def moved_normals(
    normals: Floats, facing: Floats, radius_px: Floats, x_px: float, y_px: float, wider_px: float
) -> Floats:
    """Normals (n, 3) as they are if the ball's centre was at (+x_px, +y_px) of the assumed one and its radius larger.

    facing : (n, 3) unit vectors from the camera to the ball's centre
    radius_px : (n,) radius of the ball that the normals were made with
    Small offsets, ball far from the camera: the disc's coordinates shift and shrink, the normal stays on the sphere.
    """
    n = normals.shape[0]
    moved = np.empty((n, 3))
    for i in range(n):
        ux, uy, uz = facing[i, 0], facing[i, 1], facing[i, 2]
        # The image's axes as seen from the ball's direction: across = x less its part along u, down = u cross across.
        length = math.sqrt(max(1.0 - ux * ux, 1e-12))
        ax, ay, az = (1.0 - ux * ux) / length, -ux * uy / length, -ux * uz / length
        dx, dy, dz = uy * az - uz * ay, uz * ax - ux * az, ux * ay - uy * ax
        across = ax * normals[i, 0] + ay * normals[i, 1] + az * normals[i, 2]
        down = dx * normals[i, 0] + dy * normals[i, 1] + dz * normals[i, 2]
        shrink = radius_px[i] / (radius_px[i] + wider_px)
        across, down = (across - x_px / radius_px[i]) * shrink, (down - y_px / radius_px[i]) * shrink
        rim = math.sqrt(across * across + down * down)
        if rim > 1.0:
            across, down = across / rim, down / rim
        depth = math.sqrt(max(1.0 - across * across - down * down, 0.0))
        moved[i, 0] = across * ax + down * dx - depth * ux
        moved[i, 1] = across * ay + down * dy - depth * uy
        moved[i, 2] = across * az + down * dz - depth * uz
    return moved


def axes_of(spin: Floats) -> Floats:
    """(3, 3) rows: the spin's direction and two directions across it, orthonormal."""
    along = spin / np.linalg.norm(spin)
    across = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
    across /= np.linalg.norm(across)
    return np.stack([along, across, np.cross(along, across)])


def shifted_spin(spin: Floats, axes: Floats, change: Floats) -> Floats:
    """The spin with its magnitude changed by change[0] and its direction turned by change[1:3] / |spin| (radians)."""
    magnitude = float(np.linalg.norm(spin))
    angle = math.hypot(change[1], change[2]) / magnitude
    direction = axes[0]
    if angle > 0.0:
        sideways = (change[1] * axes[1] + change[2] * axes[2]) / (angle * magnitude)
        direction = math.cos(angle) * direction + math.sin(angle) * sideways
    result: Floats = direction * max(magnitude + change[0], 1e-3)
    return result


@dataclass(slots=True, eq=False)
class Slope:
    """The score as a function of the spin and, if `prior_px` has entries, the ball's offsets.

    part : the events (one window); facing, radius_px : of the same events
    sigma, floor : kernel in radians, density floor
    prior_px : (0,), (2,) or (3,) 1 sigma of the offsets of centre x, y and radius, px
    trust : factor of the score against the prior (events of one edge repeat each other, so less than 1)
    """

    part: Window
    facing: Floats
    radius_px: Floats
    sigma: float
    floor: float
    prior_px: Floats
    trust: float
    ratios: Floats

    def value(self, spin_rad_s: Floats, offsets_px: Floats) -> float:
        """Score less the prior's cost; each event's share stays in `ratios`."""
        part = self.part
        cost = 0.0
        if self.prior_px.size:
            padded = np.zeros(3)
            padded[: offsets_px.size] = offsets_px
            moved = moved_normals(part.normals, self.facing, self.radius_px, padded[0], padded[1], padded[2])
            part = part._replace(normals=moved)
            cost = 0.5 * float(np.sum((offsets_px / self.prior_px) ** 2))
        return self.trust * score(self.ratios, spin_rad_s, *part, self.sigma * CELLS_PER_SIGMA, self.floor) - cost

    def steps(self, spin_rad_s: Floats) -> Floats:
        """Step of each unknown that moves the events by about half a kernel: rad/s, then px."""
        spread_s = max(float(np.std(self.part.t_s)), 1e-5)
        magnitude = float(np.linalg.norm(spin_rad_s))
        along = min(STEP_SIGMAS * self.sigma / spread_s, 0.3 * magnitude)
        # Once the ball has turned round, an error of the axis moves events by that angle and no more.
        across = min(STEP_SIGMAS * self.sigma * max(1.0 / spread_s, magnitude), 0.3 * magnitude)
        return np.concatenate([[along, across, across], np.full(self.prior_px.size, OFFSET_STEP_PX)])


def climb(slope: Slope, spin_rad_s: Floats, offsets_px: Floats, iterations: int) -> tuple[Floats, Floats, float]:
    """Spin, offsets and value after at most so many Newton steps; never lower than at the start."""
    spin, offsets, scale = spin_rad_s, offsets_px, 1.0
    count = 3 + slope.prior_px.size
    unit = np.eye(count)
    best = slope.value(spin, offsets)
    for _ in range(iterations):
        axes, steps = axes_of(spin), slope.steps(spin) * scale

        def at(change: Floats, axes: Floats = axes, steps: Floats = steps, spin: Floats = spin) -> float:
            return slope.value(shifted_spin(spin, axes, change[:3] * steps[:3]), offsets + change[3:] * steps[3:])

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
        if length > 2.0:
            change *= 2.0 / length
        candidates = [change, *unit, *-unit]
        gains = [at(change), *above, *below]
        pick = int(np.argmax(gains))
        if gains[pick] <= best:
            if scale < 0.3:
                break
            scale *= 0.5
            continue
        best = gains[pick]
        spin = shifted_spin(spin, axes, candidates[pick][:3] * steps[:3])
        offsets = offsets + candidates[pick][3:] * steps[3:]
        if pick == 0 and length < 0.05:
            break
    return spin, offsets, best
