"""Scenes like a lab's or a club's: backgrounds, clutter, poses, light, balls, contacts, sensors, several balls.

`KINDS` is the table of the classes; each draws what it leaves open from the seed. The truth of every free flight
is in the simulated recording's `segments`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..camera import CameraParameters
from ..errors import ParameterError
from .logos import Logo
from .motion import bounced, quaternion_of, triple
from .scene import Arm, Background, Ball, Light, Net, Rolling, Shake
from .scene_sampler import DURATION_S, MIDDLE_S, RealScene, SceneSampler
from .sensor import SensorModel

RIGHT = np.array([1.0, 0.0, 0.0])
DAVIS = CameraParameters(focal_length_mm=12.0, pixel_um=18.5)  # DAVIS346: 346 x 260 pixels of 18.5 um
GEN31 = CameraParameters(focal_length_mm=8.0, pixel_um=15.0)  # 640 x 480 pixels of 15 um


@dataclass(frozen=True)
class SceneKind:
    """A class of scenes: the group that it is counted in, and what draws one."""

    group: str
    draw: Callable[[SceneSampler], RealScene]


def plain(albedo: float, contrast: float = 0.0, **more: Any) -> Background:
    """A background without a table."""
    return Background(kind="plain", albedo=albedo, contrast=contrast, **more)


def texture(draw: SceneSampler, contrast: float, grain_px: float) -> Background:
    """A textured floor."""
    return plain(draw.between(0.08, 0.2), contrast, grain_px=grain_px, texture_seed=draw.seed)


def table(draw: SceneSampler, albedo: float, **more: Any) -> Background:
    """A table with lines below the flight."""
    return Background(height_m=draw.distance_m + draw.between(0.12, 0.3), albedo=albedo, **more)


def oblique(draw: SceneSampler) -> tuple[float, float, float]:
    """`up` of a camera that looks down at a slant."""
    slant = math.radians(draw.between(35.0, 60.0))
    return 0.0, -math.sin(slant), -math.cos(slant)


def arm(draw: SceneSampler, nearer_m: float) -> Arm:
    """An arm that swings in the middle third of the image, so much nearer than the flight."""
    side = float(draw.random.choice([-1.0, 1.0]))
    elbow = draw.place(side * draw.between(0.75, 1.0), draw.between(-0.4, 0.4), nearer_m)
    return Arm(
        elbow_m=triple(elbow),
        rest=(-side, 0.0, 0.0),
        axis=(0.0, 0.0, 1.0),
        swing_rad=draw.between(0.4, 0.8),
        frequency_hz=draw.between(1.0, 2.5),
        phase_rad=draw.between(0, 2 * math.pi),
        hand_albedo=draw.between(0.3, 0.6),
    )


def net(draw: SceneSampler) -> Net:
    """A swinging net across the flight, its tape a ball's width below it."""
    y, below = draw.between(-0.3, 0.3), -0.06
    left, right = (triple(draw.place(x, y, below)) for x in (-1.2, 1.2))
    return Net(
        left, right, swing_m=draw.between(0.003, 0.02), frequency_hz=draw.between(4, 9), phase_rad=draw.between(0, 6)
    )


def faint(contrast: float) -> dict[str, Any]:
    """A ball whose logo has this share of the usual contrast."""
    usual = Ball(())
    return {"ink_albedo": usual.albedo - contrast * (usual.albedo - usual.ink_albedo)}


def bounce(draw: SceneSampler) -> RealScene:
    """A ball that bounces: restitution and friction between those published (0.85 to 0.93, 0.2 to 0.3)."""
    place, at_s = draw.place(draw.between(-0.2, 0.2), draw.between(-0.15, 0.15)), draw.between(0.05, 0.075)
    velocity = draw.course(draw.heading_deg(), draw.between(4.0, 8.0), -draw.between(0.2, 0.5))
    spin = draw.spin(velocity, 20.0, 70.0)
    before = replace(draw.flight(at_s, at_s, place=place, velocity=velocity, spin=spin), end_s=at_s)
    up = draw.plumb
    leaving = bounced(velocity, spin, up, Ball.radius_m, draw.between(0.85, 0.93), draw.between(0.2, 0.3))
    height_m = -float(place @ up) + Ball.radius_m
    background = draw.parts.get("background", Background())
    draw.among(background=replace(background, height_m=height_m))
    return draw.shot(before, draw.after(before, *leaving, DURATION_S + 0.02))


