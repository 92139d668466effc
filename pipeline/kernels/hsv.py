"""Flow as colours (supplement, figure hsv_wheel): hue is the direction, saturation the speed."""

from __future__ import annotations

import numpy as np

from .arrays import Bytes, Floats


def flow_colours(vx_px_s: Floats, vy_px_s: Floats, bound_px_s: float) -> Bytes:
    """Colours (..., 3) uint8 RGB of velocities; white stands still, full colour moves at bound_px_s or faster.

    Hue 0 (red) moves to +x (right) and hue rises towards +y (down in the image).
    """
    hue = np.arctan2(vy_px_s, vx_px_s) / (2 * np.pi) % 1.0
    saturation = np.minimum(np.hypot(vx_px_s, vy_px_s) / bound_px_s, 1.0)
    # Value 1: a channel falls from 1 to 1 - saturation with the hue's distance from the channel's own.
    away = np.abs((hue[..., None] * 6.0 + np.array([0.0, 4.0, 2.0])) % 6.0 - 3.0) - 1.0
    channels = 1.0 - saturation[..., None] * (1.0 - np.clip(away, 0.0, 1.0))
    colours: Bytes = np.round(255.0 * channels).astype(np.uint8)
    return colours


def hsv_wheel(size_px: int) -> Bytes:
    """Colour wheel (size_px, size_px, 3) uint8: zero velocity in the middle, the bound at the rim, black outside."""
    across = (2.0 * np.arange(size_px) + 1.0) / size_px - 1.0
    vx, vy = np.meshgrid(across, across)
    wheel = flow_colours(vx, vy, 1.0)
    wheel[np.hypot(vx, vy) > 1.0] = 0
    return wheel


def hsv_image(
    x_px: Floats, y_px: Floats, vx_px_s: Floats, vy_px_s: Floats, *, bound_px_s: float, radius_px: float, size_px: int
) -> Bytes:
    """Image (size_px, size_px, 3) uint8 of the ball's disc with the mean flow of every cell; black without any.

    The places (n,) are relative to the ball's centre; those beyond radius_px, half the picture, are left out. Flow of
    bound_px_s has full colour.
    """
    scale = size_px / (2.0 * radius_px)
    column, row = np.floor((x_px + radius_px) * scale), np.floor((y_px + radius_px) * scale)
    inside = (column >= 0) & (column < size_px) & (row >= 0) & (row < size_px)
    cell = (row[inside] * size_px + column[inside]).astype(np.int64)
    count = np.bincount(cell, minlength=size_px * size_px)
    filled = np.flatnonzero(count)
    vx = np.bincount(cell, vx_px_s[inside], size_px * size_px)[filled] / count[filled]
    vy = np.bincount(cell, vy_px_s[inside], size_px * size_px)[filled] / count[filled]
    image = np.zeros((size_px * size_px, 3), np.uint8)
    image[filled] = flow_colours(vx, vy, bound_px_s)
    return image.reshape(size_px, size_px, 3)
