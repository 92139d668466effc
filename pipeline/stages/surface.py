"""Surface: the time surface in which the ball is looked for (section 3.1: EROS), and its cleaning."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..camera import Setting
from ..kernels import eros, isolated, surfaces
from ..parameters import ParameterGroup, choice, tunable
from ..results import Packet, frozen
from .filter import FilterResult

INPUTS = ("packet", "filter")


@dataclass(frozen=True, kw_only=True)
class SurfaceParameters(ParameterGroup):
    """Which surface, and how it is cleaned."""

    kind: str = choice("eros", ("eros", "accumulated", "linear"), "EROS, accumulated frame or linear time surface")
    k_px: int = tunable(
        10, 1, eros.K_MAX_PX, 1, "px", "EROS: width of the block that an event fades (forced odd, 10 -> 11)"
    )
    span_us: int = tunable(2000, 100, 100_000, 100, "us", "accumulated, linear: how far back in time it shows")
    cleaning: str = choice("isolated", ("off", "isolated", "printed"), "removal of isolated pixels before the search")


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceResult:
    """The surface at the end of the tick.

    values : (height, width) uint8, 0 = nothing, 255 = an event just now; not cleaned
    cleaning : the rule by which `cleaned` removes isolated pixels
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
        if self.cleaning == "off":
            return self.values[y0:y1, x0:x1].copy()
        window = np.empty((y1 - y0, x1 - x0), np.uint8)
        if window.size:
            isolated.copy_cleaned(window, self.values, x0, y0, self.cleaning == "printed")
        return window


@dataclass(slots=True, eq=False)
class ErosState:
    """The pixels' lives (flat uint8, see the kernel) and what each life reads."""

    lives: NDArray[np.uint8]
    table: NDArray[np.uint8]


@dataclass(slots=True, eq=False)
class LastEventState:
    """The time of each pixel's last event: (height, width) int64, us."""

    last_us: NDArray[np.int64]


@dataclass(slots=True, eq=False)
class SurfaceState:
    """What the surface remembers, and its size."""

    height_px: int
    width_px: int
    memory: ErosState | LastEventState


def start(parameters: SurfaceParameters, setting: Setting) -> SurfaceState:
    """An empty surface."""
    height, width = setting.camera.height_px, setting.camera.width_px
    memory: ErosState | LastEventState
    if parameters.kind == "eros":
        memory = ErosState(eros.no_lives(width, height), eros.values_of_lives(parameters.k_px))
    else:
        memory = LastEventState(np.full((height, width), surfaces.NEVER_US))
    return SurfaceState(height, width, memory)


def step(parameters: SurfaceParameters, state: SurfaceState, packet: Packet, filtered: FilterResult) -> SurfaceResult:
    """Draw the tick's filtered events and read the surface at its end."""
    events, memory = filtered.surface_events, state.memory
    values = np.zeros((state.height_px, state.width_px), np.uint8)
    if isinstance(memory, ErosState):
        full = len(memory.table) - 1
        eros.draw(memory.lives, state.width_px, eros.odd_px(parameters.k_px), full, events.x_px, events.y_px)
        eros.read(values, memory.lives, memory.table)
    else:
        surfaces.remember(memory.last_us, events.t_us, events.x_px, events.y_px)
        surfaces.read(values, memory.last_us, packet.end_us, parameters.span_us, parameters.kind == "linear")
    return SurfaceResult(frozen(values), parameters.cleaning)
