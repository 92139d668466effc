"""Rolling and flying balls told apart by gravity, within the time that a camera's view of it takes, never wrongly."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from spinscope.pipeline.camera import Camera, CameraParameters
from spinscope.pipeline.simulator import Air, Ball, Flight, Scene
from spinscope.pipeline.simulator.motion import triple
from spinscope.pipeline.stages.track_path import PathPoint
from spinscope.pipeline.stages.track_rolling import rolls
from tests.pipeline.stages.test_track_contact import CONTOUR_US, UPRIGHT, flown, path_of

ABOVE, OBLIQUE, SIDE = ((0.0, 0.0, -1.0), (0.0, -(0.5**0.5), -(0.5**0.5)), (0.0, -1.0, 0.0))
WEIGHTLESS = Air(gravity_m_s2=0.0, drag=0.0, magnus=0.0)
Up = tuple[float, float, float]


@cache
def path_of_slow_ball(up: Up, seed: int, *, rolling: bool, tick_us: int = 5000) -> tuple[list[PathPoint], Camera]:
    """A quarter of a second of a ball of 0.5 to 2.8 m/s, on a level table or in flight with any spin."""
    rng, camera = np.random.default_rng([seed, rolling]), Camera.of(CameraParameters(up=up), 1280, 720)
    level = np.cross(up, rng.standard_normal(3))
    velocity = level / np.linalg.norm(level) * rng.uniform(0.5, 2.8)
    if not rolling:
        velocity = velocity + np.array(up) * rng.uniform(-1.0, 1.0)
    start = np.array([*rng.uniform(-0.2, 0.2, 2), rng.uniform(1.2, 2.2)]) - 0.1 * velocity
    spin = np.zeros(3) if rolling else rng.uniform(-40.0, 40.0, 3)
    flight = Flight(0.0, 0.25, triple(start), triple(velocity), triple(spin), UPRIGHT)
    scene = Scene(0.25, (Ball((flight,)),), air=WEIGHTLESS if rolling else Air(), up=up)
    return path_of(flown(scene), camera, rng, tick_us), camera


def number_seen_to_roll(count: int, up: Up, *, rolling: bool, tick_us: int = 5000) -> int:
    """How many of 30 balls are said to roll after so many ticks."""
    number = 0
    for seed in range(9200, 9230):
        path, camera = path_of_slow_ball(up, seed, rolling=rolling, tick_us=tick_us)
        number += rolls(path[:count], camera, 0.02, CONTOUR_US) is True
    return number


@pytest.mark.parametrize(("up", "known_after"), [(ABOVE, 48), (OBLIQUE, 45), (SIDE, 20)])
def test_a_ball_that_rolls_is_told_from_one_that_flies(up: Up, known_after: int) -> None:
    """From the side within 0.1 s. Before that is known nothing is said, and of a flight never."""
    assert number_seen_to_roll(known_after, up, rolling=True) >= 24
    assert not any(number_seen_to_roll(count, up, rolling=False) for count in (3, 4, 6, 9, 13, 17, 20, 30, 48))


def test_what_cannot_be_told_yet_is_said() -> None:
    """From the side most slow balls are known to fly, or to roll, within 0.1 s; of none is the other said."""
    told: dict[bool, list[bool | None]] = {}
    for rolling in (False, True):
        paths = [path_of_slow_ball(SIDE, seed, rolling=rolling) for seed in range(9200, 9230)]
        assert all(rolls(path[:3], camera, 0.02, CONTOUR_US) is None for path, camera in paths)
        told[rolling] = [rolls(path[:20], camera, 0.02, CONTOUR_US) for path, camera in paths]
    assert told[False].count(False) >= 27 and True not in told[False]
    assert told[True].count(True) >= 24 and False not in told[True]


def test_circles_that_share_events_tell_no_more() -> None:
    assert number_seen_to_roll(15, SIDE, rolling=True, tick_us=1000) == 0


def test_a_flight_seen_from_the_side_by_a_camera_said_to_look_down_does_not_roll() -> None:
    """Gravity shows nothing along a wrong camera.up, but it bends the path."""
    said = Camera.of(CameraParameters(), 1280, 720)
    for seed in range(9240, 9250):
        path, _ = path_of_slow_ball(SIDE, seed, rolling=False)
        assert not any(rolls(path[:n], said, 0.02, CONTOUR_US) for n in range(len(path) + 1))
