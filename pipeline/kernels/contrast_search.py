"""Where to start: a search over all spins that is the same at every speed, and a tournament among its best.

A spin of m rps turns the ball by a fixed part of a turn within segments of that part / m seconds. Scored over such
segments, every speed needs the same grid of directions and the same ratio from one magnitude to the next; all
segments count together, so no single moment needs to show the logo well.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .contrast import CELLS_PER_SIGMA, scores
from .contrast_window import Window, window

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
TURN = 2.0 * math.pi

SLOWEST_RPS = 3.0
SEARCH_TURNS = 0.2
SEARCH_SIGMA = 0.12
RATIO = 1.4
DIRECTIONS = 64


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
    scores(out, spins_rad_s, *part, sigma * CELLS_PER_SIGMA, floor)
    return out


def search(
    t_s: Floats, normals: Floats, layers: Integers, fastest_rps: float, floor: float, most: int
) -> tuple[Floats, Floats]:
    """Spins (m, 3) in rad/s on a grid of all directions and speeds up to fastest_rps, and their scores, best first."""
    directions = spread_directions(DIRECTIONS)
    steps = max(1, math.ceil(math.log(fastest_rps / SLOWEST_RPS) / math.log(RATIO)))
    spins, values = [], []
    for magnitude_rps in np.geomspace(SLOWEST_RPS, fastest_rps, steps + 1):
        part = window(
            t_s,
            normals,
            layers,
            segment_s=SEARCH_TURNS / magnitude_rps,
            most=most,
            most_each=50,
            times_each=1,
        )
        if part.t_s.size < 10:
            continue
        spins.append(directions * magnitude_rps * TURN)
        # As if all events had been scored, so that magnitudes compare.
        values.append(scored(spins[-1], part, SEARCH_SIGMA, floor) * (t_s.size / part.t_s.size))
    if not spins:
        return np.empty((0, 3)), np.empty(0)
    order = np.argsort(-np.concatenate(values), kind="stable")
    return np.concatenate(spins)[order], np.concatenate(values)[order]


def distinct(spins_rad_s: Floats, apart: float, most: int) -> Integers:
    """Rows of at most `most` spins, in order, each farther than `apart` (relative to the faster) from those before."""
    rows: list[int] = []
    size = np.linalg.norm(spins_rad_s, axis=1)
    for row in range(spins_rad_s.shape[0]):
        gap = np.linalg.norm(spins_rad_s[rows] - spins_rad_s[row], axis=1)
        if np.all(gap > apart * np.maximum(size[rows], size[row])):
            rows.append(row)
            if len(rows) == most:
                break
    return np.array(rows, np.int64)
