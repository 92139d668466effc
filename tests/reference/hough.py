"""Slow twins of the kernels of circles and moving circles: the definitions in a few lines of NumPy and plain loops."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from spinscope.pipeline.kernels.moving_circle import HALF_AHEAD, OF_BRIGHT, OF_DARK, WHOLE

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def vote(
    shape: tuple[int, int, int], x_px: Ints, y_px: Ints, x0_px: int, y0_px: int, radius0_px: int
) -> NDArray[np.uint16]:
    """For every centre and radius, how many pixels lie at that distance, rounded half up."""
    votes = np.zeros(shape, np.uint16)
    for b in range(shape[0]):
        for a in range(shape[1]):
            distance = np.floor(np.hypot(x_px - x0_px - a, y_px - y0_px - b) + 0.5)
            for k in range(shape[2]):
                votes[b, a, k] = np.count_nonzero(distance == radius0_px + k)
    return votes


def peak(votes: NDArray[np.uint16], radius0_px: int) -> tuple[float, int, int, int]:
    """The first largest votes^2 / (2 pi radius), in the order of the array."""
    radius = np.maximum(radius0_px + np.arange(votes.shape[2]), 1)
    support = votes.astype(np.float64) ** 2 / (2 * math.pi * radius)
    if support.max(initial=0.0) == 0.0:
        return 0.0, 0, 0, 0
    b, a, k = np.unravel_index(int(np.argmax(support)), votes.shape)
    return float(support[b, a, k]), int(a), int(b), int(k)


def bright_pixels(image: NDArray[np.uint8], least: int, most_pixels: int) -> tuple[Ints, Ints]:
    """All pixels in reading order, every so many-th of them."""
    rows, columns = np.nonzero(image >= least)
    stride = max(1, math.ceil(rows.size / most_pixels)) | 1
    return columns[::stride], rows[::stride]


def active_cells(values: NDArray[np.uint8], x_px: Ints, y_px: Ints, least: int, cell_px: int) -> list[tuple[int, int]]:
    """(column, row) of the cells with a bright pixel and such a neighbour, by row; from eight events on."""
    if np.count_nonzero(values[y_px, x_px] >= least) < 8:
        return []
    cells = {(int(x) // cell_px, int(y) // cell_px) for x, y in zip(x_px, y_px, strict=True) if values[y, x] >= least}
    around = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if (i, j) != (0, 0)]
    kept = [(a, b) for a, b in cells if any((a + i, b + j) in cells for i, j in around)]
    return sorted(kept, key=lambda cell: (cell[1], cell[0]))


def disc_events(circle: Floats, tau_s: Floats, x_px: Floats, y_px: Floats, on_outline_px: float) -> tuple[int, int]:
    """How many events lie on the moving disc with its outline, and within twice its radius."""
    distance = np.hypot(*from_centre(circle, tau_s, x_px, y_px))
    return int(np.sum(distance <= circle[4] + on_outline_px)), int(np.sum(distance <= 2 * circle[4]))


def from_centre(circle: Floats, tau_s: Floats, x_px: Floats, y_px: Floats) -> tuple[Floats, Floats]:
    """Each event relative to the centre at its time."""
    return x_px - circle[0] - circle[2] * tau_s, y_px - circle[1] - circle[3] * tau_s


def residuals(circle: Floats, ellipticity: Floats, tau_s: Floats, x_px: Floats, y_px: Floats) -> Floats:
    """Distance from the centre less the outline's distance in that direction."""
    dx, dy = from_centre(circle, tau_s, x_px, y_px)
    phi = np.arctan2(dy, dx)
    return np.hypot(dx, dy) - circle[4] * (1 + ellipticity[0] * np.cos(2 * phi) + ellipticity[1] * np.sin(2 * phi))


def near_outline(
    circle: Floats,
    tau_s: Floats,
    x_px: Floats,
    y_px: Floats,
    on: NDArray[np.bool_],
    gate_px: float,
    most_events: int,
    part: int,
) -> Ints:
    """Indices by mask, then every so many-th."""
    dx, dy = from_centre(circle, tau_s, x_px, y_px)
    outwards = dx * circle[2] + dy * circle[3] >= 0
    anything = np.ones(on.size, np.bool_)
    masks = {WHOLE: anything, HALF_AHEAD: outwards, OF_BRIGHT: outwards == on, OF_DARK: outwards != on}
    near = (np.abs(np.hypot(dx, dy) - circle[4]) <= gate_px) & masks[part]
    chosen = np.flatnonzero(near)
    return chosen[:: max(1, math.ceil(chosen.size / most_events)) | 1]


