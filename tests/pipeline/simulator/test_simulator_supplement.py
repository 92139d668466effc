"""What the biases do to a recording, as the paper's supplement publishes it, and one's own curves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from spinscope.pipeline.biases import CURVES, FACTORY, PAPER, BiasCurve, BiasParameters
from spinscope.pipeline.camera import Camera, CameraParameters
from spinscope.pipeline.simulator import (
    Background,
    Scene,
    SensorModel,
    SimulatedRecording,
    flight,
    simulate_scene,
    spinner,
)

SMALL = Camera.of(CameraParameters(), 160, 120)
QUIET = replace(SensorModel(), noise_hz=0.0, hot_share=0.0)


def shot(seed: int) -> Scene:
    background = Background(kind="plain")
    return flight(kind="top", speed_m_s=6.0, heading_deg=80.0, background=background, camera=SMALL, seed=seed)


def test_noise_falls_with_the_thresholds():
    noise, counts = [], []
    for value in (-35, 0, 20, 40, 60, 90, 140):
        sensor = SensorModel.of(BiasParameters(diff_on=value, diff_off=value))
        noise.append(sensor.noise_hz)
        counts.append(len(simulate_scene(Scene(0.5, ()), camera=SMALL, sensor=sensor, seed=1).events))
    assert noise == sorted(noise, reverse=True)
    assert counts == sorted(counts, reverse=True)
    assert noise[1] > 5 * noise[3]  # steeply up to the paper's 40


def seen_at(**biases: int) -> SimulatedRecording:
    """A shot at the paper's biases but for these, without background noise."""
    sensor = replace(SensorModel.of(BiasParameters(**biases)), noise_hz=0.0, hot_share=0.0)
    return simulate_scene(shot(seed=6), camera=SMALL, sensor=sensor, seed=1)


def test_on_and_off_part_above_60():
    """The supplement: about as many ON as OFF events of the ball up to 60, and fewer in all, the higher the bias."""
    ratio, counts = {}, []
    for value in (0, 40, 60, 90, 140):
        on = seen_at(diff_on=value, diff_off=value).events.on
        ratio[value] = on.sum() / (~on).sum()
        counts.append(on.size)
    assert counts == sorted(counts, reverse=True)
    assert all(ratio[value] == pytest.approx(1.0, abs=0.1) for value in (0, 40, 60))
    assert ratio[90] > 1.12
    assert ratio[140] > 1.5


def test_a_longer_dead_time_gives_fewer_events():
    counts = [len(seen_at(refr=value).events) for value in (-20, 0, 40, 80, 120, 180, 235)]
    assert counts == sorted(counts)
    assert counts[0] < 0.7 * counts[3] < counts[4]


def test_a_slow_pixel_gives_fewer_events_and_late_ones():
    """The supplement: bias_fo matters below 0 only, where late events of the edge lie inside the ball."""
    values = (-35, -20, -15, -10, -5, 0, 25, 55)
    made = {value: seen_at(fo=value) for value in values}
    counts = [len(made[value].events) for value in values]
    assert counts[:6] == sorted(counts[:6])
    assert counts[0] < 0.6 * counts[5]
    assert counts[5:] == pytest.approx([counts[-1]] * 3, rel=0.1)
    first = {value: first_on_us(made[value]) for value in (-35, -10, 0, 55)}
    for slow, fast, at_least_us in ((-35, -10, 100), (-10, 0, 30), (0, 55, 0)):
        both = np.isfinite(first[slow]) & np.isfinite(first[fast])
        assert np.median(first[slow][both] - first[fast][both]) > at_least_us


def first_on_us(recording: SimulatedRecording) -> np.ndarray:
    """(h, w) time of every pixel's first ON event, infinite without one."""
    first, events = np.full((SMALL.height_px, SMALL.width_px), np.inf), recording.events
    rows = np.flatnonzero(events.on)
    np.minimum.at(first, (events.y_px[rows], events.x_px[rows]), events.t_us[rows])
    return first


def test_ones_own_curves_make_the_sensor():
    mine = BiasCurve("refr", ((-20, 100.0), (235, 10.0)), calibrated=True)
    assert SensorModel.of(PAPER, {**CURVES, "refractory_us": mine}).refractory_us == pytest.approx(mine.at(80))


def test_the_paper_and_the_maker_setting_are_not_slowed_by_their_resets():
    for biases in (PAPER, FACTORY):
        sensor = SensorModel.of(biases)
        assert sensor.dead_us == sensor.refractory_us
    assert SensorModel.of(BiasParameters(fo=-10)).dead_us == pytest.approx(2.5e6 / (2 * np.pi * 400.0))


def test_a_high_pass_gives_fewer_events():
    counts = [len(seen_at(hpf=value).events) for value in (0, 20, 60, 120)]
    assert counts == sorted(counts, reverse=True)
    assert counts[0] > counts[-1]


def test_the_high_pass_takes_slow_motion_away():
    slow = spinner(spin_rps=(1.5, 0.0, 0.0), ball=1, duration_ms=60.0, position_m=(0.0, 0.0, 2.0), seed=1)
    seen = len(simulate_scene(slow, camera=SMALL, sensor=QUIET).events)
    passed = replace(SensorModel.of(BiasParameters(hpf=120)), noise_hz=0.0, hot_share=0.0)
    assert seen > 50
    assert len(simulate_scene(slow, camera=SMALL, sensor=passed).events) < 0.7 * seen
