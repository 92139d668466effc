"""Images of the ball from a frame camera beside the event camera, with the blur of the exposure."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import erfc

from ..camera import Camera
from ..simulator import Lens, Light, Scene, default_camera
from ..simulator.background import intensity_map
from ..simulator.logos import RADIUS_MM, Texture, texture
from ..simulator.motion import Trajectory, trajectory

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class FrameCamera:
    """The paper's frame camera (sections 4.1 and 4.3): the event camera's view at 1.5 times its resolution."""

    rate_hz: float = 380.0  # that of the state of the art's setup (Tebbe 2020)
    resolution: float = 1.5  # over the event camera's
    exposure_us: float = 500.0  # not published; ours lets a ball of 50 rps turn by 9 degrees
    white_snr: float = 100.0  # 100 (40 dB) is usual for a full well of 10,000 electrons and more
    levels: int = 256  # of the quantisation

    @cached_property
    def camera(self) -> Camera:
        """Its geometry."""
        of = default_camera()
        width, height = round(of.width_px * self.resolution), round(of.height_px * self.resolution)
        focal_px = of.focal_px * self.resolution
        return Camera(width, height, focal_px, (width - 1) / 2, (height - 1) / 2, of.distortion, of.up)


@dataclass(frozen=True, eq=False)
class Frame:
    """The part of a frame around the ball, (side, side) pixels from (x0_px, y0_px) on."""

    t_s: float  # middle of the exposure
    image: Floats  # white = 1
    background: Floats
    x0_px: int
    y0_px: int


def frames(scene: Scene, of: FrameCamera, seed: int) -> Iterator[Frame]:
    """The frames with the whole part around the scene's first ball in view, in order of time."""
    random = np.random.default_rng([seed, 8])
    camera = of.camera
    ball = scene.balls[0]
    flown = trajectory(ball.motions[0], ball, scene)
    backdrop = intensity_map(scene, camera).reshape(camera.height_px, camera.width_px)
    exposure_s = of.exposure_us * 1e-6
    for number in range(int(scene.duration_s * of.rate_hz)):
        t_s = number / of.rate_hz + exposure_s / 2
        x, y, radius = (float(v[0]) for v in camera.silhouette(flown.at([t_s]).position_m, ball.radius_m))
        half = math.ceil(1.6 * radius + 4)
        x0, y0 = round(x) - half, round(y) - half
        if x0 < 0 or y0 < 0 or x0 + 2 * half > camera.width_px or y0 + 2 * half > camera.height_px:
            continue
        background = backdrop[y0 : y0 + 2 * half, x0 : x0 + 2 * half]
        image = _exposed(scene, flown, camera, t_s, exposure_s, background, x0, y0)
        image = image + np.sqrt(np.maximum(image, 1e-3)) / of.white_snr * random.standard_normal(image.shape)
        image = np.clip(np.rint(image * (of.levels - 1)) / (of.levels - 1), 0.0, 1.0)
        yield Frame(t_s, image, background, x0, y0)


def _exposed(
    scene: Scene, flown: Trajectory, camera: Camera, t_s: float, exposure_s: float, background: Floats, x0: int, y0: int
) -> Floats:
    """The mean over the exposure, in steps in which nothing moves by more than half a pixel."""
    ball = scene.balls[0]
    pose = flown.at(np.array([t_s]))
    turning = 2 * math.pi * ball.radius_m * float(np.linalg.norm(pose.spin_rps))
    speed = float(np.linalg.norm(pose.velocity_m_s)) + turning
    distance_m = float(pose.position_m[0, 2])
    steps = max(1, math.ceil(speed * exposure_s * camera.focal_px / distance_m / 0.5))
    times = t_s + exposure_s * ((np.arange(steps) + 0.5) / steps - 0.5)
    rays = pixel_rays(camera, x0, y0, background.shape[0])
    sigma_px = math.hypot(float(Lens().sigma_px(np.array([distance_m]), camera.focal_px)[0]), math.sqrt(1 / 12))
    blur_mm = sigma_px * distance_m / camera.focal_px * RADIUS_MM / ball.radius_m
    printed = None if ball.logo.name == "none" else texture(ball.logo, round(blur_mm, 2))
    poses = flown.at(times)
    total = np.zeros(background.size)
    for centre, turn in zip(poses.position_m, poses.rotation, strict=True):
        cover, normals = _seen(rays, centre, ball.radius_m, sigma_px / camera.focal_px)
        printing = 0.0 if printed is None else _print_at(printed, normals @ turn)
        albedo = ball.albedo + printing * (ball.ink_albedo - ball.albedo)
        total += background.ravel() * (1 - cover) + cover * albedo * _shade(scene.light, normals @ np.array(scene.up))
    return (total / steps).reshape(background.shape)


def pixel_rays(camera: Camera, x0_px: int, y0_px: int, side: int) -> Floats:
    """(side * side, 3) rays through the pixels of a square part of the image."""
    column, row = np.meshgrid(np.arange(x0_px, x0_px + side), np.arange(y0_px, y0_px + side))
    return camera.rays(column.ravel(), row.ravel())


def sphere_along(rays: Floats, centre_m: Floats, radius_m: float) -> tuple[Floats, Floats, Floats]:
    """Intersection of rays (n, 3) with a sphere: part along its centre, discriminant (> 0 on the disc), normals.

    Beside the disc the normals (n, 3) are those of the limb.
    """
    along, length2 = rays @ centre_m, np.sum(rays**2, axis=1)
    inside = along**2 - length2 * (float(centre_m @ centre_m) - radius_m**2)
    normals = ((along - np.sqrt(np.maximum(inside, 0.0))) / length2)[:, None] * rays - centre_m
    return along, inside, normals / np.linalg.norm(normals, axis=1)[:, None]


def _seen(rays: Floats, centre: Floats, radius_m: float, sigma: float) -> tuple[Floats, Floats]:
    """(n,) cover 0..1 of a ball along rays, and (n, 3) its normals there (beside it those of its limb)."""
    along, inside, normals = sphere_along(rays, centre, radius_m)
    spare = float(centre @ centre) - radius_m**2
    slope = np.hypot(*(2 * (along * centre[i] - rays[:, i] * spare) for i in (0, 1)))
    return 0.5 * erfc(-inside / (slope * sigma * math.sqrt(2))), normals


def _shade(light: Light, lift: Floats) -> Floats:
    """Brightness of a matte surface whose normal points up by `lift`: the simulator's soft light from above."""
    return light.sky * 0.5 * (1 + lift) + (1 - light.sky) * np.maximum(lift, 0.0) + light.bounce * 0.5 * (1 - lift)


def _print_at(printed: Texture, there: Floats) -> Floats:
    """(n,) texture values at directions (n, 3) in the ball's own frame, the nearest texel's (each is 0.06 mm)."""
    z = np.maximum(there[:, 2], -0.999)
    last = printed.values.shape[0] - 1
    place = (there[:, :2] * (np.sqrt(2 / (1 + z)) / printed.half_extent)[:, None] + 1) * 0.5 * last
    texel = np.clip(np.rint(place), 0, last).astype(np.intp)
    printing: Floats = printed.values[texel[:, 1], texel[:, 0]].astype(np.float64)
    printing[(z < math.cos(printed.cap_rad)) | np.any((place < 0) | (place > last), axis=1)] = 0.0
    return printing
