"""How fast the simulator is: `pytest tests/benchmarks/bench_simulator.py --benchmark-only -s`."""

from __future__ import annotations

import sys
import time
from typing import Any

import numpy as np
import pytest

from spinscope.pipeline.camera import Camera, CameraParameters
from spinscope.pipeline.simulator import flight, simulate_scene, spinner
from tests.pipeline.simulator.test_simulator_pixel import IDEAL, events_of
from tests.reference.simulator import naive_pixel

# The thread's own time: what other programs do on a shared machine does not count.
pytestmark = pytest.mark.benchmark(timer=time.thread_time)
CAMERA = Camera.of(CameraParameters(), 1280, 720)


@pytest.mark.parametrize("speed_m_s", [4.0, 9.0, 20.0])
def test_flight(benchmark: Any, speed_m_s: float) -> None:
    """A whole flight at 1280 x 720; the aim is 3 s for 120 ms."""
    scene = flight(speed_m_s=speed_m_s, seed=1)
    recording = benchmark.pedantic(simulate_scene, (scene,), {"camera": CAMERA}, rounds=3, warmup_rounds=1)
    benchmark.extra_info.update(ms=scene.duration_s * 1e3, events=len(recording.events))


@pytest.mark.parametrize("what", ["second_ball", "arm"])
def test_crowded_flight(benchmark: Any, what: str) -> None:
    """A flight with something else that moves."""
    scene = flight(speed_m_s=9.0, seed=1, **{what: True})  # type: ignore[arg-type]
    benchmark.pedantic(simulate_scene, (scene,), {"camera": CAMERA}, rounds=2, warmup_rounds=1)


@pytest.mark.parametrize("scale", [1, 2], ids=["1280x720", "2560x1440"])
def test_sensor_area(benchmark: Any, scale: int) -> None:
    """The same ball on a sensor of four times the pixels: what grows is the fixed part, maps and noise."""
    camera = Camera.of(CameraParameters(), 1280 * scale, 720 * scale)
    scene = spinner(magnitude_rps=60.0, position_m=(0.0, 0.0, 2.0), seed=1)
    benchmark.pedantic(simulate_scene, (scene,), {"camera": camera}, rounds=3, warmup_rounds=1)


def test_pixel_against_its_twin(benchmark: Any) -> None:
    """One pixel through 20 edges in steps of 5 us, and the twin's steps of 0.1 us, for each simulated ms."""
    knots = np.arange(41) * 250.0
    light = np.where(np.arange(41) % 2, -2.0, -0.5)
    physics = IDEAL._replace(tau_us=30.0, refractory_us=150.0)
    events_of(knots, light, physics, step_us=5.0)
    start = time.thread_time()
    naive_pixel(knots, light, physics, 0.27, 0.27)
    twin_s = time.thread_time() - start
    benchmark(events_of, knots, light, physics, 0.27, 0.27, 5.0)
    ratio = twin_s / benchmark.stats.stats.min
    sys.stderr.write(f"\npixel: the twin takes {ratio:.0f} times as long\n")
    assert ratio > 5
