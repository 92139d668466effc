"""Costs of tracking and of a flight's answer, beside their goals: CPU time of this thread, the best of several runs.

`uv run pytest tests/benchmarks/bench_tracking.py --benchmark-only -s` prints one line a figure. Tracking is surface and
track; the recordings are those of `bench_chain`; further balls are copies of the default flight's.
"""

from __future__ import annotations

import time
from typing import Any

import h5py
import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from spinscope.pipeline.chain import Chain
from spinscope.pipeline.event_source import EventsInMemory
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.registry import Parameters
from tests.benchmarks.bench_chain import SAMPLES, ball, clutter, flight, packets

ROUNDS, APART_PX = 10, 150


def chain_of(events: EventBatch) -> Chain:
    """A chain without results that counts this thread's CPU time."""
    return Chain(EventsInMemory("bench", events, 1280, 720, 0, int(events.t_us[-1]) + 1), clock=time.thread_time)


def seconds_by_tick(events: EventBatch, stages: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray]:
    """CPU seconds of these stages in each tick, and the number of balls in it."""
    chain, seconds, balls, before = chain_of(events), [], [], 0.0
    for tick in chain.run(Parameters(), ("track",), forget=("filter", "surface")):
        so_far = sum(chain.seconds[stage] for stage in stages)
        seconds.append(so_far - before)
        balls.append(len(tick.track.balls))
        before = so_far
    return np.array(seconds), np.array(balls)


def say(benchmark: BenchmarkFixture, **figures: Any) -> None:
    """Print figures beside their goals, and keep them."""
    benchmark.extra_info |= figures
    print(f"\n{benchmark.name}: " + ", ".join(f"{name} {value}" for name, value in figures.items()))


@pytest.mark.parametrize("kind", ["ball", "clutter"])
def test_tracking(benchmark: BenchmarkFixture, kind: str) -> None:
    events = {"ball": ball, "clutter": clutter}[kind]()
    count = len(packets(events))
    runs = []
    benchmark.pedantic(lambda: runs.append(seconds_by_tick(events, ("surface", "track"))[0]), rounds=ROUNDS + 1)
    of_packet = np.array(runs[1:])  # the first compiles and warms up
    best = of_packet.min(axis=0)
    say(
        benchmark,
        Mev_s=f"{len(events) / best.sum() / 1e6:.1f} (goal 30 for one ball)",
        packets=f"{count} of {len(events) / count / 5e3:.1f} Mev/s",
        p99_ms=f"{np.percentile(of_packet, 99) * 1e3:.2f} (goal 2)",
    )


def balls_in_view(count: int) -> EventBatch:
    """The default flight, and beside it the same ball again, `count` in all, APART_PX from each other."""
    shot = flight("flight_fast_top")
    with h5py.File(SAMPLES / "flight_fast_top.h5") as file:
        own = np.isin(file["truth/label"][:], (1, 2))
    t, y, on = (np.concatenate([column, *[column[own]] * (count - 1)]) for column in (shot.t_us, shot.y_px, shot.on))
    x = np.concatenate([shot.x_px, *(shot.x_px[own] + number * APART_PX for number in range(1, count))])
    order = np.argsort(t, kind="stable")
    return EventBatch.checked(t[order], x[order], y[order], on[order], width_px=1280, height_px=720)


def test_further_balls(benchmark: BenchmarkFixture) -> None:
    recordings = {count: balls_in_view(count) for count in (1, 2, 4)}
    runs: dict[int, list[np.ndarray]] = {count: [] for count in recordings}
    numbers: dict[int, np.ndarray] = {}

    def run() -> None:
        for count, events in recordings.items():
            seconds, numbers[count] = seconds_by_tick(events, ("surface", "track"))
            runs[count].append(seconds)

    benchmark.pedantic(run, rounds=ROUNDS + 1)
    # Ticks in which all balls are followed, not those in which they are still looked for.
    followed = np.all([numbers[count] == count for count in recordings], axis=0)
    cost = {count: float(np.min(runs[count][1:], axis=0)[followed].sum()) for count in recordings}
    say(
        benchmark,
        ticks=int(followed.sum()),
        one_ball_ms=f"{cost[1] / followed.sum() * 1e3:.2f}",
        second=f"{cost[2] / cost[1] - 1:.2f} of the first (goal 0.3)",
        third_and_fourth=f"{(cost[4] - cost[2]) / cost[1] / 2:.2f} each",
    )


def test_answer(benchmark: BenchmarkFixture) -> None:
    events, costs = flight("flight_fast_top"), []

    def run() -> None:
        chain = chain_of(events)
        begin = time.thread_time()
        ticks = sum(1 for _ in chain.run(Parameters()))
        costs.append({**chain.seconds, "all": time.thread_time() - begin, "ticks": ticks})

    benchmark.pedantic(run, rounds=4)
    best = min(costs[1:], key=lambda cost: cost["all"])
    say(
        benchmark,
        answer_s=f"{best['all']:.2f} (goal 0.3), {best['ticks']} ticks",
        trajectory_ms=f"{best['trajectory'] * 1e3:.1f} a shot (goal 5)",
        stages_ms={name: round(seconds * 1e3, 1) for name, seconds in best.items() if name not in ("all", "ticks")},
    )