def racket_hit(draw: SceneSampler) -> RealScene:
    """A ball that a racket sends back with another spin; the arm below it moves along with the ball that leaves."""
    place, at_s = draw.place(draw.between(-0.2, 0.2), draw.between(-0.2, 0.2)), draw.between(0.05, 0.07)
    heading = draw.heading_deg()
    velocity = draw.course(heading, draw.between(4.0, 7.0), draw.between(-0.2, 0.0))
    out = draw.course(heading + 180.0 + draw.between(-20.0, 20.0), draw.between(6.0, 11.0), draw.between(0.0, 0.2))
    before = draw.flight(at_s, at_s, place=place, velocity=velocity)
    direction = out / np.linalg.norm(out)
    rest = np.cross(draw.up, direction) * float(draw.random.choice([-1.0, 1.0]))
    length_m, swing = 0.5, 0.7
    frequency_hz = 0.5 * float(np.linalg.norm(out)) / (length_m * swing * 2 * math.pi)  # the hand at half the speed
    racket = Arm(
        elbow_m=triple(place - length_m * rest - 0.06 * direction - 0.05 * np.array(draw.up)),
        rest=triple(rest),
        axis=triple(np.cross(rest, direction)),
        length_m=length_m,
        swing_rad=swing,
        frequency_hz=frequency_hz,
        phase_rad=-2 * math.pi * frequency_hz * at_s,
    )
    return draw.among(arm=racket).shot(before, draw.after(before, out, draw.spin(out), DURATION_S + 0.02))


def turning(draw: SceneSampler, low_rps: float, high_rps: float) -> RealScene:
    """A flight with a spin between these magnitudes."""
    velocity = draw.course(draw.heading_deg(), draw.between(4.0, 8.0), draw.between(-0.1, 0.1))
    return draw.shot(draw.flight(velocity=velocity, spin=draw.spin(velocity, low_rps, high_rps)))


def sensed(draw: SceneSampler, **sensor: Any) -> RealScene:
    """A flight before the usual sensor with these changes."""
    return draw.scene(Ball((draw.flight(),)), sensor=replace(SensorModel.of(), **sensor))


def weak_sensor(random: np.random.Generator) -> SensorModel:
    """A sensor with high and uneven thresholds, above all for OFF events, slow pixels and more noise."""
    usual = SensorModel.of()
    return replace(
        usual,
        threshold_on=usual.threshold_on * float(random.uniform(1.0, 1.3)),
        threshold_off=usual.threshold_off * float(random.uniform(1.6, 2.4)),
        mismatch=0.1,
        cutoff_hz=usual.cutoff_hz * float(random.uniform(0.05, 0.15)),
        noise_hz=4 * usual.noise_hz,
    )


def flickering(draw: SceneSampler, flicker_hz: float) -> RealScene:
    """Lamps at the mains: a small sensor, for every pixel has to be simulated all the time."""
    draw.view(DAVIS, size_px=(346, 260), distance_m=draw.between(0.8, 1.2))
    return draw.among(light=Light(flicker_depth=draw.between(0.05, 0.2), flicker_hz=flicker_hz)).shot()


def edge(draw: SceneSampler) -> RealScene:
    """A ball along the border of the image, less than twice its radius inside."""
    heading = 90.0 * float(draw.random.integers(4))
    level = math.cos(math.radians(heading)) ** 2 > 0.5
    out, along = float(draw.random.choice([-1.0, 1.0])) * draw.between(0.9, 0.95), draw.between(-0.2, 0.2)
    place = draw.place(along, out) if level else draw.place(out, along)
    return draw.shot(draw.flight(place=place, velocity=draw.course(heading, draw.between(4.0, 8.0))))


