"""Reconstructed logo of a shot: a texture of the whole ball, and its events at two instants as proof of the spin.

A texture is octahedral: a direction (x, y, z) stands at column x / n and row y / n, n = |x| + |y| + |z|, of the square
from -1 to 1; the half z < 0 is folded outwards. Looking it up needs no trigonometry.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from spinscope.pipeline.kernels.derotated_logo import CELLS, count_derotated, full_count, sample_density
from spinscope.pipeline.kernels.rotation import rotations

Floats = NDArray[np.float64]
Bytes = NDArray[np.uint8]

TEXTURE_PX = 96  # 3.7 degrees at the equator's middle; the density's cells are 2.7 degrees
NOISE_SHARE = 0.15  # of the full count: below it the ball is white
INSTANT_TURN = 1 / 20  # of a turn, length of an instant: the logo smears by 18 degrees at most
INSTANT_MOST_US = 8_000  # of slow spins
INSTANT_EVENTS = 350  # drawn of an instant
APART_TURN = 1 / 12  # at least between the two instants, so that the logo has visibly moved
VISIBLE = 0.25  # cosine to the line of sight: what is nearer to the rim is seen too obliquely


@dataclass(frozen=True, slots=True, eq=False)
class LogoEvents:
    """Events of the logo over a shot.

    Attributes
    ----------
    t_us : (n,) int64
    on : (n,) bool
    normals : (n, 3) float64
        Outward unit normals where they lie on the ball, camera frame.
    """

    t_us: NDArray[np.int64]
    on: NDArray[np.bool_]
    normals: Floats


@dataclass(frozen=True, slots=True, eq=False)
class SpinProof:
    """The logo at two instants, and the first turned by the spin to the second.

    Attributes
    ----------
    first_us, second_us : float
        Middles of the instants.
    first, second, turned : (n, 2) and (m, 2) float64
        Places on the ball's disc as the camera sees it, radius 1, y down; n of `first` and `turned` belong together.
    """

    first_us: float
    second_us: float
    first: Floats
    second: Floats
    turned: Floats


def octahedral_directions(side_px: int) -> Floats:
    """(side_px * side_px, 3) float64 unit directions of a texture's pixels, row by row."""
    at = (np.arange(side_px) + 0.5) / side_px * 2 - 1
    x, y = (grid.ravel() for grid in np.meshgrid(at, at))
    z = 1 - np.abs(x) - np.abs(y)
    under = z < 0
    folded_x = np.where(under, (1 - np.abs(y)) * np.where(x < 0, -1, 1), x)
    folded_y = np.where(under, (1 - np.abs(x)) * np.where(y < 0, -1, 1), y)
    directions = np.stack([folded_x, folded_y, z], axis=1)
    unit: Floats = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    return unit


def octahedral_pixels(directions: Floats, side_px: int) -> NDArray[np.int64]:
    """Index of the texture's pixel, row by row, behind each direction (n, 3)."""
    x, y, z = (directions / np.abs(directions).sum(axis=1, keepdims=True)).T
    under = z < 0
    column = np.where(under, (1 - np.abs(y)) * np.where(x < 0, -1, 1), x)
    row = np.where(under, (1 - np.abs(x)) * np.where(y < 0, -1, 1), y)
    places = np.clip((np.stack([column, row]) + 1) * (side_px / 2), 0, side_px - 1).astype(np.int64)
    pixels: NDArray[np.int64] = places[1] * side_px + places[0]
    return pixels


def logo_texture(events: LogoEvents, spin_rps: Floats, reference_us: float) -> Bytes:
    """(TEXTURE_PX, TEXTURE_PX) uint8 ink on the ball, 255 = full, in the camera frame at the reference time."""
    density = np.empty((CELLS, CELLS, CELLS, 3), np.float32)
    count_derotated(density, events.normals, events.on, np.asarray((reference_us - events.t_us) * 1e-6), spin_rps)
    counts = np.empty((2, TEXTURE_PX * TEXTURE_PX), np.float32)
    sample_density(counts, density, _texture_directions(), np.eye(3))
    both = counts.sum(axis=0)
    strength = (both / max(full_count(both), 1e-30) - NOISE_SHARE) / (1 - NOISE_SHARE)
    ink: Bytes = (255 * np.clip(strength, 0, 1)).astype(np.uint8).reshape(TEXTURE_PX, TEXTURE_PX)
    return ink


def spin_proof(events: LogoEvents, spin_rps: Floats, line_of_sight: Floats) -> SpinProof | None:
    """The two instants that show most of the logo; None where no two do.

    Parameters
    ----------
    spin_rps : (3,) float64
        Camera frame.
    line_of_sight : (3,) float64
        Unit vector from the camera to the ball, camera frame.
    """
    rate_rps = float(np.linalg.norm(spin_rps))
    if not rate_rps or not len(events.t_us):
        return None
    length_us = min(INSTANT_TURN / rate_rps * 1e6, INSTANT_MOST_US)
    start_us = int(events.t_us.min())
    instant = ((events.t_us - start_us) / length_us).astype(np.int64)
    middles_us = start_us + (np.arange(instant.max() + 1) + 0.5) * length_us
    visible = events.normals @ -line_of_sight > VISIBLE
    members = [np.flatnonzero((instant == number) & visible)[:INSTANT_EVENTS] for number in range(len(middles_us))]
    best, pair = 0, None
    for first, its in enumerate(members):
        if len(its) <= best:
            continue
        for second in range(first + max(1, math.ceil(APART_TURN / rate_rps * 1e6 / length_us)), len(members)):
            if len(members[second]) <= best:
                continue
            turned = _turned(events.normals[its], spin_rps, middles_us[second] - middles_us[first])
            seen = min(int(np.count_nonzero(turned @ -line_of_sight > VISIBLE)), len(members[second]))
            if seen > best:
                best, pair = seen, (first, second)
    if pair is None:
        return None
    first, second = pair
    turned = _turned(events.normals[members[first]], spin_rps, middles_us[second] - middles_us[first])
    kept = turned @ -line_of_sight > 0
    return SpinProof(
        float(middles_us[first]),
        float(middles_us[second]),
        _on_disc(events.normals[members[first]][kept], line_of_sight),
        _on_disc(events.normals[members[second]], line_of_sight),
        _on_disc(turned[kept], line_of_sight),
    )


@cache
def _texture_directions() -> Floats:
    return octahedral_directions(TEXTURE_PX)


def _turned(normals: Floats, spin_rps: Floats, after_us: float) -> Floats:
    turned: Floats = normals @ rotations(2 * np.pi * after_us * 1e-6 * spin_rps)[0].T
    return turned


def _on_disc(normals: Floats, line_of_sight: Floats) -> Floats:
    """Places of normals on the disc, across the line of sight: x nearest to the image's x, y down."""
    down = np.array([0.0, 1.0, 0.0])
    across = np.cross(down, line_of_sight)
    across /= np.linalg.norm(across)
    disc: Floats = normals @ np.stack([across, np.cross(line_of_sight, across)], axis=1)
    return disc
