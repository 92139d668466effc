"""Circles of a simulated flight as the tracker would measure them, without events."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spinscope.pipeline.camera import Camera, CameraParameters
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.results import Circle, Packet
from spinscope.pipeline.simulator import flight
from spinscope.pipeline.simulator.motion import trajectory
from spinscope.pipeline.spin.trajectory import stage
from spinscope.pipeline.spin.trajectory.stage import TrajectoryParameters, TrajectoryResult
from spinscope.pipeline.stage import Context
from spinscope.pipeline.stages.track_result import BallTrack

Floats = NDArray[np.float64]

CAMERA = Camera.of(CameraParameters(), 1280, 720)
RADIUS_M = 0.02
TICK_US = 5000


@dataclass(frozen=True)
class FlownCircles:
    """Scene times (n,), circles (n, 3) in px, spin (3,) in rps and mean velocity (3,) of a flight, its air and up."""

    t_us: Floats
    circles_px: Floats
    spin_rps: Floats
    velocity_m_s: Floats
    lift_scale: float
    drag_per_m: float
    up: Floats


def flown(
    seed: int, *, noise_px: float = 0.05, radius_error_px: float = 0.0, camera: Camera = CAMERA, **options: Any
) -> FlownCircles:
    """A flight of the simulator seen at every tick while all of the ball is in the image."""
    scene = flight(seed=seed, camera=camera, **options)
    (ball,) = scene.balls
    way = trajectory(ball.motions[0], ball, scene)
    pose = way.at(np.arange(TICK_US, way.end_s * 1e6, TICK_US) * 1e-6)
    circles = np.column_stack(camera.silhouette(pose.position_m, RADIUS_M))
    inside = (circles[:, :2] > circles[:, 2:]) & (circles[:, :2] < [camera.width_px, camera.height_px] - circles[:, 2:])
    seen = inside.all(axis=1)
    noise = np.random.default_rng(seed).normal(0.0, noise_px, circles.shape)
    assert scene.air.lift_max is not None
    return FlownCircles(
        pose.time_s[seen] * 1e6,
        (circles + noise + [0.0, 0.0, radius_error_px])[seen],
        pose.spin_rps[0],
        pose.velocity_m_s[seen].mean(axis=0),
        scene.air.lift_max / 0.26,
        scene.air.drag * 0.5 * 1.2 * np.pi * RADIUS_M**2 / 0.0027,
        np.array(scene.up),
    )


def context(camera: Camera = CAMERA, **values: Any) -> Context:
    known = {"track.ball": "flying", "track.contour_us": 3000, "track.tick_us": TICK_US, "spin.max_spin_rps": 150.0}
    return Context(camera, RADIUS_M, known | values)


def ball_at(t_us: float, circle_px: Floats | None, is_shot: bool = True) -> BallTrack:
    measured = None if circle_px is None else Circle(*circle_px.tolist(), 1.0)
    mean = np.zeros(5) if circle_px is None else np.array([*circle_px[:2], 0.0, 0.0, circle_px[2]])
    return BallTrack(0, t_us, 40.0, mean, np.eye(5), measured, 0, "entered", is_shot)


def answer(
    shown: FlownCircles,
    parameters: TrajectoryParameters | None = None,
    around: Context | None = None,
) -> TrajectoryResult:
    """The stage's last result after all circles, tick by tick."""
    parameters = parameters or TrajectoryParameters()
    state = stage.start(parameters, around or context())
    result = None
    for t_us, circle in zip(shown.t_us, shown.circles_px, strict=True):
        packet = Packet(0, int(t_us) - TICK_US, int(t_us), EventBatch.empty())
        result = stage.step(parameters, state, packet, ball_at(float(t_us), circle))
    assert result is not None
    return result


def changed(shown: FlownCircles, **values: Any) -> FlownCircles:
    return replace(shown, **values)


def angle_deg(one: Floats, other: Floats) -> float:
    cosine = one @ other / np.linalg.norm(one) / np.linalg.norm(other)
    return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
