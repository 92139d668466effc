"""Recordings run through filter, surface and track, for the tracker's tests."""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from spinscope.pipeline.camera import Camera, CameraParameters
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.results import Packet, Truth
from spinscope.pipeline.stage import Context
from spinscope.pipeline.stages import filter, surface, track
from spinscope.pipeline.stages.filter import FilterParameters, FilterResult
from spinscope.pipeline.stages.surface import SurfaceParameters, SurfaceResult
from spinscope.pipeline.stages.track_parameters import TrackParameters
from spinscope.pipeline.stages.track_result import TrackResult

SAMPLES = Path(__file__).parents[1] / "sample_recordings"
WIDTH, HEIGHT = 1280, 720
Inputs = list[tuple[Packet, FilterResult, SurfaceResult]]
Floats = NDArray[np.float64]


@cache
def sample(name: str) -> tuple[EventBatch, Truth]:
    with h5py.File(SAMPLES / f"{name}.h5") as file:
        t, x, y, p = (file[f"events/{key}"][:] for key in "txyp")
        truth = Truth(*(file[f"truth/{field}"][:] for field in Truth.__dataclass_fields__))
    return EventBatch.checked(t, x, y, p == 1, width_px=WIDTH, height_px=HEIGHT), truth


def setting(
    width_px: int = WIDTH, height_px: int = HEIGHT, focal_length_mm: float = 8.0, contour_mode: str = "trail"
) -> Context:
    optics = CameraParameters(focal_length_mm=focal_length_mm)
    values = {"spin.max_spin_rps": 150.0, "filter.contour_mode": contour_mode}
    return Context(Camera.of(optics, width_px, height_px), 0.02, values)


PAPER_CONTEXT = setting()


def inputs(
    events: EventBatch,
    tick_us: int = 5000,
    place: Context = PAPER_CONTEXT,
    surface_mode: str = "stc_cut_trail",
) -> Inputs:
    """Packets with their filtered events and surfaces, from the tick of the first event to that of the last."""
    sieve, drawing = (
        FilterParameters(mode=surface_mode, contour_mode=place["filter.contour_mode"]),
        SurfaceParameters(),
    )
    filter_state, surface_state = filter.start(sieve, place), surface.start(drawing, place)
    rows: Inputs = []
    for index in range(int(events.t_us[0]) // tick_us, int(events.t_us[-1]) // tick_us + 1):
        start_us, end_us = index * tick_us, (index + 1) * tick_us
        packet = Packet(index, start_us, end_us, events.between(start_us, end_us))
        filtered = filter.step(sieve, filter_state, packet)
        rows.append((packet, filtered, surface.step(drawing, surface_state, packet, filtered)))
    return rows


def run(rows: Inputs, parameters: TrackParameters | None = None, place: Context = PAPER_CONTEXT) -> list[TrackResult]:
    tick_us = rows[0][0].end_us - rows[0][0].start_us
    parameters = parameters or TrackParameters(tick_us=tick_us)
    state = track.start(parameters, place)
    return [track.step(parameters, state, *row) for row in rows]


@cache
def tracked(name: str, tick_us: int = 5000) -> list[TrackResult]:
    """A sample with the default parameters."""
    return run(inputs(sample(name)[0], tick_us))


def true_ball(truth: Truth, t_us: Floats) -> Floats:
    """(n, 3) x, y, radius at these times; NaN outside the truth."""
    columns = (truth.x_px, truth.y_px, truth.radius_px)
    return np.stack([np.interp(t_us, truth.t_us, column, math.nan, math.nan) for column in columns], axis=1)


def wholly_in_view(ball: Floats) -> NDArray[np.bool_]:
    x, y, radius = ball.T
    inside: NDArray[np.bool_] = (x > radius) & (y > radius) & (x < WIDTH - 1 - radius) & (y < HEIGHT - 1 - radius)
    return inside


def disc_events(
    ring: Floats, start_us: int, end_us: int, bright: bool = True, width_px: int = WIDTH, height_px: int = HEIGHT
) -> EventBatch:
    """An ideal ball: each pixel answers once when the disc (5,) (at start_us) reaches it and once when it leaves.

    The disc = [x_px, y_px, vx_px_s, vy_px_s, radius_px] at start_us. Lone events: STC would drop them all.
    """
    columns, rows = np.meshgrid(np.arange(width_px), np.arange(height_px))
    dx, dy = columns - ring[0], rows - ring[1]
    v2 = ring[2] ** 2 + ring[3] ** 2
    nearest_s = (dx * ring[2] + dy * ring[3]) / v2
    miss2 = (dx - nearest_s * ring[2]) ** 2 + (dy - nearest_s * ring[3]) ** 2
    half_s = np.sqrt(np.maximum(ring[4] ** 2 - miss2, 0) / v2)
    parts = []
    for sign, on in ((-1, bright), (1, not bright)):
        t_us = start_us + np.rint((nearest_s + sign * half_s) * 1e6).astype(np.int64)
        hit = (miss2 < ring[4] ** 2) & (t_us >= start_us) & (t_us < end_us)
        parts.append((t_us[hit], columns[hit], rows[hit], np.full(np.count_nonzero(hit), on)))
    t_us, x, y, on_column = (np.concatenate(column) for column in zip(*parts, strict=True))
    order = np.argsort(t_us, kind="stable")
    return EventBatch(
        t_us[order], x[order].astype(np.uint16), y[order].astype(np.uint16), on_column[order].astype(np.bool_)
    )


def merged(*batches: EventBatch) -> EventBatch:
    """Recordings laid over each other."""
    joined = EventBatch.concatenate(batches)
    return joined[np.argsort(joined.t_us, kind="stable")]


def transformed(events: EventBatch, t_us: int = 0, x_px: int = 0, mirrored: bool = False) -> EventBatch:
    """Later, farther right (what leaves the image is dropped), or seen in a mirror."""
    x = events.x_px.astype(np.int64) + x_px
    if mirrored:
        x = WIDTH - 1 - x
    kept = (x >= 0) & (x < WIDTH)
    return EventBatch(
        events.t_us[kept] + t_us, x[kept].astype(np.uint16), events.y_px[kept].copy(), events.on[kept].copy()
    )
