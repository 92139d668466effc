"""Filter: fewer redundant events and less noise (supplement, section 'Filters')."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..events import EventBatch
from ..kernels import filter as kernels
from ..kernels.take_events import take_events
from ..parameters import ParameterGroup, choice, tunable
from ..results import Packet
from ..stage import Context, Stage

MODES = {"off": kernels.OFF, "stc": kernels.STC, "trail": kernels.TRAIL, "stc_cut_trail": kernels.STC_CUT_TRAIL}


@dataclass(frozen=True, kw_only=True)
class FilterParameters(ParameterGroup):
    """One setting for the events that draw the surface and one for those that carry the logo."""

    mode: str = choice("stc_cut_trail", tuple(MODES), "filter of the events that draw the surface")
    threshold_us: int = tunable(5000, 1, 1_000_000, 100, "us", "time window of the surface's filter")
    logo_mode: str = choice("trail", tuple(MODES), "filter of the events that carry the logo and refine the circle")
    logo_threshold_us: int = tunable(5000, 1, 1_000_000, 100, "us", "time window of the logo's filter")


@dataclass(frozen=True, slots=True, eq=False)
class FilterResult:
    """The packet's events after the two filters."""

    surface_events: EventBatch
    logo_events: EventBatch


@dataclass(slots=True, eq=False)
class FilterState:
    """The last event of every pixel: `last` (height x width,) int64 as the kernel packs it."""

    last: NDArray[np.int64]
    width_px: int


def start(parameters: FilterParameters, context: Context) -> FilterState:
    """No pixel has seen an event."""
    camera = context.camera
    return FilterState(np.full(camera.width_px * camera.height_px, kernels.NEVER), camera.width_px)


def step(parameters: FilterParameters, state: FilterState, packet: Packet) -> FilterResult:
    """The packet through both filters; see the kernel for what STC and TRAIL pass.

    Filters with the same setting give one and the same batch; a filter that is off gives the packet's own.
    """
    events = packet.events
    surface = (MODES[parameters.mode], parameters.threshold_us)
    logo = (MODES[parameters.logo_mode], parameters.logo_threshold_us)
    if surface[0] == logo[0] == kernels.OFF:
        return FilterResult(events, events)
    rows, logo_rows = kernels.filter_events(state.last, state.width_px, events.columns, *surface, *logo)
    surface_events = events if surface[0] == kernels.OFF else EventBatch(*take_events(rows, events.columns))
    if logo == surface:
        return FilterResult(surface_events, surface_events)
    logo_events = events if logo[0] == kernels.OFF else EventBatch(*take_events(logo_rows, events.columns))
    return FilterResult(surface_events, logo_events)


STAGE = Stage(
    name="filter",
    label="Filter",
    help="Spatio-temporal contrast (STC) and TRAIL filters: fewer redundant events and less noise.",
    scope="recording",
    inputs=("packet",),
    parameters=FilterParameters,
    start=start,
    step=step,
)
