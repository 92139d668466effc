"""Balls, arms, shadows and nets in the kernels' form: their times in the image, largest speeds and poses."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..camera import Camera
from . import kernels_light as columns
from .logos import RADIUS_MM, texture
from .motion import Trajectory, arm_ends, seen, shake_speed_px_s, shake_turns, tape_at, trajectory
from .scene import Arm, Ball, Scene
from .sensor import Lens

Floats = NDArray[np.float64]
Spans = list[tuple[float, float]]

PIXEL_VARIANCE_PX2 = 1 / 12  # of a square pixel's own area
TEXTURE_SHARE = 0.6  # of the blur's sigma goes into the texture, the rest into samples around the pixel
CAPSULE_PIECE_S = 0.02  # the speed of what swings about once a second is taken as constant
TAPE_PIECES = 6  # of a net's tape, straight each: a sine's half wave to 4 % of its height
TAPE_RADIUS_M, CORD_RADIUS_M = 0.0075, 0.0007  # rules of table tennis; a usual net's cords
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
            there = seen(one.at(time), self.scene.shake, camera.focal_px)
            box = self._box(camera, there.position_m, margin_px=40.0)
            inside = np.flatnonzero((box[:, 2] > box[:, 0]) & (box[:, 3] > box[:, 1]))
            if inside.size:
                first, last = max(inside[0] - 1, 0), min(inside[-1] + 1, time.size - 1)
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
        shake = shake_speed_px_s(self.scene.shake)
        return outline + shake, surface + shake

    def distance_m(self, time_s: float) -> float:
        """Depth of the centre."""
        return float(self._trajectory_at(time_s).at([time_s]).position_m[0, 2])

    def _trajectory_at(self, time_s: float) -> Trajectory:
        there = (one for one in self.trajectories if one.start_s <= time_s <= one.end_s)
        return next(there, self.trajectories[-1])

    def packed(self, camera: Camera, lens: Lens, time_s: Floats, every: int, slower: int) -> columns.Bodies:
        """The ball alone at these times, looked at in every so many of them; slower: see `kernels_light`."""
        there = self._trajectory_at(float(time_s[time_s.size // 2])).at(time_s)
        there = seen(there, self.scene.shake, camera.focal_px)
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
        kind[columns.SIDES] = self.ball.logo.sides
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


class CapsuleBody:
    """A body between two ends, seen all the time: the base of arms, shadows and parts of a net.

    Attributes
    ----------
    radii_m, albedos : (float, float)
        At the first and the second end; an arm's sleeve and hand.
    opacity : float
        Share of the light behind that it hides.
    """

    radii_m = (0.01, 0.01)
    albedos = (0.0, 0.0)
    opacity = 1.0

    def __init__(self, scene: Scene, number: int) -> None:
        self.scene, self.number = scene, number

    def ends(self, time_s: ArrayLike) -> tuple[Floats, Floats]:
        """(n, 3) places of the ends in the scene."""
        raise NotImplementedError

    def visible(self, camera: Camera, end_s: float) -> Spans:
        """The whole time, for it may come and go, in pieces in which its speed changes little."""
        edges = np.linspace(0.0, end_s, max(math.ceil(end_s / CAPSULE_PIECE_S), 1) + 1)
        return list(zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True))

    def speeds_px_s(self, camera: Camera, start_s: float, stop_s: float) -> tuple[float, float]:
        """Smallest and largest speeds in the image."""
        time = np.linspace(start_s, stop_s, 9)
        speeds = []
        for place in self.ends(time):
            speed = np.linalg.norm(np.diff(place, axis=0), axis=1).max() * 8 / max(stop_s - start_s, 1e-9)
            speeds.append(speed * camera.focal_px / max(place[:, 2].min() - max(self.radii_m), 0.1))
        shake = shake_speed_px_s(self.scene.shake)
        return 0.0, float(max(speeds)) + shake

    def distance_m(self, time_s: float) -> float:
        """Mean depth of the ends."""
        first, second = self.ends([time_s])
        return float(first[0, 2] + second[0, 2]) / 2

    def softness_m(self, time_s: Floats) -> Floats:
        """Sigma of a blur of the outline beside the lens's."""
        return np.zeros(time_s.size)

    def packed(self, camera: Camera, lens: Lens, time_s: Floats, every: int, slower: int) -> columns.Bodies:
        """The body alone at these times, looked at in every so many of them; slower: see `kernels_light`."""
        pose = np.zeros((time_s.size, columns.POSE_COLUMNS))
        low, high = [], []
        turn = shake_turns(self.scene.shake, time_s, camera.focal_px)
        for column, place, radius in zip((0, 3), self.ends(time_s), self.radii_m, strict=True):
            there = np.einsum("nij,nj->ni", turn, place)
            image, radius_px = camera.project(there), radius * camera.focal_px / there[:, 2]
            pose[:, column : column + 2], pose[:, column + 2] = image, radius_px
            low.append(image - radius_px[:, None])
            high.append(image + radius_px[:, None])
        distance_m = self.distance_m(float(time_s[time_s.size // 2]))
        sharp = _sigma_px(camera, lens, np.array([distance_m]))[0]
        pose[:, columns.SIGMA] = np.hypot(sharp, self.softness_m(time_s) * camera.focal_px / distance_m)
        sigma = float(pose[:, columns.SIGMA].max())
        kind = np.zeros(columns.BODY_COLUMNS)
        kind[[columns.KIND, columns.OWNER, columns.EVERY, columns.SLOWER]] = columns.CAPSULE, self.number, every, slower
        kind[[columns.ALBEDO, columns.ALBEDO_2]] = self.albedos
        kind[columns.OPACITY] = self.opacity
        first, last = np.minimum(*low) - 4 * sigma - 1, np.maximum(*high) + 4 * sigma + 1
        box = _clipped(first[:, 0], first[:, 1], last[:, 0], last[:, 1], camera)
        return columns.Bodies(pose, box, kind, np.zeros((2, 2), np.float32))


class ArmBody(CapsuleBody):
    """The scene's arm."""

    def __init__(self, scene: Scene, number: int) -> None:
        super().__init__(scene, number)
        assert scene.arm is not None
        self.arm: Arm = scene.arm
        self.radii_m = self.arm.radius_elbow_m, self.arm.radius_hand_m
        self.albedos = self.arm.sleeve_albedo, self.arm.hand_albedo

    def ends(self, time_s: ArrayLike) -> tuple[Floats, Floats]:
        """(n, 3) places of elbow and hand."""
        return arm_ends(self.arm, time_s)


class ShadowBody(CapsuleBody):
    """The shadow of a ball on the table: a disc with a soft edge that takes a share of the light away."""

    def __init__(self, scene: Scene, number: int, ball: int) -> None:
        super().__init__(scene, number)
        self.trajectories = BallBody(scene, ball).trajectories
        self.radii_m = scene.balls[ball].radius_m, scene.balls[ball].radius_m
        self.opacity = scene.light.shadow

    def ends(self, time_s: ArrayLike) -> tuple[Floats, Floats]:
        """(n, 3) places of the disc's middle on the table, twice."""
        place, below = self._cast(np.asarray(time_s, np.float64))
        middle = place - below[:, None] * np.array(self.scene.light.lamp)
        return middle, middle

    def softness_m(self, time_s: Floats) -> Floats:
        """Sigma of the penumbra: it grows with the way to the table."""
        return np.asarray(self._cast(time_s)[1] * self.scene.light.penumbra_rad)

    def _cast(self, time_s: Floats) -> tuple[Floats, Floats]:
        """(n, 3) places of the ball and (n,) ways from there along the light to the table."""
        place = self.trajectories[0].at(time_s).position_m
        for one in self.trajectories[1:]:
            later = time_s >= one.start_s
            place[later] = one.at(time_s[later]).position_m
        up, lamp = np.array(self.scene.up, np.float64), np.array(self.scene.light.lamp, np.float64)
        height = place @ up + self.scene.background.height_m
        return place, np.maximum(height, 0.0) / float(lamp @ up)


class NetBody(CapsuleBody):
    """A piece of the scene's net: of its tape between two shares of the length, or one upright cord."""

    def __init__(self, scene: Scene, number: int, share: tuple[float, float]) -> None:
        super().__init__(scene, number)
        assert scene.net is not None
        self.net, self.share = scene.net, share
        self.cord = share[0] == share[1]
        radius, albedo = (CORD_RADIUS_M, self.net.cord_albedo) if self.cord else (TAPE_RADIUS_M, self.net.tape_albedo)
        self.radii_m, self.albedos = (radius, radius), (albedo, albedo)

    def ends(self, time_s: ArrayLike) -> tuple[Floats, Floats]:
        """(n, 3) places of both ends; a cord's first is its foot."""
        up = np.array(self.scene.up, np.float64)
        first, second = (tape_at(self.net, share, up, time_s) for share in self.share)
        if self.cord:
            still = replace(self.net, swing_m=0.0)
            first = tape_at(still, self.share[0], up, time_s) - self.net.height_m * up
        return first, second


def _sigma_px(camera: Camera, lens: Lens, distance_m: Floats) -> Floats:
    """Blur of an outline: the lens and the pixel's own area."""
    return np.sqrt(lens.sigma_px(distance_m, camera.focal_px) ** 2 + PIXEL_VARIANCE_PX2)


def _clipped(x0: Floats, y0: Floats, x1: Floats, y1: Floats, camera: Camera) -> NDArray[np.int32]:
    """(n, 4) int32 boxes inside the image, the ends not included; empty outside."""
    box = np.stack([np.floor(x0), np.floor(y0), np.ceil(x1) + 1, np.ceil(y1) + 1], axis=1)
    return np.asarray(np.clip(box, 0, 2 * [camera.width_px, camera.height_px]), np.int32)


Body = BallBody | CapsuleBody


def bodies_of(scene: Scene) -> list[Body]:
    """The scene's balls in their order, then what else moves; number 0 is the first ball's alone."""
    others: list[CapsuleBody] = []
    first = max(len(scene.balls), 1)
    if scene.arm is not None:
        others.append(ArmBody(scene, first))
    if scene.light.shadow:
        begin = first + len(others)
        others += [ShadowBody(scene, begin + ball, ball) for ball in range(len(scene.balls))]
    if scene.net is not None:
        cuts = np.linspace(0.0, 1.0, TAPE_PIECES + 1).tolist()
        cords = np.linspace(0.0, 1.0, scene.net.cords).tolist()
        for share in (*itertools.pairwise(cuts), *zip(cords, cords, strict=True)):
            others.append(NetBody(scene, first + len(others), share))
    return [*(BallBody(scene, number) for number in range(len(scene.balls))), *others]
