"""Balls and arms in the kernels' form: their times in the image, largest speeds and poses."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from . import kernels_light as columns
from .logos import RADIUS_MM, texture
from .motion import Trajectory, arm_ends, trajectory
from .scene import Arm, Ball, Scene
from .sensor import Lens

Floats = NDArray[np.float64]
Spans = list[tuple[float, float]]

PIXEL_VARIANCE_PX2 = 1 / 12  # of a square pixel's own area
TEXTURE_SHARE = 0.6  # of the blur's sigma goes into the texture, the rest into samples around the pixel
ARM_PIECE = 0.05  # of a swing's period: its speed is taken as constant
LOOK_S = 1e-3  # a ball of 30 m/s moves 30 mm in this time, less than its width


class BallBody:
    """A ball of a scene."""

    def __init__(self, scene: Scene, number: int) -> None:
        self.scene, self.number = scene, number
        self.ball: Ball = scene.balls[number]

    @cached_property
    def trajectories(self) -> list[Trajectory]:
        """Trajectories of the ball, one a motion."""
        return [trajectory(motion, self.ball, self.scene) for motion in self.ball.motions]

    def visible(self, camera: Camera, end_s: float) -> Spans:
        """Spans of time in which some of the ball may be in the image."""
        spans: Spans = []
        for one in self.trajectories:
            start, stop = max(one.start_s, 0.0), min(one.end_s, end_s)
            if start >= stop:
                continue
            time = np.linspace(start, stop, max(math.ceil((stop - start) / LOOK_S), 1) + 1)
            box = self._box(camera, one.at(time).position_m, margin_px=40.0)
            seen = np.flatnonzero((box[:, 2] > box[:, 0]) & (box[:, 3] > box[:, 1]))
            if seen.size:
                first, last = max(seen[0] - 1, 0), min(seen[-1] + 1, time.size - 1)
                spans.append((float(time[first]), float(time[last])))
        return spans

    def speeds_px_s(self, camera: Camera, start_s: float, stop_s: float) -> tuple[float, float]:
        """Largest speeds of the outline and of the ball's surface in the image."""
        outline, surface = 0.0, 0.0
        for one in self.trajectories:
            inside = (one.time_s >= start_s - LOOK_S) & (one.time_s <= stop_s + LOOK_S)
            if one.start_s > stop_s or one.end_s < start_s or not inside.any():
                if not one.start_s <= start_s <= one.end_s:
                    continue
                inside[:] = True
            speed = np.linalg.norm(one.velocity_m_s[inside], axis=1)
            turn = 2 * np.pi * self.ball.radius_m * np.linalg.norm(one.spin_rps[inside], axis=1)
            turn *= self.ball.logo.name != "none"
            scale = camera.focal_px / np.maximum(one.position_m[inside, 2] - self.ball.radius_m, 1e-3)
            outline = max(outline, float(np.max(speed * scale)))
            surface = max(surface, float(np.max((speed + turn) * scale)))
        return outline, surface

    def distance_m(self, time_s: float) -> float:
        """Depth of the centre."""
        return float(self._trajectory_at(time_s).at([time_s]).position_m[0, 2])

    def _trajectory_at(self, time_s: float) -> Trajectory:
        there = (one for one in self.trajectories if one.start_s <= time_s <= one.end_s)
        return next(there, self.trajectories[-1])

    def packed(self, camera: Camera, lens: Lens, time_s: Floats, every: int, slower: int) -> columns.Bodies:
        """The ball alone at these times, looked at in every so many of them; slower: see `kernels_light`."""
        there = self._trajectory_at(float(time_s[time_s.size // 2])).at(time_s)
        pose = np.empty((time_s.size, columns.POSE_COLUMNS))
        pose[:, columns.CENTRE : columns.CENTRE + 3] = there.position_m
        pose[:, columns.TURN : columns.TURN + 9] = np.swapaxes(there.rotation, 1, 2).reshape(-1, 9)
        pose[:, columns.SIGMA] = sigma = _sigma_px(camera, lens, there.position_m[:, 2])
        # The texture's own blur: one for the ball's whole time, so that it is drawn once.
        far = float(np.median(np.concatenate([one.position_m[:, 2] for one in self.trajectories])))
        typical = float(_sigma_px(camera, lens, np.array([far]))[0])
        blur_mm = TEXTURE_SHARE * typical * far / camera.focal_px * 1e3 * RADIUS_MM / (self.ball.radius_m * 1e3)
        printed = texture(self.ball.logo, round(blur_mm, 2))
        kind = np.zeros(columns.BODY_COLUMNS)
        kind[[columns.KIND, columns.OWNER, columns.EVERY, columns.SLOWER]] = columns.BALL, self.number, every, slower
        kind[columns.RADIUS] = self.ball.radius_m
        kind[[columns.ALBEDO, columns.ALBEDO_2]] = self.ball.albedo, self.ball.ink_albedo
        kind[[columns.HALF_EXTENT, columns.TEXELS]] = printed.half_extent, printed.values.shape[0]
        kind[columns.CAP_COSINE] = 2.0 if self.ball.logo.name == "none" else math.cos(printed.cap_rad)
        kind[[columns.EXTENT_X, columns.EXTENT_Y]] = printed.extent_u, printed.extent_w
        kind[columns.SAMPLE] = math.sqrt(3 * (1 - TEXTURE_SHARE**2)) * typical
        box = self._box(camera, there.position_m, 4 * float(sigma.max()) + 1.0)
        return columns.Bodies(pose, box, kind, printed.values)

    def _box(self, camera: Camera, position_m: Floats, margin_px: float) -> NDArray[np.int32]:
        x, y, _ = camera.silhouette(position_m, self.ball.radius_m)
        distance2 = np.sum(position_m**2, axis=1)
        sin2 = self.ball.radius_m**2 / distance2
        q = position_m[:, 2] ** 2 / distance2 - sin2
        half = camera.focal_px * np.sqrt(sin2 * (1 - sin2)) / q + margin_px  # the longer semi-axis
        if any(camera.distortion):
            half = 1.3 * half + 2.0  # more than a usable lens stretches a ball at the border
        return _clipped(x - half, y - half, x + half, y + half, camera)


class ArmBody:
    """The scene's arm, seen all the time."""

    def __init__(self, scene: Scene, number: int) -> None:
        assert scene.arm is not None
        self.arm: Arm = scene.arm
        self.number = number

    def visible(self, camera: Camera, end_s: float) -> Spans:
        """The whole time, for the arm may come and go, in pieces in which its speed changes little."""
        edges = np.linspace(0.0, end_s, max(math.ceil(end_s * self.arm.frequency_hz / ARM_PIECE), 1) + 1)
        return list(zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True))

    def speeds_px_s(self, camera: Camera, start_s: float, stop_s: float) -> tuple[float, float]:
        """Largest speeds of elbow and hand in the image."""
        arm = self.arm
        turn = 2 * math.pi * arm.frequency_hz
        swing = np.abs(np.cos(turn * np.linspace(start_s, stop_s, 9) + arm.phase_rad)).max()
        speed = arm.length_m * arm.swing_rad * turn * float(swing)
        near = min(arm.elbow_m[2], arm.elbow_m[2] - arm.length_m) - arm.radius_elbow_m
        speed *= camera.focal_px / max(near, 0.1)
        return 0.0, speed

    def distance_m(self, time_s: float) -> float:
        """Mean depth of elbow and hand."""
        elbow, hand = arm_ends(self.arm, [time_s])
        return float(elbow[0, 2] + hand[0, 2]) / 2

    def packed(self, camera: Camera, lens: Lens, time_s: Floats, every: int, slower: int) -> columns.Bodies:
        """The arm alone at these times, looked at in every so many of them; slower: see `kernels_light`."""
        arm = self.arm
        pose = np.zeros((time_s.size, columns.POSE_COLUMNS))
        low, high = [], []
        for column, place, radius in zip(
            (0, 3), arm_ends(arm, time_s), (arm.radius_elbow_m, arm.radius_hand_m), strict=True
        ):
            image, radius_px = camera.project(place), radius * camera.focal_px / place[:, 2]
            pose[:, column : column + 2], pose[:, column + 2] = image, radius_px
            low.append(image - radius_px[:, None])
            high.append(image + radius_px[:, None])
        distance_m = self.distance_m(float(time_s[time_s.size // 2]))
        pose[:, columns.SIGMA] = sigma = _sigma_px(camera, lens, np.array([distance_m]))[0]
        kind = np.zeros(columns.BODY_COLUMNS)
        kind[[columns.KIND, columns.OWNER, columns.EVERY, columns.SLOWER]] = columns.ARM, self.number, every, slower
        kind[[columns.ALBEDO, columns.ALBEDO_2]] = arm.sleeve_albedo, arm.hand_albedo
        first, last = np.minimum(*low) - 4 * sigma - 1, np.maximum(*high) + 4 * sigma + 1
        box = _clipped(first[:, 0], first[:, 1], last[:, 0], last[:, 1], camera)
        return columns.Bodies(pose, box, kind, np.zeros((2, 2), np.float32))


def _sigma_px(camera: Camera, lens: Lens, distance_m: Floats) -> Floats:
    """Blur of an outline: the lens and the pixel's own area."""
    return np.sqrt(lens.sigma_px(distance_m, camera.focal_px) ** 2 + PIXEL_VARIANCE_PX2)


def _clipped(x0: Floats, y0: Floats, x1: Floats, y1: Floats, camera: Camera) -> NDArray[np.int32]:
    """(n, 4) int32 boxes inside the image, the ends not included; empty outside."""
    box = np.stack([np.floor(x0), np.floor(y0), np.ceil(x1) + 1, np.ceil(y1) + 1], axis=1)
    return np.asarray(np.clip(box, 0, 2 * [camera.width_px, camera.height_px]), np.int32)


def bodies_of(scene: Scene) -> list[BallBody | ArmBody]:
    """The scene's balls in their order, then the arm."""
    bodies: list[BallBody | ArmBody] = [BallBody(scene, number) for number in range(len(scene.balls))]
    if scene.arm is not None:
        bodies.append(ArmBody(scene, len(scene.balls)))
    return bodies
