"""Filter: fewer redundant events and less noise (supplement, section 'Filters')."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..events import EventBatch
from ..kernels import filter as kernels
from ..kernels import flicker
from ..kernels.take_events import take_events
from ..parameters import ParameterGroup, choice, tunable
from ..results import Packet
from ..stage import Context, Stage

MODES = {"off": kernels.OFF, "stc": kernels.STC, "trail": kernels.TRAIL, "stc_cut_trail": kernels.STC_CUT_TRAIL}
STC_MODES = "stc", "stc_cut_trail"  # nothing passes of an edge that gives one event a pixel
LAMPS_HZ = {"off": 0, "mains_50hz": 100, "mains_60hz": 120}  # a lamp flickers with twice the mains' frequency


@dataclass(frozen=True, kw_only=True)
class FilterParameters(ParameterGroup):
    """One setting each for the events that draw the surface, that refine the circle and that carry the logo."""

    mode: str = choice("stc_cut_trail", tuple(MODES), "filter of the events that draw the surface")
    threshold_us: int = tunable(5000, 1, 1_000_000, 100, "us", "time window of the surface's filter")
    contour_mode: str = choice("trail", tuple(MODES), "filter of the events to which the ball's outline is fitted")
    contour_threshold_us: int = tunable(5000, 1, 1_000_000, 100, "us", "time window of the outline's filter")
    logo_mode: str = choice("trail", tuple(MODES), "filter of the events that carry the logo")
    logo_threshold_us: int = tunable(5000, 1, 1_000_000, 100, "us", "time window of the logo's filter")
    lamps: str = choice(
        "off",
        tuple(LAMPS_HZ),
        "removal of the flicker of lamps before the other filters; a ball that turns in place at this rate goes too",
    )


Setting = tuple[int, int]  # a mode of the kernel, and its threshold in us


@dataclass(frozen=True, slots=True, eq=False)
class FilterResult:
    """The packet's events after the three filters (surface, outline, logo), and those of the lamps' flicker."""

    surface_events: EventBatch
    contour_events: EventBatch
    logo_events: EventBatch
    flicker_events: EventBatch = field(default_factory=EventBatch.empty)


@dataclass(slots=True, eq=False)
class FilterState:
    """The pixels' pasts, as the kernels keep them.

    Attributes
    ----------
    pairs : list of (Setting, Setting)
        The kernel applies two filters in one go; a third setting has a pass of its own.
    last : list of (height x width,) int64
        Last event of every pixel, one a pair.
    history : (height x width, 3) int64, optional
        Recent events of every pixel, where flicker is removed.
    width_px : int
        Width of the image.
    """

    pairs: list[tuple[Setting, Setting]]
    last: list[NDArray[np.int64]]
    history: NDArray[np.int64] | None
    width_px: int


def start(parameters: FilterParameters, context: Context) -> FilterState:
    """No pixel has seen an event."""
    camera = context.camera
    pixels = camera.width_px * camera.height_px
    different = [setting for setting in dict.fromkeys(_settings(parameters)) if setting[0] != kernels.OFF]
    pairs = [(different[k], different[min(k + 1, len(different) - 1)]) for k in range(0, len(different), 2)]
    last = [np.full(pixels, kernels.NEVER) for _ in pairs]
    history = flicker.empty_history(pixels) if LAMPS_HZ[parameters.lamps] else None
    return FilterState(pairs, last, history, camera.width_px)


def step(parameters: FilterParameters, state: FilterState, packet: Packet) -> FilterResult:
    """The packet through the three filters; see the kernel for what STC and TRAIL pass.

    Filters with the same setting give one and the same batch; a filter that is off gives the packet's own.
    """
    events, removed = _without_flicker(parameters, state, packet.events)
    passed: dict[Setting, EventBatch] = {}
    for pair, last in zip(state.pairs, state.last, strict=True):
        chosen = kernels.filter_events(last, state.width_px, events.columns, *pair[0], *pair[1])
        for setting, rows in dict(zip(pair, chosen, strict=True)).items():
            passed[setting] = EventBatch(*take_events(rows, events.columns))
    surface_events, contour_events, logo_events = (passed.get(setting, events) for setting in _settings(parameters))
    return FilterResult(surface_events, contour_events, logo_events, removed)


def _settings(parameters: FilterParameters) -> tuple[Setting, Setting, Setting]:
    """Settings for the surface, the outline and the logo."""
    return (
        (MODES[parameters.mode], parameters.threshold_us),
        (MODES[parameters.contour_mode], parameters.contour_threshold_us),
        (MODES[parameters.logo_mode], parameters.logo_threshold_us),
    )


def _without_flicker(
    parameters: FilterParameters, state: FilterState, events: EventBatch
) -> tuple[EventBatch, EventBatch]:
    """The events that are no flicker, and those that are."""
    if state.history is None:
        return events, EventBatch.empty()
    found = flicker.recurring(state.history, state.width_px, events.columns, LAMPS_HZ[parameters.lamps])
    kept, removed = (EventBatch(*take_events(np.flatnonzero(rows), events.columns)) for rows in (~found, found))
    return kept, removed


STAGE = Stage(
    name="filter",
    label="Filter",
    help="Spatio-temporal contrast (STC) and TRAIL filters: fewer redundant events and less noise; flicker of lamps.",
    scope="recording",
    inputs=("packet",),
    parameters=FilterParameters,
    start=start,
    step=step,
)
