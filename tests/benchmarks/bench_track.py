"""How fast the tracker is: `pytest tests/benchmarks/bench_track.py --benchmark-only -s`."""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
import pytest

from spinscope.pipeline.kernels import hough, moving_circle, outline
from spinscope.pipeline.stages import filter, surface, track
from spinscope.pipeline.stages.filter import FilterParameters
from spinscope.pipeline.stages.surface import SurfaceParameters
from spinscope.pipeline.stages.track_parameters import TrackParameters
from tests.reference import hough as reference
from tests.track_runs import PAPER_CONTEXT, inputs, run, sample, tracked

# The thread's own time: what other programs do on a shared machine does not count.
pytestmark = pytest.mark.benchmark(timer=time.thread_time)
cv2.setNumThreads(1)
NAME, TICK = "flight_fast_top", 10


def median_s(call: Callable[[], object], rounds: int) -> float:
    """Median seconds of some calls, after one that warms up."""
    call()
    seconds = []
    for _ in range(rounds):
        started = time.thread_time()
        call()
        seconds.append(time.thread_time() - started)
    return statistics.median(seconds)


def say(text: str) -> None:
    sys.stderr.write(f"\n{text}\n")


def test_vote_near_a_prediction(benchmark: Any) -> None:
    """13 x 13 centres, 5 radii, against the slow twin and OpenCV's circle search in the same window."""
    _, _, shown = inputs(sample(NAME)[0])[TICK]
    x, y, _, _, radius = tracked(NAME)[TICK].mean
    left, top = round(x) - 30, round(y) - 30
    window = shown.cleaned(left, top, left + 60, top + 60)
    xs, ys = hough.bright_pixels(window, 128, 250)
    first = round(radius) - 2

    def fast() -> None:
        votes = np.zeros((13, 13, 5), np.uint16)
        hough.vote(votes, xs, ys, 24, 24, first)
        hough.peak(votes, first)

    def opencv() -> None:
        cv2.HoughCircles(window, cv2.HOUGH_GRADIENT, 1, 60, param1=200, param2=8, minRadius=first, maxRadius=first + 4)

    benchmark(fast)
    ours = median_s(fast, 200)
    slow = median_s(lambda: reference.vote((13, 13, 5), xs, ys, 24, 24, first), 5)
    say(
        f"vote: {ours * 1e6:.0f} us, twin {slow / ours:.0f} x as long, "
        f"cv2.HoughCircles {median_s(opencv, 100) / ours:.1f} x as long"
    )
    assert slow > 20 * ours


def test_fit_of_an_outline(benchmark: Any) -> None:
    rows = inputs(sample(NAME)[0])
    packet, filtered, _ = rows[TICK]
    ring = tracked(NAME)[TICK].mean.copy()
    events = filtered.contour_events
    chosen = moving_circle.near_outline(
        ring, events.columns, packet.end_us, 3.0, outline.MOST_EVENTS, moving_circle.HALF_AHEAD
    )
    columns = (
        (events.t_us[chosen] - packet.end_us) * 1e-6,
        events.x_px[chosen].astype(np.float64),
        events.y_px[chosen].astype(np.float64),
    )
    args = (ring + 0.5, np.full(5, 1e9), np.zeros(2), *columns, 3.0, 0.6, 9)
    benchmark(moving_circle.fit_circle, *args)
    ours = median_s(lambda: moving_circle.fit_circle(*args), 200)
    slow = median_s(lambda: reference.fit_circle(*args), 5)
    say(f"fit of {chosen.size} events: {ours * 1e6:.0f} us, twin {slow / ours:.0f} x as long")
    assert slow > 10 * ours


@pytest.mark.parametrize("name", ["flight_slow_top", "flight_fast_top", "flight_two_balls"])
@pytest.mark.parametrize("tick_us", [1000, 5000])
def test_a_tick(benchmark: Any, name: str, tick_us: int) -> None:
    """The tracker alone, per tick, and its share of the time that the flight takes."""
    rows = inputs(sample(name)[0], tick_us)
    parameters = TrackParameters(tick_us=tick_us)
    benchmark(run, rows)
    seconds: list[list[float]] = [[] for _ in rows]
    for _ in range(5):
        state = track.start(parameters, PAPER_CONTEXT)
        for tick, row in zip(seconds, rows, strict=True):
            started = time.thread_time()
            track.step(parameters, state, *row)
            tick.append(time.thread_time() - started)
    each = np.array([min(tick) for tick in seconds]) * 1e6
    share = each.sum() / (len(rows) * tick_us)
    say(
        f"{name}, {tick_us} us ticks: median {np.median(each):.0f} us, 95 % {np.quantile(each, 0.95):.0f} us, "
        f"{share:.3f} of the flight's time"
    )


def test_filter_surface_and_track_together(benchmark: Any) -> None:
    """From events to the ball, as a share of the flight's duration (the goal for all tracking is 0.15)."""
    events = sample(NAME)[0]
    packets = [packet for packet, _, _ in inputs(events)]
    sieve, drawing, finding = FilterParameters(), SurfaceParameters(), TrackParameters()

    def whole() -> None:
        states = [
            stage.start(parameters, PAPER_CONTEXT)
            for stage, parameters in ((filter, sieve), (surface, drawing), (track, finding))
        ]
        for packet in packets:
            filtered = filter.step(sieve, states[0], packet)
            shown = surface.step(drawing, states[1], packet, filtered)
            track.step(finding, states[2], packet, filtered, shown)

    benchmark(whole)
    share = median_s(whole, 5) / (len(packets) * 5e-3)
    say(f"filter, surface and track: {share:.3f} of the flight's time")
