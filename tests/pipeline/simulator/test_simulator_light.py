"""The picture against rays: outline, shading and logo."""

from __future__ import annotations

import math

import numpy as np
import pytest

from spinscope.pipeline.camera import Camera, CameraParameters
from spinscope.pipeline.simulator import kernels_light as columns
from spinscope.pipeline.simulator.bodies import BallBody
from spinscope.pipeline.simulator.logos import NAMES, SPOTS_MM, Logo, texture
from spinscope.pipeline.simulator.motion import matrix_of
from spinscope.pipeline.simulator.scene import Ball, Fixed, Light, Scene
from spinscope.pipeline.simulator.sensor import Lens
from tests.pipeline.simulator.test_simulator_pixel import IDEAL
from tests.reference.simulator import naive_picture

CAMERA = Camera.of(CameraParameters(), 1280, 720)
BACKGROUND = 0.12


def picture(ball: Ball, lens: Lens) -> tuple[np.ndarray, np.ndarray, range, range]:
    """(intensity, cover) of a fixed ball around its outline, and where."""
    scene = Scene(0.01, (ball,))
    body = BallBody(scene, 0).packed(CAMERA, lens, np.array([0.0, 0.001]), 1, 1)
    x0, y0, x1, y1 = (int(v) for v in body.box[0])
    physics = IDEAL._replace(focal_px=CAMERA.focal_px, width_px=CAMERA.width_px)
    pose, kind, texture = body.pose[:, None], body.kind[None], body.texture[None]
    intensity, cover = np.empty((y1 - y0, x1 - x0)), np.empty((y1 - y0, x1 - x0))
    for y in range(y0, y1):
        rays = CAMERA.rays(np.arange(x0, x1), np.full(x1 - x0, y))
        for x in range(x0, x1):
            part, value, _, _ = columns.ball_light(texture, kind, pose, 0, 0, physics, rays[x - x0, 0], rays[x - x0, 1])
            cover[y - y0, x - x0] = part
            intensity[y - y0, x - x0] = BACKGROUND + part * (value - BACKGROUND)
    return intensity, cover, range(x0, x1), range(y0, y1)


def fixed(position_m, quaternion, logo="andro") -> Ball:
    return Ball((Fixed(0.0, 0.01, position_m, (0.0, 0.0, 0.0), quaternion),), logo=Logo(logo))


FACING = (0.0, 1.0, 0.0, 0.0)  # the logo's side, +z of the ball, turned to the camera
ASIDE = (0.3, 0.8, 0.4, 0.2)


@pytest.mark.parametrize("position_m", [(0.0, 0.0, 2.0), (0.6, -0.35, 1.7), (-0.2, 0.15, 1.2)])
def test_the_outline_is_the_cameras_silhouette(position_m):
    _, cover, columns_, rows = picture(fixed(position_m, FACING, "none"), Lens())
    x_px, y_px, radius_px = CAMERA.silhouette(position_m, 0.02)
    assert cover.sum() == pytest.approx(math.pi * radius_px[0] ** 2, rel=3e-3)
    assert (cover.sum(axis=0) * columns_).sum() / cover.sum() == pytest.approx(x_px[0], abs=0.02)
    assert (cover.sum(axis=1) * rows).sum() / cover.sum() == pytest.approx(y_px[0], abs=0.02)


@pytest.mark.parametrize("logo", ["andro", "double_circle", "line_1.4mm", "none"])
@pytest.mark.parametrize("quaternion", [FACING, ASIDE])
@pytest.mark.parametrize("lens", [Lens(), Lens(focus_m=0.7)], ids=["sharp", "defocus"])
def test_same_picture_as_many_rays(logo, quaternion, lens):
    position = (0.31, -0.2, 1.75)
    ball = fixed(position, quaternion, logo)
    intensity, _, columns_, rows = picture(ball, lens)
    sigma = float(lens.sigma_px(np.array([1.75]), CAMERA.focal_px)[0])
    rays = naive_picture(
        CAMERA, ball, np.array(position), matrix_of(quaternion), Light(), BACKGROUND, sigma, columns_, rows
    )
    error = intensity - rays
    assert np.sqrt(np.mean(error**2)) < 0.012
    assert np.abs(error).max() < 0.16  # strokes seen at a slant near the rim: nine samples do not catch all
    assert abs(error.mean()) < 2e-3


def test_looks_are_left_out_only_where_nothing_changes():
    """A pixel told to rest for n looks must not change by more than the shading does until then."""
    spin = 60.0
    ball = Ball((Fixed(0.0, 0.01, (0.0, 0.0, 1.8), (spin, 20.0, 10.0), ASIDE),))
    step_s = 0.25 / (2 * math.pi * spin * 1.1 * 0.02 * CAMERA.focal_px / 1.78)
    body = BallBody(Scene(0.01, (ball,)), 0).packed(CAMERA, Lens(), np.arange(40) * step_s, 1, 8)
    physics = IDEAL._replace(focal_px=CAMERA.focal_px, width_px=CAMERA.width_px)
    pose, kind, texture = body.pose[:, None], body.kind[None], body.texture[None]
    for y in range(int(body.box[0, 1]), int(body.box[0, 3])):
        for x in range(int(body.box[0, 0]), int(body.box[0, 2])):
            ray = CAMERA.rays(x, y)[0]
            _, value, plain, looks = columns.ball_light(texture, kind, pose, 0, 0, physics, ray[0], ray[1])
            if looks < 2:
                continue
            row = min(int(looks) - 1, 39)
            _, later, _, _ = columns.ball_light(texture, kind, pose, 0, row, physics, ray[0], ray[1])
            assert value == plain
            assert abs(later - value) < 0.01


@pytest.mark.parametrize("name", NAMES)
def test_logos_keep_their_strokes(name):
    drawn = texture(Logo(name))
    side = drawn.values.shape[0]
    row = drawn.values[side // 2]
    width_mm = row.sum() * 2 * drawn.half_extent / (side - 1) * 20.0
    if name.startswith("line"):
        column = drawn.values[:, side // 2].sum() * 2 * drawn.half_extent / (side - 1) * 20.0
        assert column == pytest.approx(float(name[5:8]), abs=0.1)
        assert width_mm == pytest.approx(26.0 + float(name[5:8]), rel=0.03)
    elif name == "double_circle":
        assert width_mm == pytest.approx(4 * 0.6, abs=0.15)
    elif name == "none":
        assert not drawn.values.any()
    else:
        area_mm2 = drawn.values.sum() * (2 * drawn.half_extent / (side - 1) * 20.0) ** 2
        # On the sphere a circle around the logo's centre is shorter than in the plane.
        spots_mm2 = sum(math.pi * r**2 * np.sinc(math.hypot(a, b) / 20.0 / math.pi) for a, b, r in SPOTS_MM)
        low, high = {"seam": (49, 52), "marks": (0.97 * spots_mm2, 1.03 * spots_mm2)}.get(name, (60, 140))
        assert low < area_mm2 < high
