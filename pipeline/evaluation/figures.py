"""The suites' figures as PNG; matplotlib is loaded when the first one is drawn."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import RecordingError
from ..files import atomic_file
from . import biases, detector, filters, runtime
from .honesty import by_coverage
from .spinner import group_of
from .tables import Row, distinct, summary, where
from .thrower import THROWER

if TYPE_CHECKING:
    from .suites import Report

Figure = Any  # matplotlib's; it has no business here before it is needed
WIDTH_IN, HEIGHT_IN, DPI = 5.0, 3.4, 120  # of one panel
BIN_RPS = 20.0  # errors against the spin are averaged over so much of it
LEAST = 1e-3  # errors below are drawn there, for the logarithm
BEST = "best"  # nearly always `contrast`: its curve would hide that one
ERRORS = (("magnitude_error_rps", "magnitude error [rps]"), ("axis_error_deg", "axis error [deg]"))


def draw(report: Report, folder: Path) -> list[Path]:
    """Write a suite's figures into a folder, which is made if needed; returns their paths.

    Raises RecordingError when they cannot be written.
    """
    paths = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, figure in DRAWINGS[report.suite.name](report.rows).items():
            content = io.BytesIO()
            _legend(figure).savefig(content, format="png", dpi=DPI)
            path = folder / f"{report.suite.name}_{name}.png"
            with atomic_file(path, "figure") as part:
                part.write_bytes(content.getvalue())
            paths.append(path)
    except OSError as error:
        raise RecordingError(f"figures cannot be written ({error.strerror}): {folder}") from error
    return paths


def _panels(rows: int, columns: int) -> tuple[Figure, Any]:
    """A figure and its (rows, columns) axes; not pyplot's, which would keep it."""
    from matplotlib.figure import Figure as NewFigure

    figure = NewFigure(figsize=(columns * WIDTH_IN, rows * HEIGHT_IN), layout="constrained")
    return figure, figure.subplots(rows, columns, squeeze=False)


def _curve(
    axes: Any,
    rows: Sequence[Row],
    x: str,
    y: str,
    label: str,
    style: str = "-",
    color: int = 0,
    band: bool = True,
) -> None:
    """Mean of y at each x, with a band up to one standard deviation above it as in the paper's figures."""
    points = [(value, summary(where(rows, **{x: value}), y)) for value in sorted(distinct(rows, x))]
    points = [(value, errors) for value, errors in points if errors.mean is not None]
    if not points:
        return
    place = [value for value, _ in points]
    mean = np.array([errors.mean for _, errors in points])
    sd = np.array([errors.sd or 0.0 for _, errors in points])
    axes.plot(place, mean, style, color=f"C{color}", marker="o", markersize=3, label=label)
    if not band:
        return
    # As far down as up on a logarithmic axis: a standard deviation may be larger than the mean.
    below = mean**2 / np.maximum(mean + sd, LEAST)
    axes.fill_between(place, below, mean + sd, color=f"C{color}", alpha=0.12)


def _methods(rows: Sequence[Row]) -> list[tuple[int, str]]:
    """(colour, method) of the curves."""
    return list(enumerate(method for method in distinct(rows, "method") if method != BEST))


def _coverage(groups: Sequence[tuple[str, Sequence[Row]]]) -> Figure:
    """Mean error when only the answers with the smallest stated errors are given, against the share given."""
    figure, axes = _panels(len(groups), len(ERRORS))
    for line, (what, rows) in enumerate(groups):
        for column, (name, label) in enumerate(ERRORS):
            for color, method in _methods(rows):
                coverage, error = by_coverage(where(rows, method=method), name, name.replace("_error_", "_std_"))
                if coverage.size:
                    axes[line, column].plot(coverage, np.maximum(error, LEAST), color=f"C{color}", label=method)
            axes[line, column].set_yscale("log")
            axes[line, column].set_xlim(0.0, 1.0)
            _finish(axes[line, column], what, "share answered, the surest first", f"mean {label}")
    return figure


