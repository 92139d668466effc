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
    """One setting each for the events that draw the surface, that refine the circle and that carry the logo."""

    mode: str = choice("stc_cut_trail", tuple(MODES), "filter of the events that draw the surface")
    threshold_us: int = tunable(5000, 1, 1_000_000, 100, "us", "time window of the surface's filter")
    contour_mode: str = choice("trail", tuple(MODES), "filter of the events to which the ball's outline is fitted")
    contour_threshold_us: int = tunable(5000, 1, 1_000_000, 100, "us", "time window of the outline's filter")
    logo_mode: str = choice("trail", tuple(MODES), "filter of the events that carry the logo")
    logo_threshold_us: int = tunable(5000, 1, 1_000_000, 100, "us", "time window of the logo's filter")


Setting = tuple[int, int]  # a mode of the kernel, and its threshold in us


@dataclass(frozen=True, slots=True, eq=False)
class FilterResult:
    """The packet's events after the three filters: for the surface, the outline and the logo."""

    surface_events: EventBatch
    contour_events: EventBatch
    logo_events: EventBatch


@dataclass(slots=True, eq=False)
class FilterState:
    """The last event of every pixel, once for every two different settings.

    Attributes
    ----------
    pairs : list of (Setting, Setting)
        The kernel applies two filters in one go; a third setting has a pass of its own.
    last : list of (height x width,) int64
        As the kernel packs it, one a pair.
    width_px : int
        Width of the image.
    """

    pairs: list[tuple[Setting, Setting]]
    last: list[NDArray[np.int64]]
    width_px: int


def start(parameters: FilterParameters, context: Context) -> FilterState:
    """No pixel has seen an event."""
    camera = context.camera
    different = [setting for setting in dict.fromkeys(_settings(parameters)) if setting[0] != kernels.OFF]
    pairs = [(different[k], different[min(k + 1, len(different) - 1)]) for k in range(0, len(different), 2)]
    last = [np.full(camera.width_px * camera.height_px, kernels.NEVER) for _ in pairs]
    return FilterState(pairs, last, camera.width_px)


def step(parameters: FilterParameters, state: FilterState, packet: Packet) -> FilterResult:
    """The packet through the three filters; see the kernel for what STC and TRAIL pass.

    Filters with the same setting give one and the same batch; a filter that is off gives the packet's own.
    """
    events = packet.events
    passed: dict[Setting, EventBatch] = {}
    for pair, last in zip(state.pairs, state.last, strict=True):
        chosen = kernels.filter_events(last, state.width_px, events.columns, *pair[0], *pair[1])
        for setting, rows in dict(zip(pair, chosen, strict=True)).items():
            passed[setting] = EventBatch(*take_events(rows, events.columns))
    return FilterResult(*(passed.get(setting, events) for setting in _settings(parameters)))


def _settings(parameters: FilterParameters) -> tuple[Setting, Setting, Setting]:
    """Settings for the surface, the outline and the logo."""
    return (
        (MODES[parameters.mode], parameters.threshold_us),
        (MODES[parameters.contour_mode], parameters.contour_threshold_us),
        (MODES[parameters.logo_mode], parameters.logo_threshold_us),
    )


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
