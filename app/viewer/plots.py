"""The plots: the Kalman state, the event rate and its rhythm, the spin; each over time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from spinscope.pipeline.results import Circle

from . import entities as at
from .rerun_api import Chunk, band, line, points
from .run import ViewedRun

Floats = NDArray[np.float64]


def state_plots(run: ViewedRun) -> list[Chunk]:
    """The Kalman state with its band, and what was measured as dots."""
    chunks: list[Chunk] = []
    for i, (name, unit) in enumerate(zip(at.QUANTITIES, at.UNITS, strict=True)):
        values, variances = from_start(run.means[:, i]), from_start(run.variances[:, i])
        entity = f"{at.PLOT}/{name}"
        chunks += band(
            f"{entity}/kalman", run.times_us, values, np.nan_to_num(variances), "Kalman ± 1σ", unit, at.KALMAN_COLOUR
        )  # fmt: skip
        if name in ("x", "y", "radius"):
            field = f"{name}_px"
            hough = from_start([_measured(tick.track.hough, field, tick.track.has_ball) for tick in run.ticks])
            refined = from_start([_measured(tick.track.measured, field, True) for tick in run.ticks])
            chunks += points(f"{entity}/hough", run.times_us, hough, f"Hough [{unit}]", at.HOUGH_COLOUR, "circle", 2.5)
            chunks += points(f"{entity}/measured", run.times_us, refined, f"refined [{unit}]", at.MEASURED_COLOUR)
        if run.truth is not None:
            truth = from_start(true_state(run)[:, i])
            chunks += line(f"{entity}/truth", run.times_us, truth, f"truth [{unit}]", at.TRUTH_COLOUR, 0.8)
    return chunks


def residual_plots(run: ViewedRun) -> list[Chunk]:
    """What was measured, and the truth, less the Kalman filter's value, in its band around zero."""
    chunks: list[Chunk] = []
    for i, name in ((0, "x"), (1, "y"), (4, "radius")):
        entity, mean = f"{at.RESIDUAL}/{name}", run.means[:, i]
        zero = from_start(np.where(run.has_ball, 0.0, np.nan))
        variances = np.nan_to_num(from_start(run.variances[:, i]))
        chunks += band(f"{entity}/kalman", run.times_us, zero, variances, "Kalman ± 1σ", "px", at.KALMAN_COLOUR)
        refined = [_measured(tick.track.measured, f"{name}_px", True) for tick in run.ticks] - mean
        chunks += points(f"{entity}/measured", run.times_us, from_start(refined), "refined [px]", at.MEASURED_COLOUR)
        if run.truth is not None:
            truth = from_start(true_state(run)[:, i] - mean)
            chunks += line(f"{entity}/truth", run.times_us, truth, "truth [px]", at.TRUTH_COLOUR, 1.0)
    return chunks


def rate_chunks(run: ViewedRun) -> list[Chunk]:
    """Histogram of the event rate with its moving average, and the rhythm with its falling zero crossings."""
    t_us, curves, crossings_us = _rate_curves(run)
    zeros = np.where(np.isfinite(crossings_us), 0.0, np.nan)
    times = np.nan_to_num(crossings_us, nan=run.start_us)
    return [
        *line(f"{at.RATE}/histogram", t_us, curves[:, 0], "event rate [kev/s]", at.MASK_COLOUR, 1.0, steps=True),
        *line(f"{at.RATE}/ema", t_us, curves[:, 1], "moving average [kev/s]", at.HOUGH_COLOUR, 2.0),
        *line(f"{at.RHYTHM}/smooth", t_us, curves[:, 2], "less mean, low-passed [kev/s]", at.RATE_COLOUR, 2.0),
        *points(f"{at.RHYTHM}/crossings", times, zeros, "falls through zero", at.ON, "down", 5.0),
    ]


