"""The tracking part of the chain, filter to logo: events a second, and the slowest of the 5 ms packets.

`ball` is the default flight with each event four times within 300 us: `DENSITY_MEV_S` of a ball's own events.
`clutter` is that flight with a moving edge as high as the image laid over it, to the same density: the tracker has
something else to look at in every second packet.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from spinscope.pipeline.chain import Chain
from spinscope.pipeline.event_source import EventsInMemory
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.registry import STAGES, Parameters
from spinscope.pipeline.results import Packet

SAMPLES = Path(__file__).parents[2] / "sample_recordings"
TRACKING = ("filter", "surface", "track", "logo")
DENSITY_MEV_S = 5.0


def flight(name: str) -> EventBatch:
    """The events of a sample."""
    with h5py.File(SAMPLES / f"{name}.h5") as file:
        t, x, y, p = (file[f"events/{key}"][:] for key in "txyp")
    return EventBatch.checked(t, x, y, p == 1, width_px=1280, height_px=720)


def ball() -> EventBatch:
    """The default flight, every event four times."""
    once = flight("flight_fast_top")
    rng = np.random.default_rng(1)
    t = np.concatenate([once.t_us, *(once.t_us + rng.integers(1, 300, len(once)) for _ in range(3))])
    order = np.argsort(t, kind="stable")
    x, y, on = (np.tile(column, 4)[order] for column in (once.x_px, once.y_px, once.on))
    return EventBatch.checked(t[order], x, y, on, width_px=1280, height_px=720)


def clutter() -> EventBatch:
    """The default flight, and in the left third of the image a vertical edge that sweeps to and fro."""
    shot = flight("flight_fast_top")
    duration_us = int(shot.t_us[-1]) + 1
    count = int(DENSITY_MEV_S * duration_us) - len(shot)
    rng = np.random.default_rng(5)
    t = np.sort(rng.integers(0, duration_us, count))
    sweep = 150 + 100 * np.sin(2 * np.pi * t / 100_000)
    x = np.clip(np.round(sweep + rng.normal(0, 0.7, count)), 0, 400)
    y = rng.integers(0, 720, count)
    on = np.cos(2 * np.pi * t / 100_000) > 0
    order = np.argsort(np.concatenate([shot.t_us, t]), kind="stable")
    return EventBatch.checked(
        np.concatenate([shot.t_us, t])[order],
        np.concatenate([shot.x_px, x])[order],
        np.concatenate([shot.y_px, y])[order],
        np.concatenate([shot.on, on])[order],
        width_px=1280,
        height_px=720,
    )


def packets(events: EventBatch, tick_us: int = 5000) -> list[Packet]:
    """The stream cut on the grid of ticks."""
    count = int(events.t_us[-1]) // tick_us + 1
    return [
        Packet(n, n * tick_us, (n + 1) * tick_us, events.between(n * tick_us, (n + 1) * tick_us)) for n in range(count)
    ]


def track(events: EventBatch, parts: list[Packet]) -> list[float]:
    """Thread seconds of each packet from filter to logo."""
    parameters = Parameters()
    chain = Chain(EventsInMemory("bench", events, 1280, 720, 0, parts[-1].end_us))
    stages = [STAGES[name] for name in TRACKING]
    states = {stage.name: chain.start(parameters, stage) for stage in stages}
    seconds = []
    for packet in parts:
        begin = time.thread_time()
        results: dict[str, Any] = {"packet": packet}
        for stage in stages:
            if stage.scope == "ball":
                results["ball"] = results["track"].ball
                if results["ball"] is None:
                    continue
            given = [results[name] for name in stage.inputs]
            results[stage.name] = stage.step(parameters.group(stage.group), states[stage.name], *given)
        seconds.append(time.thread_time() - begin)
    return seconds


@pytest.mark.parametrize("kind", ["flight", "ball", "clutter"])
def test_filter_to_logo(benchmark: BenchmarkFixture, kind: str) -> None:
    events = {"flight": lambda: flight("flight_fast_top"), "ball": ball, "clutter": clutter}[kind]()
    parts = packets(events)
    track(events, parts)  # compile and warm up
    runs = benchmark.pedantic(lambda: track(events, parts), rounds=10, iterations=1)
    all_runs = np.array([track(events, parts) for _ in range(10)] + [runs])
    per_run = np.median(all_runs.sum(axis=1))
    benchmark.extra_info |= {
        "Mev_s": round(len(events) / per_run / 1e6, 1),
        "share_of_duration": round(per_run / (parts[-1].end_us * 1e-6), 3),
        "packet_p50_ms": round(float(np.percentile(all_runs, 50)) * 1e3, 2),
        "packet_p99_ms": round(float(np.percentile(all_runs, 99)) * 1e3, 2),
    }
    print(f"\n{kind}: {len(events):,} events, {benchmark.extra_info}")
