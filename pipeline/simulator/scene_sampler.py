"""Draws of flights and of what is around them, before one camera."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..biases import PAPER, BiasParameters
from ..camera import Camera, CameraParameters
from ..kernels.rotation import rotations
from .flights import drawn_set_up, mounted, spin_direction
from .motion import quaternion_of, trajectory, triple
from .scene import Air, Background, Ball, Flight, Motion, Scene, Vector3
from .sensor import Lens, SensorModel
from .simulation import Progress, SimulatedRecording, simulate_scene

Floats = NDArray[np.float64]

DOWN = (0.0, 0.0, -1.0)  # `up` of a camera that looks down
PAPER_CAMERA = CameraParameters()
LOGO_SEATS = (1, 2, 3, 4, 6, 7)  # of the ball spinner's: all but the one beside the axis
MIDDLE_S, DURATION_S = 0.06, 0.12


@dataclass(frozen=True)
class RealScene:
    """A scene with the camera and sensor that look at it."""

    kind: str
    seed: int
    scene: Scene
    camera: Camera
    sensor: SensorModel | BiasParameters
    lens: Lens

    def simulate(self, on_progress: Progress | None = None) -> SimulatedRecording:
        """The recording; `segments` of it is the truth of every free flight."""
        options: dict[str, Any] = {"camera": self.camera, "sensor": self.sensor, "lens": self.lens}
        return simulate_scene(self.scene, **options, seed=self.seed, on_progress=on_progress)


class SceneSampler:
    """Draws flights and what is around them before one camera."""

    def __init__(self, kind: str, seed: int) -> None:
        self.kind, self.seed = kind, seed
        self.random = np.random.default_rng([seed, *kind.encode()])
        self.optics, self.size_px = PAPER_CAMERA, (1280, 720)
        self.up, self.distance_m = DOWN, 1.8  # what the camera is believed to see
        self.parts: dict[str, Any] = {}

    def between(self, low: float, high: float) -> float:
        """A number between two others."""
        return float(self.random.uniform(low, high))

    def view(self, optics: CameraParameters = PAPER_CAMERA, **pose: Any) -> SceneSampler:
        """The same sampler before another camera: `size_px`, `up`, `distance_m`."""
        self.optics = optics
        for name, value in pose.items():
            setattr(self, name, value)
        return self

    @property
    def camera(self) -> Camera:
        """The camera."""
        return Camera.of(replace(self.optics, up=tuple(self.up)), *self.size_px)

    @property
    def set_up(self) -> tuple[Air, Vector3]:
        """Air and plumb line, drawn from the seed."""
        return drawn_set_up(self.camera, self.seed)

    @property
    def plumb(self) -> Floats:
        """(3,) true up direction: that of gravity and the table."""
        return np.array(self.set_up[1])

    def place(self, x_share: float, y_share: float, nearer_m: float = 0.0) -> Floats:
        """A place seen at this share of half the image from its middle."""
        camera, depth = self.camera, self.distance_m - nearer_m
        half = np.array([camera.width_px, camera.height_px]) / 2 / camera.focal_px * depth
        return np.append(half * (x_share, y_share), depth)

    def course(self, heading_deg: float, speed_m_s: float, rise: float = 0.0) -> Floats:
        """A velocity in a level direction as seen in the image (0 = right, 90 = down), rising by this share of it."""
        up, heading = np.array(self.up), math.radians(heading_deg)
        level = np.array([math.cos(heading), math.sin(heading), 0.0])
        level -= (level @ up) * up
        level /= np.linalg.norm(level)
        return np.asarray(speed_m_s * (math.sqrt(1 - rise**2) * level + rise * up))

    def heading_deg(self) -> float:
        """A direction along the image's columns; along its rows for a camera that does not look down."""
        along = 90.0 if self.up == DOWN else 0.0
        return along + float(self.random.choice([0.0, 180.0])) + float(self.random.normal(0, 12.0))

    def spin(self, velocity: Floats, low_rps: float = 30.0, high_rps: float = 70.0) -> Floats:
        """Top or back spin, tilted by about 8 degrees."""
        kind = str(self.random.choice(["top", "back"]))
        return self.between(low_rps, high_rps) * spin_direction(kind, velocity, np.array(self.up), self.random)

    def seat(self, spin: Floats, toward: Floats) -> Floats:
        """(3, 3) rotation of a ball whose logo comes into sight in every turn."""
        return mounted(int(self.random.choice(LOGO_SEATS)), spin, self.between(0, 2 * math.pi), toward)

    def passing(
        self, at_s: float, place: Floats, velocity: Floats, spin: Floats, span_s: tuple[float, float]
    ) -> Flight:
        """The flight during span_s that is at a place with this velocity at a time of it."""
        turn = rotations(2 * np.pi * (span_s[0] - at_s) * spin)[0] @ self.seat(spin, -place)
        air, up = self.set_up
        start, its_velocity = place - (at_s - span_s[0]) * velocity, velocity
        for _ in range(6):  # converges by a factor of ten a round
            here = Flight(*span_s, triple(start), triple(its_velocity), triple(spin), quaternion_of(turn))
            there = trajectory(here, Ball((here,)), Scene(1.0, (), air=air, up=up)).at([at_s])
            missed = velocity - there.velocity_m_s[0]
            its_velocity = its_velocity + missed
            start = start + place - there.position_m[0] - (at_s - span_s[0]) * missed
        return here

    def flight(self, at_s: float = MIDDLE_S, duration_s: float = DURATION_S, **choice: Any) -> Flight:
        """A flight through the image; place, velocity and spin may be given."""
        place = choice.get("place", self.place(self.between(-0.3, 0.3), self.between(-0.2, 0.2)))
        velocity = choice.get("velocity")
        if velocity is None:
            rise = self.between(-0.1, 0.1)
            velocity = self.course(self.heading_deg(), choice.get("speed_m_s", self.between(4.0, 8.0)), rise)
        spin = choice.get("spin", self.spin(velocity))
        return self.passing(at_s, place, velocity, spin, (min(0.0, at_s), max(duration_s, at_s)))

    def after(self, before: Flight, velocity: Floats, spin: Floats, duration_s: float) -> Flight:
        """The flight that goes on from the end of another with this velocity and spin."""
        air, up = self.set_up
        end = trajectory(before, Ball((before,)), Scene(1.0, (), air=air, up=up))
        turn = quaternion_of(end.rotation[-1])
        return Flight(before.end_s, duration_s, triple(end.position_m[-1]), triple(velocity), triple(spin), turn)

    def shot(self, *motions: Motion, **look: Any) -> RealScene:
        """The scene of one ball; without motions, of a flight."""
        return self.scene(Ball(motions or (self.flight(),), **look))

    def scene(self, *balls: Ball, duration_s: float = DURATION_S, sensor: SensorModel | None = None) -> RealScene:
        """The scene of these balls among the sampler's `parts`."""
        background = self.parts.get("background", Background(height_m=self.distance_m + self.between(0.12, 0.3)))
        air, up = self.set_up
        parts = self.parts | {"background": background, "air": air, "up": up}
        scene = Scene(duration_s, balls, **parts, description=f"{self.kind}, seed {self.seed}")
        return RealScene(self.kind, self.seed, scene, self.camera, sensor or PAPER, Lens(focus_m=self.distance_m))

    def among(self, **parts: Any) -> SceneSampler:
        """The same sampler with these parts of the scene."""
        self.parts |= parts
        return self
