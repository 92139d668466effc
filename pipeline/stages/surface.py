"""Surface: the time surface in which the ball is looked for (section 3.1: EROS) and its cleaning (supplement)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..parameters import ParameterGroup, choice, tunable

INPUTS = ("packet", "filter")


@dataclass(frozen=True, kw_only=True)
class SurfaceParameters(ParameterGroup):
    """Which surface, and how it is cleaned."""

    kind: str = choice(
        "eros", ("eros", "accumulated", "linear"), "EROS, accumulated frame or linear time surface"
    )
    k_px: int = tunable(
        10, 1, 51, 1, "px", "EROS: width of the block that an event fades (forced odd, 10 -> 11)"
    )
    span_us: int = tunable(
        2000, 100, 100_000, 100, "us", "accumulated, linear: how far back in time it shows"
    )
    cleaning: str = choice(
        "isolated", ("off", "isolated", "printed"), "removal of isolated pixels before the search"
    )


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceResult:
    """The surface at the end of the tick.

    values : (height, width) uint8, 0 = nothing, 255 = an event just now; not cleaned
    cleaning : the rule by which `cleaned` removes isolated pixels
    """

    values: NDArray[np.uint8]
    cleaning: str

    def cleaned(self, x0_px: int, y0_px: int, x1_px: int, y1_px: int) -> NDArray[np.uint8]:
        """Copy of the window [x0, x1) x [y0, y1) (clipped to the image) without its isolated pixels."""
        raise NotImplementedError
