"""Logo: the events inside the moving ball (section 3.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..events import EventBatch
from ..parameters import ParameterGroup, tunable

INPUTS = ("packet", "filter", "track")


@dataclass(frozen=True, kw_only=True)
class LogoParameters(ParameterGroup):
    """How far from the outline an event must be to count as the logo's."""

    pad_px: float = tunable(2.5, 0.0, 100.0, 0.1, "px", "distance kept from the outline (pad of the paper)")


@dataclass(frozen=True, slots=True, eq=False)
class LogoResult:
    """The logo events of the tick, each with the ball at its own time.

    events : the n events inside the circle less pad
    centre_x_px, centre_y_px : (n,) float64, the ball's centre when the event happened
    radius_px : radius of the ball in this tick; NaN without a ball
    normals : (n, 3) float64, outward unit normals e_r of the ball's surface where the events' camera rays meet it
        (camera frame; the visible side has e_r . c < 0)
    position_std_px : 1 sigma of the centre across one axis, NaN without a ball
    """

    events: EventBatch
    centre_x_px: NDArray[np.float64]
    centre_y_px: NDArray[np.float64]
    radius_px: float
    normals: NDArray[np.float64]
    position_std_px: float
