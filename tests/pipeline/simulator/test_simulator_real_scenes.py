"""Scenes like a lab's or a club's: their truth, and that each shows what it is named for."""

from __future__ import annotations

import dataclasses
import json
from dataclasses import replace

import numpy as np
import pytest

from spinscope.pipeline.camera import Camera, CameraParameters
from spinscope.pipeline.errors import ParameterError
from spinscope.pipeline.simulator import Background, Ball, Fixed, Scene, SensorModel, simulate_scene, spinner
from spinscope.pipeline.simulator.background import intensity_map
from spinscope.pipeline.simulator.bodies import BallBody
from spinscope.pipeline.simulator.logos import Logo
from spinscope.pipeline.simulator.motion import seen, shake_px, shake_speed_px_s, trajectory
from spinscope.pipeline.simulator.real_scenes import KINDS, real_scene
from spinscope.pipeline.simulator.scene import Light, Shake
from spinscope.pipeline.simulator.segments import segments_of

SMALL = Camera.of(CameraParameters(), 160, 120)
QUIET = replace(SensorModel(), noise_hz=0.0, hot_share=0.0)
PLAIN = Background(kind="plain")


def segments(kind: str, seed: int = 0):
    """The segments of a scene without a simulation: nobody counts its logo events."""
    made = real_scene(kind, seed)
    return made.scene, segments_of(made.scene, made.camera, [np.empty(0, np.int64)] * len(made.scene.balls))


@pytest.mark.parametrize("kind", KINDS)
def test_every_scene_has_a_flight_in_view_and_can_be_told_as_json(kind):
    for seed in range(3):
        scene, found = segments(kind, seed)
        assert Scene.from_dict(json.loads(json.dumps(scene.to_dict()))) == scene
        assert any(segment.is_shot and segment.end_us - segment.start_us > 30_000 for segment in found), seed
    assert scene == real_scene(kind, seed).scene
    with pytest.raises(ParameterError, match="unknown"):
        real_scene("snow")


@pytest.mark.parametrize(("kind", "contact"), [("bounce", "bounce"), ("bounce_side", "bounce"), ("racket_hit", "hit")])
def test_a_contact_ends_a_segment_and_begins_the_next(kind, contact):
    for seed in range(4):
        scene, (before, after) = segments(kind, seed)
        assert (before.ended_by, after.began_by) == (contact, contact)
        assert before.end_us == after.start_us == round(scene.balls[0].motions[0].end_s * 1e6)
        flown = BallBody(scene, 0).trajectories
        assert np.allclose(flown[0].position_m[-1], flown[1].position_m[0])
        assert np.allclose(flown[0].rotation[-1], flown[1].rotation[0], atol=1e-9)
        if contact == "bounce":
            up = np.array(scene.up)
            assert flown[0].velocity_m_s[-1] @ up < 0 < flown[1].velocity_m_s[0] @ up
            energy = [np.sum(v**2) + 2 / 3 * np.sum((2 * np.pi * 0.02 * w) ** 2) for v, w in _contact_states(flown)]
            assert energy[1] < energy[0]  # a hollow sphere's, table at rest


def _contact_states(flown):
    return [(flown[0].velocity_m_s[-1], flown[0].spin_rps[-1]), (flown[1].velocity_m_s[0], flown[1].spin_rps[0])]


def test_several_balls_and_what_rolls_is_no_shot():
    for kind, count in (("same_speed", 2), ("crossing", 2), ("relay", 2), ("succession", 3), ("four_balls", 4)):
        scene, found = segments(kind, 1)
        assert {segment.ball for segment in found if segment.is_shot} == set(range(count)), kind
        places = [BallBody(scene, ball).trajectories[0] for ball in range(count)]
        times = np.linspace(0, scene.duration_s, 400)
        for one in range(count):
            for other in range(one):
                apart = places[one].at(times).position_m - places[other].at(times).position_m
                assert np.linalg.norm(apart, axis=1).min() > 0.04, kind  # or they would collide
    scene, found = segments("rolling", 1)
    assert [segment.is_shot for segment in found if segment.ball == 1] == [False]
    rolls = BallBody(scene, 1).trajectories[0]
    contact = rolls.velocity_m_s[0] + 2 * np.pi * np.cross(rolls.spin_rps[0], -0.02 * np.array(scene.up))
    assert np.allclose(contact, 0, atol=1e-12)  # it does not slip


def test_the_flight_passes_the_place_that_was_asked_for():
    for seed in range(3):
        made = real_scene("fast_spin", seed)
        (motion,) = made.scene.balls[0].motions
        flown = trajectory(motion, made.scene.balls[0], made.scene)
        x, y, _ = made.camera.silhouette(flown.at([0.06]).position_m, 0.02)
        assert abs(x[0] - 639.5) < 0.31 * 640
        assert abs(y[0] - 359.5) < 0.21 * 360
        assert 3.9 < np.linalg.norm(flown.at([0.06]).velocity_m_s) < 8.1


