"""Where to start: a search over all spins that is the same at every speed and narrows down to a handful.

A spin of m rps turns the ball by a given part of a turn within segments of that part / m seconds. Scored over such
segments, every speed needs the same grid of directions and the same ratio from one magnitude to the next, and all
segments count together: no single moment needs to show the logo well. Then the best cells of the grid are halved
while the segments double, which is the usual doubling of the window without betting on one stretch of it.
"""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import NDArray

from .contrast import CELLS_PER_SIGMA, score, scores
from .contrast_window import Window, segment_starts, segmented

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
TURN = 2.0 * math.pi

SLOWEST_RPS = 3.0
# First pass: over a fifth of a turn, neighbours in a grid of 64 directions (0.44 rad) and of magnitudes 1.4 apart
# move an event by 0.14 rad at most, about the kernel's width.
SEARCH_TURNS = 0.2
SEARCH_SIGMA = 0.12
MAGNITUDE_RATIO = 1.4
DIRECTIONS = 64
DIRECTION_SPACING = math.sqrt(4.0 * math.pi / DIRECTIONS)
# Halvings of the best cells, how many are kept, and how the kernel shrinks: four bring 0.2 to 3.2 turns.
HALVINGS = 4
KEPT = 48
CROWD = 6
SHRINK = 0.8
EACH_SEGMENT = 100  # events: more do not sharpen a coarse answer, they only cost time
# Spins nearer than this (relative) belong to one top of the score, farther ones to two.
NEAR = 0.3
# Magnitudes that share a segment length.
SHARED = 0.15


def spread_directions(count: int) -> Floats:
    """(count, 3) unit vectors spread evenly over the sphere (Fibonacci's spiral)."""
    i = np.arange(count) + 0.5
    z = 1.0 - 2.0 * i / count
    angle = math.pi * (1.0 + math.sqrt(5.0)) * i
    across = np.sqrt(1.0 - z * z)
    return np.stack([across * np.cos(angle), across * np.sin(angle), z], axis=1)


def scored(spins_rad_s: Floats, part: Window, sigma: float, floor: float) -> Floats:
    """(m,) scores of spins (m, 3) with a kernel of `sigma` radians."""
    out = np.empty(spins_rad_s.shape[0])
    scores(out, np.ascontiguousarray(spins_rad_s), *part, sigma * CELLS_PER_SIGMA, floor)
    return out


@numba.njit(cache=True, nogil=True)
def distinct(spins: Floats, apart: float, most: int, crowd: int) -> Integers:
    """Rows of at most `most` spins, in order, each farther than `apart` (relative to the faster) from those before.

    crowd : if not 0, of spins within NEAR of each other no more than so many, or one broad top takes every place
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


@numba.njit(cache=True, nogil=True)
def axes_of(spin: Floats) -> Floats:
    """(3, 3) rows: the spin's direction and two directions across it, orthonormal."""
    x, y, z = spin / math.sqrt(spin[0] ** 2 + spin[1] ** 2 + spin[2] ** 2)
    across = np.array([0.0, -z, y]) if abs(x) < 0.6 else np.array([z, 0.0, -x])
    u, v, w = across / math.sqrt(across[0] ** 2 + across[1] ** 2 + across[2] ** 2)
    return np.array([[x, y, z], [u, v, w], [y * w - z * v, z * u - x * w, x * v - y * u]])


