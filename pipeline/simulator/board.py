"""Simulation of a chessboard on a blinking screen, with the true places of its corners.

A board has no part in `Scene`: nothing moves while the screen turns bright or dark, so every pixel is followed
through its events by formulas, without steps of time.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..events import EventBatch
from ..kernels.rotation import rotations
from .sensor import LabelledEvents, Lens, SensorModel, noise, read_out, thresholds

Floats = NDArray[np.float64]

SCREEN_TAU_US = 2000.0  # an LCD's response, 10 to 90 % in 4.4 ms
BLACK = 0.01  # of the white: contrast of 100 in a lit room
FINER = 3  # looks a pixel and axis, for its share of white
MOST_EVENTS = 40  # of a pixel at one flash


@dataclass(frozen=True)
class BoardPose:
    """Pose of the board during some blinks: a point p of it is at rotation p + shift_m in the camera frame."""

    turn_rad: tuple[float, float, float]
    shift_m: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class SimulatedBoard:
    """Events of a blinking board, the camera that saw it, and its corners.

    Attributes
    ----------
    events : EventBatch
    camera : Camera
    corners_px : (poses, rows * columns, 2) float64
        True places of the inner corners.
    """

    events: EventBatch
    camera: Camera
    corners_px: Floats


def simulate_board(
    poses: Sequence[BoardPose],
    *,
    camera: Camera,
    columns: int = 9,
    rows: int = 6,
    square_mm: float = 20.0,
    blink_hz: float = 10.0,
    blinks: int = 1,
    sensor: SensorModel | None = None,
    lens: Lens | None = None,
    seed: int = 0,
) -> SimulatedBoard:
    """Simulate a chessboard with a white margin that blinks so many times in each pose; same arguments, same events."""
    random = np.random.default_rng([seed, 9])
    sensor, lens = sensor or SensorModel.of(), lens or Lens()
    pixels = camera.width_px * camera.height_px
    up, down = (array.astype(np.float64) for array in thresholds(sensor, pixels, random))
    half_us = 0.5e6 / blink_hz
    parts: list[LabelledEvents] = []
    corners = []
    start_us = half_us
    column, row = np.meshgrid(np.arange(columns), np.arange(rows))
    points_m = np.column_stack([column.ravel(), row.ravel(), np.zeros(column.size)]) * square_mm * 1e-3
    x, y = np.meshgrid(np.arange(camera.width_px), np.arange(camera.height_px))
    rays = camera.rays(x.ravel(), y.ravel()).reshape(camera.height_px, camera.width_px, 3)
    for pose in poses:
        turn = rotations(np.array(pose.turn_rad))[0]
        corners.append(camera.project(points_m @ turn.T + pose.shift_m))
        white = share_of_white(rays, pose, columns, rows, square_mm * 1e-3, lens).ravel()
        lit = np.flatnonzero(white > 1e-3)
        for _ in range(blinks):
            for begin_us, on, threshold in ((start_us, True, up[lit]), (start_us + half_us, False, down[lit])):
                t_us, which = _flash(white[lit], threshold, on, sensor)
                late = sensor.delay_us + sensor.jitter_us * random.standard_normal(t_us.size)
                times = np.floor(begin_us + t_us + np.maximum(late, 0.0)).astype(np.int64)
                y, x = np.divmod(lit[which], camera.width_px)
                zeros = np.zeros(times.size, np.uint8)
                batch = EventBatch(times, x.astype(np.uint16), y.astype(np.uint16), np.full(times.size, on))
                parts.append(LabelledEvents(batch, zeros, zeros))
            start_us += 2 * half_us
    duration_us = round(start_us)
    still = noise(sensor, np.full(pixels, BLACK), duration_us, camera.width_px, random, random)
    return SimulatedBoard(read_out([*parts, still], sensor, duration_us, random).events, camera, np.array(corners))


def share_of_white(rays: Floats, pose: BoardPose, columns: int, rows: int, square_m: float, lens: Lens) -> Floats:
    """(height, width) share of each pixel's light that comes from white squares and margin, blurred by the lens.

    Between the pixels, rays (height, width, 3) change evenly.
    """
    from scipy.ndimage import gaussian_filter

    turn = rotations(np.array(pose.turn_rad))[0]
    shift = np.array(pose.shift_m)
    down, right = np.gradient(rays, axis=(0, 1))
    white = np.zeros(rays.shape[:2])
    looks = (np.arange(FINER) + 0.5) / FINER - 0.5
    for dx, dy in itertools.product(looks, looks):
        seen = rays + dx * right + dy * down
        depth = (shift @ turn[:, 2]) / (seen @ turn[:, 2])
        on_board = (seen * depth[..., None] - shift) @ turn[:, :2] / square_m
        u, v = np.moveaxis(np.floor(on_board + 1.0), -1, 0)  # squares from the outer corner
        inside = (u >= 0) & (v >= 0) & (u <= columns) & (v <= rows) & (depth > 0)
        margin = (u >= -1) & (v >= -1) & (u <= columns + 1) & (v <= rows + 1) & (depth > 0) & ~inside
        white += margin | (inside & ((u + v) % 2 == 1))
    return np.asarray(gaussian_filter(white / FINER**2, lens.blur_px), np.float64)


def _flash(white: Floats, threshold: Floats, on: bool, sensor: SensorModel) -> tuple[Floats, NDArray[np.int64]]:
    """Times (n,) in us after the screen begins to change, and pixels (n,) of the events; on: from dark to bright.

    The light is BLACK + white (1 - exp(-t / tau)) or BLACK + white exp(-t / tau), with the screen's tau and the
    pixel's together.
    """
    tau_us = SCREEN_TAU_US + sensor.tau_us
    times, pixels = [], []
    alive = np.arange(white.size)
    reference = np.log(BLACK + (0.0 if on else 1.0) * white)
    free_us = np.zeros(white.size)
    for _ in range(MOST_EVENTS):
        target = np.exp(reference[alive] + (threshold[alive] if on else -threshold[alive]))
        left = (target - BLACK) / white[alive]  # share of the change that is bright
        left = 1 - left if on else left
        crosses = left > 0
        alive, left = alive[crosses], left[crosses]
        if not alive.size:
            break
        when = np.maximum(-tau_us * np.log(np.minimum(left, 1.0)), free_us[alive])
        times.append(when)
        pixels.append(alive)
        free_us[alive] = when + sensor.dead_us
        change = np.exp(-free_us[alive] / tau_us)
        bright = 1 - change if on else change
        reference[alive] = np.log(BLACK + white[alive] * bright)
    if not times:
        return np.empty(0), np.empty(0, np.int64)
    return np.concatenate(times), np.concatenate(pixels)


def drawn_poses(
    count: int, *, camera: Camera, columns: int = 9, rows: int = 6, square_mm: float = 20.0, seed: int = 0
) -> list[BoardPose]:
    """Poses with the whole board and its margin in view, tilted by up to 40 degrees, the image's corners among them."""
    random = np.random.default_rng([seed, 10])
    half = np.array([columns - 1, rows - 1]) / 2 * square_mm * 1e-3
    outer = np.array([(x, y, 0.0) for x in (-2, columns + 1) for y in (-2, rows + 1)]) * square_mm * 1e-3
    poses: list[BoardPose] = []
    targets = [(0.02, 0.02), (0.98, 0.02), (0.02, 0.98), (0.98, 0.98)]
    while len(poses) < count:
        turn_rad = math.radians(40.0) * random.uniform(-1, 1, 3) * (1.0, 1.0, 0.3)
        turn = rotations(turn_rad)[0]
        distance_m = float(random.uniform(1.6, 3.2)) * 2 * half[0] * camera.focal_px / camera.width_px
        # The board's middle is drawn over the image; every second pose is pushed towards a corner until it touches.
        corner = len(poses) % 2 == 0
        target = np.array(targets[len(poses) // 2 % 4]) if corner else random.uniform(0.2, 0.8, 2)
        for pull in np.linspace(1.0, 0.0, 40):
            place = (0.5 + pull * (target - 0.5)) * (camera.width_px, camera.height_px)
            middle = camera.rays(*(place[:, None]))[0] * distance_m
            shift = middle - turn @ np.append(half, 0.0)
            seen = camera.project(outer @ turn.T + shift)
            if np.all(seen >= 2) and np.all(seen < np.array([camera.width_px, camera.height_px]) - 3):
                poses.append(BoardPose(tuple(turn_rad), tuple(shift)))
                break
    return poses
