"""Layouts fitted to the viewer's size: panes that are too small share one place as tabs, low plots have no legend."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass

import numpy as np
import rerun.blueprint as rrb
from numpy.typing import NDArray

from . import entities as at

Part = rrb.View | rrb.Container
Floats = NDArray[np.float64]

TITLE_PX = 28  # height of a pane's title, and of a row of tabs
TIME_PANEL_PX = 34
# A pane's buttons take 120 px of its title; plots are read in a lower pane than pictures and text.
MIN_WIDTH_PX, MIN_HEIGHT_PX, MIN_PLOT_HEIGHT_PX = 200, 120, 75
# Two rows of a legend hide half of a plot that is lower: it is left without, and tells a curve's name at the mouse.
MIN_LEGEND_HEIGHT_PX = 160
# That of all methods has seven rows; beside a plot without it the witnesses bear their names in its colours.
LEGEND_HEIGHTS_PX = {at.SPIN_MAGNITUDE: 330}
PLOTS = (rrb.TimeSeriesView, rrb.StateTimelineView, rrb.BarChartView)
# Width and height by a pane's origin: the witnesses have words in many rows, the tracker two lanes with their names.
LARGER_PX = {at.WITNESSES: (360, 250), at.TRACKER: (200, 128)}


@dataclass(frozen=True)
class ViewerSize:
    """Width and height of the viewer, px of the page."""

    width_px: float
    height_px: float

    def fitted(self, view: rrb.Container) -> Part:
        """The panes of a whole view, below the tabs and above the time panel."""
        return fitted(view, self.width_px, self.height_px - TITLE_PX - TIME_PANEL_PX)


def fitted(part: Part, width_px: float, height_px: float) -> Part:
    """Part of a layout in which neighbours that are too many for a size are tabs of one pane, low plots without legend.

    Parameters
    ----------
    part : View or Container
        Horizontal, Vertical and Tabs of views.
    width_px, height_px : float
        Its size.
    """
    if isinstance(part, rrb.TimeSeriesView) and height_px < LEGEND_HEIGHTS_PX.get(
        str(part.origin), MIN_LEGEND_HEIGHT_PX
    ):
        low = copy(part)
        low.properties = {**part.properties, "PlotLegend": rrb.PlotLegend(visible=False)}
        return low
    if isinstance(part, rrb.View):
        return part
    contents = list(part.contents)
    if isinstance(part, rrb.Tabs):
        below = [fitted(one, width_px, height_px - TITLE_PX) for one in contents]
        return rrb.Tabs(*below, active_tab=part.active_tab, name=part.name)
    is_row = isinstance(part, rrb.Horizontal)
    given, room = (part.column_shares, width_px) if is_row else (part.row_shares, height_px)
    needs = [_least(one)[0 if is_row else 1] for one in contents]
    shares = np.array([1.0] * len(contents) if given is None else given, float)
    if sum(needs) <= room:
        lengths = _lengths(shares, np.array(needs), room)
    else:
        contents, needs = _grouped(contents, needs, room)
        lengths = room * np.array(needs) / sum(needs)
    inside = [
        fitted(one, *((length, height_px) if is_row else (width_px, length)))
        for one, length in zip(contents, lengths, strict=True)
    ]
    if is_row:
        return rrb.Horizontal(*inside, column_shares=lengths, name=part.name)
    return rrb.Vertical(*inside, row_shares=lengths, name=part.name)


def _lengths(shares: Floats, needs: Floats, room: float) -> Floats:
    """Lengths by shares of the room, none less than it needs: together they need no more than there is."""
    is_least = np.zeros(len(shares), np.bool_)
    while True:
        spare = room - needs[is_least].sum()
        lengths = np.where(is_least, needs, spare * shares / max(float(shares[~is_least].sum()), 1e-9))
        short = ~is_least & (lengths < needs)
        if not short.any():
            return lengths
        is_least |= short


def _grouped(contents: Sequence[Part], needs: Sequence[float], room: float) -> tuple[list[Part], list[float]]:
    """Neighbours as tabs of one pane, as few as the room asks for, and what each group needs."""
    for count in range(len(contents), 0, -1):
        groups = [list(group) for group in np.array_split(np.arange(len(contents)), count)]
        most = [max(needs[i] for i in group) for group in groups]
        if sum(most) <= room or count == 1:
            break
    return [_tabs([contents[i] for i in group]) for group in groups], most


def _tabs(parts: Sequence[Part]) -> Part:
    """Parts as tabs of one pane, those of tabs among the others; a single one as it is."""
    if len(parts) == 1:
        return parts[0]
    return rrb.Tabs(
        *(one for part in parts for one in (part.contents if isinstance(part, rrb.Tabs) else [part])), active_tab=0
    )


def _least(part: Part) -> tuple[float, float]:
    """Width and height, px, that a part needs."""
    if isinstance(part, rrb.View):
        usual = MIN_WIDTH_PX, MIN_PLOT_HEIGHT_PX if isinstance(part, PLOTS) else MIN_HEIGHT_PX
        return LARGER_PX.get(str(part.origin), usual)
    widths, heights = zip(*(_least(one) for one in part.contents), strict=True)
    if isinstance(part, rrb.Tabs):
        return max(widths), max(heights) + TITLE_PX
    return (sum(widths), max(heights)) if isinstance(part, rrb.Horizontal) else (max(widths), sum(heights))
