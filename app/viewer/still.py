"""The logo with the spin taken out: events gathered on the ball's surface, turned back to one moment.

A logo that stands still and sharp is the visual proof of a right spin; a wrong one smears it.

The body frame is the camera frame at the shot's start, turning with the ball from then on.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# Cells along the cube around the unit sphere: 2.7 degrees, a pixel's share of a ball of 20 px radius. Finer pictures
# show no more, and the tuner draws them anew with every change.
CELLS = 48
TEXTURE_PX = (144, 72)  # 2.5 degrees a texel
DISC_PX = 96
MAP_PX = (180, 90)  # 2 degrees a pixel
GAP_PX = 10


def turned(vectors: Floats, spin_rps: Floats, seconds: Floats) -> Floats:
    """(n, 3) vectors, each turned by the spin (3,) for its own time (n,) (Rodrigues' formula)."""
    magnitude = float(np.linalg.norm(spin_rps))
    if magnitude == 0:
        return vectors
    axis = spin_rps / magnitude
    angle = (2 * np.pi * magnitude) * seconds[:, None]
    along = (vectors @ axis)[:, None] * axis
    turned_vectors: Floats = along + np.cos(angle) * (vectors - along) + np.sin(angle) * np.cross(axis, vectors)
    return turned_vectors


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


def texture_directions() -> Floats:
    """(height, width, 3) unit vectors in the body frame behind the texels of the ball's texture.

    The middle of the texture is the point that faced the camera, right and down are the image's.
    """
    width, height = TEXTURE_PX
    longitude = ((np.arange(width) + 0.5) / width - 0.5) * 2 * np.pi
    latitude = ((np.arange(height) + 0.5) / height - 0.5) * np.pi
    return sphere(longitude[None, :], latitude[:, None])


def sphere(longitude: Floats, latitude: Floats) -> Floats:
    """(..., 3) unit vectors: longitude to the right and latitude down, from the direction to the camera."""
    longitude, latitude = np.broadcast_arrays(longitude, latitude)
    across = np.cos(latitude)
    return np.stack([across * np.sin(longitude), np.sin(latitude), -across * np.cos(longitude)], axis=-1)


def map_directions() -> Floats:
    """(height, width, 3) unit vectors behind the pixels of the unrolled map, in the map's frame.

    Longitude runs from left to right in the sense of the spin, latitude from +90 degrees, where the axis pierces the
    ball, down to -90.
    """
    width, height = MAP_PX
    longitude = ((np.arange(width) + 0.5) / width - 0.5) * 2 * np.pi
    latitude = (0.5 - (np.arange(height) + 0.5) / height) * np.pi
    longitude, latitude = np.broadcast_arrays(longitude[None, :], latitude[:, None])
    across = np.cos(latitude)
    return np.stack([across * np.cos(longitude), across * np.sin(longitude), np.sin(latitude)], axis=-1)


def map_frame(spin_rps: Floats, middle: Floats) -> Floats:
    """(3, 3) rows: the map's longitudes 0 and 90 degrees, and its pole, in the frame of the spin.

    The direction `middle` has longitude 0. Without a spin the pole is the image's up.
    """
    magnitude = float(np.linalg.norm(spin_rps))
    pole = spin_rps / magnitude if magnitude else np.array([0.0, -1.0, 0.0])
    out = middle - (middle @ pole) * pole
    if np.linalg.norm(out) < 1e-6 * np.linalg.norm(middle):
        out = np.cross(pole, [1.0, 0.0, 0.0] if abs(pole[0]) < 0.9 else [0.0, 1.0, 0.0])
    out = out / np.linalg.norm(out)
    return np.stack([out, np.cross(pole, out), pole])


def disc_directions(middle: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """(height, width, 3) unit vectors behind the pixels of two discs, and which pixels lie on a disc.

    The left disc is the half of the ball around `middle` as seen from outside, the right one the other half, as if
    turned about the vertical. Up is the image's up, as far as it can be.
    """
    out = middle / np.linalg.norm(middle)
    down = np.array([0.0, 1.0, 0.0]) if abs(out[1]) < 0.9 else np.array([0.0, 0.0, 1.0])
    down = down - (down @ out) * out
    down /= np.linalg.norm(down)
    right = np.cross(down, -out)  # x right, y down, the third away from the viewer
    side = (np.arange(DISC_PX) + 0.5) / DISC_PX * 2.1 - 1.05
    x, y = np.meshgrid(side, side)
    on_disc = x**2 + y**2 < 1
    z = np.sqrt(np.clip(1 - x**2 - y**2, 0, None))
    front = x[..., None] * right + y[..., None] * down + z[..., None] * out
    back = -x[..., None] * right + y[..., None] * down - z[..., None] * out
    gap = np.zeros((DISC_PX, GAP_PX, 3))
    gap[..., 2] = 1
    mask = np.hstack([on_disc, np.zeros((DISC_PX, GAP_PX), np.bool_), on_disc])
    return np.hstack([front, gap, back]), mask


def tone(counts: NDArray[np.float32], full: float) -> NDArray[np.float32]:
    """Counts as 0..1: nothing below a tenth of `full`, which is noise, and all of the colour from `full` on."""
    if full <= 0:
        return np.zeros_like(counts)
    shades: NDArray[np.float32] = (counts * np.float32(1 / full) - np.float32(0.1)) * np.float32(1 / 0.9)
    return shades.clip(0, 1)
