"""Projections of the ball's surface: directions behind the pixels of its texture, of two discs, and of a map.

In these pictures the logo is derotated: sharp where the spin is right, smeared where it is wrong. The body frame is the
camera frame at the shot's start, turning with the ball from then on.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from spinscope.pipeline.kernels.rotation import cross_product

Floats = NDArray[np.float64]

# As fine as the cells in which the events are counted.
TEXTURE_PX = (144, 72)  # 2.5 degrees a texel
DISC_PX = 96
MAP_PX = (180, 90)  # 2 degrees a pixel
GAP_PX = 10


def texture_directions() -> Floats:
    """Unit vectors (height, width, 3) in the body frame behind the texels of the ball's texture.

    The middle of the texture is the point that faced the camera, right and down are the image's.
    """
    width, height = TEXTURE_PX
    longitude = ((np.arange(width) + 0.5) / width - 0.5) * 2 * np.pi
    latitude = ((np.arange(height) + 0.5) / height - 0.5) * np.pi
    return sphere(longitude[None, :], latitude[:, None])


def sphere(longitude: Floats, latitude: Floats) -> Floats:
    """Unit vectors (..., 3) of longitudes to the right and latitudes down, radians from the direction to the camera."""
    longitude, latitude = np.broadcast_arrays(longitude, latitude)
    across = np.cos(latitude)
    return np.stack([across * np.sin(longitude), np.sin(latitude), -across * np.cos(longitude)], axis=-1)


def map_directions() -> Floats:
    """Unit vectors (height, width, 3) behind the pixels of the unrolled map, in the map's frame.

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
    """Rows (3, 3): the map's longitudes 0 and 90 degrees, and its pole, in the frame of the spin.

    The direction `middle` has longitude 0. Without a spin the pole is the image's up.
    """
    magnitude = float(np.linalg.norm(spin_rps))
    pole = spin_rps / magnitude if magnitude else np.array([0.0, -1.0, 0.0])
    out = middle - (middle @ pole) * pole
    if np.linalg.norm(out) < 1e-6 * np.linalg.norm(middle):
        out = cross_product(pole, np.array([1.0, 0.0, 0.0] if abs(pole[0]) < 0.9 else [0.0, 1.0, 0.0]))
    out = out / np.linalg.norm(out)
    return np.stack([out, cross_product(pole, out), pole])


def disc_directions(middle: Floats) -> Floats:
    """Unit vectors (n, 3) behind the pixels of two discs, those of `disc_mask` in its order.

    The left disc is the half of the ball around `middle` as seen from outside, the right one the other half, as if
    turned about the vertical. Up is the image's up, as far as it can be.
    """
    out = middle / np.linalg.norm(middle)
    down = np.array([0.0, 1.0, 0.0]) if abs(out[1]) < 0.9 else np.array([0.0, 0.0, 1.0])
    down = down - (down @ out) * out
    down /= np.linalg.norm(down)
    right = np.cross(down, -out)  # x right, y down, the third away from the viewer
    turned: Floats = _discs() @ np.stack([right, down, out])
    return turned


@cache
def disc_mask() -> NDArray[np.bool_]:
    """Pixels of the picture (height, width) that lie on one of the two discs."""
    side = _disc_side()
    on_disc = side[None, :] ** 2 + side[:, None] ** 2 < 1
    return np.hstack([on_disc, np.zeros((DISC_PX, GAP_PX), np.bool_), on_disc])


@cache
def _discs() -> Floats:
    """Components right, down and out of the left disc (n, 3) behind the pixels of both."""
    x, y = np.meshgrid(_disc_side(), _disc_side())
    z = np.sqrt(np.clip(1 - x**2 - y**2, 0, None))
    front = np.stack([x, y, z], axis=-1)
    gap = np.zeros((DISC_PX, GAP_PX, 3))
    both: Floats = np.hstack([front, gap, front * [-1, 1, -1]])[disc_mask()]
    return both


def _disc_side() -> Floats:
    """Centres of a disc's pixels along one side, in radii."""
    return (np.arange(DISC_PX) + 0.5) / DISC_PX * 2.1 - 1.05
