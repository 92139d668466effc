"""Picture of the derotated logo: events turned back to one moment, counted around the ball, read and coloured.

Directions are unit vectors from the ball's centre. They are counted in the cells of a cube around the unit sphere, of
`side` cells along an edge. A density is a float32 array (side, side, side, 3): how often OFF and ON events fall in each
cell, smoothed with weights 1/4 1/2 1/4 along each axis (integers over 64, which float32 holds exactly), and 1 where a
direction between this cell's centre and the next ones' has any density, else 0.

A kernel that returns nothing writes into its first argument, and into nothing else.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from .arrays import Bytes, Flags, Floats, Integers, Singles
from .order_statistics import value_of_rank
from .rotation import axis_and_length, rotate

CELLS = 48  # along the cube of a painting: 2.7 degrees, a pixel's share of a ball of 20 px radius
NOISE_SHARE = 0.1  # of the full count: below it there is no colour
FULL_RANK = 0.95  # of the marked places: what a twentieth of them exceed has full colour


@njit(cache=True, nogil=True)
def _place(direction: float, side: int) -> float:
    """Place of a coordinate of a unit vector among the centres of the cells, two cells away from the cube's sides."""
    return direction * (0.5 * side - 3.0) + (0.5 * side - 0.5)


@njit(cache=True, nogil=True)
def count_derotated(density: Singles, normals: Floats, on: Flags, seconds: Floats, spin_rps: Floats) -> None:
    """Fill `density` with events of these unit normals (n, 3), each turned by the spin for so many seconds.

    Counts first, then spreads the few cells that have any: 3 x as fast as turning the events and smoothing the whole
    cube with numpy.
    """
    side = density.shape[0]
    density[:] = 0.0
    counts = np.zeros((side, side, side, 2), np.int32)
    touched = np.empty((normals.shape[0], 4), np.int16)
    marked = 0
    ax, ay, az, magnitude = axis_and_length(spin_rps)
    for e in range(normals.shape[0]):
        angle = 2.0 * math.pi * magnitude * seconds[e]
        cosine = math.cos(angle)
        normal = (normals[e, 0], normals[e, 1], normals[e, 2])
        x, y, z = rotate(normal, (ax, ay, az), math.sin(angle), cosine, 1.0 - cosine)
        i, j, k = int(_place(x, side) + 0.5), int(_place(y, side) + 0.5), int(_place(z, side) + 0.5)
        p = 1 if on[e] else 0
        if counts[i, j, k, p] == 0:
            touched[marked, 0], touched[marked, 1], touched[marked, 2], touched[marked, 3] = i, j, k, p
            marked += 1
        counts[i, j, k, p] += 1
    for m in range(marked):
        i, j, k, p = touched[m, 0], touched[m, 1], touched[m, 2], touched[m, 3]
        share = np.float32(counts[i, j, k, p] / 64.0)
        for di in range(-1, 2):
            for dj in range(-1, 2):
                for dk in range(-1, 2):
                    weight = np.float32((2 - abs(di)) * (2 - abs(dj)) * (2 - abs(dk)))
                    density[i + di, j + dj, k + dk, p] += weight * share
        density[i - 2 : i + 2, j - 2 : j + 2, k - 2 : k + 2, 2] = 1.0


@njit(cache=True, nogil=True)
def sample_density(found: Singles, density: Singles, directions: Floats, frame: Floats) -> None:
    """Fill `found` (2, n) with the densities of OFF and ON, linear between the centres of the cells.

    The directions (n, 3) are in the frame whose axes, in that of the density, are the rows of `frame`.
    """
    side = density.shape[0]
    for n in range(directions.shape[0]):
        a, b, c = directions[n, 0], directions[n, 1], directions[n, 2]
        x = _place(a * frame[0, 0] + b * frame[1, 0] + c * frame[2, 0], side)
        y = _place(a * frame[0, 1] + b * frame[1, 1] + c * frame[2, 1], side)
        z = _place(a * frame[0, 2] + b * frame[1, 2] + c * frame[2, 2], side)
        i, j, k = int(x), int(y), int(z)
        off, on = 0.0, 0.0
        if density[i, j, k, 2] == 0.0:
            found[0, n], found[1, n] = off, on
            continue
        fx, fy, fz = x - i, y - j, z - k
        for di in range(2):
            wx = fx if di else 1.0 - fx
            for dj in range(2):
                wy = wx * (fy if dj else 1.0 - fy)
                for dk in range(2):
                    weight = wy * (fz if dk else 1.0 - fz)
                    off += weight * density[i + di, j + dj, k + dk, 0]
                    on += weight * density[i + di, j + dj, k + dk, 1]
        found[0, n], found[1, n] = off, on


