"""Scenes of the ball spinner, one flight and a rally; options that are not given are drawn from `seed`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..errors import ParameterError
from ..kernels.rotation import rotations
from .flights import HEADING_DEG, FlightSampler, drawn_set_up, mounted, vector
from .logos import Logo
from .motion import quaternion_of, triple
from .scene import Arm, Background, Ball, Fixed, Flight, Light, Scene
from .simulation import default_camera

Floats = NDArray[np.float64]

SPINNER_AXES = {"top": (1.0, 0.0, 0.0), "back": (-1.0, 0.0, 0.0), "side": (0.0, 0.0, 1.0)}
SPINNER_TILT_DEG = 3.0  # how well the spinner's axis is aligned with the camera's axes (our reading)


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
    """A ball that turns in place (the paper's ball spinner); raises ParameterError for unknown or impossible values.

    Parameters
    ----------
    ball : int
        1 to 7, position of the logo on the ball.
    kind : str
        "top" (axis +x of the camera), "back" (-x) or "side" (+z), tilted at random by 3 degrees.
    spin_rps : (3,) sequence of float or None
        Exact spin in the camera frame instead of kind and magnitude.
    position_m : (3,) sequence of float or None
        Of the centre, camera frame; None = drawn within 0.2 m of the optical axis at 2 m.
    """
    random = np.random.default_rng([seed, 1])
    if spin_rps is None:
        if kind not in SPINNER_AXES:
            raise ParameterError(f"kind {kind!r} is unknown: there are {', '.join(SPINNER_AXES)}")
        tilt = rotations(math.radians(SPINNER_TILT_DEG) * random.standard_normal(3))[0]
        spin = magnitude_rps * (tilt @ np.array(SPINNER_AXES[kind]))
    else:
        spin = vector("spin_rps", spin_rps)
    place = np.append(random.uniform(-0.2, 0.2, 2), 2.0) if position_m is None else vector("position_m", position_m)
    turn = mounted(ball, spin, random.uniform(0, 2 * np.pi), toward=-place)
    motion = Fixed(0.0, duration_ms * 1e-3, triple(place), triple(spin), quaternion_of(turn))
    return Scene(
        duration_ms * 1e-3,
        (Ball((motion,), logo=Logo.of(logo)),),
        background=background or Background(kind="plain"),
        light=light or Light(),
        description=f"spinner, ball {ball}",
    )


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
    set_up: int | None = None,
    spin_decay_hz: float = 0.0,
    camera: Camera | None = None,
    seed: int = 0,
) -> Scene:
    """One shot across the image, from border to border; raises ParameterError, also when the ball does not leave it.

    Parameters
    ----------
    kind : str
        Spin relative to the direction of flight, tilted at random by about 8 degrees; "mixed" = any direction.
    spin_rps : (3,) sequence of float or None
        Exact spin in the camera frame instead of kind and magnitude.
    speed_m_s : float
        In the middle of the image (with `bounce`: at the table).
    heading_deg : float or None
        Direction in the image, 0 = +x, 90 = +y (down); None = drawn about 90 or 270.
    ball : int or None
        1 to 7, position of the logo relative to the spin axis as on the spinner; None = at random.
    second_ball, arm : bool
        Whether another ball crosses, an arm swings at the border; both count as other objects.
    bounce : bool
        Whether the ball bounces off the table.
    set_up : int or None
        Number of the set-up: flights with the same one share air and plumb line; None = as the seed.
    spin_decay_hz : float
        The spin falls as exp(-spin_decay_hz t).
    camera : Camera or None
        None = the paper's.
    """
    random = np.random.default_rng([seed, 2])
    camera = camera or default_camera()
    air, up = drawn_set_up(camera, seed if set_up is None else set_up)
    draw = FlightSampler(random, camera, air, up, spin_decay_hz)
    shot, middle_s, heading = draw.shot(kind, magnitude_rps, speed_m_s, heading_deg, spin_rps, ball, bounce)
    balls = [Ball((shot,), logo=Logo.of(logo))]
    if second_ball:
        away = heading + float(random.choice([-1, 1]) * random.uniform(60.0, 120.0))
        other, its_middle_s = _second(draw, float(random.uniform(2.0, 5.0)), away)
        # Through the middle a quarter of the flight before or after the first, so that they do not collide.
        start = middle_s + float(random.choice([-0.25, 0.25])) * shot.end_s - its_middle_s
        balls.append(Ball((replace(other, start_s=start, end_s=start + other.end_s),), logo=Logo.of(logo)))
    return Scene(
        shot.end_s,
        tuple(balls),
        arm=swinging_arm(random, camera) if arm else None,
        background=background or Background(),
        light=light or Light(),
        air=air,
        up=up,
        description=f"flight, {kind if spin_rps is None else 'given spin'}",
    )


def _second(draw: FlightSampler, speed_m_s: float, heading_deg: float) -> tuple[Flight, float]:
    """A second ball's flight and the time of its middle.

    One so slow that it would fall before it has crossed the image is taken faster.
    """
    while True:
        try:
            return draw.shot("mixed", 20.0, speed_m_s, heading_deg)[:2]
        except ParameterError:
            if speed_m_s > 10.0:
                raise
            speed_m_s *= 1.25


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
    """Several shots to and fro with pauses; speeds and spins drawn from the ranges, kinds in turn."""
    random = np.random.default_rng([seed, 3])
    camera = camera or default_camera()
    if shots < 1:
        raise ParameterError(f"a rally of {shots} shots is out of range: 1 or more")
    slot = duration_s / shots
    air, up = drawn_set_up(camera, seed)
    draw = FlightSampler(random, camera, air, up, 0.0)
    motions: list[Fixed | Flight] = []
    for number in range(shots):
        shot, _, _ = draw.shot(
            kinds[number % len(kinds)],
            float(random.uniform(*magnitude_rps)),
            float(random.uniform(*speed_m_s)),
            (90.0 if number % 2 == 0 else 270.0) + float(random.normal(0, HEADING_DEG)),
        )
        if shot.end_s > slot:
            takes = f"one takes {shot.end_s:.2f} s"
            raise ParameterError(f"{shots} shots do not fit into {duration_s:g} s, {takes}: ask for fewer or more time")
        start = round(number * slot + float(random.uniform(0, slot - shot.end_s)), 6)
        motions.append(replace(shot, start_s=start, end_s=start + shot.end_s))
    return Scene(
        duration_s,
        (Ball(tuple(motions), logo=Logo.of(logo)),),
        arm=swinging_arm(random, camera) if arm else None,
        background=background or Background(),
        light=light or Light(),
        air=air,
        up=up,
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
