"""Whole recordings: truth, labels, noise, sameness, and what biases do."""

from __future__ import annotations

import base64
import hashlib
import json
import math
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from spinscope.pipeline.biases import FACTORY
from spinscope.pipeline.camera import Camera, CameraParameters
from spinscope.pipeline.errors import ParameterError
from spinscope.pipeline.kernels.rotation import rotations
from spinscope.pipeline.simulator import (
    Background,
    Ball,
    Fixed,
    Lens,
    Light,
    Scene,
    SensorModel,
    flight,
    rally,
    simulate_again,
    simulate_scene,
    spinner,
)
from spinscope.pipeline.simulator.logos import Logo, texture
from spinscope.pipeline.simulator.sensor import hot_rates_hz, thresholds

SMALL = Camera.of(CameraParameters(), 160, 120)
QUIET = replace(SensorModel(), noise_hz=0.0, hot_share=0.0)
PLAIN = Background(kind="plain")
CENTRE = (0.0, 0.0, 2.0)


def turning(spin_rps=(40.0, 10.0, 15.0), ms=20.0, ball=3, seed=1, **options) -> Scene:
    return spinner(spin_rps=spin_rps, ball=ball, duration_ms=ms, position_m=CENTRE, seed=seed, **options)


def shot(**options) -> Scene:
    options = {"kind": "top", "speed_m_s": 6.0, "seed": 4, "background": PLAIN, "heading_deg": 80.0} | options
    return flight(camera=SMALL, **options)


def digest(recording) -> str:
    events, truth = recording.events, recording.truth
    columns = (events.t_us, events.x_px, events.y_px, events.on, truth.label, truth.x_px)
    return hashlib.sha256(b"".join(column.tobytes() for column in columns)).hexdigest()


def test_same_seed_same_bytes():
    first = simulate_scene(turning(), camera=SMALL, seed=7)
    assert digest(first) == digest(simulate_scene(turning(), camera=SMALL, seed=7))
    assert digest(first) != digest(simulate_scene(turning(), camera=SMALL, seed=8))


def test_a_description_gives_the_recording_again():
    recording = simulate_scene(shot(second_ball=True), camera=SMALL, seed=3)
    description = json.loads(json.dumps(recording.description))
    assert digest(simulate_again(description)) == digest(recording)
    factory = simulate_again(description, sensor=FACTORY)
    assert json.loads(json.dumps(factory.description["scene"])) == description["scene"]
    assert digest(factory) != digest(recording)
    assert np.array_equal(factory.truth.position_m, recording.truth.position_m)
    with pytest.raises(ParameterError, match="no description"):
        simulate_again({"scene": description["scene"]})
    with pytest.raises(ParameterError, match="no scene"):
        Scene.from_dict({"duration_s": 1.0, "balls": [{"motions": [{"nothing": 1}]}]})
    assert Scene.from_dict(json.loads(json.dumps(shot(arm=True).to_dict()))) == shot(arm=True)


def test_the_truth_keeps_the_contract():
    scene = shot()
    recording = simulate_scene(scene, camera=SMALL, seed=1)
    truth, events = recording.truth, recording.events
    assert np.all(np.diff(truth.t_us) == 500)
    assert truth.t_us[0] == 0
    assert truth.t_us[-1] < scene.duration_s * 1e6
    assert truth.label.shape == events.t_us.shape
    x_px, y_px, radius_px = SMALL.silhouette(truth.position_m, 0.02)
    assert np.array_equal(np.stack([x_px, y_px, radius_px]), np.stack([truth.x_px, truth.y_px, truth.radius_px]))
    slope = np.gradient(truth.position_m, truth.t_us * 1e-6, axis=0)
    assert slope[1:-1] == pytest.approx(truth.velocity_m_s[1:-1], abs=1e-3)
    assert np.all(truth.spin_rps == truth.spin_rps[0])
    assert np.all(np.diff(events.t_us) >= 0)
    assert events.t_us[0] >= 0
    assert events.t_us[-1] < scene.duration_s * 1e6
    assert events.x_px.max() < 160
    assert events.y_px.max() < 120
    assert set(np.unique(truth.label)) <= {0, 1, 2, 4}


def test_labels_say_where_events_come_from():
    blank = simulate_scene(turning(logo="none"), camera=SMALL, sensor=QUIET)
    assert len(blank.events) == 0  # a blank ball that turns in place shows nothing
    logo = simulate_scene(turning(), camera=SMALL, sensor=QUIET)
    assert set(np.unique(logo.truth.label)) == {2}
    passing = simulate_scene(shot(logo="none"), camera=SMALL, sensor=QUIET)
    assert set(np.unique(passing.truth.label)) == {1}
    with_arm = simulate_scene(
        replace(shot(arm=True), balls=()), camera=Camera.of(CameraParameters(), 640, 480), sensor=QUIET
    )
    crossing = simulate_scene(shot(second_ball=True), camera=SMALL, sensor=QUIET)
    assert (crossing.truth.label == 3).sum() > 100
    assert set(np.unique(with_arm.truth.label)) <= {1, 3}


