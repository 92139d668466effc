"""The static background: the table with its lines, the floor, and their texture."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from .scene import Scene

TABLE_WIDTH_M, TABLE_LENGTH_M = 1.525, 2.74  # rules of table tennis
SIDE_LINE_M, CENTRE_LINE_M = 0.020, 0.003


def intensity_map(scene: Scene, camera: Camera) -> NDArray[np.float64]:
    """(height x width,) float64 intensity of the background, white in full light = 1."""
    background = scene.background
    plain = background.kind == "plain"
    albedo = np.full(camera.width_px * camera.height_px, background.albedo) if plain else _table(scene, camera)
    if background.contrast > 0:
        from scipy.ndimage import gaussian_filter  # a quarter of a second to load, needed here only

        random = np.random.default_rng(background.texture_seed)
        grain = gaussian_filter(random.standard_normal((camera.height_px, camera.width_px)), background.grain_px)
        albedo = albedo * np.exp(background.contrast * grain.ravel() / grain.std())
    return albedo


def _table(scene: Scene, camera: Camera) -> NDArray[np.float64]:
    """Albedo of the table below the camera, its length along the image's columns; soft-edged lines."""
    background = scene.background
    column, row = np.meshgrid(np.arange(camera.width_px), np.arange(camera.height_px))
    rays = camera.rays(column.ravel(), row.ravel())
    up = np.asarray(scene.up, np.float64)
    fall = -rays @ up
    below = fall > 1e-3
    depth = np.where(below, background.height_m / np.where(below, fall, 1.0), np.inf)
    across = np.array([1.0, 0.0, 0.0]) - up[0] * up
    across = across / np.linalg.norm(across) if np.linalg.norm(across) > 1e-6 else np.array([0.0, 1.0, 0.0])
    along = np.cross(up, across)
    with np.errstate(invalid="ignore"):
        a, b = (np.where(below, depth * (rays @ axis), np.inf) for axis in (across, along))
    pixel_m = background.height_m / camera.focal_px

    def within(distance: NDArray[np.float64], half: float) -> NDArray[np.float64]:
        return np.clip((half - np.abs(distance)) / pixel_m + 0.5, 0.0, 1.0)

    table = within(a, TABLE_WIDTH_M / 2) * within(b, TABLE_LENGTH_M / 2)
    field = within(a, TABLE_WIDTH_M / 2 - SIDE_LINE_M) * within(b, TABLE_LENGTH_M / 2 - SIDE_LINE_M)
    # A line thinner than a pixel covers it in part.
    centre = np.clip(
        (CENTRE_LINE_M + pixel_m) / 2 / pixel_m - np.abs(a) / pixel_m, 0.0, min(CENTRE_LINE_M / pixel_m, 1.0)
    )
    line = table * np.maximum(1 - field, centre)
    return (
        background.floor_albedo
        + table * (background.albedo - background.floor_albedo)
        + line * (background.line_albedo - background.albedo)
    )