def companions(draw: SceneSampler, gap_s: float, count: int, turn_deg: float, duration_s: float) -> RealScene:
    """Balls through places near each other, one after the other, each course turned from the one before."""
    heading, speed = draw.heading_deg(), draw.between(4.5, 7.5)
    middle_s = (duration_s - gap_s * (count - 1)) / 2
    balls = []
    for number in range(count):
        # At depths and places apart, so that they do not collide.
        place = draw.place(draw.between(-0.05, 0.05) + 0.2 * (number % 2), draw.between(-0.1, 0.1), 0.08 * number)
        velocity = draw.course(heading + number * turn_deg + draw.between(-3.0, 3.0), speed)
        balls.append(Ball((draw.flight(middle_s + number * gap_s, duration_s, place=place, velocity=velocity),)))
    return draw.scene(*balls, duration_s=duration_s)


def relay(draw: SceneSampler) -> RealScene:
    """A ball that comes in while another leaves."""
    place = draw.place(draw.between(-0.2, 0.2), 0.0)
    velocity = draw.course(draw.heading_deg(), draw.between(5.0, 8.0))
    crossing_s = 2 * abs(draw.place(0.0, 1.0)[1]) / float(np.linalg.norm(velocity))
    gap_s = crossing_s * draw.between(0.85, 1.05)
    balls = [
        Ball((draw.flight(at_s, 0.2, place=place + 0.1 * number * RIGHT, velocity=velocity),))
        for number, at_s in enumerate((0.1 - gap_s / 2, 0.1 + gap_s / 2))
    ]
    return draw.scene(*balls, duration_s=0.2)


def rolling(draw: SceneSampler) -> RealScene:
    """A flight above a ball that rolls on the table."""
    up, below = draw.plumb, draw.between(0.12, 0.25)
    velocity = draw.course(draw.between(0.0, 360.0), draw.between(0.5, 1.5))
    velocity = velocity - (velocity @ up) * up
    spin = np.cross(up, velocity) / (2 * math.pi * Ball.radius_m)
    place = draw.place(draw.between(-0.5, 0.5), draw.between(-0.4, 0.4), -below)
    turn = quaternion_of(draw.seat(spin, -place))
    rolls = Rolling(0.0, DURATION_S, triple(place - MIDDLE_S * velocity), triple(velocity), triple(spin), turn)
    draw.among(background=Background(height_m=Ball.radius_m - float(place @ up)))
    return draw.scene(Ball((draw.flight(),)), Ball((rolls,)))


