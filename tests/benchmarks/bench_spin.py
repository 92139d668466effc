"""How fast logo, rate, flow and spin are: `pytest tests/benchmarks/bench_spin.py --benchmark-only -s`."""

from __future__ import annotations

import itertools
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from spinscope.pipeline.kernels.logo import logo_rows
from spinscope.pipeline.kernels.plane_flow import FEWEST, SPREAD_PX, fit_plane
from spinscope.pipeline.kernels.rate import low_passed
from spinscope.pipeline.kernels.triplet import earlier_neighbours, triplet_flow
from spinscope.pipeline.spin import normal_flow, triplet
from spinscope.pipeline.spin.parameters import SpinParameters
from spinscope.pipeline.stages import flow, logo, rate
from spinscope.pipeline.stages.filter import FilterResult
from tests.pipeline.stages.test_spin_samples import track_of, truth_of
from tests.reference.spin import (
    naive_logo_rows,
    naive_low_pass,
    naive_neighbours,
    naive_plane,
    naive_triplets,
)
from tests.spinning_ball import CONTEXT, packets

# The thread's own time: what other programs do on a shared machine does not count.
pytestmark = pytest.mark.benchmark(timer=time.thread_time)
SAMPLES = Path(__file__).parents[2] / "sample_recordings"


def slow_s(work: Any, rounds: int = 1) -> float:
    started = time.thread_time()
    for _ in range(rounds):
        work()
    return (time.thread_time() - started) / rounds


def say(text: str) -> None:
    sys.stdout.write(f"\n{text}\n")


def test_the_mask(benchmark: Any) -> None:
    rng = np.random.default_rng(0)
    n = 200_000
    t = np.sort(rng.integers(0, 5000, n))
    x, y = (rng.integers(600, 680, n).astype(np.uint16) for _ in range(2))
    on = rng.random(n) < 0.5
    circle = (4900.0, (640.0, 640.0), (5000.0, -3000.0), 14.5, 16.5, (16.0, 19.0))
    benchmark.pedantic(lambda: logo_rows((t, x, y, on), *circle), rounds=30, warmup_rounds=2)
    fast_ns = benchmark.stats.stats.median / n * 1e9

    def by_numpy() -> None:
        dt = t - 4900.0
        dx, dy = x - 640.0 - 5e-3 * dt, y - 640.0 + 3e-3 * dt
        across2, like = dx**2 + dy**2, (5.0 * dx - 3.0 * dy > 0) == on
        ring = (across2 > 16.0**2) & (across2 < 19.0**2)
        np.sum(ring & like), np.sum(ring & ~like)
        np.flatnonzero((across2 < 14.5**2) | (~like & (across2 < 16.5**2)))

    few = (t[:5000], x[:5000], y[:5000], on[:5000])
    numpy_ns = slow_s(by_numpy, 10) / n * 1e9
    twin_ns = slow_s(lambda: naive_logo_rows(*few, *circle)) / 5000 * 1e9
    say(f"mask: {fast_ns:.1f} ns an event, numpy {numpy_ns / fast_ns:.0f} x, twin {twin_ns / fast_ns:.0f} x")
    assert numpy_ns > 2 * fast_ns


def ticks(name: str) -> list[Any]:
    """Packets of a sample, filtered, with a track from its truth."""
    events, truth = truth_of(SAMPLES, name)
    tracks = [track_of(truth, p.end_us, np.zeros(3), fixed=False, wider_px=0.0) for p in packets(events)]
    return list(zip(packets(events), tracks, strict=True))