def test_the_arm_is_another_object():
    wide = Camera.of(CameraParameters(), 640, 360)
    scene = flight(camera=wide, arm=True, seed=2, speed_m_s=8.0, background=PLAIN)
    arm = replace(scene.arm, elbow_m=(0.3, 0.0, 1.7), rest=(-1.0, 0.0, 0.0))
    recording = simulate_scene(replace(scene, arm=arm, duration_s=0.02), camera=wide, sensor=QUIET)
    assert (recording.truth.label == 3).sum() > 500


def test_events_of_the_outline_lie_on_the_silhouette():
    recording = simulate_scene(shot(logo="none"), camera=SMALL, sensor=SensorModel.ideal(0.5))
    truth, events = recording.truth, recording.events
    x = np.interp(events.t_us, truth.t_us, truth.x_px)
    y = np.interp(events.t_us, truth.t_us, truth.y_px)
    radius = np.interp(events.t_us, truth.t_us, truth.radius_px)
    away = np.hypot(events.x_px - x, events.y_px - y) - radius
    assert np.mean(np.abs(away) < 2.0) > 0.85  # the rest is shading
    # The first event of a pixel comes as the outline enters it.
    _, first = np.unique(events.x_px.astype(int) * 1000 + events.y_px, return_index=True)
    assert np.all(events.on[first])
    assert np.median(away[first]) == pytest.approx(0.3, abs=0.4)


@pytest.mark.parametrize("sensor", [SensorModel.ideal(), QUIET], ids=["ideal", "paper"])
def test_a_known_rotation_moves_the_events_as_it_must(sensor):
    """Turned back by the true spin the logo is sharpest: neither another speed nor another axis does better."""
    spin = np.array([35.0, 12.0, -20.0])
    recording = simulate_scene(turning(tuple(spin), ms=40.0), camera=SMALL, sensor=sensor)
    events = recording.events
    ray = SMALL.rays(events.x_px, events.y_px)
    centre = np.array(CENTRE)
    along, length2 = ray @ centre, np.sum(ray**2, axis=1)
    inside = along**2 - length2 * (centre @ centre - 0.02**2)
    hit = inside > 0
    normal = (((along - np.sqrt(np.maximum(inside, 0))) / length2)[:, None] * ray - centre) / 0.02

    def sharpness(trial) -> float:
        turn = rotations(-2 * np.pi * (events.t_us[:, None] * 1e-6) * trial)
        there = np.einsum("nij,nj->ni", turn, normal)
        score = 0.0
        for on in (False, True):
            cells, _ = np.histogramdd(there[hit & (events.on == on)], bins=36, range=[(-1, 1)] * 3)
            score += float(np.sum(cells**2))
        return score

    best = sharpness(spin)
    for factor in (0.9, 0.95, 1.05, 1.1, -1.0, 0.0):
        assert sharpness(factor * spin) < best
    for axis in np.eye(3):
        for angle in (-8.0, 8.0):
            assert sharpness(rotations(math.radians(angle) * axis)[0] @ spin) < best or abs(axis @ spin) > 39


def test_thresholds_scatter_as_asked():
    on, off = thresholds(replace(SensorModel(), threshold_off=0.4), 200_000, np.random.default_rng(0))
    assert on.mean() == pytest.approx(0.27, rel=1e-3)
    assert off.mean() == pytest.approx(0.4, rel=1e-3)
    assert on.std() / on.mean() == pytest.approx(0.03, rel=0.02)
    assert abs(np.corrcoef(on, off)[0, 1]) < 0.01


def test_noise_comes_at_the_rates_asked_for():
    sensor = replace(SensorModel(), noise_hz=20.0, noise_on_share=0.7, hot_share=0.0, pattern_seed=1)
    still = Scene(0.5, (), background=replace(PLAIN, albedo=0.25))
    recording = simulate_scene(still, camera=SMALL, sensor=sensor)
    expected = 20.0 / math.sqrt(0.25) * 0.5 * 160 * 120  # more in the dark, as the root of the light
    assert len(recording.events) == pytest.approx(expected, abs=5 * math.sqrt(expected))
    assert recording.events.on.mean() == pytest.approx(0.7, abs=0.02)
    assert np.all(recording.truth.label == 0)
    per_pixel = np.bincount(recording.events.x_px + 160 * recording.events.y_px.astype(int), minlength=19200)
    assert per_pixel.var() == pytest.approx(per_pixel.mean(), rel=0.06)  # Poisson


