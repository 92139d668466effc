"""Suite `live`: latency of a recording replayed in real time, at the event rates of quiet and busy scenes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ...cameras import EventStream, ReplayCamera
from ...event_source import EventsInMemory
from ...events import EventBatch
from ...live import LiveRun, load_kernels
from ...live_outputs import LiveShot, LiveSpin, LiveStatus
from ...live_spins import ANNOUNCED_S
from ...results import spin_errors
from ...session import DEFAULT_SAMPLE, Session
from .. import paper
from ..plots import Figures, label_axes, panels
from ..tables import Cell, ResultTable, Row, where
from ..tasks import Task, TaskContext

LABEL = "Live"
HELP = "Latency from an event's arrival to the track and to the shot's spin, replayed in real time."
TIMED = True  # its tasks measure run times

# Event rates, and lengths of a tick: the default, and the shortest that is asked for.
RATES_MEV_S, TICKS_US = (1.0, 5.0), (5000, 1000)
SECONDS, QUICK_SECONDS = 60.0, 5.0
ROUND_US = 1_000_000  # one shot, and noise around it
BATCH_EVENTS = 50_000


def tasks(quick: bool) -> list[Task]:
    """One event rate and length of a tick a task; quick: the first ones, for a shorter time."""
    cases = [(tick_us, rate_mev_s) for tick_us in TICKS_US for rate_mev_s in RATES_MEV_S]
    cases, seconds = (cases[:1], QUICK_SECONDS) if quick else (cases, SECONDS)
    return [
        Task(measure, {"rate_mev_s": rate_mev_s, "tick_us": tick_us, "seconds": seconds}, keep=False)
        for tick_us, rate_mev_s in cases
    ]


def busy_round(sample: Session, rate_mev_s: float) -> EventBatch:
    """A second with the sample's shot among uniform noise, which brings all to the rate."""
    random, size = np.random.default_rng(11), (sample.source.width_px, sample.source.height_px)
    shot = sample.source.between(sample.source.start_us, sample.source.end_us)
    count = max(round(rate_mev_s * ROUND_US) - len(shot), 0)
    t_us = np.concatenate([shot.t_us, random.integers(0, ROUND_US, count)])
    order = np.argsort(t_us, kind="stable")
    x_px, y_px = (
        np.concatenate([column, random.integers(0, length, count, np.uint16)])[order]
        for column, length in zip((shot.x_px, shot.y_px), size, strict=True)
    )
    return EventBatch(t_us[order], x_px, y_px, np.concatenate([shot.on, random.random(count) < 0.5])[order])


def measure(context: TaskContext, rate_mev_s: float, tick_us: int, seconds: float) -> list[Row]:
    """Latency of every tick and shot, and whether the first round's shots are those of the events read at once."""
    parameters = context.parameters.with_values({"track": {"tick_us": tick_us}})
    load_kernels()
    sample = Session.open(DEFAULT_SAMPLE)
    events, rounds = busy_round(sample, rate_mev_s), round(seconds * 1e6 / ROUND_US)
    width_px, height_px = sample.source.width_px, sample.source.height_px

    def batches() -> Iterator[EventBatch]:
        for number in range(rounds):
            for first in range(0, len(events), BATCH_EVENTS):
                part = events[first : first + BATCH_EVENTS]
                yield EventBatch(part.t_us + number * ROUND_US, *part.columns[1:])

    camera, rows = ReplayCamera(batches, width_px, height_px), list[Row]()
    run = LiveRun(
        lambda tick_us, on_notice: EventStream(camera, tick_us, on_notice=on_notice),
        parameters,
        with_balls=True,
        on_tick=lambda arrived, tick, latency_ms: rows.append({"what": "track", "latency_ms": latency_ms}),
    )
    shots, announced, skipped = list[LiveShot](), list[LiveSpin](), 0
    for one in run.outputs():
        if isinstance(one, LiveShot):
            shots.append(one)
        elif isinstance(one, LiveSpin) and one.ended_by is None:
            rows.append({"what": "so far", "latency_ms": one.latency_ms})
        elif isinstance(one, LiveSpin):
            announced.append(one)
        elif isinstance(one, LiveStatus):
            skipped = one.skipped
    start_us, end_us = int(events.t_us[0]), int(events.t_us[-1]) + 1
    source = EventsInMemory(("round", rate_mev_s), events, width_px, height_px, start_us, end_us)
    once = Session(sample.recording, source, parameters, sample.chain).clip(start_us, end_us).estimate()
    whole = [shot for shot in once.shots if shot.end_us < ROUND_US - tick_us]
    first = [one.shot for one in shots if one.shot.end_us < ROUND_US - tick_us]
    identical = [a.to_dict(once.session.camera, 0.02) for a in whole] == [
        b.to_dict(once.session.camera, 0.02) for b in sorted(first, key=lambda shot: shot.start_us)
    ]
    rows += [{"what": "shot", "latency_ms": one.latency_ms} for one in shots]
    rows += [{"what": "announced", "latency_ms": one.latency_ms, **_apart(one, shots)} for one in announced]
    about: Row = {"rate_mev_s": rate_mev_s, "tick_us": tick_us, "skipped": skipped, "identical": identical}
    return [{**about, **row} for row in rows]


