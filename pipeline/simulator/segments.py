"""Truth of free flights: motions of balls between two contacts, as far as they are in the image."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from .bodies import BallBody
from .motion import Trajectory, seen
from .scene import Flight, Scene, Vector3

STEP_US = 500
TOUCHES_M = 1e-3  # a ball so near to the table bounces there, one that is higher was hit


@dataclass(frozen=True)
class Segment:
    """A ball between two contacts, as far as its centre is in the image.

    Attributes
    ----------
    ball : int
        Number of the ball in the scene.
    start_us, end_us : int
        Exact at a contact and at the borders of the recording, otherwise to 500 us.
    spin_rps : (3,) floats
        In the middle of this time, camera frame.
    is_shot : bool
        Whether it flies freely: a ball that rolls or turns in place does not.
    began_by, ended_by : str
        "start" or "end" of the recording, "entered" or "left" the image, "bounce" or "hit".
    logo_events : int
        Events of its logo in this time.
    """

    ball: int
    start_us: int
    end_us: int
    spin_rps: Vector3
    is_shot: bool
    began_by: str
    ended_by: str
    logo_events: int


def segments_of(scene: Scene, camera: Camera, logo_us: Sequence[NDArray[np.int64]]) -> list[Segment]:
    """Segments of all balls in order of their start; `logo_us` are the times of each ball's logo events, rising."""
    found = []
    for number, ball in enumerate(scene.balls):
        flights = BallBody(scene, number).trajectories
        for k, flown in enumerate(flights):
            start_us, end_us = round(flown.start_s * 1e6), round(flown.end_s * 1e6)
            first, last = max(start_us, 0), min(end_us, round(scene.duration_s * 1e6))
            time_us = np.append(np.arange(first, last, STEP_US), last)
            poses = flown.at(time_us * 1e-6)
            inside = np.flatnonzero(_in_image(seen(poses, scene.shake, camera.focal_px), ball.radius_m, camera))
            if last <= first or not inside.size:
                continue
            begun, ended = int(time_us[inside[0]]), int(time_us[inside[-1]])
            began_by = "entered" if begun > first else "start"
            if begun == start_us and k > 0 and flights[k - 1].end_s == flown.start_s:
                began_by = _contact(scene, flown, 0, ball.radius_m)
            ended_by = "left" if ended < last else "end"
            if ended == end_us and k + 1 < len(flights) and flights[k + 1].start_s == flown.end_s:
                ended_by = _contact(scene, flown, -1, ball.radius_m)
            x, y, z = flown.at([(begun + ended) / 2e6]).spin_rps[0].tolist()
            logo = int(np.diff(np.searchsorted(logo_us[number], (begun, ended)))[0])
            is_shot = isinstance(ball.motions[k], Flight)
            found.append(Segment(number, begun, ended, (x, y, z), is_shot, began_by, ended_by, logo))
    return sorted(found, key=lambda segment: (segment.start_us, segment.ball))


def _in_image(poses: Trajectory, radius_m: float, camera: Camera) -> NDArray[np.bool_]:
    x, y, _ = camera.silhouette(poses.position_m, radius_m)
    return np.asarray((x >= 0) & (x < camera.width_px) & (y >= 0) & (y < camera.height_px))


def _contact(scene: Scene, flown: Trajectory, row: int, radius_m: float) -> str:
    height = float(flown.position_m[row] @ np.array(scene.up)) + scene.background.height_m - radius_m
    return "bounce" if abs(height) < TOUCHES_M else "hit"
