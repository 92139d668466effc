"""Plots of the tracker's state, of event rates and of the spin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from spinscope.pipeline.results import Circle

from . import entities as at
from .curves import Curve, Plot, Range
from .run import ViewedRun

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class StateComponent:
    """Component of the tracker's state; `circle` names the same quantity of a measured circle, where it has it."""

    name: str
    label: str
    unit: str
    circle: str | None = None


STATE = (
    StateComponent("x", "x", "px", "x_px"),
    StateComponent("y", "y", "px", "y_px"),
    StateComponent("vx", "Velocity x", "px/s"),
    StateComponent("vy", "Velocity y", "px/s"),
    StateComponent("radius", "Radius", "px", "radius_px"),
)


def _state_curves(index: int, is_residual: bool, run: ViewedRun) -> list[Curve]:
    """Kalman value with its band, measured circles as dots, and truth; as residuals each minus the Kalman value."""
    component = STATE[index]
    unit, means, variances = component.unit, run.means[:, index], run.variances[:, index]
    offset = means if is_residual else np.zeros(len(means))
    curves = [Curve("kalman", "Kalman ± 1σ", at.KALMAN_COLOUR, means - offset, variances=variances, unit=unit)]
    tracks = [tick.track for tick in run.ticks]
    if component.circle is not None and not is_residual:
        hough = _measured([track.hough if track.has_ball else None for track in tracks], component.circle)
        curves.append(Curve("hough", f"Hough [{unit}]", at.HOUGH_COLOUR, hough, marker="circle", width=2.5))
    if component.circle is not None:
        refined = _measured([track.measured for track in tracks], component.circle) - offset
        curves.append(Curve("measured", f"refined [{unit}]", at.MEASURED_COLOUR, refined, marker="circle", width=3.0))
    if run.true_states is not None:
        curves.append(_truth(run.true_states[:, index] - offset, f"truth [{unit}]", is_in_range=is_residual))
    return curves


def _event_curves(run: ViewedRun) -> list[Curve]:
    """Events per second, all and those that the filters keep."""
    rows = zip(run.ticks, run.results("filter"), strict=True)
    counts = [(len(t.packet.events), len(kept.surface_events), len(kept.logo_events)) for t, kept in rows]
    rates = np.array(counts) / (np.diff(run.times_us) * 1e-6)[:, None] / 1e6
    labels = ("all", "after the surface's filter", "after the logo's filter")
    colours = (at.TRUTH_COLOUR, at.KALMAN_COLOUR, at.MEASURED_COLOUR)
    columns = enumerate(zip(labels, colours, rates.T, strict=True))
    return [Curve(str(i), label, colour, rate) for i, (label, colour, rate) in columns]


def _rate_curves(run: ViewedRun) -> list[Curve]:
    """Histogram of the logo's event rate with its moving average."""
    t_us, curves, _ = _rates(run)
    histogram, average = curves[:, 0], curves[:, 1]
    return [
        Curve("histogram", "event rate [kev/s]", at.MASK_COLOUR, histogram, t_us=t_us, width=1.0, is_stepped=True),
        Curve("ema", "moving average [kev/s]", at.HOUGH_COLOUR, average, t_us=t_us, width=2.0),
    ]


def _crossing_curves(run: ViewedRun) -> list[Curve]:
    """The event rate less its mean, low-passed, and its falling zero crossings."""
    t_us, curves, crossings_us = _rates(run)
    zeros = np.where(np.isfinite(crossings_us), 0.0, np.nan)
    times = np.nan_to_num(crossings_us, nan=run.start_us)
    smooth = curves[:, 2]
    return [
        Curve("smooth", "minus mean, low-passed [kev/s]", at.RATE_COLOUR, smooth, t_us=t_us, width=2.0),
        Curve("crossings", "falling zero crossings", at.ON, zeros, t_us=times, marker="down", width=5.0),
    ]


def _rates(run: ViewedRun) -> tuple[NDArray[np.int64], Floats, Floats]:
    """Event rate of the whole run, put together from the ticks' results.

    The result of every tick covers the shot so far (its window's part): for each bin the latest result counts. A row
    of NaN leads, and separates the shots.

    Returns
    -------
    t_us : (n,) int64
        Starts of the bins.
    rates : (n, 3) float64
        Histogram, moving average and low-passed rate, 1000 events/s.
    crossings_us : (m,) float64
        Falling zero crossings; a single NaN where there are none.
    """
    times, curves, crossings = [], [], []
    covered_us = np.inf
    for rate in reversed(run.results("rate")):
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