def test_hot_pixels_make_most_of_the_noise_and_stay():
    still = Scene(2.0, (), background=PLAIN)
    sensor = replace(SensorModel(), pattern_seed=5)
    busiest = []
    for seed in (1, 2):
        recording = simulate_scene(still, camera=SMALL, sensor=sensor, seed=seed)
        hot = recording.truth.label == 4
        assert 0.4 < hot.mean() < 0.9
        pixel = recording.events.x_px + 160 * recording.events.y_px.astype(int)
        assert 1 - np.unique(pixel).size / 19200 > 0.9  # most pixels are silent
        busiest.append(set(np.argsort(np.bincount(pixel[hot], minlength=19200))[-5:]))
    assert len(busiest[0] & busiest[1]) >= 3
    where, rate = hot_rates_hz(sensor, 100_000, np.random.default_rng(0))
    assert where.size == pytest.approx(1000, abs=5 * math.sqrt(1000))
    assert np.median(rate) == pytest.approx(0.5, rel=0.2)


def test_readout_clock_delay_and_limit():
    scene = turning()
    plain = simulate_scene(scene, camera=SMALL, sensor=replace(QUIET, delay_us=100.0))
    later = simulate_scene(scene, camera=SMALL, sensor=replace(QUIET, delay_us=350.0))
    count = len(later.events)
    assert np.array_equal(np.sort(later.events.t_us), np.sort(plain.events.t_us + 250)[:count])
    coarse = simulate_scene(scene, camera=SMALL, sensor=replace(QUIET, delay_us=100.0, timestamp_us=100))
    assert np.array_equal(coarse.events.t_us, plain.events.t_us // 100 * 100)
    limit = replace(QUIET, rate_limit_hz=50_000.0)
    limited = simulate_scene(scene, camera=SMALL, sensor=limit)
    assert np.bincount(limited.events.t_us // 1000).max() == 50
    assert len(limited.events) < len(plain.events)
    assert limited.truth.label.size == len(limited.events)


def test_flicker_wakes_every_pixel_at_its_frequency():
    tiny = Camera.of(CameraParameters(), 48, 40)
    light = Light(flicker_depth=0.4, flicker_hz=100.0)
    scene = Scene(0.05, (), background=PLAIN, light=light)
    recording = simulate_scene(scene, camera=tiny, sensor=SensorModel.ideal(0.27))
    swing = math.log(1.4 / 0.6) / 0.27
    per_period = len(recording.events) / (48 * 40) / 5
    # As many thresholds as fit into the swing, up and down; what is left over may cost one of each.
    assert 2 * math.floor(swing) - 2.5 < per_period <= 2 * math.floor(swing)
    rising = np.abs(recording.events.t_us % 10_000 - 5000) > 2500  # the first and the last quarter of the sine
    assert np.array_equal(recording.events.on, rising)


def test_a_moving_edge_is_seen_the_same_however_it_is_stepped(monkeypatch):
    """Half the step, nearly the same events: the steps are fine enough."""
    import spinscope.pipeline.simulator.simulation as simulation

    sensor = replace(QUIET, jitter_us=0.0, contrast_noise=0.0)
    once = simulate_scene(shot(), camera=SMALL, sensor=sensor)
    monkeypatch.setattr(simulation, "EDGE_STEP_PX", 0.0625)
    fine = simulate_scene(shot(), camera=SMALL, sensor=sensor)
    assert len(once.events) == pytest.approx(len(fine.events), rel=0.02)
    for label in (1, 2):
        assert (once.truth.label == label).sum() == pytest.approx((fine.truth.label == label).sum(), rel=0.06)


def test_thin_lines_give_few_events_in_flight():
    """The paper's limitation: a 0.8 mm line is not seen behind the leading edge, a 1.4 mm line is."""
    counts = {}
    for logo in ("line_0.8mm", "line_1.4mm", "andro"):
        found = 0
        for seed in range(2):
            scene = shot(logo=logo, speed_m_s=8.0, seed=seed, ball=1)
            found += (simulate_scene(scene, camera=SMALL, sensor=QUIET).truth.label == 2).sum()
        counts[logo] = found
    assert counts["line_0.8mm"] < 0.6 * counts["line_1.4mm"] < counts["andro"]


def test_a_rally_is_quiet_between_its_shots():
    scene = rally(shots=3, duration_s=1.5, speed_m_s=(8.0, 9.0), camera=SMALL, background=PLAIN, seed=1)
    recording = simulate_scene(scene, camera=SMALL, sensor=QUIET, seed=1)
    motions = scene.balls[0].motions
    there = np.zeros(len(recording.events), bool)
    for motion in motions:
        t_us = recording.events.t_us
        there |= (t_us >= motion.start_s * 1e6) & (t_us < motion.end_s * 1e6 + 5000)
        assert ((t_us >= motion.start_s * 1e6) & (t_us < motion.end_s * 1e6)).sum() > 1000
    assert there.all()
    assert np.all(np.diff(recording.truth.t_us) > 0)


def test_defocus_and_distortion_change_the_picture_not_the_rules():
    sharp = simulate_scene(shot(), camera=SMALL, sensor=QUIET)
    soft = simulate_scene(shot(), camera=SMALL, sensor=QUIET, lens=Lens(focus_m=0.3))
    assert (soft.truth.label == 2).sum() < (sharp.truth.label == 2).sum()
    bent = replace_camera(SMALL, (0.2, 0.0, 0.0, 0.0, 0.0))
    recording = simulate_scene(shot(), camera=bent, sensor=QUIET)
    x_px, _, _ = bent.silhouette(recording.truth.position_m, 0.02)
    assert np.array_equal(recording.truth.x_px, x_px)
    assert len(recording.events) > 1000
    with pytest.raises(ParameterError, match="lens"):
        Lens(blur_px=0.0)


def replace_camera(camera: Camera, distortion: tuple[float, ...]) -> Camera:
    return replace(camera, distortion=distortion)


def test_a_picture_of_ones_own_is_printed(tmp_path: Path):
    picture = np.full((40, 80), 255, np.uint8)
    picture[10:30, 10:70] = 0
    file = tmp_path / "mine.png"
    cv2.imwrite(str(file), picture)
    logo = Logo.of(str(file))
    drawn = texture(logo)
    side = drawn.values.shape[0]
    mm = 2 * drawn.half_extent / (side - 1) * 20.0
    assert drawn.values[side // 2].sum() * mm == pytest.approx(60 / 80 * logo.width_mm, rel=0.05)
    assert drawn.values[:, side // 2].sum() * mm == pytest.approx(20 / 80 * logo.width_mm, rel=0.05)
    scene = turning(logo=logo)
    assert Scene.from_dict(json.loads(json.dumps(scene.to_dict()))) == scene
    assert len(simulate_scene(scene, camera=SMALL, sensor=QUIET).events) > 200
    (tmp_path / "broken.png").write_bytes(b"no picture")
    with pytest.raises(ParameterError, match="no PNG"):
        Logo.of(str(tmp_path / "broken.png"))
    with pytest.raises(ParameterError, match="no PNG"):
        texture(Logo("png", base64.b64encode(b"nothing").decode()))


def test_progress_rises_to_one():
    seen: list[float] = []
    simulate_scene(turning(), camera=SMALL, on_progress=lambda share, what: seen.append(share))
    assert seen == sorted(seen)
    assert seen[-1] == 1.0


def test_a_negative_seed_is_refused():
    with pytest.raises(ParameterError, match="seed"):
        simulate_scene(turning(), seed=-1)


def test_balls_may_come_and_go():
    one = Ball((Fixed(0.005, 0.01, CENTRE, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)),))
    recording = simulate_scene(Scene(0.02, (one,), background=PLAIN), camera=SMALL, sensor=QUIET)
    appeared = recording.events.on
    assert appeared.any()
    assert (~appeared).any()
    assert recording.events.t_us[appeared].min() > 5000
    assert recording.events.t_us[~appeared].min() > 10_000


WITHOUT_COMPILER = """
import numpy as np
from spinscope.pipeline.camera import Camera, CameraParameters
from spinscope.pipeline.simulator import simulate_scene, spinner
scene = spinner(spin_rps=(40.0, 10.0, 15.0), ball=3, duration_ms=1.0, position_m=(0.0, 0.0, 2.0), seed=1)
found = simulate_scene(scene, camera=Camera.of(CameraParameters(), 48, 40), seed=1)
np.save("OUT", np.stack([found.events.t_us, found.events.x_px, found.events.y_px, found.events.on, found.truth.label]))
"""


@pytest.mark.nojit
def test_kernels_say_the_same_without_the_compiler(tmp_path: Path):
    out = tmp_path / "events.npy"
    subprocess.run(
        [sys.executable, "-W", "error", "-c", WITHOUT_COMPILER.replace("OUT", str(out))],
        check=True,
        env=os.environ | {"NUMBA_DISABLE_JIT": "1"},
        cwd=Path(__file__).parents[3],
    )
    plain = np.load(out)
    scene = turning(ms=1.0, ball=3)
    found = simulate_scene(scene, camera=Camera.of(CameraParameters(), 48, 40), seed=1)
    events = found.events
    assert plain.shape[1] == len(events)
    assert np.abs(plain[0] - events.t_us).max() <= 1  # the last bit of exp and log may differ
    assert np.array_equal(plain[1:3].sum(axis=1), [events.x_px.sum(dtype=int), events.y_px.sum(dtype=int)])