def test_a_shake_moves_ball_and_background_alike_and_the_truth_tells():
    shake = Shake(2.0, 20.0, 3)
    times = np.linspace(0, 0.2, 4001)
    shift = shake_px(shake, times)
    assert 0.3 < np.abs(shift).max() <= 2.0
    assert np.abs(np.diff(shift, axis=0)).max() / (times[1] - times[0]) <= shake_speed_px_s(shake)
    still = Fixed(0.0, 0.1, (0.0, 0.0, 2.0), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    scene = Scene(0.03, (Ball((still,), logo=Logo("none")),), background=PLAIN, shake=shake)
    recording = simulate_scene(scene, camera=SMALL, sensor=QUIET)
    truth = recording.truth
    expected = shake_px(shake, truth.t_us * 1e-6)
    assert np.allclose(np.stack([truth.x_px - 79.5, truth.y_px - 59.5], axis=1), expected, atol=0.01)
    # A grain of the background goes the same way: a picture shifted by hand.
    rough = replace(PLAIN, contrast=0.6, grain_px=3.0)
    shaken = simulate_scene(
        Scene(0.03, (), background=rough, shake=shake), camera=SMALL, sensor=SensorModel.ideal(0.15)
    )
    assert set(np.unique(shaken.truth.label)) == {3}
    picture = np.log(intensity_map(Scene(0.03, (), background=rough), SMALL) + 1e-3).reshape(120, 160)
    change = _net_change(shaken, 0.15)
    best = min(
        ((x, y) for x in np.arange(-3, 3.1, 0.5) for y in np.arange(-3, 3.1, 0.5)),
        key=lambda at: np.sum((_shifted(picture, *at) - picture - change)[8:-8, 8:-8] ** 2),
    )
    first, last = shake_px(shake, [0.0, 0.03])
    assert np.allclose(best, last - first, atol=0.76)


def _net_change(recording, threshold: float) -> np.ndarray:
    """(height, width) change of log intensity that the events add up to."""
    total = np.zeros((recording.height_px, recording.width_px))
    events = recording.events
    np.add.at(total, (events.y_px, events.x_px), np.where(events.on, threshold, -threshold))
    return total


def _shifted(picture: np.ndarray, x: float, y: float) -> np.ndarray:
    from scipy.ndimage import shift

    return np.asarray(shift(picture, (y, x), order=1, mode="nearest"))


def test_a_shadow_darkens_and_is_an_other_object():
    flies = real_scene("shadow", 2).scene.balls[0].motions[0]
    over = replace(flies, position_m=(0.0, -0.03, 1.8), velocity_m_s=(0.0, 3.0, 0.0), end_s=0.02)
    light = Light(shadow=0.6, penumbra_rad=0.01, lamp=(0.2, 0.0, -0.98))
    scene = Scene(0.02, (Ball((over,), logo=Logo("none")),), background=PLAIN, light=light)
    made = simulate_scene(scene, camera=SMALL, sensor=QUIET)
    shadow = made.truth.label == 3
    assert shadow.any()
    x, on = made.events.x_px[shadow], made.events.on[shadow]
    assert np.median(x) == pytest.approx(79.5 - 0.2 * 0.2 / 0.98 * 1646 / 2.0, abs=3.0)
    # Ahead of where it stood at first, a pixel gets dark, then light again.
    ahead = made.events.y_px[shadow] > 75
    where = made.events.y_px[shadow].astype(np.int64) * 160 + x
    _, first = np.unique(where[ahead], return_index=True)
    assert on[ahead][first].mean() < 0.05


def test_a_second_logo_stands_on_the_other_side():
    one, two = (
        simulate_scene(
            spinner(spin_rps=(40, 0, 0), ball=1, duration_ms=25.0, position_m=(0, 0, 2.0), logo=Logo(sides=sides)),
            camera=SMALL,
            sensor=QUIET,
        )
        for sides in (1, 2)
    )
    assert two.logo_events == pytest.approx(2 * one.logo_events, rel=0.1)  # one turn: each shows once
    with pytest.raises(ParameterError, match="sides"):
        Logo(sides=3)


def test_logo_events_are_counted_for_every_ball():
    places = ((-0.03, 0.0, 2.0), (0.03, 0.0, 2.0))
    turning = [spinner(spin_rps=(40, 0, 0), duration_ms=25.0, position_m=place).balls[0] for place in places]
    made = simulate_scene(Scene(0.025, tuple(turning), background=PLAIN), camera=SMALL, sensor=QUIET)
    first, second = made.segments
    assert first.logo_events == made.logo_events > 100
    assert second.logo_events == pytest.approx(first.logo_events, rel=0.2)
    assert not first.is_shot
    assert dataclasses.asdict(first)["began_by"] == "start"


def test_the_net_swings_at_its_tape_and_stands_at_its_feet():
    made = real_scene("net", 1)
    recording = simulate_scene(
        replace(made.scene, balls=(), duration_s=0.02), camera=made.camera, sensor=QUIET, lens=made.lens
    )
    assert set(np.unique(recording.truth.label)) == {3}
    still = replace(made.scene, balls=(), duration_s=0.02, net=replace(made.scene.net, swing_m=0.0))
    assert len(simulate_scene(still, camera=made.camera, sensor=QUIET, lens=made.lens).events) == 0


def test_gaps_of_the_readout_lose_all_events_for_a_time():
    scene = spinner(duration_ms=80.0, position_m=(0, 0, 2.0))
    whole = simulate_scene(scene, camera=SMALL, sensor=SensorModel(), seed=5).events
    kept = simulate_scene(scene, camera=SMALL, sensor=SensorModel(gaps_hz=100.0, gap_us=2000.0), seed=5).events
    words = [events.t_us * (1 << 20) + events.y_px * 1024 + events.x_px for events in (whole, kept)]
    lost = ~np.isin(*words)
    assert set(words[1]) < set(words[0])
    begins = np.flatnonzero(np.diff(lost.astype(np.int8)) == 1)
    assert 2 <= begins.size <= 16  # 8 are expected
    for begin in begins:
        length = np.argmin(lost[begin + 1 :])
        assert whole.t_us[begin + length] - whole.t_us[begin + 1] < 2000 * 3  # gaps may meet


def test_a_camera_at_rest_sees_the_trajectory_itself():
    made = real_scene("bounce", 0)
    flown = BallBody(made.scene, 0).trajectories[0]
    assert seen(flown, made.scene.shake, 1646.0) is flown
