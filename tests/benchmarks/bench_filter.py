"""How fast the filters are: `pytest tests/benchmarks/bench_filter.py --benchmark-only -s`."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from spinscope.pipeline.camera import Camera, CameraParameters
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.results import Packet
from spinscope.pipeline.stage import Context
from spinscope.pipeline.stages import filter as stage
from spinscope.pipeline.stages.filter import FilterParameters
from tests.reference.filter import NaiveFilter

# The thread's own time: what other programs do on a shared machine does not count.
pytestmark = pytest.mark.benchmark(timer=time.thread_time)
PACKET_EVENTS = 25_000  # 5 ms at 5 Mev/s
CONTEXT = Context(Camera.of(CameraParameters(), 1280, 720), 0.02, {"spin.max_spin_rps": 150.0})


def flight() -> EventBatch:
    """A recorded flight with noise."""
    path = Path(__file__).parents[2] / "sample_recordings/flight_two_balls.h5"
    with h5py.File(path) as file:
        t, x, y, p = (file[f"events/{key}"][:] for key in "txyp")
    return EventBatch.checked(t, x, y, p == 1, width_px=1280, height_px=720)


def everywhere() -> EventBatch:
    """The worst case for the memory: every event at another place of the sensor."""
    rng = np.random.default_rng(0)
    count = 200_000
    x, y = rng.integers(0, 1280, count), rng.integers(0, 720, count)
    t = np.sort(rng.integers(0, 40_000, count))
    return EventBatch.checked(t, x, y, rng.random(count) < 0.5, width_px=1280, height_px=720)


@pytest.mark.parametrize("stream", [flight, everywhere])
def test_two_filters_in_one_packet(benchmark: Any, stream: Any) -> None:
    events, parameters = stream(), FilterParameters()
    packets = [Packet(0, 0, 0, events[first : first + PACKET_EVENTS]) for first in range(0, len(events), PACKET_EVENTS)]
    state = stage.start(parameters, CONTEXT)

    def run() -> None:
        for packet in packets:
            stage.step(parameters, state, packet)

    benchmark.pedantic(run, rounds=30, warmup_rounds=2)
    fast_ns = benchmark.stats.stats.median / len(events) * 1e9

    twins = NaiveFilter("stc_cut_trail", 5000), NaiveFilter("trail", 5000)
    some = events[:20_000]
    started = time.thread_time()
    for event in zip(*(c.tolist() for c in (some.t_us, some.x_px, some.y_px, some.on)), strict=True):
        for twin in twins:
            twin.passes(*event)
    slow_ns = (time.thread_time() - started) / len(some) * 1e9
    sys.stdout.write(
        f"\n{stream.__name__}: {fast_ns:.1f} ns an event for both filters with their batches, "
        f"dictionaries {slow_ns:.0f} ns = {slow_ns / fast_ns:.0f} x\n"
    )
    assert slow_ns > 20 * fast_ns
