"""Figures that suites share, and their PNG files; matplotlib is loaded when the first one is drawn."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from .estimation import BEST
from .tables import Row, distinct, summary, where
from .tasks import write_whole
from .uncertainty_calibration import ERRORS, STATED, risk_coverage

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .suite import Report

Figures: TypeAlias = "dict[str, Figure]"  # by name

WIDTH_IN, HEIGHT_IN, DPI = 5.0, 3.4, 120  # of one panel
BIN_RPS = 20.0  # errors against the spin are averaged over so much of it
MOST_COLUMNS = 6  # of a legend
LEAST = 1e-3  # errors below are drawn there, for the logarithm
LABELS = ("magnitude error [rps]", "axis error [deg]")  # of ERRORS


def draw(report: Report, folder: Path) -> list[Path]:
    """Write a suite's figures into a folder, which is made if needed; returns their paths; raises RecordingError."""
    paths = []
    for name, figure in report.suite.figures(report.rows).items():
        content = io.BytesIO()
        _legend(figure).savefig(content, format="png", dpi=DPI)
        paths.append(folder / f"{report.suite.name}_{name}.png")
        write_whole(paths[-1], content.getvalue())
    return paths


def panels(rows: int, columns: int) -> tuple[Figure, Any]:
    """A figure and its (rows, columns) axes; not pyplot's, which would keep it in memory."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(columns * WIDTH_IN, rows * HEIGHT_IN), layout="constrained")
    return figure, figure.subplots(rows, columns, squeeze=False)


def curve(
    axes: Any, rows: Sequence[Row], x: str, y: str, label: str, style: str = "-", color: int = 0, band: bool = True
) -> None:
    """Draw the mean of column y at each value of x, with a band of one standard deviation as in the paper's figures."""
    points = [(value, summary(where(rows, **{x: value}), y)) for value in sorted(distinct(rows, x))]
    points = [(value, errors) for value, errors in points if errors.mean is not None]
    if not points:
        return
    place = [value for value, _ in points]
    mean = np.array([errors.mean for _, errors in points])
    sd = np.array([errors.sd or 0.0 for _, errors in points])
    axes.plot(place, mean, style, color=f"C{color}", marker="o", markersize=3, label=label)
    if band:
        # As far down as up on a logarithmic axis: a standard deviation may be larger than the mean.
        below = mean**2 / np.maximum(mean + sd, LEAST)
        axes.fill_between(place, below, mean + sd, color=f"C{color}", alpha=0.12)


def method_colors(rows: Sequence[Row]) -> list[tuple[int, str]]:
    """(colour, method) of the curves; `best` is nearly always `contrast` and would hide its curve."""
    return list(enumerate(method for method in distinct(rows, "method") if method != BEST))


def coverage_figure(groups: Sequence[tuple[str, Sequence[Row]]]) -> Figure:
    """Mean error when only the answers with the smallest stated errors are given, against the share given."""
    figure, axes = panels(len(groups), len(ERRORS))
    for line, (what, rows) in zip(axes, groups, strict=True):
        for panel, name, std, label in zip(line, ERRORS, STATED, LABELS, strict=True):
            for color, method in method_colors(rows):
                coverage, error = risk_coverage(where(rows, method=method), name, std)
                if coverage.size:
                    panel.plot(coverage, np.maximum(error, LEAST), color=f"C{color}", label=method)
            panel.set_xlim(0.0, 1.0)
            label_axes(panel, what, "share answered, the surest first", f"mean {label}", log=True)
    return figure


def label_axes(axes: Any, title: str, x: str, y: str, log: bool = False) -> None:
    """Set title, axis labels and grid of a panel, and whether y is logarithmic."""
    axes.set_title(title, fontsize=10)
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.grid(alpha=0.3)
    if log:
        axes.set_yscale("log")


def _legend(figure: Figure) -> Figure:
    """One legend for all panels, below them, in as many columns as there is room for."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    known: dict[str, Any] = {}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            known.setdefault(label, handle)
    renderer = FigureCanvasAgg(figure).get_renderer()
    for columns in range(min(len(known), MOST_COLUMNS), 0, -1):
        legend = figure.legend(known.values(), known.keys(), loc="outside lower center", ncols=columns, fontsize=8)
        if legend.get_window_extent(renderer).width <= figure.bbox.width:
            break
        if columns > 1:
            legend.remove()
    return figure


def flight_figure(rows: Sequence[Row]) -> Figures:
    """Errors against the spin, and the success rate (the paper's figure of the thrower)."""
    binned = [
        row | {"bin_rps": (row["rps"] // BIN_RPS + 0.5) * BIN_RPS} for row in rows if isinstance(row["rps"], float)
    ]
    figure, axes = panels(1, 3)
    for color, method in method_colors(rows):
        part = where(binned, method=method)
        for panel, name in zip(axes[0], ERRORS, strict=False):
            curve(panel, part, "bin_rps", name, method, color=color)
        bins = sorted(distinct(part, "bin_rps"))
        success = [summary(where(part, bin_rps=b), "magnitude_error_rps").success for b in bins]
        axes[0, 2].plot(bins, success, color=f"C{color}", marker="o", markersize=3, label=method)
    axes[0, 2].set_ylim(0.0, 1.05)
    for panel, label in zip(axes[0], (*LABELS, "success rate"), strict=True):
        label_axes(panel, "flying balls", "spin [rps]", label, log=label in LABELS)
    return {"errors": figure}