def _magnitude_curves(run: ViewedRun) -> list[Curve]:
    """Each method's magnitude with its band, that of the event rate, and the truth."""
    curves = []
    for method in run.methods:
        estimates = [tick.estimates[method.name] for tick in run.ticks]
        stds = _numbers([estimate.magnitude_std_rps for estimate in estimates])
        values = _numbers([estimate.magnitude_rps for estimate in estimates])
        curves.append(Curve(method.name, method.label, method.colour, values, variances=stds**2, unit="rps"))
    if rates := run.results("rate"):
        values = _numbers([rate.spin_rps for rate in rates])
        curves.append(Curve("rate", "event rate's zero crossings", at.RATE_COLOUR, values))
    if run.true_spins_rps is not None:
        curves.append(_truth(np.linalg.norm(run.true_spins_rps, axis=1)))
    return curves


def _magnitude_range(run: ViewedRun) -> Range:
    """Range from zero to beyond all but the highest magnitudes, and the truth."""
    curves = {curve.name: curve.values for curve in _magnitude_curves(run)}
    truth = curves.pop("truth", np.empty(0))
    known = np.concatenate([np.empty(0), *curves.values()])
    known = known[np.isfinite(known)]
    top = 1.2 * float(np.quantile(known, 0.95)) if known.size else 100.0
    return 0.0, max(top, 1.2 * float(np.nan_to_num(truth).max(initial=0.0)))


def _component_curves(run: ViewedRun) -> list[Curve]:
    """x, y and z of the trusted estimate."""
    vectors = np.full((len(run.ticks), 3), np.nan)
    for row, tick in zip(vectors, run.ticks, strict=True):
        if tick.best is not None:
            row[:] = tick.estimates[tick.best].vector_rps
    axes = zip("xyz", (at.ON, at.KALMAN_COLOUR, at.OFF), vectors.T, strict=True)
    return [Curve(x, f"{x} [rps]", colour, values, width=2.0) for x, colour, values in axes]


def _axis_error_curves(run: ViewedRun) -> list[Curve]:
    """Angle between each method's axis and the true one."""
    if run.true_spins_rps is None:
        return []
    curves = []
    for method in run.methods:
        axes = [tick.estimates[method.name].axis for tick in run.ticks]
        pairs = zip(axes, run.true_spins_rps, strict=True)
        cosines = [np.nan if axis is None else axis @ spin / np.linalg.norm(spin) for axis, spin in pairs]
        errors_deg = np.degrees(np.arccos(np.clip(cosines, -1, 1)))
        curves.append(Curve(method.name, f"{method.label} [°]", method.colour, errors_deg))
    return curves


def _truth(values: Floats, label: str = "truth", is_in_range: bool = True) -> Curve:
    return Curve("truth", label, at.TRUTH_COLOUR, values, width=0.8, is_in_range=is_in_range)


def _measured(circles: Sequence[Circle | None], name: str) -> Floats:
    return np.array([np.nan if circle is None else getattr(circle, name) for circle in circles])


def _numbers(values: Sequence[float | None]) -> Floats:
    return np.array([np.nan if value is None else value for value in values])


def _all_shots(index: int, run: ViewedRun) -> Floats:
    """A component of the state, of all shots."""
    return np.concatenate([np.empty(0), *(shot.state[:, index] for shot in run.shots)])


STATE_PLOTS = tuple(
    Plot(
        f"{at.PLOT}/{c.name}",
        f"{c.label} [{c.unit}]",
        partial(_state_curves, i, False),
        others=partial(_all_shots, i),
    )
    for i, c in enumerate(STATE)
)
RESIDUAL_PLOTS = tuple(
    Plot(f"{at.RESIDUAL}/{c.name}", f"Δ {c.name} [px]", partial(_state_curves, i, True))
    for i, c in enumerate(STATE)
    if c.circle is not None
)
EVENT_PLOT = Plot(at.EVENT_COUNT, "Event rate [Mev/s]", _event_curves, "top", with_zero=True)
RATE_PLOT = Plot(at.RATE, "Logo rate [kev/s]", _rate_curves, "top", with_zero=True)
CROSSING_PLOT = Plot(at.RATE_CROSSINGS, "Zero crossings", _crossing_curves, "top")
MAGNITUDE_PLOT = Plot(at.SPIN_MAGNITUDE, "Spin [rps] ± 1σ", _magnitude_curves, "bottom", _magnitude_range)
COMPONENT_PLOT = Plot(at.SPIN_COMPONENTS, "Trusted [rps]", _component_curves, "top", with_zero=True)
AXIS_ERROR_PLOT = Plot(at.AXIS_ERROR, "Axis error [°]", _axis_error_curves, "top", lambda _: (0.0, 40.0))
