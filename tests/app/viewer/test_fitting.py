"""Layouts fitted to the size of the viewer."""

from __future__ import annotations

from typing import Any

import pytest
import rerun.blueprint as rrb

from spinscope.app.viewer import entities as at
from spinscope.app.viewer.fitting import (
    LARGER_PX,
    LEGEND_HEIGHTS_PX,
    MIN_LEGEND_HEIGHT_PX,
    MIN_PLOT_HEIGHT_PX,
    MIN_WIDTH_PX,
    ViewerSize,
    fitted,
)
from spinscope.app.viewer.run import ViewedRun
from spinscope.app.viewer.views import views

CONTAINERS = ("Horizontal", "Vertical", "Tabs")


def kind(part: Any) -> str:
    return type(part).__name__


def names(part: Any) -> list[str]:
    """Names of all views, in order."""
    if kind(part) not in CONTAINERS:
        return [str(part.name)]
    return [name for one in part.contents for name in names(one)]


def row(*names: str) -> Any:
    return rrb.Horizontal(*(rrb.Spatial2DView(name=name) for name in names), column_shares=[3, 1, 1][: len(names)])


def smallest(part: Any, width: float, height: float) -> tuple[float, float]:
    """Width and height of the smallest view."""
    if kind(part) not in CONTAINERS:
        return width, height
    shares = part.column_shares if kind(part) == "Horizontal" else part.row_shares
    parts = [1 / len(part.contents)] * len(part.contents) if shares is None else [one / sum(shares) for one in shares]
    across, down = kind(part) == "Horizontal", kind(part) == "Vertical"
    sizes = [(width * one if across else width, height * one if down else height) for one in parts]
    found = [smallest(one, *size) for one, size in zip(part.contents, sizes, strict=True)]
    return min(width for width, _ in found), min(height for _, height in found)


def test_what_has_room_stays_as_it_is() -> None:
    found: Any = fitted(row("a", "b", "c"), 5 * MIN_WIDTH_PX, 400)
    assert kind(found) == "Horizontal" and [len(names(one)) for one in found.contents] == [1, 1, 1]
    assert list(found.column_shares) == pytest.approx([3 * MIN_WIDTH_PX, MIN_WIDTH_PX, MIN_WIDTH_PX])


def test_shares_give_way_before_neighbours_become_tabs() -> None:
    found: Any = fitted(row("a", "b", "c"), 3 * MIN_WIDTH_PX, 400)
    assert list(found.column_shares) == pytest.approx([MIN_WIDTH_PX] * 3)
    found = fitted(row("a", "b", "c"), 4.5 * MIN_WIDTH_PX, 400)  # those with room to spare give what others need
    assert list(found.column_shares) == pytest.approx([2.5 * MIN_WIDTH_PX, MIN_WIDTH_PX, MIN_WIDTH_PX])
    found = fitted(row("a", "b", "c"), 2.9 * MIN_WIDTH_PX, 400)
    tabs, alone = found.contents
    assert kind(tabs) == "Tabs" and names(tabs) == ["a", "b"] and names(alone) == ["c"]
    only: Any = fitted(row("a", "b", "c"), 0.5 * MIN_WIDTH_PX, 400)
    assert [kind(one) for one in only.contents] == ["Tabs"]


def test_a_low_plot_has_no_legend() -> None:
    plot = rrb.TimeSeriesView(plot_legend=rrb.PlotLegend(visible=True))
    low: Any = fitted(rrb.Vertical(plot, plot), 400, 2 * MIN_LEGEND_HEIGHT_PX - 2)
    high: Any = fitted(rrb.Vertical(plot, plot), 400, 2 * MIN_LEGEND_HEIGHT_PX)
    shown = [
        [one.properties["PlotLegend"].visible.as_arrow_array().to_pylist() for one in of.contents] for of in (low, high)
    ]
    assert shown == [[[False]] * 2, [[True]] * 2]


def test_a_legend_of_many_rows_and_the_trackers_lanes_need_more_room() -> None:
    plot = rrb.TimeSeriesView(origin=at.SPIN_MAGNITUDE, plot_legend=rrb.PlotLegend(visible=True))
    low, high = (fitted(plot, 400, height) for height in (LEGEND_HEIGHTS_PX[at.SPIN_MAGNITUDE] + d for d in (-1, 0)))
    shown = [one.properties["PlotLegend"].visible.as_arrow_array().to_pylist() for one in (low, high)]
    assert shown == [[False], [True]]
    lanes = rrb.StateTimelineView(origin=at.TRACKER, name="lanes")
    _, needed_px = LARGER_PX[at.TRACKER]
    column = rrb.Vertical(lanes, rrb.TimeSeriesView(name="plot"))
    assert kind(fitted(column, 400, needed_px + MIN_PLOT_HEIGHT_PX)) == "Vertical"
    assert kind(fitted(column, 400, needed_px + MIN_PLOT_HEIGHT_PX - 1).contents[0]) == "Tabs"


@pytest.mark.parametrize("size", [(600, 400), (800, 600), (950, 650), (1600, 900)])
def test_no_pane_of_any_view_is_too_small_and_none_is_lost(flight: ViewedRun, size: tuple[int, int]) -> None:
    for view in views(compare=True):
        whole = view.panes(flight)
        found = ViewerSize(*size).fitted(whole)
        assert names(found) == names(whole), view.name
        width, height = smallest(found, size[0], size[1])
        assert width >= MIN_WIDTH_PX - 1 and height >= MIN_PLOT_HEIGHT_PX - 1, view.name
