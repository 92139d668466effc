"""Flights through the image, and how logos are mounted."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..errors import ParameterError
from ..kernels.rotation import rotations
from .motion import Trajectory, quaternion_of, trajectory, triple
from .scene import DRAG_RANGE, LIFT_STD, PLUMB_STD_DEG, Air, Background, Ball, Flight, Scene, Vector3

Floats = NDArray[np.float64]

# Angle of the logo's centre from the spin axis, rotation of the wordmark in its plane (degrees): our reading of the
# paper's picture of balls 1-7. At rotation 0 the word runs along the direction in which the ball turns.
SPINNER_BALLS = {1: (90, 0), 2: (45, 0), 3: (45, 90), 4: (45, 45), 5: (4, 0), 6: (90, 90), 7: (90, 45)}
FLIGHT_KINDS = ("top", "back", "left", "right", "corkscrew", "mixed")
HEADING_DEG = 8.0  # spread of the direction of shots along the table
SPREAD = np.array([0.17, 0.3])  # of the middle of a flight, as a share of half the image
REACH_M = 2.5  # no flight through the image is longer than this to either side


def mounted(ball: int, spin_rps: Floats, phase_rad: float, toward: Floats) -> Floats:
    """(3, 3) ball frame -> camera frame of a ball 1-7 on a spin axis.

    The logo lies near the end of the axis that points `toward` the viewer, as it must be to be seen.
    """
    if ball not in SPINNER_BALLS:
        raise ParameterError(f"ball {ball} is unknown: there are 1 to 7")
    angle, in_plane = (math.radians(value) for value in SPINNER_BALLS[ball])
    length = float(np.linalg.norm(spin_rps))
    axis = spin_rps / length if length > 0 else np.array([0.0, 0.0, -1.0])
    pole = axis if axis @ toward >= 0 else -axis
    side = np.cross(pole, [0.0, 1.0, 0.0] if abs(pole[1]) < 0.9 else [1.0, 0.0, 0.0])
    side /= np.linalg.norm(side)
    # At phase 0: the centre in the plane of pole and side, the word along the circle of latitude.
    centre = math.cos(angle) * pole + math.sin(angle) * side
    word = np.cross(pole, side)
    frame = np.stack([word, np.cross(centre, word), centre], axis=1)
    return np.asarray(rotations(phase_rad * pole)[0] @ frame @ rotations([0.0, 0.0, in_plane])[0])


def drawn_set_up(camera: Camera, seed: int) -> tuple[Air, Vector3]:
    """Air and up direction (unit, camera frame) of a set-up drawn from a seed: as far from the defaults as real ones.

    Camera.up is what the user believes; the plumb line is known to about a degree only.
    """
    random = np.random.default_rng([seed, 6])
    scale = 1 + LIFT_STD * float(np.clip(random.standard_normal(), -2.5, 2.5))
    plain = Air()
    assert plain.lift_max is not None
    air = replace(
        plain,
        drag=float(random.uniform(*DRAG_RANGE)),
        magnus=scale * plain.magnus,
        lift_max=scale * plain.lift_max,
    )
    up = np.array(camera.up)
    lean = math.radians(PLUMB_STD_DEG) * random.standard_normal(3)
    return air, triple(rotations(lean - (lean @ up) * up)[0] @ up)


class FlightSampler:
    """Draws flights through the image."""

    def __init__(
        self, random: np.random.Generator, camera: Camera, air: Air, up: Vector3, spin_decay_hz: float
    ) -> None:
        self.random, self.camera, self.air, self.spin_decay_hz = random, camera, air, spin_decay_hz
        self.up = np.array(up, np.float64)

    def shot(
        self,
        kind: str,
        magnitude_rps: float,
        speed_m_s: float,
        heading_deg: float | None = None,
        spin_rps: Sequence[float] | None = None,
        ball: int | None = None,
        bounce: bool = False,
    ) -> tuple[Flight, float, float]:
        """A flight that comes in after time 0 and ends when it has left, the time of its middle, its heading."""
        if not 0.5 <= speed_m_s <= 50:
            raise ParameterError(f"speed {speed_m_s:g} m/s is out of range: 0.5 to 50 m/s")
        if not 0 <= magnitude_rps <= 1000:
            raise ParameterError(f"spin of {magnitude_rps:g} rps is out of range: 0 to 1000 rps")
        random, up = self.random, self.up
        drawn = float(random.choice([90.0, 270.0]) + random.normal(0, HEADING_DEG))
        heading = drawn if heading_deg is None else heading_deg
        middle, velocity = self._middle(speed_m_s, heading, bounce)
        if spin_rps is None:
            spin = magnitude_rps * spin_direction(kind, velocity, up, random)
        else:
            spin = vector("spin_rps", spin_rps)
        if ball is None:
            turn = rotations(_rotation_vector(random))[0]
        else:
            turn = mounted(ball, spin, float(random.uniform(0, 2 * np.pi)), toward=-middle)
        here = Flight(0.0, REACH_M / speed_m_s, triple(middle), triple(velocity), triple(spin), quaternion_of(turn))
        start_s, position, its_velocity = self._entry(here)
        turn = rotations(2 * np.pi * start_s * spin)[0] @ turn
        whole = replace(
            here,
            position_m=triple(position),
            velocity_m_s=triple(its_velocity),
            orientation=quaternion_of(turn),
            spin_decay_hz=self.spin_decay_hz,
            bounces=bounce,
            end_s=here.end_s - start_s,
        )
        flown = self._flown(whole, self.air)
        # It starts outside, so only what comes after the middle counts as leaving.
        end = self._leaves(flown, after_s=-start_s)
        return replace(whole, end_s=round(float(flown.time_s[end]), 6)), -start_s, heading

    def _middle(self, speed_m_s: float, heading_deg: float, bounce: bool) -> tuple[Floats, Floats]:
        """Place and velocity near the middle of the image: near the top of an arc, or on the table."""
        random, up = self.random, self.up
        height = 0.02 if bounce else float(random.uniform(0.12, 0.35))
        rise = -float(random.uniform(0.2, 0.4)) * speed_m_s if bounce else float(random.uniform(-0.5, 0.5))
        rise = math.copysign(min(abs(rise), 0.5 * speed_m_s), rise)
        ahead = np.array([0.0, 0.0, 1.0])
        depth = (Background().height_m - height) / max(-float(ahead @ up), 0.2)
        half = np.array([self.camera.width_px, self.camera.height_px]) / 2 / self.camera.focal_px * depth
        middle = np.append(random.uniform(-1.0, 1.0, 2) * SPREAD * half, depth)
        course = np.array([math.cos(math.radians(heading_deg)), math.sin(math.radians(heading_deg)), 0.0])
        course = course - (course @ up) * up
        level = math.sqrt(speed_m_s**2 - rise**2)
        return middle, level * course / float(np.linalg.norm(course)) + rise * up

    def _flown(self, motion: Flight, air: Air) -> Trajectory:
        ball = Ball((motion,))
        return trajectory(motion, ball, Scene(motion.end_s, (ball,), air=air, up=triple(self.up)))

    def _entry(self, here: Flight) -> tuple[float, Floats, Floats]:
        """(time < 0, position, velocity) where this flight came into the image.

        With the velocity mirrored time runs back if drag and Magnus force, both odd in it, change their
        signs.
        """
        mirrored = replace(here, velocity_m_s=triple(-np.array(here.velocity_m_s)))
        back = self._flown(mirrored, replace(self.air, drag=-self.air.drag, magnus=-self.air.magnus))
        row = self._leaves(back, after_s=0.0)
        return -float(back.time_s[row]), back.position_m[row], -back.velocity_m_s[row]

    def _leaves(self, ahead: Trajectory, after_s: float) -> int:
        """First sample after a time at which the ball has left the image; raises ParameterError when it stays."""
        x, y, radius = self.camera.silhouette(ahead.position_m, Ball.radius_m)
        gone = (x < -radius - 8) | (x > self.camera.width_px + radius + 8)
        gone |= (y < -radius - 8) | (y > self.camera.height_px + radius + 8)
        gone &= ahead.time_s > after_s
        if not gone.any():
            raise ParameterError("the ball does not leave the image: choose a higher speed or another heading")
        return int(np.argmax(gone))


def spin_direction(kind: str, velocity: Floats, up: Floats, random: np.random.Generator) -> Floats:
    """(3,) unit vector of a kind of spin for this velocity: top, left and corkscrew point along +s, +u, +v."""
    if kind not in FLIGHT_KINDS:
        raise ParameterError(f"kind {kind!r} is unknown: there are {', '.join(FLIGHT_KINDS)}")
    if kind == "mixed":
        anything = random.standard_normal(3)
        return anything / float(np.linalg.norm(anything))
    forward = velocity / np.linalg.norm(velocity)
    across = np.cross(up, forward)
    across /= np.linalg.norm(across)
    pure = {"top": across, "back": -across, "left": up, "right": -up, "corkscrew": forward}[kind]
    return np.asarray(rotations(math.radians(8.0) * random.standard_normal(3))[0] @ pure)


def _rotation_vector(random: np.random.Generator) -> Floats:
    """(3,) rotation vector of a uniformly random rotation."""
    w, *xyz = random.standard_normal(4)
    length = float(np.linalg.norm(xyz))
    return np.asarray(2 * math.atan2(length, w) * np.array(xyz) / length)


def vector(name: str, value: Sequence[float]) -> Floats:
    """(3,) float64 of a list of three finite numbers; raises ParameterError for any other."""
    vector = np.asarray(value, np.float64)
    if vector.shape != (3,) or not np.all(np.isfinite(vector)):
        raise ParameterError(f"{name} = {value!r} is not a list of 3 numbers")
    return vector
