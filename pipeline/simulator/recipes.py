"""Scenes ready to simulate: the ball spinner, one flight, a rally.

What is not given is drawn from `seed`; the scene that comes back holds every number.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..errors import ParameterError
from .logos import Logo
from .motion import Path, path, quaternion_of, rotations
from .scene import Air, Arm, Background, Ball, Fixed, Flight, Light, Scene, Vector3
from .simulation import default_camera

Floats = NDArray[np.float64]

# Angle of the logo's centre from the spin axis, rotation of the wordmark in its plane (degrees): our reading of the
# paper's picture of balls 1-7. At rotation 0 the word runs along the direction in which the ball turns.
SPINNER_BALLS = {1: (90, 0), 2: (45, 0), 3: (45, 90), 4: (45, 45), 5: (4, 0), 6: (90, 90), 7: (90, 45)}
SPINNER_KINDS = ("top", "back", "side")
FLIGHT_KINDS = ("top", "back", "left", "right", "corkscrew", "mixed")
SPINNER_TILT_DEG = 3.0  # how well the spinner's axis is aligned with the camera's axes (our reading)
HEADING_DEG = 8.0  # spread of the direction of shots along the table
REACH_M = 2.5  # no flight through the image is longer than this to either side


def spinner(
    *,
    ball: int = 1,
    kind: str = "top",
    magnitude_rps: float = 50.0,
    spin_rps: Sequence[float] | None = None,
    duration_ms: float = 100.0,
    logo: str | Logo = "andro",
    position_m: Sequence[float] | None = None,
    background: Background | None = None,
    light: Light | None = None,
    seed: int = 0,
) -> Scene:
    """A ball that turns in place (the paper's ball spinner).

    ball : 1 to 7, how the logo is mounted
    kind, magnitude_rps : "top" (axis +x of the camera), "back" (-x) or "side" (+z), tilted at random by 3 degrees
    spin_rps : (3,) the exact spin in the camera frame instead
    position_m : (3,) of the centre, camera frame; drawn within 0.2 m of the optical axis at 2 m when not given
    """
    random = np.random.default_rng([seed, 1])
    if spin_rps is None:
        if kind not in SPINNER_KINDS:
            raise ParameterError(f"kind {kind!r} is unknown: there are {', '.join(SPINNER_KINDS)}")
        axis = {"top": (1.0, 0.0, 0.0), "back": (-1.0, 0.0, 0.0), "side": (0.0, 0.0, 1.0)}[kind]
        tilt = rotations(math.radians(SPINNER_TILT_DEG) * random.standard_normal(3))[0]
        spin = magnitude_rps * (tilt @ np.array(axis))
    else:
        spin = _vector("spin_rps", spin_rps)
    place = np.append(random.uniform(-0.2, 0.2, 2), 2.0) if position_m is None else _vector("position_m", position_m)
    turn = mounted(ball, spin, random.uniform(0, 2 * np.pi), toward=-place)
    motion = Fixed(0.0, duration_ms * 1e-3, _triple(place), _triple(spin), quaternion_of(turn))
    return Scene(
        duration_ms * 1e-3,
        (Ball((motion,), logo=_logo(logo)),),
        background=Background(kind="plain") if background is None else background,
        light=Light() if light is None else light,
        description=f"spinner, ball {ball}",
    )


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
    spun = rotations(phase_rad * pole)[0] @ frame
    result: Floats = spun @ rotations([0.0, 0.0, in_plane])[0]
    return result


def flight(
    *,
    kind: str = "top",
    magnitude_rps: float = 50.0,
    spin_rps: Sequence[float] | None = None,
    speed_m_s: float = 7.5,
    heading_deg: float | None = None,
    ball: int | None = None,
    logo: str | Logo = "andro",
    second_ball: bool = False,
    arm: bool = False,
    bounce: bool = False,
    background: Background | None = None,
    light: Light | None = None,
    air: Air | None = None,
    spin_decay_hz: float = 0.0,
    camera: Camera | None = None,
    seed: int = 0,
) -> Scene:
    """One shot across the image, from border to border.

    kind, magnitude_rps : the spin relative to the direction of flight (CONTRACTS: signs), tilted at random by about 8
        degrees; "mixed" is any direction
    spin_rps : (3,) the exact spin in the camera frame instead
    speed_m_s : in the middle of the image (with `bounce`: where it comes down on the table)
    heading_deg : direction in the image, 0 = +x, 90 = +y (down); drawn about 90 or 270 when not given
    ball : 1-7 mounts the logo on the spin axis as on the spinner; at random when not given
    second_ball, arm : another ball crosses, an arm swings at the border; both count as other objects
    """
    random = np.random.default_rng([seed, 2])
    camera = default_camera() if camera is None else camera
    air = Air() if air is None else air
    draw = _Shots(random, camera, air, spin_decay_hz)
    shot, middle_s, heading = draw.shot(kind, magnitude_rps, spin_rps, speed_m_s, heading_deg, ball, bounce)
    balls = [Ball((shot,), logo=_logo(logo))]
    if second_ball:
        away = heading + float(random.choice([-1, 1]) * random.uniform(60.0, 120.0))
        other, its_middle_s, _ = draw.shot("mixed", 20.0, None, float(random.uniform(2.0, 5.0)), away, None, False)
        # It comes through the middle a quarter of the flight before or after the first, so that they do not collide.
        start = middle_s + float(random.choice([-0.25, 0.25])) * shot.end_s - its_middle_s
        balls.append(Ball((replace(other, start_s=start, end_s=start + other.end_s),), logo=_logo(logo)))
    return Scene(
        shot.end_s,
        tuple(balls),
        arm=swinging_arm(random, camera) if arm else None,
        background=background or Background(),
        light=light or Light(),
        air=air,
        up=_triple(np.array(camera.up)),
        description=f"flight, {kind if spin_rps is None else 'given spin'}",
    )


def rally(
    *,
    shots: int = 8,
    duration_s: float = 20.0,
    speed_m_s: tuple[float, float] = (4.0, 10.0),
    magnitude_rps: tuple[float, float] = (10.0, 80.0),
    kinds: Sequence[str] = ("top", "back", "top", "mixed"),
    logo: str | Logo = "andro",
    arm: bool = False,
    background: Background | None = None,
    light: Light | None = None,
    camera: Camera | None = None,
    seed: int = 0,
) -> Scene:
    """Several shots to and fro with pauses between them; speeds and spins drawn from the ranges, kinds in turn."""
    random = np.random.default_rng([seed, 3])
    camera = default_camera() if camera is None else camera
    if shots < 1:
        raise ParameterError(f"a rally of {shots} shots is out of range: 1 or more")
    slot = duration_s / shots
    draw = _Shots(random, camera, Air(), 0.0)
    motions: list[Fixed | Flight] = []
    for number in range(shots):
        shot, _, _ = draw.shot(
            kinds[number % len(kinds)],
            float(random.uniform(*magnitude_rps)),
            None,
            float(random.uniform(*speed_m_s)),
            (90.0 if number % 2 == 0 else 270.0) + float(random.normal(0, HEADING_DEG)),
            None,
            False,
        )
        if shot.end_s > slot:
            raise ParameterError(
                f"{shots} shots do not fit into {duration_s:g} s: one takes {shot.end_s:.2f} s; ask for fewer or longer"
            )
        start = round(number * slot + float(random.uniform(0, slot - shot.end_s)), 6)
        motions.append(replace(shot, start_s=start, end_s=start + shot.end_s))
    return Scene(
        duration_s,
        (Ball(tuple(motions), logo=_logo(logo)),),
        arm=swinging_arm(random, camera) if arm else None,
        background=background or Background(),
        light=light or Light(),
        up=_triple(np.array(camera.up)),
        description=f"rally of {shots} shots",
    )


def swinging_arm(random: np.random.Generator, camera: Camera) -> Arm:
    """A forearm that reaches in from the left or right border, above the table, and swings to and fro."""
    side = float(random.choice([-1.0, 1.0]))
    depth = float(random.uniform(1.6, 1.8))
    x = side * (camera.width_px / 2 / camera.focal_px * depth + 0.1)
    y = float(random.uniform(-0.25, 0.25))
    return Arm(
        elbow_m=(x, y, depth),
        rest=(-side, 0.0, 0.0),
        axis=(0.0, 0.0, 1.0),
        swing_rad=float(random.uniform(0.4, 0.8)),
        frequency_hz=float(random.uniform(0.8, 1.5)),
        phase_rad=float(random.uniform(0, 2 * np.pi)),
    )


class _Shots:
    """Draws flights through the image."""

    def __init__(self, random: np.random.Generator, camera: Camera, air: Air, spin_decay_hz: float) -> None:
        self.random, self.camera, self.air, self.spin_decay_hz = random, camera, air, spin_decay_hz
        self.up = np.array(camera.up, np.float64)

    def shot(
        self,
        kind: str,
        magnitude_rps: float,
        spin_rps: Sequence[float] | None,
        speed_m_s: float,
        heading_deg: float | None,
        ball: int | None,
        bounce: bool,
    ) -> tuple[Flight, float, float]:
        """A flight from outside the image at time 0 until it has left, the time of its middle, its heading."""
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
            spin = _vector("spin_rps", spin_rps)
        if ball is None:
            turn = rotations(_rotation_vector(random))[0]
        else:
            turn = mounted(ball, spin, float(random.uniform(0, 2 * np.pi)), toward=-middle)
        here = Flight(
            0.0, REACH_M / speed_m_s, _triple(middle), _triple(velocity), _triple(spin), quaternion_of(turn)
        )
        start_s, position, its_velocity = self._entry(here)
        turn = rotations(2 * np.pi * start_s * spin)[0] @ turn
        whole = replace(
            here,
            position_m=_triple(position),
            velocity_m_s=_triple(its_velocity),
            orientation=quaternion_of(turn),
            spin_decay_hz=self.spin_decay_hz,
            bounces=bounce,
            end_s=here.end_s - start_s,
        )
        ball_there, scene = self._alone(whole)
        flown = path(whole, ball_there, scene)
        # It starts outside, so only what comes after the middle counts as leaving.
        end = _leaves(flown, ball_there, self.camera, after_s=-start_s)
        return replace(whole, end_s=round(float(flown.time_s[end]), 6)), -start_s, heading

    def _middle(self, speed_m_s: float, heading_deg: float, bounce: bool) -> tuple[Floats, Floats]:
        """Place and velocity near the middle of the image: near the top of an arc, or coming down on the table."""
        random, up = self.random, self.up
        height = 0.02 if bounce else float(random.uniform(0.12, 0.35))
        rise = -float(random.uniform(0.2, 0.4)) * speed_m_s if bounce else float(random.uniform(-0.5, 0.5))
        rise = math.copysign(min(abs(rise), 0.5 * speed_m_s), rise)
        ahead = np.array([0.0, 0.0, 1.0])
        depth = (Background().height_m - height) / max(-ahead @ up, 0.2)
        middle = np.append(random.uniform(-0.12, 0.12, 2), depth)
        course = np.array([math.cos(math.radians(heading_deg)), math.sin(math.radians(heading_deg)), 0.0])
        course = course - (course @ up) * up
        level = math.sqrt(speed_m_s**2 - rise**2)
        return middle, level * course / np.linalg.norm(course) + rise * up

    def _alone(self, motion: Flight, air: Air | None = None) -> tuple[Ball, Scene]:
        ball = Ball((motion,))
        return ball, Scene(motion.end_s, (ball,), air=air or self.air, up=_triple(self.up))

    def _entry(self, here: Flight) -> tuple[float, Floats, Floats]:
        """(time < 0, position, velocity) where this flight came into the image.

        With the velocity mirrored time runs back if drag and Magnus force, both odd in it, change their signs.
        """
        mirrored = replace(here, velocity_m_s=_triple(-np.array(here.velocity_m_s)))
        ball, scene = self._alone(mirrored, replace(self.air, drag=-self.air.drag, magnus=-self.air.magnus))
        back = path(mirrored, ball, scene)
        row = _leaves(back, ball, self.camera, after_s=0.0)
        return -float(back.time_s[row]), back.position_m[row], -back.velocity_m_s[row]


def _leaves(ahead: Path, ball: Ball, camera: Camera, after_s: float) -> int:
    """First sample after a time at which the ball has left the image; raises ParameterError when it stays."""
    x, y, radius = camera.silhouette(ahead.position_m, ball.radius_m)
    gone = (x < -radius - 8) | (x > camera.width_px + radius + 8)
    gone |= (y < -radius - 8) | (y > camera.height_px + radius + 8)
    gone &= ahead.time_s > after_s
    if not gone.any():
        raise ParameterError("the ball does not leave the image: choose a higher speed or another heading")
    return int(np.argmax(gone))


def spin_direction(kind: str, velocity: Floats, up: Floats, random: np.random.Generator) -> Floats:
    """(3,) unit vector of a kind of spin for a ball that flies with this velocity; see CONTRACTS for the signs."""
    if kind not in FLIGHT_KINDS:
        raise ParameterError(f"kind {kind!r} is unknown: there are {', '.join(FLIGHT_KINDS)}")
    if kind == "mixed":
        anything = random.standard_normal(3)
        return anything / float(np.linalg.norm(anything))
    forward = velocity / np.linalg.norm(velocity)
    across = np.cross(up, forward)
    across /= np.linalg.norm(across)
    pure = {"top": across, "back": -across, "left": up, "right": -up, "corkscrew": forward}[kind]
    tilted: Floats = rotations(math.radians(8.0) * random.standard_normal(3))[0] @ pure
    return tilted


def _rotation_vector(random: np.random.Generator) -> Floats:
    """(3,) rotation vector of a uniformly random rotation."""
    w, *xyz = random.standard_normal(4)
    length = float(np.linalg.norm(xyz))
    result: Floats = 2 * math.atan2(length, w) * np.array(xyz) / length
    return result


def _vector(name: str, value: Sequence[float]) -> Floats:
    vector = np.asarray(value, np.float64)
    if vector.shape != (3,) or not np.all(np.isfinite(vector)):
        raise ParameterError(f"{name} = {value!r} is not a list of 3 numbers")
    return vector


def _triple(vector: Floats) -> Vector3:
    x, y, z = (float(v) for v in vector)
    return x, y, z


def _logo(logo: str | Logo) -> Logo:
    return logo if isinstance(logo, Logo) else Logo.of(logo)
