"""The obvious twins of the kernels that paint the logo with the spin taken out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

CELLS = 48


def density(normals: Floats) -> NDArray[np.float32]:
    """How often the unit vectors (n, 3) fall in each cell of the cube, smoothed: (CELLS**3,) float32."""
    cells = (_place(normals) + 0.5).astype(np.int64)
    flat = (cells[:, 0] * CELLS + cells[:, 1]) * CELLS + cells[:, 2]
    counts = np.bincount(flat, minlength=CELLS**3).astype(np.float32)
    for stride in (1, CELLS, CELLS * CELLS):  # weights 1 2 1 along each side; the cube's sides are empty
        smooth = 2 * counts
        smooth[stride:] += counts[:-stride]
        smooth[:-stride] += counts[stride:]
        counts = smooth
    whole: NDArray[np.float32] = counts / np.float32(64)
    return whole


def _place(directions: Floats) -> Floats:
    """Where unit vectors lie among the centres of the cells, two cells away from the cube's sides."""
    return directions * (0.5 * CELLS - 3) + (0.5 * CELLS - 0.5)


class Sampler:
    """Reads densities in given directions, linear between the centres of the cells."""

    def __init__(self, directions: Floats) -> None:
        """directions : (..., 3) unit vectors."""
        place = _place(directions.reshape(-1, 3))
        cell = np.floor(place).astype(np.int64)
        part = place - cell
        corners, weights = [], []
        for corner in np.ndindex(2, 2, 2):
            at = cell + corner
            corners.append((at[:, 0] * CELLS + at[:, 1]) * CELLS + at[:, 2])
            weights.append(np.prod(np.where(np.array(corner), part, 1 - part), axis=-1))
        self._shape = directions.shape[:-1]
        self._corners = np.array(corners)
        self._weights = np.array(weights, np.float32)

    def __call__(self, smooth: NDArray[np.float32]) -> NDArray[np.float32]:
        """(...) the density in every direction."""
        found: NDArray[np.float32] = np.einsum("kn,kn->n", self._weights, smooth.take(self._corners))
        return found.reshape(self._shape)


def tone(counts: NDArray[np.float32], full: float) -> NDArray[np.float32]:
    """Counts as 0..1: nothing below a tenth of `full`, which is noise, and all of the colour from `full` on."""
    if full <= 0:
        return np.zeros_like(counts)
    shades: NDArray[np.float32] = (counts * np.float32(1 / full) - np.float32(0.1)) * np.float32(1 / 0.9)
    return shades.clip(0, 1)