def bursts(t_s: Floats, normals: Floats, layers: Integers) -> NDArray[np.bool_]:
    """(n,) which events come in bursts where they are on the disc: the logo's edges do, shading does not.

    The score's ratio for a ball that does not turn, half a millisecond against the whole stretch: an event that is
    no denser than usual at its place (less than e^0.2) is left out. Sparse events pass, for the floor is low.
    """
    segment_s, sigma, floor, usual = 0.5e-3, 0.1, 0.3, 600
    starts = segment_starts(t_s, segment_s)
    rows = np.arange(0, t_s.size, max(1, t_s.size // usual))
    count = starts.size - 1
    ratios = np.empty(t_s.size)
    score(
        ratios,
        np.zeros(3),
        t_s,
        normals,
        layers,
        starts,
        np.zeros(count * rows.size),
        np.tile(normals[:, rows], count),
        np.tile(layers[rows], count),
        np.arange(count + 1) * rows.size,
        sigma * CELLS_PER_SIGMA,
        floor,
    )
    return ratios > 0.2


def search(
    t_s: Floats, normals: Floats, layers: Integers, fastest_rps: float, floor: float, most: int
) -> tuple[Floats, Floats]:
    """Spins (m, 3) in rad/s on a grid of all directions and speeds up to fastest_rps, and their scores, best first."""
    directions = spread_directions(DIRECTIONS)
    count = max(1, math.ceil(math.log(fastest_rps / SLOWEST_RPS) / math.log(MAGNITUDE_RATIO)))
    spins = np.concatenate(
        [directions * m * TURN for m in np.geomspace(min(SLOWEST_RPS, fastest_rps), fastest_rps, count + 1)]
    )
    values = _over_turns(t_s, normals, layers, spins, SEARCH_TURNS, SEARCH_SIGMA, floor, most, EACH_SEGMENT // 2)
    order = np.argsort(-values, kind="stable")
    return spins[order], values[order]


def narrowed(
    t_s: Floats, normals: Floats, layers: Integers, spins_rad_s: Floats, floor: float, most: int, keep: int
) -> Floats:
    """At most `keep` distinct spins (k, 3), best first, from the best cells of `search` by halving them."""
    span_s = float(t_s[-1] - t_s[0])
    spins, turns, sigma = spins_rad_s[:KEPT], SEARCH_TURNS, SEARCH_SIGMA
    ratio, spacing = math.log(MAGNITUDE_RATIO), DIRECTION_SPACING
    for _ in range(HALVINGS):
        turns, sigma = 2.0 * turns, SHRINK * sigma
        spins = _halved(spins, ratio, spacing)
        values = _over_turns(t_s, normals, layers, spins, turns, sigma, floor, most, EACH_SEGMENT)
        spins = spins[np.argsort(-values, kind="stable")]
        ratio, spacing = 0.5 * ratio, 0.5 * spacing
        spins = spins[distinct(spins, 0.6 * spacing, KEPT, CROWD)]
        if turns * TURN > span_s * np.linalg.norm(spins, axis=1).max():
            break
    return spins[distinct(spins, NEAR, keep, 0)]


@numba.njit(cache=True, nogil=True)
def _halved(spins: Floats, ratio: float, spacing: float) -> Floats:
    """(8 m, 3) the middles of the eighths of the cells around spins (m, 3), whose log magnitudes are ratio wide."""
    parts, at = np.empty((8 * spins.shape[0], 3)), 0
    for k in range(spins.shape[0]):
        axes = axes_of(spins[k])
        magnitude = math.sqrt(spins[k, 0] ** 2 + spins[k, 1] ** 2 + spins[k, 2] ** 2)
        for larger in (-0.25, 0.25):
            for right in (-0.25, 0.25):
                for up in (-0.25, 0.25):
                    direction = axes[0] + spacing * (right * axes[1] + up * axes[2])
                    length = math.sqrt(direction[0] ** 2 + direction[1] ** 2 + direction[2] ** 2)
                    parts[at] = direction * (magnitude * math.exp(larger * ratio) / length)
                    at += 1
    return parts


@numba.njit(cache=True, nogil=True)
def _over_turns(
    t_s: Floats,
    normals: Floats,
    layers: Integers,
    spins_rad_s: Floats,
    turns: float,
    sigma: float,
    floor: float,
    most: int,
    most_each: int,
) -> Floats:
    """(m,) scores over segments of so many turns of each spin, as if no events had been left out."""
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
        part, _ = segmented(t_s, normals, layers, segment_s, most, most_each)
        ratios = np.empty(part.t_s.size)
        for k in range(first, count):
            if speed[k] != speed[first]:
                continue
            done[k] = True
            if part.t_s.size:
                one = score(
                    ratios,
                    spins_rad_s[k],
                    part.t_s,
                    part.normals,
                    part.layers,
                    part.starts,
                    part.other_t_s,
                    part.other_normals,
                    part.other_layers,
                    part.other_starts,
                    sigma * CELLS_PER_SIGMA,
                    floor,
                )
                values[k] = one * (t_s.size / part.t_s.size)
    return values