def test_triplet_matching_of_a_slice(benchmark: Any) -> None:
    """The densest slices of a flight, 2 ms each."""
    group, state = logo.LogoParameters(), logo.start(logo.LogoParameters(), CONTEXT)
    seen = [
        logo.step(group, state, p, FilterResult(p.events, p.events, p.events), k.ball)
        for p, k in ticks("flight_slow_top")
    ]
    t = np.concatenate([s.events.t_us for s in seen])
    x, y = (np.concatenate([getattr(s, name) for s in seen]) for name in ("x_px", "y_px"))
    on = np.concatenate([s.events.on for s in seen])
    cuts = np.searchsorted(t, np.arange(0, 200_001, 2000))
    slices = [slice(a, b) for a, b in itertools.pairwise(cuts) if b - a > 100]

    def run() -> None:
        for s in slices:
            near = earlier_neighbours((t[s], x[s], y[s], on[s]), 0.7, 3.0, 1000.0, 16_000.0, 12)
            triplet_flow(t[s], x[s], y[s], near, 0.5, 0.2)

    benchmark.pedantic(run, rounds=20, warmup_rounds=2)
    count = sum(s.stop - s.start for s in slices)
    fast_us = benchmark.stats.stats.median / count * 1e6
    first = slices[0]

    def twin() -> None:
        near = naive_neighbours(t[first], x[first], y[first], on[first], 0.7, 3.0, 1000.0, 16_000.0, 12)
        naive_triplets(t[first], x[first], y[first], near, 0.5, 0.2)

    slow_us = slow_s(twin) / (first.stop - first.start) * 1e6
    say(f"triplets: {fast_us:.2f} us an event, {count / len(slices):.0f} a slice, twin {slow_us / fast_us:.0f} x")
    assert slow_us > 50 * fast_us


def test_a_plane(benchmark: Any) -> None:
    rng = np.random.default_rng(1)
    x, y = rng.uniform(-3, 3, 25), rng.uniform(-3, 3, 25)
    t = 200 * x + 80 * y + rng.normal(0, 60, 25)
    scales = np.array([1200.0, 600.0, 300.0, 300.0])
    work = (x, y, t, scales, FEWEST, SPREAD_PX)
    benchmark.pedantic(lambda: [fit_plane(*work) for _ in range(1000)], rounds=20, warmup_rounds=1)
    fast_us = benchmark.stats.stats.median / 1000 * 1e6
    slow_us = slow_s(lambda: naive_plane(*work), 50) * 1e6
    say(f"plane of 25 events: {fast_us:.2f} us, numpy's lstsq {slow_us / fast_us:.0f} x")
    assert slow_us > 10 * fast_us


def test_the_low_pass(benchmark: Any) -> None:
    signal = np.random.default_rng(2).normal(size=1000)
    benchmark.pedantic(lambda: low_passed(signal, 0.1), rounds=50, warmup_rounds=2)
    fast_us = benchmark.stats.stats.median * 1e6
    naive_low_pass(signal, 0.1)  # scipy takes its time to load
    slow_us = slow_s(lambda: naive_low_pass(signal, 0.1), 50) * 1e6
    say(f"low-pass of 1000 bins: {fast_us:.0f} us, scipy's filtfilt {slow_us / fast_us:.1f} x")


@pytest.mark.parametrize("name", ["flight_fast_top", "flight_slow_top", "flight_mixed"])
def test_a_flight_through_the_stages_after_the_track(benchmark: Any, name: str) -> None:
    work = ticks(name)
    stages = (logo, rate, flow, triplet, normal_flow)
    groups = logo.LogoParameters(), rate.RateParameters(), flow.FlowParameters(), SpinParameters(), SpinParameters()
    took: dict[str, list[float]] = {"logo": [], "rate": [], "flow": [], "spin": []}

    def run() -> None:
        states = [s.start(g, CONTEXT) for s, g in zip(stages, groups, strict=True)]
        for packet, track in work:
            clock = [time.thread_time()]
            seen = logo.step(
                groups[0], states[0], packet, FilterResult(packet.events, packet.events, packet.events), track.ball
            )
            clock.append(time.thread_time())
            rhythm = rate.step(groups[1], states[1], packet, track.ball, seen)
            clock.append(time.thread_time())
            moved = flow.step(groups[2], states[2], packet, track.ball, seen, rhythm)
            clock.append(time.thread_time())
            triplet.step(groups[3], states[3], packet, moved, rhythm)
            normal_flow.step(groups[4], states[4], packet, seen, moved, rhythm)
            clock.append(time.thread_time())
            for stage, taken in zip(took, np.diff(clock), strict=True):
                took[stage].append(taken * 1e3)

    benchmark.pedantic(run, rounds=5, warmup_rounds=1)
    parts = ", ".join(f"{k} {np.median(v):.2f} (p99 {np.percentile(v, 99):.1f})" for k, v in took.items())
    say(f"{name}: {benchmark.stats.stats.median * 1e3:.0f} ms for {len(work)} ticks; ms a tick: {parts}")
    assert benchmark.stats.stats.median < 0.2
