"""Filter: fewer redundant events and less noise (supplement, section 'Filters')."""

from __future__ import annotations

from dataclasses import dataclass

from ..events import EventBatch
from ..parameters import ParameterGroup, choice, tunable

INPUTS = ("packet",)
MODES = ("off", "stc", "trail", "stc_cut_trail")


@dataclass(frozen=True, kw_only=True)
class FilterParameters(ParameterGroup):
    """One setting for the events that draw the surface and one for those that carry the logo."""

    mode: str = choice("stc_cut_trail", MODES, "filter of the events that draw the surface")
    threshold_us: int = tunable(5000, 1, 1_000_000, 100, "us", "time window of the surface's filter")
    logo_mode: str = choice("trail", MODES, "filter of the events that carry the logo and refine the circle")
    logo_threshold_us: int = tunable(5000, 1, 1_000_000, 100, "us", "time window of the logo's filter")


@dataclass(frozen=True, slots=True, eq=False)
class FilterResult:
    """The packet's events after the two filters."""

    surface_events: EventBatch
    logo_events: EventBatch