def _kinds() -> dict[str, SceneKind]:
    groups: dict[str, dict[str, Callable[[SceneSampler], RealScene]]] = {
        "background": {
            "bright_floor": lambda d: d.among(background=plain(d.between(0.45, 0.6))).shot(),
            "grey": lambda d: d.among(background=plain(d.between(0.25, 0.45))).shot(),
            "white_wall": lambda d: d.view(up=oblique(d)).among(background=plain(d.between(0.65, 0.8))).shot(),
            "table_lines": lambda d: d.among(background=table(d, d.between(0.1, 0.2))).shot(),
            "textured_floor": lambda d: d.among(background=texture(d, d.between(0.2, 0.5), d.between(2.5, 6.0))).shot(),
            "green_table": lambda d: d.among(background=table(d, d.between(0.22, 0.32), floor_albedo=0.1)).shot(),
        },
        "clutter": {
            "vibration": lambda d: (
                d.view(size_px=(800, 600))
                .among(
                    background=texture(d, d.between(0.3, 0.7), d.between(2.0, 3.5)),
                    shake=Shake(d.between(0.5, 2.0), d.between(8.0, 25.0), d.seed),
                )
                .shot()
            ),
            "shadow": lambda d: d.among(
                light=Light(shadow=d.between(0.3, 0.6), penumbra_rad=d.between(0.02, 0.1))
            ).shot(),
            "net": lambda d: d.among(net=net(d)).shot(),
            "arm_before": lambda d: d.among(arm=arm(d, 0.35)).shot(),
            "arm_behind": lambda d: d.among(arm=arm(d, -0.1)).shot(),
        },
        "poses": {
            "side": lambda d: d.view(up=(0.0, -1.0, 0.0)).among(background=plain(0.1)).shot(),
            "oblique": lambda d: d.view(up=oblique(d)).among(background=plain(0.12)).shot(),
            "near": lambda d: d.view(distance_m=d.between(0.65, 1.0)).shot(),
            "far": lambda d: d.view(distance_m=d.between(3.0, 4.0)).shot(),
            "lens_16mm": lambda d: d.view(CameraParameters(focal_length_mm=16.0)).shot(),
            "lens_5mm": lambda d: d.view(CameraParameters(focal_length_mm=5.0)).shot(),
            "vga": lambda d: d.view(GEN31, size_px=(640, 480), distance_m=d.between(0.7, 1.0)).shot(),
            "davis346": lambda d: d.view(DAVIS, size_px=(346, 260), distance_m=d.between(0.8, 1.2)).shot(),
        },
        "flicker": {
            "flicker_100hz": lambda d: flickering(d, 100.0),
            "flicker_120hz": lambda d: flickering(d, 120.0),
        },
        "balls and logos": {
            "orange": lambda d: d.shot(albedo=d.between(0.45, 0.6)),
            "faint_logo": lambda d: d.shot(**faint(d.between(0.3, 0.5))),
            "double_circle": lambda d: d.shot(logo=Logo("double_circle")),
            "two_logos": lambda d: d.shot(logo=Logo(sides=2)),
            "marks": lambda d: d.shot(logo=Logo("marks"), **faint(d.between(0.6, 1.0))),
            "seam": lambda d: d.shot(logo=Logo("seam"), **faint(d.between(0.5, 0.9))),
        },
        "bounces and extreme spins": {
            "bounce": bounce,
            "bounce_side": lambda d: bounce(d.view(up=(0.0, -1.0, 0.0)).among(background=plain(0.1))),
            "racket_hit": racket_hit,
            "slow_spin": lambda d: turning(d, 2.0, 8.0),
            "fast_spin": lambda d: turning(d, 100.0, 150.0),
        },
        "sensor trouble": {
            "gaps": lambda d: sensed(d, gaps_hz=40.0, gap_us=d.between(500.0, 2000.0)),
            "jitter": lambda d: sensed(d, jitter_us=50.0),
            "noise": lambda d: sensed(d, noise_hz=10 * SensorModel.of().noise_hz, hot_share=0.03),
            "dead_time": lambda d: sensed(d, refractory_us=d.between(800.0, 1500.0)),
            "weak": lambda d: d.scene(Ball((d.flight(),)), sensor=weak_sensor(d.random)),
        },
        "edges and several balls": {
            "edge": edge,
            "same_speed": lambda d: companions(d, 0.0, 2, 0.0, DURATION_S),
            "crossing": lambda d: companions(d, d.between(0.015, 0.03), 2, d.between(50.0, 130.0), DURATION_S),
            "relay": relay,
            "succession": lambda d: companions(d, d.between(0.035, 0.05), 3, 0.0, 0.2),
            "four_balls": lambda d: companions(d, d.between(0.02, 0.03), 4, d.between(30.0, 80.0), 0.15),
            "rolling": rolling,
        },
    }
    return {kind: SceneKind(group, draw) for group, kinds in groups.items() for kind, draw in kinds.items()}


KINDS = _kinds()


def real_scene(kind: str, seed: int = 0) -> RealScene:
    """A scene of a class of `KINDS`; raises ParameterError for an unknown one."""
    if kind not in KINDS:
        raise ParameterError(f"scene {kind!r} is unknown: there are {', '.join(KINDS)}")
    return KINDS[kind].draw(SceneSampler(kind, seed))
