"""The pixel against physics: contrast over threshold, low-pass, dead time, the paper's slow OFF, noise."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spinscope.pipeline.simulator import Light, kernels_pixel
from spinscope.pipeline.simulator.kernels_light import Physics
from tests.reference.simulator import naive_pixel

IDEAL = Physics(
    tau_us=1e-3,
    dark_tau_us=0.0,
    forget_per_us=0.0,
    refractory_us=0.0,
    off_after_on_us=0.0,
    contrast_noise=0.0,
    up=(0.0, 0.0, -1.0),
    sky=Light().sky,
    bounce=Light().bounce,
    brightness=1.0,
    floor=0.0,
    flicker_depth=0.0,
    flicker_per_us=0.0,
    pause_us=0.0,
    focal_px=1646.0,
    width_px=1,
)


def events_of(knots_us, light, physics=IDEAL, on=0.25, off=0.25, step_us=2.0, seed=0):
    """(time, on) of a pixel whose log intensity runs straight from knot to knot."""
    state = np.zeros((1, kernels_pixel.STATE_COLUMNS))
    cursor = np.zeros(3, np.int64)
    events = (cursor, np.empty(10_000), np.empty(10_000, np.int64))
    normals = np.random.default_rng(seed).standard_normal(1024)
    sensor = (np.full(1, on, np.float32), np.full(1, off, np.float32), normals)
    first = math.exp(light[0])
    role = np.zeros(1, np.uint8)
    kernels_pixel.begin(state, role, cursor, sensor, physics, 0, first, first, knots_us[0])
    for now in np.arange(knots_us[0] + step_us, knots_us[-1] + step_us / 2, step_us):
        intensity = math.exp(np.interp(now, knots_us, light))
        kernels_pixel.advance(state, events, sensor, physics, 0, 0, intensity, intensity, now)
    return [(events[1][i], bool(events[2][i] & 1)) for i in range(cursor[1])]


@given(
    start=st.floats(-3.0, 0.0),
    contrast=st.floats(-2.5, 2.5),
    on=st.floats(0.1, 0.6),
    off=st.floats(0.1, 0.6),
    rise_us=st.floats(4.0, 5000.0),
)
@settings(max_examples=60)
def test_an_edge_gives_contrast_over_threshold_events(start, contrast, on, off, rise_us):
    found = events_of([0.0, rise_us, rise_us + 100.0], [start, start + contrast, start + contrast], IDEAL, on, off)
    steps = abs(contrast) / (np.float32(on) if contrast > 0 else np.float32(off))
    assert math.floor(steps - 1e-4) <= len(found) <= math.floor(steps + 1e-4)
    assert all(polarity == (contrast > 0) for _, polarity in found)
    # The ramp crosses its thresholds at even distances.
    for number, (time, _) in enumerate(found, start=1):
        if number < 0.98 * steps:  # what just reaches the threshold at the ramp's end comes when it settles
            assert time == pytest.approx(number / steps * rise_us, abs=2.5)


@pytest.mark.parametrize("contrast", [0.3, 0.6, 1.5])
@pytest.mark.parametrize("tau_us", [20.0, 150.0])
def test_the_latency_of_a_step_follows_the_low_pass(contrast, tau_us):
    physics = IDEAL._replace(tau_us=tau_us, refractory_us=1e6)
    ((time, on),) = events_of([0.0, 100.0, 100.001, 2000.0], [-2, -2, contrast - 2, contrast - 2], physics, step_us=1.0)
    expected = 100.0 + tau_us * math.log(contrast / (contrast - 0.25))
    assert on
    assert time == pytest.approx(expected, abs=1.0)


def test_darkness_makes_the_pixel_slow():
    physics = IDEAL._replace(tau_us=20.0, dark_tau_us=5.0, refractory_us=1e6)
    late = []
    for level in (-3.0, -1.0):
        steps = [level - 0.6, level - 0.6, level, level]
        ((time, _),) = events_of([0.0, 100.0, 100.001, 3000.0], steps, physics, step_us=1.0)
        late.append(time - 100.0)
        tau_us = 20.0 + 5.0 / math.exp(level)
        assert late[-1] == pytest.approx(tau_us * math.log(0.6 / 0.35), abs=1.0)
    assert late[0] > late[1]


def test_the_reference_follows_the_signal_in_the_dead_time():
    # A ramp of 1 per ms, thresholds of 0.25, dead for 150 us: an event every 250 + 150 us.
    found = events_of([0.0, 4000.0], [-4.0, 0.0], IDEAL._replace(refractory_us=150.0))
    times = [time for time, _ in found]
    assert np.diff(times) == pytest.approx(np.full(len(times) - 1, 400.0), abs=3.0)


def test_off_waits_after_on():
    # A line passes: bright edge, 300 us later dark again for 200 us, then bright.
    knots, light = [0.0, 50.0, 51.0, 350.0, 351.0, 550.0, 551.0, 2000.0], [-2, -2, -1, -1, -2, -2, -1, -1]
    quick = events_of(knots, light, IDEAL._replace(refractory_us=100.0), on=0.4, off=0.4)
    slow = events_of(knots, light, IDEAL._replace(refractory_us=100.0, off_after_on_us=600.0), on=0.4, off=0.4)
    assert [on for _, on in quick] == [True, False, True]
    assert [on for _, on in slow] == [True]  # the thin line is never seen
    knots = [0.0, 50.0, 51.0, 350.0, 351.0, 2000.0]
    late = events_of(
        knots, [-2, -2, -1, -1, -2, -2], IDEAL._replace(refractory_us=100.0, off_after_on_us=600.0), on=0.4, off=0.4
    )
    assert [on for _, on in late] == [True, False]
    assert late[1][0] == pytest.approx(late[0][0] + 600.0, abs=0.1)


def test_jitter_grows_as_the_edge_gets_softer():
    spread = []
    for rise_us in (200.0, 2000.0):
        physics = IDEAL._replace(contrast_noise=0.02)
        light = [0.0, 1.0]
        times = [events_of([0.0, rise_us], light, physics, seed=seed)[0][0] for seed in range(80)]
        spread.append(np.std(times))
        # Noise over slope.
        assert np.std(times) == pytest.approx(0.02 * rise_us, rel=0.3)
    assert spread[1] > 5 * spread[0]


def test_the_high_pass_forgets_slow_change():
    physics = IDEAL._replace(forget_per_us=1 / 10_000)  # a reference that forgets within 10 ms
    assert not events_of([0.0, 200_000.0], [-4.0, 0.0], physics, step_us=50.0)  # 0.2 in 10 ms: below the threshold
    assert len(events_of([0.0, 2_000.0], [-4.0, 0.0], physics)) >= 13


@given(
    light=st.lists(st.floats(-2.5, 0.0), min_size=3, max_size=6),
    tau_us=st.floats(5.0, 100.0),
    refractory_us=st.sampled_from([0.0, 50.0, 150.0]),
    hold_us=st.sampled_from([0.0, 300.0]),
)
@settings(max_examples=12)
def test_same_events_as_the_slow_twin(light, tau_us, refractory_us, hold_us):
    knots = np.arange(len(light)) * 200.0
    physics = IDEAL._replace(tau_us=tau_us, dark_tau_us=3.0, refractory_us=refractory_us, off_after_on_us=hold_us)
    # In small steps the two are the same model; events at the very edge of a threshold may come or not.
    found = events_of(knots, np.array(light), physics, 0.27, 0.27, step_us=0.5)
    twin = naive_pixel(knots, np.array(light), physics, 0.27, 0.27)
    assert abs(len(found) - len(twin)) <= 1
    for (time, on), (twin_time, twin_on) in zip(found[:2], twin[:2], strict=False):
        assert on == twin_on
        assert time == pytest.approx(twin_time, abs=6.0)
