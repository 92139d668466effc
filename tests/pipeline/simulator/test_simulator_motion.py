"""Motion against mechanics."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spinscope.pipeline.camera import Camera, CameraParameters
from spinscope.pipeline.errors import ParameterError
from spinscope.pipeline.kernels.rotation import rotations
from spinscope.pipeline.simulator import Air, Ball, Flight, Scene, flight, human_shot, rally, spinner, thrown
from spinscope.pipeline.simulator.flights import SPINNER_BALLS, mounted
from spinscope.pipeline.simulator.motion import bounced, matrix_of, quaternion_of, trajectory
from spinscope.pipeline.simulator.thrower import THROWER_BACKTOP_RPS, THROWER_SIDE_RPS, thrower_spin

UP = np.array([0.0, 0.0, -1.0])
CAMERA = Camera.of(CameraParameters(), 1280, 720)
VACUUM = Air(drag=0.0, magnus=0.0)


def flown(velocity, spin=(0.0, 0.0, 0.0), air=VACUUM, seconds=0.2, bounces=False, decay_hz=0.0):
    motion = Flight(0.0, seconds, (0.1, -0.3, 1.7), velocity, spin, (1.0, 0.0, 0.0, 0.0), decay_hz, bounces)
    ball = Ball((motion,))
    return trajectory(motion, ball, Scene(seconds, (ball,), air=air))


def test_a_flight_without_air_is_a_parabola():
    way = flown((2.0, 6.0, -1.0))
    time = np.linspace(0.0, 0.2, 777)
    pose = way.at(time)
    expected = np.array([0.1, -0.3, 1.7]) + time[:, None] * [2.0, 6.0, -1.0]
    expected[:, 2] += 9.81 * time**2 / 2  # down is +z
    assert pose.position_m == pytest.approx(expected, abs=1e-9)
    assert pose.velocity_m_s[:, 2] == pytest.approx(-1.0 + 9.81 * time, abs=1e-9)


def test_drag_slows_as_one_over_distance_e_folding():
    air = Air(gravity_m_s2=0.0, magnus=0.0)
    k = 0.5 * 1.2 * 0.55 * math.pi * 0.02**2 / 0.0027
    way = flown((0.0, 12.0, 0.0), air=air)
    assert way.velocity_m_s[:, 1] == pytest.approx(12.0 / (1 + k * 12.0 * way.time_s), rel=1e-9)


def test_magnus_turns_the_flight_and_keeps_the_speed():
    air = Air(gravity_m_s2=0.0, drag=0.0, magnus=0.6, lift_max=None)
    way = flown((0.0, 8.0, 0.0), (0.0, 0.0, -40.0), air)  # spin along up: left sidespin
    assert np.linalg.norm(way.velocity_m_s, axis=1) == pytest.approx(8.0, rel=1e-9)
    rate = 0.5 * 1.2 * math.pi * 0.02**2 / 0.0027 * 0.6 * 0.02 * 2 * math.pi * 40.0
    heading = np.unwrap(np.arctan2(way.velocity_m_s[:, 1], way.velocity_m_s[:, 0]))
    assert heading[-1] - heading[0] == pytest.approx(-rate * 0.2, rel=1e-6)
    left = np.cross(UP, [0.0, 1.0, 0.0])
    assert (way.position_m[-1] - way.position_m[0]) @ left > 0


@pytest.mark.parametrize("spin_rps", [2.0, 20.0, 60.0, 300.0])
def test_lift_saturates_with_the_spin(spin_rps):
    """C_L = 0.26 tanh(S / 0.4) for the spin across the flight, whatever turns along it."""
    air = Air(gravity_m_s2=0.0, drag=0.0)
    way = flown((0.0, 8.0, 0.0), (0.0, 35.0, -spin_rps), air, seconds=0.001)
    parameter = 2 * math.pi * spin_rps * 0.02 / 8.0
    lift = 0.5 * 1.2 * math.pi * 0.02**2 / 0.0027 * 64.0 * 0.26 * math.tanh(parameter / 0.4)
    change = (way.velocity_m_s[-1] - way.velocity_m_s[0]) / 0.001
    assert np.linalg.norm(change) == pytest.approx(lift, rel=1e-3)
    assert change[0] == pytest.approx(lift, rel=1e-3)  # to the left, seen along the flight to +y from above


def test_scenes_of_one_set_up_share_air_and_plumb_line():
    one, other, foreign = (flight(seed=seed, set_up=set_up) for seed, set_up in ((1, 5), (2, 5), (2, 6)))
    assert (one.air, one.up) == (other.air, other.up)
    assert one.air != foreign.air and one.up != foreign.up
    assert flight(seed=5).air == one.air
    drawn = [flight(seed=seed) for seed in range(60)]
    drags = np.array([scene.air.drag for scene in drawn]) * 0.5 * 1.2 * math.pi * 0.02**2 / 0.0027
    assert 0.125 <= drags.min() < 0.14 and 0.175 < drags.max() <= 0.19
    lifts = np.array([scene.air.lift_max for scene in drawn]) / 0.26
    assert np.std(lifts) == pytest.approx(0.12, rel=0.3) and np.mean(lifts) == pytest.approx(1.0, abs=0.05)
    tilts = np.degrees(np.arccos([-scene.up[2] for scene in drawn]))
    assert np.sqrt(np.mean(tilts**2)) == pytest.approx(math.sqrt(2), rel=0.3)  # a degree in each direction


def test_scenes_of_earlier_versions_keep_their_linear_lift():
    plain = flight(seed=3).to_dict()
    del plain["air"]["lift_max"]
    assert Scene.from_dict(plain).air.lift_max is None
    again = Scene.from_dict(flight(seed=3).to_dict())
    assert again.air == flight(seed=3).air


def test_topspin_dips_and_backspin_floats():
    forward = np.array([0.0, 8.0, 0.0])
    across = np.cross(UP, forward / 8.0)
    drop = {}
    for name, sign in (("top", 1.0), ("none", 0.0), ("back", -1.0)):
        way = flown(tuple(forward), tuple(sign * 50.0 * across), Air(), seconds=0.1)
        drop[name] = way.position_m[-1, 2] - way.position_m[0, 2]
    assert drop["top"] > drop["none"] > drop["back"]


@pytest.mark.parametrize("seconds", [0.2, 0.0317])  # a whole number of integration steps, and not
def test_spin_decays(seconds):
    way = flown((0.0, 5.0, 0.0), (30.0, 0.0, 0.0), decay_hz=20.0, seconds=seconds)
    assert way.spin_rps[:, 0] == pytest.approx(30.0 * np.exp(-20.0 * way.time_s), rel=1e-9)


def test_the_ball_turns_by_its_spin():
    way = flown((0.0, 5.0, 0.0), (12.0, -30.0, 20.0))
    time = np.array([0.0, 0.01234, 0.19])
    turned = way.at(time).rotation
    for t, matrix in zip(time, turned, strict=True):
        assert matrix == pytest.approx(rotations(2 * np.pi * t * np.array([12.0, -30.0, 20.0]))[0], abs=1e-9)
        assert matrix @ matrix.T == pytest.approx(np.eye(3), abs=1e-12)


@given(st.tuples(*[st.floats(-3.0, 3.0)] * 3))
def test_quaternions_and_matrices_agree(vector):
    matrix = rotations(vector)[0]
    assert matrix_of(quaternion_of(matrix)) == pytest.approx(matrix, abs=1e-9)
    angle = np.linalg.norm(vector)
    if angle > 1e-6:
        assert matrix @ np.array(vector) == pytest.approx(vector, abs=1e-9)
        assert np.trace(matrix) == pytest.approx(1 + 2 * math.cos(angle), abs=1e-9)


@given(
    st.tuples(st.floats(-9, 9), st.floats(-9, 9), st.floats(0.2, 6)),
    st.tuples(*[st.floats(-100.0, 100.0)] * 3),
)
def test_a_bounce_obeys_mechanics(velocity, spin):
    before, turn = np.array(velocity), 2 * np.pi * np.array(spin)
    after, spin_after = bounced(before, np.array(spin), UP, 0.02)
    turn_after = 2 * np.pi * spin_after
    assert after @ UP == pytest.approx(0.89 * before[2])  # it comes down along +z
    # The push at the contact turns the ball as it must: no change of angular momentum about the contact.
    about = np.cross(-0.02 * UP, after - before)
    assert turn_after - turn == pytest.approx(about / (2 / 3 * 0.02**2), abs=1e-6)
    energy = 0.5 * before @ before + 0.5 * 2 / 3 * 0.02**2 * turn @ turn
    assert 0.5 * after @ after + 0.5 * 2 / 3 * 0.02**2 * turn_after @ turn_after <= energy + 1e-9
    # Friction never reverses the slip.
    slip = before - (before @ UP) * UP - 0.02 * np.cross(turn, UP)
    slip_after = after - (after @ UP) * UP - 0.02 * np.cross(turn_after, UP)
    assert slip @ slip_after >= -1e-9


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("kind", ["top", "back", "left", "right", "corkscrew"])
def test_flights_cross_the_image_with_the_spin_asked_for(kind, seed):
    scene = flight(kind=kind, magnitude_rps=60.0, speed_m_s=8.0, seed=seed)
    way = trajectory(scene.balls[0].motions[0], scene.balls[0], scene)
    x, y, radius = CAMERA.silhouette(way.position_m, 0.02)
    inside = (x > -radius) & (x < 1280 + radius) & (y > -radius) & (y < 720 + radius)
    assert inside.any()
    assert not inside[0]
    assert not inside[-1]
    assert np.all(np.diff(np.flatnonzero(inside)) == 1)
    middle = way.at([way.end_s / 2])
    assert np.linalg.norm(middle.velocity_m_s) == pytest.approx(8.0, rel=0.03)
    assert np.linalg.norm(way.spin_rps[0]) == pytest.approx(60.0)
    forward = middle.velocity_m_s[0] / np.linalg.norm(middle.velocity_m_s)
    across = np.cross(UP, forward) / np.linalg.norm(np.cross(UP, forward))
    share = {"top": across, "back": -across, "left": UP, "right": -UP, "corkscrew": forward}[kind]
    assert way.spin_rps[0] @ share > 0.8 * 60.0
    # 0.02 m above the table at least.
    assert way.position_m[:, 2].max() < 2.0 - 0.02


def test_flights_keep_their_logo_where_it_was_mounted():
    for ball, (angle, _) in SPINNER_BALLS.items():
        scene = flight(spin_rps=(30.0, 5.0, -40.0), ball=ball, seed=ball)
        way = trajectory(scene.balls[0].motions[0], scene.balls[0], scene)
        axis = way.spin_rps[0] / np.linalg.norm(way.spin_rps[0])
        centre = way.rotation[:, :, 2]
        assert np.abs(centre @ axis) == pytest.approx(math.cos(math.radians(angle)), abs=1e-6)


@pytest.mark.parametrize("ball", SPINNER_BALLS)
def test_mounted_logos_read_along_the_turn(ball):
    spin = np.array([40.0, 3.0, -6.0])
    frame = mounted(ball, spin, 1.0, toward=np.array([0.0, 0.0, -2.0]))
    _, in_plane = SPINNER_BALLS[ball]
    assert np.linalg.det(frame) == pytest.approx(1.0)
    motion = np.cross(spin, frame[:, 2])
    motion /= np.linalg.norm(motion)
    assert abs(motion @ frame[:, 0]) == pytest.approx(math.cos(math.radians(in_plane)), abs=1e-6)


@pytest.mark.parametrize("seed", range(12))
def test_a_second_ball_crosses_the_image_too(seed):
    """Also where the one drawn first is so slow that it would fall before it has crossed (seeds 6 and 7)."""
    scene = flight(kind="top", speed_m_s=8.0, second_ball=True, seed=seed)
    first, second = scene.balls
    assert len(second.motions) == 1
    assert second.motions[0].end_s > 0.25 * first.motions[0].end_s
    assert second.motions[0].start_s < 0.75 * first.motions[0].end_s


def test_bouncing_flights_meet_the_table():
    scene = flight(bounce=True, speed_m_s=7.0, seed=2)
    way = trajectory(scene.balls[0].motions[0], scene.balls[0], scene)
    height = 2.0 - way.position_m[:, 2]
    assert height.min() == pytest.approx(0.02, abs=2e-3)
    assert way.velocity_m_s[0, 2] > 0 > way.velocity_m_s[-1, 2]
    assert not np.allclose(way.spin_rps[0], way.spin_rps[-1])


def test_thrower_settings_are_the_papers():
    for side, table in ((False, THROWER_BACKTOP_RPS), (True, THROWER_SIDE_RPS)):
        for velocity, row in table.items():
            for setting, magnitude in row.items():
                assert math.hypot(*thrower_spin(velocity, setting, side)) == pytest.approx(magnitude)
    assert thrower_spin(25, -5, False)[1] < 0 < thrower_spin(25, 5, False)[1]
    scene = thrown(25, -3, side=True, seed=1)
    motion = scene.balls[0].motions[0]
    assert math.hypot(*motion.spin_rps) == pytest.approx(107.42)
    with pytest.raises(ParameterError, match="not in the paper's table"):
        thrown(12, 0)


def test_human_shots_have_the_published_distribution():
    spins, speeds = [], []
    for seed in range(80):
        motion = human_shot(seed=seed).balls[0].motions[0]
        spins.append(math.hypot(*motion.spin_rps))
        speeds.append(math.hypot(*motion.velocity_m_s))
    assert np.median(spins) == pytest.approx(46.0, rel=0.2)
    assert np.percentile(spins, 95) == pytest.approx(120.0, rel=0.2)
    assert max(spins) <= 152.0 + 1e-6
    assert np.median(speeds) == pytest.approx(9.0, rel=0.2)


def test_rallies_go_to_and_fro_with_pauses():
    scene = rally(shots=6, duration_s=5.0, seed=3)
    motions = scene.balls[0].motions
    assert len(motions) == 6
    for number, (one, after) in enumerate(pairwise(motions)):
        assert one.end_s <= after.start_s
        assert math.copysign(1, one.velocity_m_s[1]) == (1 if number % 2 == 0 else -1)
    assert motions[-1].end_s <= 5.0


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: spinner(kind="sideways"),
        lambda: spinner(ball=8),
        lambda: spinner(spin_rps=(1.0, 2.0)),
        lambda: spinner(spin_rps=(0.0, 0.0, 2000.0)),
        lambda: spinner(logo="nike"),
        lambda: spinner(logo="missing.png"),
        lambda: spinner(duration_ms=0.0),
        lambda: spinner(position_m=(0.0, 0.0, -1.0)),
        lambda: flight(kind="fast"),
        lambda: flight(speed_m_s=0.0),
        lambda: rally(shots=100, duration_s=1.0),
        lambda: Scene(1.0, (replace(spinner().balls[0], radius_m=-1.0),)),
    ],
)
def test_what_cannot_be_is_refused_in_words(wrong):
    with pytest.raises(ParameterError, match=r"."):
        wrong()
