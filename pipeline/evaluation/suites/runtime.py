"""Suite `runtime`: latency up to the logo's events and time of processing over time of recording (section 4.4)."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from ...chain import Chain
from ...registry import Parameters, default_stages
from .. import paper
from ..estimation import chain_over
from ..lab_recordings import FLIGHT, SPINNER, LabRecording
from ..plots import Figures, label_axes, panels
from ..tables import Cell, ResultTable, Row, Value, distinct, summary, where
from ..tasks import Task, TaskContext
from .thrower import flight_of, flights

LABEL = "Run times"
HELP = "Latency up to the logo's events, and processing time over recording time (section 4.4)."
TAKES_SCENE_CHOICES = True
REAL_KINDS = (FLIGHT, SPINNER)
TIMED = True  # its tasks measure run times

# The paper's "from the moment the events are received": up to the logo's events; the rest is spin estimation.
STAGES = default_stages()
LATENCY_STAGES = ("filter", "surface", "track", "logo")
SPIN_STAGES = ("rate", "flow", "triplet", "normal_flow")  # the paper's method, and normal flow beside it
TICKS_US = (5000, 1000)  # the paper's 200 Hz, and the shortest useful
SHARES = ("spin", "contrast", "all")
EVERY = 8  # every so many of the thrower's flights are taken


def tasks(quick: bool) -> list[Task]:
    """One flight and length of tick a task."""
    chosen = flights(quick)[:1] if quick else flights(quick)[::EVERY]
    return [Task(measure, {**flight, "tick_us": tick_us}, keep=False) for tick_us in TICKS_US for flight in chosen]


def measure(context: TaskContext, tick_us: int, **flight: Any) -> list[Row]:
    """Milliseconds of every stage in every tick, the kernels being loaded before."""
    recording, about = flight_of(context, **flight)
    chain = chain_over(recording, clock=time.thread_time)  # other work of the machine does not count
    return _timed_rows(chain_over(recording), chain, context.parameters, tick_us, about["seed"])


def real(context: TaskContext, recording: LabRecording) -> list[Row]:
    """The same of a real recording, for each length of tick; no truth is needed."""
    rows: list[Row] = []
    for tick_us in TICKS_US:
        session = recording.session
        warm_up, chain = Chain(session.source), Chain(session.source, clock=time.thread_time)
        rows += _timed_rows(warm_up, chain, session.parameters, tick_us, recording.path.name)
    return rows


def _timed_rows(warm_up: Chain, chain: Chain, parameters: Parameters, tick_us: int, seed: Value) -> list[Row]:
    """Rows of a chain that measures its time, after one over the same events; `seed` tells recordings apart."""
    parameters = parameters.with_values({"track": {"tick_us": tick_us}})
    for _ in warm_up.run(parameters, forget=STAGES):
        pass
    rows: list[Row] = []
    before = dict.fromkeys(STAGES, 0.0)
    for tick in chain.run(parameters, forget=STAGES):
        taken_ms = {name: (chain.seconds[name] - before[name]) * 1e3 for name in STAGES}
        before = dict(chain.seconds)
        packet, latency_ms = tick.packet, sum(taken_ms[name] for name in LATENCY_STAGES)
        row: Row = {"tick_us": tick_us, "seed": seed, "t_us": packet.end_us}
        row |= {"tick_ms": (packet.end_us - packet.start_us) / 1e3, "events": len(packet.events)}
        row |= {"has_ball": tick.track.has_ball, "latency_ms": latency_ms}
        rows.append(row | {f"{name}_ms": value for name, value in taken_ms.items()})
    return rows


def tables(rows: Sequence[Row]) -> list[ResultTable]:
    """The paper's two numbers, and the stages one by one."""
    lengths = sorted(distinct(rows, "tick_us"), reverse=True)
    totals: list[tuple[Cell, ...]] = [
        ("paper, 5000 us", None, paper.LATENCY_MS, None, paper.SPIN_TIME_SHARE, None, None)
    ]
    for tick_us in lengths:
        part = where(rows, tick_us=tick_us)
        flown = where(part, has_ball=True)
        most_ms = max((row["latency_ms"] for row in flown if isinstance(row["latency_ms"], float)), default=None)
        flights = [_of_recording(where(part, seed=seed)) for seed in distinct(part, "seed")]
        shares = (summary(flights, f"{what}_share") for what in SHARES)
        totals.append((f"{tick_us} us", len(part), summary(flown, "latency_ms"), most_ms, *shares))
    stages: list[tuple[Cell, ...]] = [
        (f"{tick_us} us", name, summary(where(rows, tick_us=tick_us, has_ball=True), f"{name}_ms"))
        for tick_us in lengths
        for name in STAGES
    ]
    return [
        ResultTable(
            "Run time",
            ("tick", "ticks", "events to logo [ms]", "longest [ms]", *(f"{what} / recording" for what in SHARES)),
            totals,
            "Events to logo: filter, surface, track and logo in ticks with a ball. Shares: time of processing over "
            "time of recording, a flight at a time; below 1 is real time. Spin: rate, flow and spin, which are the "
            "paper's method and normal flow; contrast on top of it. All of them give an answer at the end of every "
            "tick. Processor time of one thread.",
        ),
        ResultTable("Run time by stage, ticks with a ball", ("tick", "stage", "time [ms]"), stages),
    ]


def _of_recording(rows: Sequence[Row]) -> Row:
    """Time of the stages over the length of one recording."""

    def total(*names: str) -> float:
        return sum(value for row in rows for name in names if isinstance(value := row[f"{name}_ms"], float))

    length_ms = total("tick")
    return {
        "spin_share": total(*SPIN_STAGES) / length_ms,
        "contrast_share": total("contrast") / length_ms,
        "all_share": total(*STAGES) / length_ms,
    }


def figures(rows: Sequence[Row]) -> Figures:
    """The latency's distribution, and its parts."""
    lengths = sorted(distinct(rows, "tick_us"), reverse=True)
    figure, axes = panels(1, 2)
    for number, tick_us in enumerate(lengths):
        flown = where(rows, tick_us=tick_us, has_ball=True)
        latency_ms = [row["latency_ms"] for row in flown]
        weights = np.full(len(flown), 1 / max(len(flown), 1))
        axes[0, 0].hist(latency_ms, bins=40, weights=weights, alpha=0.6, label=f"tick of {tick_us} us")
        bottom = 0.0
        for color, name in enumerate(STAGES):
            mean = summary(flown, f"{name}_ms").mean or 0.0
            label = name if number == 0 else None
            axes[0, 1].bar(f"{tick_us} us", mean, bottom=bottom, color=f"C{color}", label=label)
            bottom += mean
    label_axes(axes[0, 0], "events to logo", "latency [ms]", "share of ticks")
    label_axes(axes[0, 1], "stages, ticks with a ball", "tick", "mean time [ms]")
    return {"times": figure}