def _finish(axes: Any, title: str, x: str, y: str) -> None:
    axes.set_title(title, fontsize=10)
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.grid(alpha=0.3)


def _legend(figure: Figure) -> Figure:
    """One legend for all panels, below them."""
    known: dict[str, Any] = {}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            known.setdefault(label, handle)
    if known:
        figure.legend(known.values(), known.keys(), loc="outside lower center", ncols=min(len(known), 6), fontsize=8)
    return figure


def _spinner(rows: Sequence[Row]) -> dict[str, Figure]:
    """Errors against rps (the paper's figure): top/back with balls 1, 6, 7, side with 2, 3, 4."""
    windows = sorted(distinct(rows, "window_ms"))
    figure, axes = _panels(2, len(windows))
    chosen = [row for row in rows if row["ball"] in ((2, 3, 4) if group_of(row) == "side" else (1, 6, 7))]
    for column, window_ms in enumerate(windows):
        for line, (name, label) in enumerate(ERRORS):
            for group, style in (("top/back", "-"), ("side", "--")):
                for color, method in _methods(rows):
                    part = [r for r in where(chosen, window_ms=window_ms, method=method) if group_of(r) == group]
                    _curve(axes[line, column], part, "rps", name, f"{method}, {group}", style, color)
            axes[line, column].set_yscale("log")
            _finish(axes[line, column], f"ball spinner, {window_ms} ms", "spin [rps]", label)
    groups = [(f"ball spinner, {window_ms} ms", where(rows, window_ms=window_ms)) for window_ms in windows]
    return {"errors": figure, "coverage": _coverage(groups)}


def _thrower(rows: Sequence[Row]) -> dict[str, Figure]:
    """The paper's figure of the thrower's flights, and error against coverage of all flights."""
    return _flights(where(rows, by=THROWER)) | {"coverage": _coverage([("flying balls", rows)])}


