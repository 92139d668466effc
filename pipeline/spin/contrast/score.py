"""The score of contrast maximisation on the sphere: how much sharper a spin maps the logo than chance would.

A spin omega turns each event's point on the ball back to a reference time. The points of each polarity are splatted
(smoothly) into a map of the sphere; the density I(q) there, without the event's own splat, is compared with the
density B(q) that the same events give when their times are permuted among each other:

    score(omega) = sum over events of log((I + floor) / (B + floor)).

This is the log likelihood ratio of "the pattern turns with omega" against "place and time have nothing to do with
each other", with densities estimated from the events themselves. What stands still on the ball's disc (shading,
bleeding edges) and the mere smallness of a turn raise I and B alike. The usual contrast, sum I^2 (Gallego et al.,
"A Unifying Contrast Maximization Framework", CVPR 2018), less the same with shuffled times, has the same property
but gives dense spots the square of their weight: at 10 ms its errors were a third larger.

The map is Lambert's equal-area one, one hemisphere around the direction in which most of the turned points lie and one
around its antipode. Equal areas make the kernel's area the same everywhere, so the ratio of two densities does not
depend on where on the map they are. One map of the whole ball has no room for two stamps on opposite sides: near the
antipode of its pole the kernel is drawn out along the map's rim, and the axis was up to 6 degrees off.

A kernel that returns nothing writes into its first argument, and into nothing else.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from ...kernels.arrays import Flags, Floats, Integers
from ...kernels.rotation import axis_and_length, orthonormal_axes, rotate
from ...kernels.small_matrices import product
from .events import EventColumns, ScoreWindow, SphereEvents, segment_starts, shifted_normals, take_columns

TURN = 2.0 * math.pi
ONE, TWO = np.uint64(1), np.uint64(2)  # cells: an unsigned index plus a signed number would be a float
# The quadratic B-spline's overlap with itself in two dimensions, mean over its place on the grid (11/20 each):
# what one coinciding event adds to a density.
COINCIDENCE = 0.55 * 0.55
SQRT2, LOG2 = math.sqrt(2.0), math.log(2.0)
# Parts of a float64: number of bits of its mantissa, that mantissa, and the other bits of 1.0 and of 2^52.
MANTISSA_BITS, MANTISSA = np.uint64(52), np.uint64(0x000FFFFFFFFFFFFF)
ONE_BITS, TWO_TO_52 = np.uint64(0x3FF0000000000000), np.uint64(0x4330000000000000)
# Splatting and reading are each smeared by the spline (variance 1/4 cell^2): kernel of 1 sigma = cell / sqrt(2).
CELLS_PER_SIGMA = math.sqrt(2.0)
# Divisors are never zero: `error_model="numpy"` spares a look for it. No fast math: its last bits depend on what the
# compiler has at hand in a process, and a running camera's spins have to be those of the recording.
# The maps' pole need not be exact: so many events are enough for it.
POLE_EVENTS = 64
# Steps of the finite differences.
STEP_SIGMAS = 0.5
OFFSET_STEP_PX = 0.3
# `burst_mask`: bursts of half a millisecond; the density that is usual is estimated from so many events.
BURST_S, BURST_SIGMA_RAD, BURST_FLOOR, BURST_LOG_RATIO, USUAL_EVENTS = 0.5e-3, 0.1, 0.3, 0.2, 600


@numba.njit(cache=True, nogil=True, error_model="numpy")
def derotate(derotated: Floats, spin_rad_s: Floats, t_s: Floats, normals: Floats) -> None:
    """Write the normals (3, n), each turned by -spin t_s, into `derotated` (3, n).

    Sine and cosine of half the angle come from their series on [-pi/2, pi/2], whose terms left out are below 1e-6:
    plain arithmetic, so that the compiler handles several events at once (3 times as fast as the library's).
    """
    ax, ay, az, speed = axis_and_length(spin_rad_s)
    turns_per_s = -speed / TURN
    xs, ys, zs = normals[0], normals[1], normals[2]
    to_x, to_y, to_z = derotated[0], derotated[1], derotated[2]
    for k in range(t_s.size):
        turns = t_s[k] * turns_per_s
        half = math.pi * (turns - np.floor(turns + 0.5))
        h2 = half * half
        s = half * (1.0 + h2 * (-1 / 6 + h2 * (1 / 120 + h2 * (-1 / 5040 + h2 * (1 / 362880 - h2 * (1 / 39916800))))))
        c = 1.0 + h2 * (
            -1 / 2 + h2 * (1 / 24 + h2 * (-1 / 720 + h2 * (1 / 40320 + h2 * (-1 / 3628800 + h2 * (1 / 479001600)))))
        )
        versine = 2.0 * s * s
        to_x[k], to_y[k], to_z[k] = rotate((xs[k], ys[k], zs[k]), (ax, ay, az), 2.0 * s * c, 1.0 - versine, versine)


@numba.njit(cache=True, nogil=True)
def _pole(points: Floats) -> tuple[float, float, float]:
    """Direction along which most of the unit vectors (3, n) lie, of either sign, by about POLE_EVENTS of them.

    Their mean, multiplied by the eighth power of their second moments: the first axis of these, nearly. A thousandth of
    the unit matrix keeps it a direction where they cancel.
    """
    moments, mean = np.zeros((3, 3)), np.zeros(3)
    mean[2] = 1e-9
    for i in range(3):
        moments[i, i] = 1e-3
    used = points[:, :: max(1, points.shape[1] // POLE_EVENTS)]
    for k in range(used.shape[1]):
        for i in range(3):
            mean[i] += used[i, k]
            for j in range(3):
                moments[i, j] += used[i, k] * used[j, k] / used.shape[1]
    for _ in range(3):
        moments = product(moments, moments)
    x = moments[0, 0] * mean[0] + moments[0, 1] * mean[1] + moments[0, 2] * mean[2]
    y = moments[1, 0] * mean[0] + moments[1, 1] * mean[1] + moments[1, 2] * mean[2]
    z = moments[2, 0] * mean[0] + moments[2, 1] * mean[1] + moments[2, 2] * mean[2]
    length = math.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length


class Splats(NamedTuple):
    """Splats of n events in the flat maps, size x size cells a polarity and hemisphere.

    Attributes
    ----------
    cells : (n,) int32
        Index of the first of the nine cells that an event is splatted into.
    weights : (6, n) float64
        B-spline at the three columns of these cells, then at their three rows.
    """

    cells: NDArray[np.int32]
    weights: Floats


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _set_splats(
    splats: Splats, points: Floats, polarity: Integers, pole: tuple[float, float, float], cell_rad: float, size: int
) -> None:
    """Write the splats of unit vectors (3, n) on the maps around the pole and its antipode into `splats`."""
    px, py, pz = pole
    _, (ux, uy, uz), (vx, vy, vz) = orthonormal_axes(px, py, pz)
    xs, ys, zs = points[0], points[1], points[2]
    cells, weights = splats
    left, centre, right, above, level, below = weights[0], weights[1], weights[2], weights[3], weights[4], weights[5]
    middle, rows = 0.5 * (size - 1), float(size)
    for k in range(xs.size):
        x, y, z = xs[k], ys[k], zs[k]
        height = px * x + py * y + pz * z
        beyond = 1.0 if height < 0.0 else 0.0
        scale = math.sqrt(2.0 / (1.0 + abs(height))) / cell_rad
        across, down = (ux * x + uy * y + uz * z) * scale + middle, (vx * x + vy * y + vz * z) * scale + middle
        column, row = np.floor(across + 0.5), np.floor(down + 0.5)
        cells[k] = np.int32(((2.0 * polarity[k] + beyond) * rows + row - 1.0) * rows + column - 1.0)
        left[k], centre[k], right[k] = _spline(across - column)
        above[k], level[k], below[k] = _spline(down - row)


@numba.njit(cache=True, nogil=True, inline="always")
def _spline(offset: float) -> tuple[float, float, float]:
    """Quadratic B-spline at the three cells around a point `offset` (-1/2..1/2) from the middle one."""
    return 0.5 * (0.5 - offset) ** 2, 0.75 - offset * offset, 0.5 * (0.5 + offset) ** 2


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _add_splats(density: Floats, splats: Splats, first: int, last: int, size: int, weight: float) -> None:
    """Add splats [first, last) of this weight to the flat maps."""
    cells, weights = splats
    for k in range(first, last):
        x0, x1, x2 = weights[0, k], weights[1, k], weights[2, k]
        at = np.uint64(cells[k])
        for part in (weights[3, k] * weight, weights[4, k] * weight, weights[5, k] * weight):
            density[at] += part * x0
            density[at + ONE] += part * x1
            density[at + TWO] += part * x2
            at += np.uint64(size)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _set_ratios(
    ratios: Floats, splats: Splats, sharp: Floats, blurred: Floats, first: int, last: int, size: int, added: float
) -> None:
    """Write (I + added) / (B + added) of the events [first, last) into `ratios` (n,)."""
    cells, weights = splats
    for i in range(first, last):
        x0, x1, x2 = weights[0, i], weights[1, i], weights[2, i]
        y0, y1, y2 = weights[3, i], weights[4, i], weights[5, i]
        at = np.uint64(cells[i])
        density = -(x0 * x0 + x1 * x1 + x2 * x2) * (y0 * y0 + y1 * y1 + y2 * y2)
        expected = 0.0
        for part in (y0, y1, y2):
            density += part * (x0 * sharp[at] + x1 * sharp[at + ONE] + x2 * sharp[at + TWO])
            expected += part * (x0 * blurred[at] + x1 * blurred[at + ONE] + x2 * blurred[at + TWO])
            at += np.uint64(size)
        ratios[i] = (max(density, 0.0) + added) / (expected + added)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _set_ratios_apart(
    ratios: Floats,
    splats: Splats,
    t_s: Floats,
    sharp: Floats,
    blurred: Floats,
    first: int,
    last: int,
    size: int,
    added: float,
    apart_s: float,
) -> None:
    """Write (I + added) / (B + added) of the events [first, last) into `ratios` (n,), I and B of distant events alone.

    `blurred` is the mean of the permuted events; events no farther than `apart_s` in time are taken out of `sharp`.
    """
    cells, weights = splats
    removed = kept = first  # events [kept, removed) are out of the map
    for i in range(first, last):
        while removed < last and t_s[removed] <= t_s[i] + apart_s:
            _add_splats(sharp, splats, removed, removed + 1, size, -1.0)
            removed += 1
        while t_s[kept] < t_s[i] - apart_s:
            _add_splats(sharp, splats, kept, kept + 1, size, 1.0)
            kept += 1
        density = expected = 0.0
        at = np.uint64(cells[i])
        for row in range(3, 6):
            for column in range(3):
                part = weights[row, i] * weights[column, i]
                density += part * sharp[at + np.uint64(column)]
                expected += part * blurred[at + np.uint64(column)]
            at += np.uint64(size)
        others = last - first - (removed - kept)
        ratios[i] = (max(density, 0.0) + added) / (others * expected + added)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def take_logarithms(values: Floats) -> float:
    """Replace positive numbers (n,) by their natural logarithms; return the sum of these.

    The binary exponent apart, a number is a mantissa m in [1, 2): log m = log sqrt(2) + 2 artanh of
    (m - sqrt(2)) / (m + sqrt(2)), whose series' terms left out are below 1e-12: plain arithmetic, so that the
    compiler handles several numbers at once (1.5 times as fast as NumPy's).
    """
    bits, shifted = values.view(np.uint64), np.empty(values.size, np.uint64)
    exponents = shifted.view(np.float64)  # each plus 2^52: integers to floats is not done several at once
    for k in range(values.size):
        shifted[k] = (bits[k] >> MANTISSA_BITS) | TWO_TO_52
        bits[k] = (bits[k] & MANTISSA) | ONE_BITS
    for k in range(values.size):
        a = (values[k] - SQRT2) / (values[k] + SQRT2)
        a2 = a * a
        series = 1.0 + a2 * (1 / 3 + a2 * (1 / 5 + a2 * (1 / 7 + a2 * (1 / 9 + a2 * (1 / 11 + a2 * (1 / 13))))))
        values[k] = (exponents[k] - 2.0**52 - 1022.5) * LOG2 + 2.0 * a * series
    total = 0.0  # summed in a loop of its own: in order, which is one number at a time
    for k in range(values.size):
        total += values[k]
    return total


@numba.njit(cache=True, nogil=True, error_model="numpy")
def score(log_ratios: Floats, spin_rad_s: Floats, window: ScoreWindow, cell_rad: float, floor: float) -> float:
    """Score of one spin; each event's log((I + floor) / (B + floor)) is written into `log_ratios` (n,).

    Parameters
    ----------
    window : ScoreWindow
        The events draw I; the same at permuted times draw B. Each segment has a map of its own.
    cell_rad : float
        Width of the map's cells, radians near its middle.
    floor : float
        Density in units of coinciding events that is added to both, against ratios of small numbers.
    """
    events, permuted = window.events, window.permuted
    size = int(2.0 * SQRT2 / cell_rad) + 5
    added = floor * COINCIDENCE
    points, permuted_points = np.empty_like(events.normals), np.empty_like(permuted.normals)
    derotate(points, spin_rad_s, events.t_s, events.normals)
    derotate(permuted_points, spin_rad_s, permuted.t_s, permuted.normals)
    pole = _pole(points)
    splats = Splats(np.empty(events.t_s.size, np.int32), np.empty((6, events.t_s.size)))
    permuted_splats = Splats(np.empty(permuted.t_s.size, np.int32), np.empty((6, permuted.t_s.size)))
    _set_splats(splats, points, events.polarity, pole, cell_rad, size)
    _set_splats(permuted_splats, permuted_points, permuted.polarity, pole, cell_rad, size)
    sharp, blurred = np.zeros(4 * size * size), np.zeros(4 * size * size)
    for segment in range(events.starts.size - 1):
        first, last = events.starts[segment], events.starts[segment + 1]
        begin, end = permuted.starts[segment], permuted.starts[segment + 1]
        if segment > 0:
            sharp[:] = 0.0
            blurred[:] = 0.0
        _add_splats(sharp, splats, first, last, size, 1.0)
        if window.apart_s > 0.0:
            _add_splats(blurred, permuted_splats, begin, end, size, 1.0 / max(end - begin, 1))
            _set_ratios_apart(log_ratios, splats, events.t_s, sharp, blurred, first, last, size, added, window.apart_s)
            continue
        # An event has no share in the density that it is compared with: count - 1 others.
        weight = (last - first - 1) / max(end - begin, 1)
        _add_splats(blurred, permuted_splats, begin, end, size, weight)
        _set_ratios(log_ratios, splats, sharp, blurred, first, last, size, added)
    total: float = take_logarithms(log_ratios)
    return total


@numba.njit(cache=True, nogil=True)
def scores(spins_rad_s: Floats, window: ScoreWindow, sigma_rad: float, floor: float) -> Floats:
    """Scores (m,) of spins (m, 3) with a kernel of `sigma_rad`."""
    values, log_ratios = np.empty(spins_rad_s.shape[0]), np.empty(window.events.t_s.size)
    for k in range(spins_rad_s.shape[0]):
        values[k] = score(log_ratios, spins_rad_s[k], window, sigma_rad * CELLS_PER_SIGMA, floor)
    return values


def burst_mask(events: SphereEvents) -> Flags:
    """Mask (n,) of the events that come in bursts where they are on the disc: the logo's edges do, shading does not.

    The log ratio of a ball that does not turn, BURST_S against the whole stretch: an event that is no denser than
    usual at its place (less than e^BURST_LOG_RATIO) is left out. Sparse events pass, for the floor is low.
    """
    t_s, normals, polarity, _ = events.columns
    starts = segment_starts(t_s, BURST_S)
    rows = np.arange(0, t_s.size, max(1, t_s.size // USUAL_EVENTS))
    every = np.tile(rows, starts.size - 1)
    everywhere = np.ascontiguousarray(normals[:, every])
    usual = EventColumns(np.zeros(every.size), everywhere, polarity[every], np.arange(starts.size) * rows.size)
    window = ScoreWindow(EventColumns(t_s, normals, polarity, starts), usual, every, 0.0)
    log_ratios = np.empty(t_s.size)
    score(log_ratios, np.zeros(3), window, BURST_SIGMA_RAD * CELLS_PER_SIGMA, BURST_FLOOR)
    return log_ratios > BURST_LOG_RATIO


class Objective(NamedTuple):
    """The score as a function of the spin and, if `prior_px` has entries, of the ball's offsets.

    Attributes
    ----------
    window : ScoreWindow
        Events of one segment.
    slopes : (3, 3, n) float64
        `offset_slopes` of these events; (3, 3, 0) where no offsets are looked at.
    prior_px : (0,) or (3,) float64
        1 sigma of the offsets of centre x, y and radius.
    weight : float
        Weight of the score against the prior.
    """

    window: ScoreWindow
    slopes: Floats
    sigma_rad: float
    floor: float
    prior_px: Floats
    weight: float


@numba.njit(cache=True, nogil=True)
def changed_spin(spin_rad_s: Floats, axes: Floats, change: Floats) -> Floats:
    """The spin with its magnitude changed by change[0] and its direction turned by change[1:3] / |spin| (radians)."""
    magnitude = math.sqrt(spin_rad_s[0] ** 2 + spin_rad_s[1] ** 2 + spin_rad_s[2] ** 2)
    across = math.hypot(change[1], change[2])
    angle = across / magnitude
    ahead, sideways = math.cos(angle), math.sin(angle) / max(across, 1e-12)
    changed = np.empty(3)
    for k in range(3):
        direction = ahead * axes[0, k] + sideways * (change[1] * axes[1, k] + change[2] * axes[2, k])
        changed[k] = direction * max(magnitude + change[0], 1e-3)
    return changed


@numba.njit(cache=True, nogil=True)
def scores_near(
    shares: Floats, objective: Objective, spin_rad_s: Floats, offsets_px: Floats, changes: Floats
) -> Floats:
    """Scores (m,) at m changes (m, 3 or 6) of spin and offsets; each event's share is written into `shares` (m, n).

    The changes are rad/s as in `changed_spin`, then px.
    """
    window = objective.window
    values, axes = np.empty(changes.shape[0]), spin_axes(spin_rad_s)
    events, permuted, at_px = window.events, window.permuted, np.zeros(3)
    for m in range(changes.shape[0]):
        if objective.prior_px.size:
            place_px = np.empty(3)
            for k in range(3):
                place_px[k] = offsets_px[k] + changes[m, 3 + k]
            if place_px[0] != at_px[0] or place_px[1] != at_px[1] or place_px[2] != at_px[2]:
                at_px = place_px
                normals = shifted_normals(window.events.normals, objective.slopes, at_px)
                events = EventColumns(events.t_s, normals, events.polarity, events.starts)
                normals = take_columns(normals, window.rows)
                permuted = EventColumns(permuted.t_s, normals, permuted.polarity, permuted.starts)
        values[m] = score(
            shares[m],
            changed_spin(spin_rad_s, axes, changes[m, :3]),
            ScoreWindow(events, permuted, window.rows, window.apart_s),
            objective.sigma_rad * CELLS_PER_SIGMA,
            objective.floor,
        )
    return values


@numba.njit(cache=True, nogil=True)
def spin_axes(spin_rad_s: Floats) -> Floats:
    """The spin's direction and two directions across it: (3, 3), orthonormal rows."""
    length = math.sqrt(spin_rad_s[0] ** 2 + spin_rad_s[1] ** 2 + spin_rad_s[2] ** 2)
    rows = orthonormal_axes(spin_rad_s[0] / length, spin_rad_s[1] / length, spin_rad_s[2] / length)
    axes = np.empty((3, 3))
    for i in range(3):
        for k in range(3):
            axes[i, k] = rows[i][k]
    return axes


@numba.njit(cache=True, nogil=True, error_model="numpy")
def difference_steps(objective: Objective, spin_rad_s: Floats) -> Floats:
    """Step of each unknown (c,) that moves the events by about half a kernel: rad/s, then px."""
    t_s = objective.window.events.t_s
    mean, variance, terms = 0.0, 0.0, np.empty(t_s.size)
    for i in range(t_s.size):  # sums in loops of their own: the divisions are vectorized
        terms[i] = t_s[i] / t_s.size
    for i in range(t_s.size):
        mean += terms[i]
    for i in range(t_s.size):
        terms[i] = (t_s[i] - mean) ** 2 / t_s.size
    for i in range(t_s.size):
        variance += terms[i]
    spread_s = max(math.sqrt(variance), 1e-5)
    magnitude = math.sqrt(spin_rad_s[0] ** 2 + spin_rad_s[1] ** 2 + spin_rad_s[2] ** 2)
    steps = np.full(3 + objective.prior_px.size, OFFSET_STEP_PX)
    steps[0] = min(STEP_SIGMAS * objective.sigma_rad / spread_s, 0.3 * magnitude)
    # Once the ball has turned round, an error of the axis moves events by that angle and no more.
    steps[1:3] = min(STEP_SIGMAS * objective.sigma_rad * max(1.0 / spread_s, magnitude), 0.3 * magnitude)
    return steps
