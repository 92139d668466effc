"""Figure of a run's series for a publication: the plots of the viewer on white, A dashed where it is compared."""

from __future__ import annotations

import io
from typing import Any

import numpy as np

from . import plots
from .curves import Curve, Plot
from .entities import Colour
from .run import ViewedRun

STATE = ("x", "y", "radius")
PANELS = (
    *(plot for plot, component in zip(plots.STATE_PLOTS, plots.STATE, strict=True) if component.name in STATE),
    plots.MAGNITUDE_PLOT,
    plots.COMPONENT_PLOT,
    plots.AXIS_ERROR_PLOT,
)
COLUMNS = 2
SPARE = 0.05  # of the time shown, on each side of the ball's flight
TIME_LABELS = 6  # at most: more of a long time in ms overlap
BRIGHTEST = 0.45  # relative luminance of a line on white, at most: the viewer's colours are made for a dark ground


def series_figure(run: ViewedRun, suffix: str, pinned: ViewedRun | None = None) -> bytes:
    """Draw state, spin and errors over time as a figure.

    Parameters
    ----------
    run : ViewedRun
        The run, B where two are compared.
    suffix : str
        Format: ".pdf" or ".svg".
    pinned : ViewedRun or None
        A, whose curves are dashed.
    """
    from spinscope.pipeline.evaluation.plots import panels  # with matplotlib, which takes a second to load

    shown = [plot for plot in PANELS if plot.curves(run)]
    figure, axes = panels(-(-len(shown) // COLUMNS), COLUMNS)
    for panel, plot in zip(axes.flat, shown, strict=False):
        _draw(panel, plot, run)
        if pinned is not None:
            _draw(panel, plot, pinned, is_pinned=True)
        panel.set(xlabel="time [ms]", ylabel=plot.title, xlim=time_range_ms(run), ylim=plot.axis_range(run))
        panel.locator_params(axis="x", nbins=TIME_LABELS)
        panel.legend(fontsize="x-small")
    for panel in axes.flat[len(shown) :]:
        panel.remove()
    content = io.BytesIO()
    figure.savefig(content, format=suffix.removeprefix("."))
    return content.getvalue()


def time_range_ms(run: ViewedRun) -> tuple[float, float]:
    """Time that all panels show: that in which there is a ball, the whole run where there is none."""
    seen = run.ends_us[run.has_ball] if run.has_ball.any() else run.ends_us
    start, end = float(seen[0]) / 1000, float(seen[-1]) / 1000
    spare = SPARE * max(end - start, 1.0)
    return start - spare, end + spare


def _draw(panel: Any, plot: Plot, run: ViewedRun, *, is_pinned: bool = False) -> None:
    for curve in plot.curves(run):
        if is_pinned and curve.name == "truth":
            continue  # it is the same one
        _draw_curve(panel, curve, run, is_pinned)


def _draw_curve(panel: Any, curve: Curve, run: ViewedRun, is_pinned: bool) -> None:
    t_ms = np.asarray(run.ends_us if curve.t_us is None else curve.t_us) / 1000
    colour = printed_colour(curve.colour)
    label = f"A: {curve.label}" if is_pinned else curve.label
    if curve.marker is not None:
        panel.plot(t_ms, curve.values, ".", color=colour, markersize=curve.width, label=label)
        return
    panel.plot(t_ms, curve.values, "--" if is_pinned else "-", color=colour, linewidth=1.0, label=label)
    if curve.variances is not None and not is_pinned:
        deviations = np.sqrt(curve.variances)
        panel.fill_between(t_ms, curve.values - deviations, curve.values + deviations, color=colour, alpha=0.15, lw=0)


def printed_colour(colour: Colour) -> tuple[float, float, float]:
    """Colour of the viewer as one that is seen on white: darker where it is bright, 0..1."""
    red, green, blue = (part / 255 for part in colour)
    luminance = 0.2126 * red + 0.7152 * green + 0.0722 * blue
    share = min(1.0, BRIGHTEST / max(luminance, 1e-9))
    return share * red, share * green, share * blue