def _flights(rows: Sequence[Row]) -> dict[str, Figure]:
    """Errors against the spin, and the success rate (the paper's figure of the thrower)."""
    binned = [
        row | {"bin_rps": (row["rps"] // BIN_RPS + 0.5) * BIN_RPS} for row in rows if isinstance(row["rps"], float)
    ]
    figure, axes = _panels(1, 3)
    for color, method in _methods(rows):
        part = where(binned, method=method)
        for column, (name, _) in enumerate(ERRORS):
            _curve(axes[0, column], part, "bin_rps", name, method, color=color)
        bins = sorted(distinct(part, "bin_rps"))
        success = [summary(where(part, bin_rps=b), "axis_error_deg").success for b in bins]
        axes[0, 2].plot(bins, success, color=f"C{color}", marker="o", markersize=3, label=method)
    axes[0, 2].set_ylim(0.0, 1.05)
    for column in range(len(ERRORS)):
        axes[0, column].set_yscale("log")
    for column, (_, label) in enumerate((*ERRORS, ("success", "success rate"))):
        _finish(axes[0, column], "flying balls", "spin [rps]", label)
    return {"errors": figure}


def _detector(rows: Sequence[Row]) -> dict[str, Figure]:
    """Errors against the speed (the paper's figure of the detector)."""
    scenes = distinct(rows, "scene")
    names = (
        ("centre_error_px", "centre error [px]"),
        ("radius_error_px", "radius error [px]"),
        ("velocity_error_px_s", "velocity error [px/s]"),
    )
    figure, axes = _panels(len(scenes), len(names))
    for line, scene in enumerate(scenes):
        for column, (name, label) in enumerate(names):
            for color, stage in enumerate(detector.STAGES):
                part = where(rows, scene=scene, stage=stage)
                _curve(axes[line, column], part, "speed_m_s", name, stage, color=color)
            axes[line, column].set_yscale("log")
            _finish(axes[line, column], scene, "speed [m/s]", label)
    return {"errors": figure}


def _biases(rows: Sequence[Row]) -> dict[str, Figure]:
    """Event rates against each bias, and the logo's pictures (the supplement's figures)."""
    sweeps = distinct(rows, "sweep")
    figure, axes = _panels(2, len(sweeps))
    for column, sweep in enumerate(sweeps):
        for line, what in enumerate(("noise", "ball")):
            part = where(rows, sweep=sweep, what=what)
            for color, (name, label) in enumerate((("on_hz", "ON"), ("off_hz", "OFF"))):
                _curve(axes[line, column], part, "value", name, label, color=color)
            for paper in sorted(distinct(where(part, paper=True), "value")):
                axes[line, column].axvline(paper, color="green", linewidth=1)
            _finish(axes[line, column], f"{what}, bias_{sweep}", "bias (green: the paper's)", "events [1/s]")
        axes[0, column].set_yscale("log")
    result = {"rates": figure}
    pictures = where(rows, what="picture")
    if pictures:
        columns = min(len(pictures), 4)
        figure, axes = _panels(-(-len(pictures) // columns), columns)
        for panel in axes.flat:
            panel.set_axis_off()
        for panel, row in zip(axes.flat, pictures, strict=False):
            panel.imshow(biases.picture_of(row), cmap="coolwarm", vmin=-1, vmax=1)
            panel.set_title(f"bias_{row['sweep']}: {row['value']} ({row['span_us']} us)", fontsize=10)
        result["pictures"] = figure
    return result


def _filters(rows: Sequence[Row]) -> dict[str, Figure]:
    """Events kept against the threshold (the supplement's figure), and the spin's errors."""
    figure, axes = _panels(1, 3)
    kept, spin = where(rows, question="kept"), where(rows, question="spin")
    for color, mode in enumerate(filters.FILTERS):
        for name, style in (("kept_ball", "-"), ("kept_noise", ":")):
            label = f"{mode}, {name.removeprefix('kept_')}"
            _curve(axes[0, 0], where(kept, mode=mode), "threshold_us", name, label, style, color)
        for column, (name, _) in enumerate(ERRORS, start=1):
            for method, style in (("contrast", "-"), ("triplet", "--")):
                part = where(spin, mode=mode, method=method)
                _curve(axes[0, column], part, "threshold_us", name, f"{mode}, {method}", style, color, band=False)
            axes[0, column].set_yscale("log")
    for column, label in enumerate(("share of events kept", *(label for _, label in ERRORS))):
        axes[0, column].set_xscale("log")
        _finish(axes[0, column], "flying ball", "threshold [us]", label)
    return {"thresholds": figure}


def _runtime(rows: Sequence[Row]) -> dict[str, Figure]:
    """The latency's distribution, and its parts."""
    lengths = sorted(distinct(rows, "tick_us"), reverse=True)
    figure, axes = _panels(1, 2)
    for number, tick_us in enumerate(lengths):
        flown = where(rows, tick_us=tick_us, has_ball=True)
        latency_ms = [row["latency_ms"] for row in flown]
        weights = np.full(len(flown), 1 / max(len(flown), 1))
        axes[0, 0].hist(latency_ms, bins=40, weights=weights, alpha=0.6, label=f"tick of {tick_us} us")
        bottom = 0.0
        for color, name in enumerate(runtime.STAGES):
            mean = summary(flown, f"{name}_ms").mean or 0.0
            label = name if number == 0 else None
            axes[0, 1].bar(f"{tick_us} us", mean, bottom=bottom, color=f"C{color}", label=label)
            bottom += mean
    _finish(axes[0, 0], "events to logo", "latency [ms]", "share of ticks")
    _finish(axes[0, 1], "stages, ticks with a ball", "tick", "mean time [ms]")
    return {"times": figure}


DRAWINGS: dict[str, Callable[[Sequence[Row]], dict[str, Figure]]] = {
    "detector": _detector,
    "spinner": _spinner,
    "thrower": _thrower,
    "frames": _flights,
    "biases": _biases,
    "filters": _filters,
    "runtime": _runtime,
}