def spin_chunks(run: ViewedRun) -> list[Chunk]:
    """Plots of each method's magnitude with its +-1 sigma, of the trusted vector, and of the axes' errors."""
    chunks: list[Chunk] = []
    for method in run.methods:
        estimates = [tick.estimates[method] for tick in run.ticks]
        values = from_start([_number(e.magnitude_rps) for e in estimates])
        stds = from_start([_number(e.magnitude_std_rps) for e in estimates])
        entity, colour = f"{at.SPIN_MAGNITUDE}/{method}", at.method_colour(method)
        chunks += band(entity, run.times_us, values, np.nan_to_num(stds) ** 2, method, "rps", colour)
    rhythm = from_start([_number(tick.rate.spin_rps) for tick in run.ticks])
    chunks += line(f"{at.SPIN_MAGNITUDE}/rate", run.times_us, rhythm, "rhythm of the event rate", at.RATE_COLOUR)
    vectors = np.full((len(run.ticks), 3), np.nan)
    for i, tick in enumerate(run.ticks):
        if tick.best is not None:
            vectors[i] = tick.estimates[tick.best].vector_rps
    for i, (axis, colour) in enumerate(zip("xyz", (at.ON, at.KALMAN_COLOUR, at.OFF), strict=True)):
        values = from_start(vectors[:, i])
        chunks += line(f"{at.SPIN_PARTS}/{axis}", run.times_us, values, f"{axis} [rps]", colour, 2.0)
    if run.true_spins_rps is not None:
        chunks += _true_spin(run, run.true_spins_rps)
    return chunks


def true_state(run: ViewedRun) -> Floats:
    """(n, 5) the truth behind the Kalman states, at the scene's time."""
    assert run.truth is not None
    t_us = np.array([tick.track.t_us for tick in run.ticks])
    truth, seconds = run.truth, run.truth.t_us * 1e-6
    columns = [truth.x_px, truth.y_px, np.gradient(truth.x_px, seconds), np.gradient(truth.y_px, seconds)]
    return run.true_values(t_us, np.column_stack([*columns, truth.radius_px]))


def _number(value: float | None) -> float:
    return float("nan") if value is None else value


def from_start(values: Sequence[float] | Floats) -> Floats:
    """A column of ticks with the row before it, in which nothing is known."""
    return np.concatenate([[np.nan], np.asarray(values, np.float64)])


def _measured(circle: Circle | None, field: str, shown: bool) -> float:
    return getattr(circle, field) if circle is not None and shown else float("nan")


def _rate_curves(run: ViewedRun) -> tuple[NDArray[np.int64], Floats, Floats]:
    """(n,) times, (n, 3) histogram, moving average and rhythm in 1000 events/s, (m,) crossings in us.

    Every tick tells the whole shot anew (its window's part): of each bin the latest word counts. A row of NaN
    leads, and parts the shots.
    """
    times, curves, crossings = [], [], []
    covered_us = np.inf
    for rate in (tick.rate for tick in reversed(run.ticks)):
        if not rate.t_us.size or rate.t_us[0] >= covered_us:
            continue
        new = rate.t_us < covered_us
        if rate.t_us[-1] < covered_us - 2 * (rate.t_us[-1] - rate.t_us[0]) / max(rate.t_us.size - 1, 1):
            times.append(rate.t_us[-1:] + 1)
            curves.append(np.full((1, 3), np.nan))
        values = np.column_stack([rate.rate_hz, rate.ema_hz, rate.smooth_hz]) / 1e3
        times.append(rate.t_us[new])
        curves.append(values[new])
        crossings.append(rate.crossings_us[rate.crossings_us < covered_us])
        covered_us = rate.t_us[0]
    if covered_us > run.start_us:
        times.append(np.array([run.start_us]))
        curves.append(np.full((1, 3), np.nan))
    if len(times) == 1 and not np.isfinite(curves[0]).any():  # no rate at all: the plot spans the run all the same
        times.insert(0, np.array([run.end_us]))
        curves.insert(0, curves[0])
    found = np.concatenate([*crossings[::-1], np.empty(0)])
    return np.concatenate(times[::-1]), np.concatenate(curves[::-1]), found if found.size else np.array([np.nan])


def _true_spin(run: ViewedRun, spin: Floats) -> list[Chunk]:
    magnitude = np.linalg.norm(spin, axis=1)
    chunks = line(f"{at.SPIN_MAGNITUDE}/truth", run.times_us, from_start(magnitude), "truth", at.TRUTH_COLOUR, 0.8)
    for method in run.methods:
        errors = np.full(len(run.ticks), np.nan)
        for i, tick in enumerate(run.ticks):
            axis = tick.estimates[method].axis
            if axis is not None:
                errors[i] = np.degrees(np.arccos(np.clip(axis @ spin[i] / magnitude[i], -1, 1)))
        entity, colour = f"{at.AXIS_ERROR}/{method}", at.method_colour(method)
        chunks += line(entity, run.times_us, from_start(errors), f"{method} [°]", colour)
    return chunks