@njit(cache=True, nogil=True)
def full_count(counts: Singles) -> float:
    """Count (n,) that is shown in full colour: what a twentieth of the marked places exceed; 0 for none."""
    marked = np.empty(counts.size)
    m = 0
    for n in range(counts.size):
        if counts[n] > 0:
            marked[m] = counts[n]
            m += 1
    return value_of_rank(marked[:m], int(FULL_RANK * (m - 1))) if m else 0.0


@njit(cache=True, nogil=True)
def colour_counts(picture: Bytes, places: Integers, counts: Singles, colours: Singles, ground: Singles) -> None:
    """Write the ground's colour, shifted towards those of k kinds of events, into n places of `picture` (m, 3).

    Of the counts (k, n), noise below a tenth of the full count has no colour, and from the full count on there is all
    of it.
    """
    scale = np.zeros(counts.shape[0])
    for k in range(counts.shape[0]):
        scale[k] = 1.0 / max(full_count(counts[k]), 1e-30)  # all counts are 0 where that one is
    for n in range(places.size):
        red, green, blue = ground[0], ground[1], ground[2]
        for k in range(counts.shape[0]):
            strength = min((counts[k, n] * scale[k] - NOISE_SHARE) / (1.0 - NOISE_SHARE), 1.0)
            if strength > 0.0:
                red += strength * (colours[k, 0] - ground[0])
                green += strength * (colours[k, 1] - ground[1])
                blue += strength * (colours[k, 2] - ground[2])
        at = places[n]
        picture[at, 0] = np.uint8(min(max(red, 0.0), 255.0))
        picture[at, 1] = np.uint8(min(max(green, 0.0), 255.0))
        picture[at, 2] = np.uint8(min(max(blue, 0.0), 255.0))


class Canvas(NamedTuple):
    """Pixels of a picture that are painted, and their colours.

    Attributes
    ----------
    places : (n,) int64
        The pixels.
    directions : (n, 3) float64
        Directions behind them, in the picture's own frame.
    colours : (1, 3) or (2, 3) float32
        Of both polarities, or of OFF and ON.
    ground : (3,) float32
        Colour where there are no events.
    """

    places: Integers
    directions: Floats
    colours: Singles
    ground: Singles


@njit(cache=True, nogil=True)
def paint(
    pictures: tuple[Bytes, ...],
    canvases: tuple[Canvas, ...],
    frames: tuple[Floats, ...],
    normals: Floats,
    on: Flags,
    seconds: Floats,
    seen: Integers,
    spins_rps: Floats,
) -> None:
    """Paint the logo at several moments m, in pictures of several kinds, in one call.

    Parameters
    ----------
    pictures, canvases, frames : tuple of (m, pixels, 3) uint8, of Canvas, of (m, 3, 3) float64
        Output, canvas, and frames at the moments of each kind; the rows of a frame are the axes of the picture's.
    normals, on, seconds : (e, 3) float64, (e,) bool, (e,) float64
        The events, as in `count_derotated`.
    seen : (m, 2) int64
        First event of each moment, and the one after its last.
    """
    density = np.empty((CELLS, CELLS, CELLS, 3), np.float32)
    for moment in range(spins_rps.shape[0]):
        first, last = seen[moment]
        count_derotated(density, normals[first:last], on[first:last], seconds[first:last], spins_rps[moment])
        for kind in range(len(pictures)):
            canvas = canvases[kind]
            counts = np.empty((2, canvas.places.size), np.float32)
            sample_density(counts, density, canvas.directions, frames[kind][moment])
            if canvas.colours.shape[0] == 1:
                for n in range(counts.shape[1]):
                    counts[0, n] += counts[1, n]
                counts = counts[:1]
            colour_counts(pictures[kind][moment], canvas.places, counts, canvas.colours, canvas.ground)


@njit(cache=True, nogil=True)
def centroid(density: Singles) -> Floats:
    """Mean direction (3,) of the events, a vector from the middle of the cube; zeros where there are none."""
    found = np.zeros(3)
    middle = 0.5 * (density.shape[0] - 1)
    for i, j, k in np.ndindex(density.shape[:3]):
        count = density[i, j, k, 0] + density[i, j, k, 1]
        if count > 0.0:
            found[0] += (i - middle) * count
            found[1] += (j - middle) * count
            found[2] += (k - middle) * count
    return found