def fit_circle(
    start: Floats,
    prior_std: Floats,
    ellipticity: Floats,
    tau_s: Floats,
    x_px: Floats,
    y_px: Floats,
    gate_px: float,
    floor_px: float,
    most_rounds: int,
) -> Floats:
    """Reweighted least squares with a numerical Jacobian, solved by `lstsq`."""
    circle, gate = start.astype(np.float64).copy(), gate_px
    steps = np.array([1e-4, 1e-4, 1e-1, 1e-1, 1e-4])
    for _ in range(most_rounds):
        error = residuals(circle, ellipticity, tau_s, x_px, y_px)
        weight = np.where(np.abs(error) < gate, (1 - (error / gate) ** 2) ** 2, 0.0)
        slope = np.empty((tau_s.size, 5))
        for k, step in enumerate(np.diag(steps)):
            after, before = (residuals(circle + sign * step, ellipticity, tau_s, x_px, y_px) for sign in (1, -1))
            slope[:, k] = (after - before) / (2 * step.sum())
        held = 1 / np.maximum(prior_std, 1e-9)
        rows = np.concatenate([np.sqrt(weight)[:, None] * slope, np.diag(held)])
        target = np.concatenate([-np.sqrt(weight) * error, held * (start - circle)])
        unit = np.array([1.0, 1.0, 1e3, 1e3, 1.0])
        change = np.linalg.lstsq(rows * unit, target, rcond=None)[0] * unit
        circle = circle + change
        if gate <= floor_px and np.max(np.abs(change / unit)) < 1e-3:
            break
        scatter = math.sqrt(float(np.sum(weight * error**2)) / max(float(weight.sum()), 1e-9)) / 0.91
        gate = max(min(4.7 * scatter, 0.5 * gate), floor_px)
    return circle


def vote_velocity(
    m: int,
    circle: Floats,
    tau_s: Floats,
    x_px: Floats,
    y_px: Floats,
    on: NDArray[np.bool_],
    step_px_s: float,
    gate_px: float,
    signed: bool,
) -> Floats:
    """For every velocity of the grid: nearness of the events, signed or not, to the outline that moves so."""
    votes = np.zeros((2 * m + 1, 2 * m + 1))
    for j in range(-m, m + 1):
        for i in range(-m, m + 1):
            if i * i + j * j <= m * m:
                trial = circle + np.array([0.0, 0.0, i * step_px_s, j * step_px_s, 0.0])
                dx, dy = from_centre(trial, tau_s, x_px, y_px)
                near = np.maximum(1 - np.abs(np.hypot(dx, dy) - circle[4]) / gate_px, 0.0)
                sign = np.sign(dx * trial[2] + dy * trial[3]) * np.where(on, 1, -1)
                votes[m + j, m + i] = np.sum(near * sign) if signed else np.sum(near)
    return votes


def support(
    circle: Floats,
    ellipticity: Floats,
    tau_s: Floats,
    x_px: Floats,
    y_px: Floats,
    on: NDArray[np.bool_],
    width_px: int,
    height_px: int,
    tolerance_px: float,
    early_px: float,
    bins: int,
) -> Floats:
    """The eight numbers of the kernel, by masks."""
    dx, dy = from_centre(circle, tau_s, x_px, y_px)
    error = residuals(circle, ellipticity, tau_s, x_px, y_px)
    ahead = dx * circle[2] + dy * circle[3] > 0
    inner = np.where(ahead, tolerance_px, max(tolerance_px, early_px))
    on_it = (error <= tolerance_px) & (error >= -inner)
    sector = np.floor((np.arctan2(dy, dx) / (2 * math.pi) + 1) * bins).astype(np.int64) % bins
    counts = np.bincount(sector[on_it], minlength=bins)
    enough = counts >= (2 if np.count_nonzero(on_it) >= 3 * bins else 1)
    angle = 2 * math.pi * (np.arange(bins) + 0.5) / bins
    x, y = circle[0] + circle[4] * np.cos(angle), circle[1] + circle[4] * np.sin(angle)
    in_view = (x >= 0) & (y >= 0) & (x <= width_px - 1) & (y <= height_px - 1)
    across = (np.cos(angle) * circle[2] + np.sin(angle) * circle[3]) / (math.hypot(circle[2], circle[3]) + 1e-9)

    def share(part: NDArray[np.bool_], whole: NDArray[np.bool_]) -> float:
        return float(np.count_nonzero(part & whole)) / max(np.count_nonzero(whole), 1)

    return np.array(
        [
            np.count_nonzero(on_it),
            share(on, on_it & ahead),
            share(on, on_it & ~ahead),
            share(enough, in_view & (across >= 0.25)),
            share(enough, in_view & (across <= -0.25)),
            in_view.mean(),
            np.count_nonzero((error > tolerance_px) & (error < 4 * tolerance_px)),
            np.count_nonzero(error < -inner),
        ]
    )


def distance_behind(
    circle: Floats,
    ellipticity: Floats,
    tau_s: Floats,
    x_px: Floats,
    y_px: Floats,
    on: NDArray[np.bool_],
    bright: bool,
    least: int,
) -> float:
    """Upper median of the distances of the events of the other polarity, 105 degrees and more from the motion."""
    dx, dy = from_centre(circle, tau_s, x_px, y_px)
    angle = np.arctan2(dy, dx) - math.atan2(circle[3], circle[2])
    error = residuals(circle, ellipticity, tau_s, x_px, y_px)[(on != bright) & (np.cos(angle) < -0.25)]
    return math.nan if error.size < least else float(np.sort(error)[error.size // 2])


def inside_circles(circles: Floats, tau_s: Floats, x_px: Floats, y_px: Floats, margins_px: Floats) -> Ints:
    """Indices of the events within any circle and its margin."""
    inside = [
        np.hypot(*from_centre(circle, tau_s, x_px, y_px)) <= circle[4] + margin_px
        for circle, margin_px in zip(circles, margins_px, strict=True)
    ]
    return np.flatnonzero(np.any(inside, axis=0))
