"""Registry of views: each is a tab of the viewer over the same results, one record a view."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import rerun.blueprint as rrb

from spinscope.pipeline.extensions import Registry

from . import entities as at
from . import panes, plots
from .comparison import comparison
from .fitting import ViewerSize
from .run import ViewedRun
from .summary import CARD_PX

SLOW_MOTION = 0.01  # a flight of 100 ms plays for 10 s


@dataclass(frozen=True, kw_only=True)
class View:
    """A tab of the viewer.

    Attributes
    ----------
    name : str
        Name on the command line (`--layout`).
    label : str
        Title of the tab.
    help : str
        What it shows, in one sentence.
    panes : callable
        `panes(run) -> Container`: its panes, side by side and below each other.
    compares : bool
        Whether it shows two runs beside each other: for the page, where a second run can be pinned.
    """

    name: str
    label: str
    help: str
    panes: Callable[[ViewedRun], rrb.Container]
    compares: bool = False


def views(*, compare: bool = False) -> tuple[View, ...]:
    """The views in the order of their tabs, with those of two runs or without."""
    return tuple(view for view in VIEWS if compare or not view.compares)


def blueprint(
    run: ViewedRun, layout: str, *, compare: bool = False, is_lasting: bool = False, size: ViewerSize | None = None
) -> rrb.Blueprint:
    """All tabs over a run, in slow motion and paused.

    Parameters
    ----------
    run : ViewedRun
        The run, for ranges and sizes.
    layout : str
        Name of the view in front; the first one when it is not among the tabs.
    compare : bool
        Whether there are the views of two runs.
    is_lasting : bool
        Whether other recordings are to be shown with it: all of each is played, for the viewer forgets the selection.
        Otherwise the followed shot, by default the first, is played over and over.
    size : ViewerSize or None
        Of the viewer, to which the panes are fitted; None where it is not known.
    """
    shown = views(compare=compare)
    tabs = [view.panes(run) if size is None else size.fitted(view.panes(run)) for view in shown]
    for tab, view in zip(tabs, shown, strict=True):
        tab.name = view.label
    front = next((i for i, view in enumerate(shown) if view.name == layout), 0)
    end_us = run.shots[(run.followed or 1) - 1].end_us if run.shots else run.end_us
    shot = rrb.components.AbsoluteTimeRange(min=run.first_sight_us * 1000, max=end_us * 1000)
    return rrb.Blueprint(
        rrb.Tabs(*tabs, active_tab=front),
        rrb.TopPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(
            state="collapsed",
            timeline=at.TIMELINE,
            playback_speed=SLOW_MOTION,
            play_state="paused",
            loop_mode="all" if is_lasting else "selection",
            time_selection=None if is_lasting else shot,
        ),
        auto_layout=False,
        auto_views=False,
    )


def _all(run: ViewedRun) -> rrb.Container:
    state = rrb.Tabs(*(plot.view(run) for plot in plots.STATE_PLOTS), active_tab=0)
    return rrb.Vertical(
        rrb.Horizontal(
            panes.events(run),
            panes.surface(run),
            panes.close_up(run),
            panes.flight(run),
            column_shares=[4, 4, 3, 3],
            name="Image",
        ),
        rrb.Horizontal(
            rrb.Vertical(panes.status(), state, row_shares=[4, 5]),
            panes.logo_events(run),
            panes.flow(run),
            panes.derotated_logo(),
            column_shares=[4, 3, 3, 4],
            name="Tracker and logo",
        ),
        rrb.Horizontal(
            plots.RATE_PLOT.view(run, legend=False),
            plots.MAGNITUDE_PLOT.view(run, legend=False),
            panes.ball(run),
            panes.text(at.SUMMARY, "Summary"),
            column_shares=[4, 4, 3, 5],
            name="Spin",
        ),
        row_shares=[4, 4, 5],
    )


def _tracker(run: ViewedRun) -> rrb.Container:
    pictures = rrb.Horizontal(panes.close_up(run), panes.events(run))
    state, residuals = ([plot.view(run) for plot in some] for some in (plots.STATE_PLOTS, plots.RESIDUAL_PLOTS))
    return rrb.Horizontal(
        rrb.Vertical(panes.surface(run), pictures, row_shares=[3, 2], name="Images"),
        rrb.Vertical(panes.status(), *state, row_shares=[3, *(2 for _ in state)], name="State"),
        rrb.Vertical(*residuals, plots.EVENT_PLOT.view(run), name="Residuals"),
        column_shares=[5, 4, 4],
    )


def _logo(run: ViewedRun) -> rrb.Container:
    return rrb.Horizontal(
        rrb.Vertical(panes.logo_events(run), panes.close_up(run), name="Events"),
        rrb.Vertical(panes.flow(run), panes.derotated_logo(), name="Flow and logo"),
        rrb.Vertical(
            *(plot.view(run) for plot in (plots.RATE_PLOT, plots.CROSSING_PLOT, plots.MAGNITUDE_PLOT)), name="Curves"
        ),
        column_shares=[3, 4, 4],
    )


def _spin(run: ViewedRun) -> rrb.Container:
    unrolled = panes.picture(at.UNROLLED, "Logo unrolled")
    score = panes.picture(at.SCORE_AXES, "Contrast over axes")
    errors = [] if run.truth is None else [plots.AXIS_ERROR_PLOT.view(run, legend=False)]
    text = rrb.Tabs(panes.text(at.SUMMARY, "Summary"), panes.contacts(), active_tab=0)
    return rrb.Horizontal(
        rrb.Vertical(panes.ball(run), unrolled, score, row_shares=[3, 2, 2], name="Ball"),
        rrb.Vertical(
            panes.witnesses(),
            plots.MAGNITUDE_PLOT.view(run),
            panes.score_over_magnitude(),
            row_shares=[6, 4, 3],
            name="Evidence",
        ),
        rrb.Vertical(
            text, plots.COMPONENT_PLOT.view(run), *errors, row_shares=[6, 3, *(3 for _ in errors)], name="Answer"
        ),
        column_shares=[4, 5, 4],
    )


def _coach(run: ViewedRun) -> rrb.Container:
    card = panes.picture(at.COACH, "Shot", bounds=np.array([[0, CARD_PX], [0, CARD_PX]]))
    flight = panes.flight(run, "Flight", (at.AXES, at.TRUE_PATH, at.SPIN_SHOWN))
    return rrb.Horizontal(
        panes.ball(run, "Ball and spin", methods=False),
        rrb.Vertical(card, flight, row_shares=[3, 2]),
        column_shares=[3, 2],
    )


VIEWS: Registry[View] = Registry("view")
for _view in (
    View(name="all", label="All stages", help="Every stage side by side.", panes=_all),
    View(name="tracker", label="Tracker", help="Circles on the surface, state and residuals.", panes=_tracker),
    View(name="logo", label="Logo and flow", help="Logo events, their flow and their rate.", panes=_logo),
    View(
        name="spin",
        label="Spin",
        help="Every method's estimate and what speaks for it.",
        panes=_spin,
    ),
    View(name="compare", label="Compare", help="Two settings A and B side by side.", panes=comparison, compares=True),
    View(name="coach", label="Coach", help="Spin and speed in large letters, ball and flight.", panes=_coach),
):
    VIEWS.register(_view)
