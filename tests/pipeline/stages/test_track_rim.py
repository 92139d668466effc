"""The ball's rim: what the events behind tell of it, and the radius that follows before every ground and sensor."""

from __future__ import annotations

import base64
import dataclasses
import math

import cv2
import numpy as np
import pytest

from spinscope.pipeline.camera import Camera, CameraParameters
from spinscope.pipeline.chain import Chain
from spinscope.pipeline.event_source import EventsInMemory
from spinscope.pipeline.presets import preset
from spinscope.pipeline.simulator import Lens, Scene, SensorModel, simulate_scene
from spinscope.pipeline.simulator.logos import Logo
from spinscope.pipeline.simulator.scene import Background, Ball, Flight
from spinscope.pipeline.stages.track_outline import Sighting
from spinscope.pipeline.stages.track_rim import USUAL_BEHIND_PX, Rim

RIM_SHARE, LATE_US = 0.6, 40.0


def outline(behind_px: float, behind: float = 1.0) -> Sighting:
    """An outline with its events behind so far outside it, in this share of its half behind."""
    return Sighting(np.zeros(5), np.eye(5), 0.15, 80, 0.95, behind, 0.95, 0.97, 1.0, 0.05, behind_px)


def test_the_rim_follows_the_events_behind() -> None:
    """By 0.6 of what they differ from the usual; outwards by no more than slow pixels leave of it."""
    assert Rim().outside_px(5000.0) == 0.0 and Rim().std_px(20.0) == 0.0
    inwards, outwards = (Rim().with_outline(outline(USUAL_BEHIND_PX + off)) for off in (-1.0, 1.0))
    assert inwards.outside_px(5000.0) == pytest.approx(-RIM_SHARE)
    assert outwards.outside_px(0.0) == pytest.approx(RIM_SHARE)
    assert outwards.outside_px(5000.0) == pytest.approx(RIM_SHARE * (1.0 - 5000.0 * LATE_US * 1e-6))
    assert outwards.outside_px(1e6) == 0.0
    assert inwards.std_px(20.0) == 0.0 and outwards.std_px(20.0) == pytest.approx(0.5 * RIM_SHARE)


def test_outlines_are_averaged() -> None:
    """Of outlines without events behind only that counts."""
    rim = Rim()
    for one in (outline(0.2, 1.0), outline(math.nan, 0.0), outline(0.6, 0.5)):
        rim = rim.with_outline(one)
    assert (rim.outlines, rim.distances) == (3, 2)
    assert rim.behind_px == pytest.approx(0.4) and rim.shown == pytest.approx(0.5)


def test_a_rim_that_does_not_show_may_lie_further_out() -> None:
    """By 0.15 of the radius, 1 sigma, where there are no events behind."""
    assert Rim().with_outline(outline(math.nan, 0.0)).std_px(20.0) == pytest.approx(0.15 * 20.0)
    assert Rim().with_outline(outline(math.nan, 0.8)).std_px(20.0) == pytest.approx(0.2 * 0.15 * 20.0)


def test_a_print_at_the_rim_moves_the_circle() -> None:
    """By 0.2 of the radius for each share of the rarer polarity ahead beyond 0.02, on average over the outlines."""
    rim = Rim()
    for ahead_on in (0.8, 1.0, 0.1):
        rim = rim.with_outline(dataclasses.replace(outline(0.0), ahead_on=ahead_on))
    assert rim.mixed == pytest.approx(0.1)
    assert rim.unsteady_px(20.0) == pytest.approx(0.2 * 0.08 * 20.0)
    assert Rim().with_outline(dataclasses.replace(outline(0.0), ahead_on=0.99)).unsteady_px(20.0) == 0.0


def test_a_ball_that_is_half_painted_touches_nothing() -> None:
    """Its print comes and goes at the outline ahead, which moves the circle by half a pixel and more."""
    _, black = cv2.imencode(".png", np.zeros((8, 8), np.uint8))
    painted = Logo("png", base64.b64encode(black.tobytes()).decode(), 60.0)
    flight = Flight(0.0, 0.06, (-0.11, 0.0, 1.8), (4.0, 0.3, 0.0), (5.0, 38.0, -30.0), (1.0, 0.0, 0.0, 0.0))
    scene = Scene(0.06, (Ball((flight,), logo=painted),))
    made = simulate_scene(scene, camera=Camera.of(CameraParameters(), 280, 120), seed=97_203)
    chain = Chain(EventsInMemory("simulation", made.events, made.width_px, made.height_px, 0, made.duration_us))
    results = [tick.track for tick in chain.run(preset("default"), targets=("track",))]
    assert sum(result.measured is not None for result in results) >= 8
    assert [end for result in results for end in result.ended] == []


@pytest.mark.parametrize(
    ("albedo", "threshold_on", "threshold_off", "blur_px"),
    [
        pytest.param(0.1, 0.2, 0.3, 0.9, id="soft lens"),
        pytest.param(0.1, 0.3, 0.3, 0.2, id="sharp lens"),
        pytest.param(0.35, 0.4, 0.3, 0.5, id="grey ground"),
        pytest.param(0.55, 0.18, 0.45, 0.5, id="bright ground, hardly an event behind"),
    ],
)
def test_the_radius_is_right_within_what_is_stated(
    albedo: float, threshold_on: float, threshold_off: float, blur_px: float
) -> None:
    """Within two stated errors, whatever the ground, the sensor and the lens."""
    camera = Camera.of(CameraParameters(), 320, 240)
    flight = Flight(0.0, 0.03, (-0.09, 0.0, 1.8), (6.0, 0.5, 0.0), (0.0, 40.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    scene = Scene(0.03, (Ball((flight,)),), background=Background(kind="plain", albedo=albedo))
    sensor = dataclasses.replace(SensorModel.of(), threshold_on=threshold_on, threshold_off=threshold_off)
    made = simulate_scene(scene, camera=camera, sensor=sensor, lens=Lens(blur_px=blur_px), seed=90_100)
    chain = Chain(EventsInMemory("simulation", made.events, made.width_px, made.height_px, 0, made.duration_us))
    *_, last = (tick.track.ball for tick in chain.run(preset("default"), targets=("track",)))
    assert last is not None, "the ball is tracked"
    off_px = last.mean[4] - np.interp(last.t_us, made.truth.t_us, made.truth.radius_px)
    assert abs(off_px) < 2.0 * math.sqrt(last.covariance[4, 4])