def _apart(announced: LiveSpin, shots: Sequence[LiveShot]) -> Row:
    """Difference of an announced spin from the final one, rps and degrees; None where either is missing."""
    row: Row = {"apart_rps": None, "apart_deg": None}
    for shot in (one.shot for one in shots):
        vector_rps = None if shot.best is None else shot.estimates[shot.best].vector_rps
        if (shot.number, shot.end_us) != (announced.shot, announced.t_us) or vector_rps is None:
            continue
        estimate_rps = announced.spin.estimate.vector_rps
        if estimate_rps is not None:
            row["apart_rps"], row["apart_deg"] = spin_errors(estimate_rps, vector_rps)
    return row


def tables(rows: Sequence[Row]) -> list[ResultTable]:
    """Percentiles of the latencies by event rate and length of a tick, beside the paper's."""
    lines: list[tuple[Cell, ...]] = [("paper, tracking alone", None, None, paper.LATENCY_MS, *[None] * 11)]
    for rate, tick_us, part in _cases(rows):
        columns = [_column(where(part, what=what)) for what in ("track", "so far", "announced", "shot")]
        shares = [_percentile(column, q) for column in columns for q in (50, 99)]
        apart = [_percentile(_column(where(part, what="announced"), name), 50) for name in ("apart_rps", "apart_deg")]
        about = f"{rate:g} Mev/s", tick_us / 1000
        lines.append((*about, columns[0].size, *shares, *apart, part[0]["skipped"], part[0]["identical"]))
    return [
        ResultTable(
            "Live, replayed in real time",
            (
                "events",
                "tick [ms]",
                "ticks",
                "track p50 [ms]",
                "p99 [ms]",
                "spin so far p50 [ms]",
                "p99 [ms]",
                "announced p50 [ms]",
                "p99 [ms]",
                "final p50 [ms]",
                "p99 [ms]",
                "apart [rps]",
                "apart [deg]",
                "ticks left out",
                "identical",
            ),
            lines,
            "Track: from the arrival of a tick's first events to its track, the tick included; spin so far: to "
            "that of each tick of a flying ball. Announced: from the arrival of a shot's last events to the newest "
            f"spin so far, told when its end is known and {1000 * ANNOUNCED_S:.0f} ms have passed, sooner where all "
            "its ticks are answered; final: to that of the whole shot. Apart: the median difference of the two. "
            "Identical: the first round's shots are those of the same events read at once. The paper computes spins "
            "afterwards.",
        )
    ]


def figures(rows: Sequence[Row]) -> Figures:
    """Distribution of the track's latency by event rate and length of a tick."""
    figure, axes = panels(1, 1)
    for rate, tick_us, part in _cases(rows):
        latencies = np.sort(_column(where(part, what="track")))
        label = f"{rate:g} Mev/s, ticks of {tick_us / 1000:g} ms"
        axes[0, 0].plot(latencies, np.linspace(0.0, 1.0, latencies.size), label=label)
    axes[0, 0].set_xscale("log")
    label_axes(axes[0, 0], "arrival to track", "latency [ms]", "share of ticks below")
    return {"latency": figure}


def _cases(rows: Sequence[Row]) -> list[tuple[float, int, list[Row]]]:
    """(event rate in Mev/s, length of a tick in us, their rows)."""
    cases: dict[tuple[float, int], list[Row]] = {}
    for row in rows:
        cases.setdefault((float(row["rate_mev_s"] or 0), int(row["tick_us"] or 0)), []).append(row)
    return [(*case, part) for case, part in cases.items()]


def _column(rows: Sequence[Row], name: str = "latency_ms") -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    return np.array([row[name] for row in rows if row[name] is not None], np.float64)


def _percentile(values: np.ndarray[tuple[int], np.dtype[np.float64]], share: float) -> float | None:
    return round(float(np.percentile(values, share)), 1) if values.size else None
