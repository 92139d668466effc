"""Surface: the time surface in which the ball is looked for (section 3.1: EROS), and its cleaning."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
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


SurfaceLevels = tuple[NDArray[np.uint8], NDArray[np.uint8]]  # `levels` and `table` of a SurfaceResult


def _plain_table() -> NDArray[np.uint8]:
    return np.arange(256, dtype=np.uint8)


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceResult(ReadOnlyArrays):
    """The surface at the end of the tick.

    Attributes
    ----------
    levels : (height, width) uint8
        Indices into `table`, 0 = nothing; not cleaned.
    cleaning : str
        The rule by which `cleaned` removes isolated pixels.
    table : (n,) uint8
        Rising values of the levels, the first is 0. By default the levels themselves.
    """

    levels: NDArray[np.uint8]
    cleaning: str
    table: NDArray[np.uint8] = field(default_factory=_plain_table)

    @property
    def values(self) -> NDArray[np.uint8]:
        """The surface, (height, width) uint8: 0 = nothing, 255 = an event just now; not cleaned.

        Looked up with each call: the tracker needs the values of few pixels.
        """
        values = self._values_of(self.levels)
        values.flags.writeable = False
        return values

    def level_of(self, value: int) -> int:
        """The lowest level of at least this value."""
        return int(self.table.searchsorted(value))

    def cleaned(self, x0_px: int, y0_px: int, x1_px: int, y1_px: int) -> NDArray[np.uint8]:
        """Values in the window [x0, x1) x [y0, y1), clipped to the image, without its isolated pixels.

        Returns (rows, columns) uint8, empty where the window misses the image. Pixels around the window count
        as neighbours: any window is a cut-out of the whole image cleaned.
        """
        height, width = self.levels.shape
        x0, y0 = min(max(x0_px, 0), width), min(max(y0_px, 0), height)
        x1, y1 = max(min(x1_px, width), x0), max(min(y1_px, height), y0)
        is_printed = CLEANINGS[self.cleaning]
        window = self.levels[y0:y1, x0:x1].copy()
        if window.size and is_printed is not None:
            isolated.copy_cleaned(window, self.levels, x0, y0, is_printed)
        return self._values_of(window)

    def _values_of(self, levels: NDArray[np.uint8]) -> NDArray[np.uint8]:
        values = np.zeros_like(levels)
        eros.render(values, levels, self.table)
        return values


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

    def update(self, packet: Packet, events: EventBatch) -> SurfaceLevels:
        """Draw the tick's events and return the surface at its end."""
        levels, table = self.drawn(events)
        return levels.copy(), table

    def drawn(self, events: EventBatch) -> SurfaceLevels:
        """Draw events and return the surface after the last one, as a view: good until more are drawn."""
        eros.update(self._levels, self._width_px, self._k_px, len(self._table) - 1, events.x_px, events.y_px)
        return eros.image_levels(self._levels, self._width_px, self._height_px), self._table

    def clear(self, drawn: EventBatch) -> None:
        """Forget these events, all that were drawn since the surface was empty."""
        if len(drawn):
            rows, columns = (slice(int(one.min()), int(one.max()) + 1) for one in (drawn.y_px, drawn.x_px))
            eros.image_levels(self._levels, self._width_px, self._height_px)[rows, columns] = 0


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

    def update(self, packet: Packet, events: EventBatch) -> SurfaceLevels:
        """Remember the tick's events and return the surface at its end."""
        values = np.zeros(self._last_us.shape, np.uint8)
        self._last_us[events.y_px, events.x_px] = events.t_us  # of a pixel's events the last one stays
        surfaces.render(values, self._last_us, packet.end_us, self._span_us, self._is_linear)
        return values, _plain_table()


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
    levels, table = state.update(packet, filtered.surface_events)
    return SurfaceResult(levels, parameters.cleaning, table)


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
