"""Registry of drawers: what is shown of the results of a run, each drawer one record."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from spinscope.pipeline.extensions import Registry

from . import image, plots
from .ball import ball_chunks
from .curves import Plot
from .derotated_logo import derotated_logo_chunks
from .rerun_api import Chunk
from .run import ViewedRun
from .score import score_chunks
from .shot_marks import shot_mark_chunks
from .summary import summary_chunks
from .witnesses import witness_chunks


@dataclass(frozen=True, kw_only=True)
class Drawer:
    """Drawing of results into the viewer.

    Attributes
    ----------
    name : str
        Unique name.
    stage : str, optional
        Stage whose results it shows: nothing is drawn where that was not run, and a drawing stays good until the
        stage's results change. None for a drawer that shows whatever was run.
    draw : callable, optional
        `draw(run) -> list of Chunk`, each with an entity of its own.
    plots : tuple of Plot
        Plots that it draws besides.
    """

    name: str
    stage: str | None = None
    draw: Callable[[ViewedRun], list[Chunk]] | None = None
    plots: tuple[Plot, ...] = ()

    def chunks(self, run: ViewedRun) -> list[Chunk]:
        """Everything that it draws."""
        drawn = self.draw(run) if self.draw else []
        return [*drawn, *(chunk for plot in self.plots for chunk in plot.chunks(run))]


DRAWERS: Registry[Drawer] = Registry("drawer")
for _drawer in (
    Drawer(name="filter", stage="filter", draw=image.filter_chunks, plots=(plots.EVENT_PLOT,)),
    Drawer(name="frames", draw=image.frame_chunks),
    Drawer(name="surface", stage="surface", draw=image.surface_chunks),
    Drawer(name="track", stage="track", draw=image.track_chunks, plots=(*plots.STATE_PLOTS, *plots.RESIDUAL_PLOTS)),
    Drawer(name="logo", stage="logo", draw=image.logo_chunks),
    Drawer(name="rate", stage="rate", plots=(plots.RATE_PLOT, plots.CROSSING_PLOT)),
    Drawer(name="flow", stage="flow", draw=image.flow_chunks),
    Drawer(name="score", draw=score_chunks),
    Drawer(name="witnesses", stage="combined", draw=witness_chunks),
    Drawer(name="spin", plots=(plots.MAGNITUDE_PLOT, plots.COMPONENT_PLOT, plots.AXIS_ERROR_PLOT)),
    Drawer(name="ball", draw=ball_chunks),
    Drawer(name="derotated_logo", draw=derotated_logo_chunks),
    Drawer(name="shots", draw=shot_mark_chunks),
    Drawer(name="summary", draw=summary_chunks),
):
    DRAWERS.register(_drawer)


def drawers_of(run: ViewedRun) -> list[Drawer]:
    """The drawers that have something to draw of a run."""
    return [drawer for drawer in DRAWERS if drawer.stage is None or drawer.stage in run.stages]


def run_chunks(run: ViewedRun) -> list[Chunk]:
    """Everything there is to see of a run."""
    return [chunk for drawer in drawers_of(run) for chunk in drawer.chunks(run)]
