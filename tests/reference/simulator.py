"""Slow, obvious twins of the simulator's kernels: one pixel in tiny steps, one picture ray by ray."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from spinscope.pipeline.camera import Camera
from spinscope.pipeline.simulator.kernels_light import Physics
from spinscope.pipeline.simulator.logos import _drawing
from spinscope.pipeline.simulator.scene import Ball, Light

Floats = NDArray[np.float64]


def naive_pixel(
    knots_us: Floats, light: Floats, physics: Physics, threshold_on: float, threshold_off: float
) -> list[tuple[float, bool]]:
    """(time, on) of the events of a pixel whose log intensity runs through these knots, in steps of 0.1 us."""
    step = 0.1
    now, signal, reference = knots_us[0], light[0], light[0]
    free, off_from = -math.inf, -math.inf
    events = []
    while now < knots_us[-1]:
        now += step
        here = float(np.interp(now, knots_us, light))
        tau = physics.tau_us + physics.dark_tau_us / math.exp(here)
        signal += (here - signal) * (1 - math.exp(-step / tau))
        if now <= free:
            reference = signal
            continue
        on = signal - reference >= threshold_on
        off = signal - reference <= -threshold_off and now >= off_from
        if on or off:
            events.append((now, on))
            reference, free = signal, now + physics.refractory_us
            if on:
                off_from = now + physics.off_after_on_us
    return events


def naive_picture(
    camera: Camera,
    ball: Ball,
    centre_m: Floats,
    rotation: Floats,
    light: Light,
    background: float,
    sigma_px: float,
    columns: range,
    rows: range,
) -> Floats:
    """(rows, columns) float64 intensity: rays through the pixels' area, blurred by a Gaussian of sigma_px."""
    fine = 12  # rays along a pixel
    margin = math.ceil(4 * sigma_px)
    offset = (np.arange(fine) + 0.5) / fine - 0.5
    x = (np.arange(columns.start - margin, columns.stop + margin)[:, None] + offset).ravel()
    y = (np.arange(rows.start - margin, rows.stop + margin)[:, None] + offset).ravel()
    grid_x, grid_y = np.meshgrid(x, y)
    rays = camera.rays(grid_x.ravel(), grid_y.ravel())
    along = rays @ centre_m
    length2 = np.sum(rays**2, axis=1)
    inside = along**2 - length2 * (centre_m @ centre_m - ball.radius_m**2)
    hit = inside > 0
    far = (along - np.sqrt(np.where(hit, inside, 0))) / length2
    normal = (far[:, None] * rays - centre_m) / ball.radius_m
    lift = -normal[:, 2]
    shade = light.sky * (1 + lift) / 2 + (1 - light.sky) * np.maximum(lift, 0) + light.bounce * (1 - lift) / 2
    b = normal @ rotation  # rows times (ball -> camera) = camera -> ball
    angle = np.arccos(np.clip(b[:, 2], -1, 1))
    around = np.arctan2(b[:, 1], b[:, 0])
    drawing, _ = _drawing(ball.logo)
    surface_mm = angle * 20.0
    ink = drawing(surface_mm * np.cos(around), surface_mm * np.sin(around)) < 0
    value = np.where(hit, shade * np.where(ink, ball.ink_albedo, ball.albedo), background)
    picture = value.reshape(grid_x.shape)
    reach = math.ceil(4 * sigma_px * fine)
    bell = np.exp(-0.5 * (np.arange(-reach, reach + 1) / fine / sigma_px) ** 2)
    bell /= bell.sum()
    for axis in (0, 1):
        picture = np.apply_along_axis(np.convolve, axis, picture, bell, mode="same")
    boxes = picture.reshape(len(rows) + 2 * margin, fine, len(columns) + 2 * margin, fine).mean(axis=(1, 3))
    result: Floats = boxes[margin:-margin, margin:-margin]
    return result
