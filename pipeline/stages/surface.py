"""Surface: the time surface in which the ball is looked for (section 3.1: EROS), and its cleaning."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..events import EventBatch
from ..kernels import eros, isolated, surfaces
from ..parameters import ParameterGroup, choice, tunable
from ..results import Packet, ReadOnlyArrays
from ..stage import Context, Stage
from .filter import FilterResult

KINDS = ("eros", "tos", "accumulated", "linear")
# The rules of removal, and whether each is the printed kernel.
CLEANINGS = {"off": None, "isolated": False, "printed": True}


@dataclass(frozen=True, kw_only=True)
class SurfaceParameters(ParameterGroup):
    """Kind of surface, and its cleaning."""

    kind: str = choice("eros", KINDS, "EROS, threshold-ordinal surface (TOS), accumulated frame or linear time surface")
    k_px: int = tunable(
        10, 1, eros.K_MAX_PX, 1, "px", "EROS, TOS: width of the block that an event fades (forced odd, 10 -> 11)"
    )
    span_us: int = tunable(2000, 100, 100_000, 100, "us", "accumulated, linear: how far back in time it shows")
    cleaning: str = choice("isolated", tuple(CLEANINGS), "removal of isolated pixels before the search")


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceResult(ReadOnlyArrays):
    """The surface at the end of the tick.

    Attributes
    ----------
    values : (height, width) uint8
        0 = nothing, 255 = an event just now; not cleaned.
    cleaning : str
        The rule by which `cleaned` removes isolated pixels.
    """

    values: NDArray[np.uint8]
    cleaning: str

    def cleaned(self, x0_px: int, y0_px: int, x1_px: int, y1_px: int) -> NDArray[np.uint8]:
        """Copy of the window [x0, x1) x [y0, y1), clipped to the image, without its isolated pixels.

        Returns (rows, columns) uint8, empty where the window misses the image. Pixels around the window count
        as neighbours: any window is a cut-out of the whole image cleaned.
        """
        height, width = self.values.shape
        x0, y0 = min(max(x0_px, 0), width), min(max(y0_px, 0), height)
        x1, y1 = max(min(x1_px, width), x0), max(min(y1_px, height), y0)
        is_printed = CLEANINGS[self.cleaning]
        if is_printed is None:
            return self.values[y0:y1, x0:x1].copy()
        window = np.empty((y1 - y0, x1 - x0), np.uint8)
        if window.size:
            isolated.copy_cleaned(window, self.values, x0, y0, is_printed)
        return window


class OrdinalSurface:
    """EROS or TOS: an event sets its pixel to 255 and fades the block around it (section 3.1; see kernels.eros).

    Parameters
    ----------
    table : callable
        Values of the levels for a width of the block, px.
    """

    def __init__(
        self,
        parameters: SurfaceParameters,
        width_px: int,
        height_px: int,
        *,
        table: Callable[[int], NDArray[np.uint8]],
    ) -> None:
        self._width_px, self._height_px = width_px, height_px
        self._k_px = eros.odd_px(parameters.k_px)
        self._levels = eros.empty_levels(width_px, height_px)  # flat uint8, see the kernel
        self._table = table(parameters.k_px)

    def update(self, packet: Packet, events: EventBatch) -> NDArray[np.uint8]:
        """Draw the tick's events and return the (height, width) uint8 surface at its end."""
        return self.drawn(events)

    def drawn(self, events: EventBatch) -> NDArray[np.uint8]:
        """Draw events and return the (height, width) uint8 surface after the last one."""
        values = np.zeros((self._height_px, self._width_px), np.uint8)
        eros.update(self._levels, self._width_px, self._k_px, len(self._table) - 1, events.x_px, events.y_px)
        eros.render(values, self._levels, self._table)
        return values


class LastEventSurface:
    """Surface read from the time of each pixel's last event: accumulated frame, or linear time surface.

    Parameters
    ----------
    is_linear : bool
        Whether pixels fade linearly with the age of their last event, or are 255 for the whole span.
    """

    def __init__(self, parameters: SurfaceParameters, width_px: int, height_px: int, *, is_linear: bool) -> None:
        self._span_us, self._is_linear = parameters.span_us, is_linear
        self._last_us = np.full((height_px, width_px), surfaces.NEVER_US)

    def update(self, packet: Packet, events: EventBatch) -> NDArray[np.uint8]:
        """Remember the tick's events and return the (height, width) uint8 surface at its end."""
        values = np.zeros(self._last_us.shape, np.uint8)
        self._last_us[events.y_px, events.x_px] = events.t_us  # of a pixel's events the last one stays
        surfaces.render(values, self._last_us, packet.end_us, self._span_us, self._is_linear)
        return values


Surface = OrdinalSurface | LastEventSurface
# The choices of surface.kind, each with what draws it.
_SURFACES: dict[str, Callable[[SurfaceParameters, int, int], Surface]] = {
    "eros": partial(OrdinalSurface, table=eros.value_table),
    "tos": partial(OrdinalSurface, table=eros.threshold_table),
    "accumulated": partial(LastEventSurface, is_linear=False),
    "linear": partial(LastEventSurface, is_linear=True),
}


def start(parameters: SurfaceParameters, context: Context) -> Surface:
    """An empty surface."""
    return _SURFACES[parameters.kind](parameters, context.camera.width_px, context.camera.height_px)


def step(parameters: SurfaceParameters, state: Surface, packet: Packet, filtered: FilterResult) -> SurfaceResult:
    """Draw the tick's filtered events and read the surface at its end."""
    return SurfaceResult(state.update(packet, filtered.surface_events), parameters.cleaning)


STAGE = Stage(
    name="surface",
    label="Surface (EROS)",
    help="Exponential reduced ordinal surface of the filtered events, in which the ball is looked for.",
    scope="recording",
    inputs=("packet", "filter"),
    parameters=SurfaceParameters,
    start=start,
    step=step,
)
