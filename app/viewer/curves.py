"""Curve and plot over time: what is drawn of them, and the view in which they stand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from .entities import CONTACT_COLOUR, Colour
from .rerun_api import Chunk, columns_at, styled
from .run import ViewedRun

Floats = NDArray[np.float64]
Range = tuple[float, float]

LEGEND_SHARE = 0.5  # of a plot's range, added at the top to make room for the legend


@dataclass(frozen=True, eq=False)
class Curve:
    """One curve of a plot.

    Attributes
    ----------
    name : str
        Last part of its entity path.
    label : str
        Name in the legend.
    colour : (int, int, int)
        Red, green and blue, 0..255.
    values : (n,) float64
        One for each tick, at its end, or for each of `t_us`; NaN makes a gap.
    variances : (n,) float64, optional
        Drawn as a translucent band of +-1 sigma; then `unit` is its unit.
    t_us : (n,) array, optional
        Times of the values, us of file time, where they are not the ticks' ends.
    marker : {"circle", "down"}, optional
        Dots of this form in place of a line.
    width : float
        Of the line, or of the dots.
    is_stepped : bool
        Whether each value holds until the next one.
    is_in_range : bool
        Whether the plot's axis must reach over it.
    """

    name: str
    label: str
    colour: Colour
    values: Floats
    variances: Floats | None = None
    unit: str = ""
    t_us: NDArray[np.int64] | Floats | None = None
    marker: Literal["circle", "down"] | None = None
    width: float = 1.5
    is_stepped: bool = False
    is_in_range: bool = True

    def chunks(self, run: ViewedRun, plot: str) -> list[Chunk]:
        """The curve below the entity of its plot."""
        entity = f"{plot}/{self.name}"
        t_us, values = (run.times_us, _from_start(self.values)) if self.t_us is None else (self.t_us, self.values)
        if self.variances is not None:
            variances = np.nan_to_num(_from_start(self.variances))
            columns = rr.Measurements.columns(values=values, variances=variances)
            look = {"units": self.unit, "widths": self.width, "aggregation_policy": "Off"}
            style = styled(entity, rr.Measurements, names=self.label, colors=self.colour, **look)
            return [columns_at(entity, t_us, columns), style]
        if self.marker is not None:
            look = {"markers": self.marker, "marker_sizes": self.width}
            style = styled(entity, rr.SeriesPoints, names=self.label, colors=self.colour, **look)
        else:
            mode = "StepAfter" if self.is_stepped else "Linear"
            look = {"widths": self.width, "interpolation_mode": mode, "aggregation_policy": "Off"}
            style = styled(entity, rr.SeriesLines, names=self.label, colors=self.colour, **look)
        return [columns_at(entity, t_us, rr.Scalars.columns(scalars=values)), style]


@dataclass(frozen=True)
class Plot:
    """Curves over one span of time with an axis of their own.

    Attributes
    ----------
    entity : str
        Entity above its curves.
    title : str
        Name of its view.
    curves : callable
        `curves(run) -> list of Curve`.
    legend : {"none", "top", "bottom"}
        Corner of the legend; at the top the axis makes room for it.
    y_range : callable, optional
        `y_range(run) -> (low, high)` of the axis, where it is not that of the curves.
    with_zero : bool
        Whether the axis begins at zero at the latest.
    others : callable, optional
        `others(run) -> (n,) float64`: values that the axis must reach as well, of balls that may be followed later.
    """

    entity: str
    title: str
    curves: Callable[[ViewedRun], list[Curve]]
    legend: Literal["none", "top", "bottom"] = "none"
    y_range: Callable[[ViewedRun], Range] | None = None
    with_zero: bool = False
    others: Callable[[ViewedRun], Floats] | None = None

    def chunks(self, run: ViewedRun) -> list[Chunk]:
        """All curves, and a vertical line at each contact."""
        curves = [*self.curves(run), *self._contacts(run)]
        return [chunk for curve in curves for chunk in curve.chunks(run, self.entity)]

    def view(self, run: ViewedRun, *, legend: bool = True) -> rrb.TimeSeriesView:
        """View of the plot over the time in view; without its legend where there is no room for it."""
        corner = self.legend if legend else "none"
        y_range = self.axis_range(run)
        if corner == "top" and y_range is not None:
            y_range = (y_range[0], y_range[1] + LEGEND_SHARE * (y_range[1] - y_range[0]))
        place: Literal["RightBottom", "RightTop"] = "RightBottom" if corner == "bottom" else "RightTop"
        return rrb.TimeSeriesView(
            origin=self.entity,
            name=self.title,
            axis_x=rrb.TimeAxis(link="LinkToGlobal"),
            axis_y=None if y_range is None else rrb.ScalarAxis(range=y_range),
            plot_legend=rrb.PlotLegend(corner=place, visible=corner != "none"),
        )

    def _contacts(self, run: ViewedRun) -> list[Curve]:
        """Vertical lines at the contacts over the range of the axis: up within a nanosecond, the time's resolution."""
        y_range = self.axis_range(run) if run.contacts_us.size else None
        if y_range is None:
            return []
        t_us = np.add.outer(run.contacts_us, [-1e-3, 0.0, 1e-3]).ravel()
        values = np.tile([*y_range, np.nan], run.contacts_us.size)
        t_us, values = np.concatenate([[run.start_us], t_us]), _from_start(values)
        return [Curve("contacts", "contact", CONTACT_COLOUR, values, t_us=t_us, width=1.0)]

    def axis_range(self, run: ViewedRun) -> Range | None:
        """Range of the axis, or of the curves with a tenth to spare on either side; None where they have no values."""
        if self.y_range:
            return self.y_range(run)
        values = np.concatenate([np.zeros(int(self.with_zero)), *([self.others(run)] if self.others else [])])
        for curve in self.curves(run):
            if curve.is_in_range:
                deviations = 0.0 if curve.variances is None else np.sqrt(curve.variances)
                values = np.concatenate([values, curve.values - deviations, curve.values + deviations])
        known = values[np.isfinite(values)]
        if not known.size:
            return None
        low, high = float(known.min()), float(known.max())
        spare = 0.1 * (high - low) or 1.0
        return low - spare, high + spare


def _from_start(values: Floats) -> Floats:
    """A column of ticks with a row before it, in which nothing is known."""
    return np.concatenate([[np.nan], values])
