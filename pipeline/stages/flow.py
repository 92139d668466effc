"""Flow: the logo's optical flow in the ball's frame by Triplet Matching (section 3.3; Shiba 2022)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..parameters import ParameterGroup, choice, tunable

INPUTS = ("packet", "track", "logo", "rate")


@dataclass(frozen=True, kw_only=True)
class FlowParameters(ParameterGroup):
    """How long a slice is, and what the matching accepts."""

    t_acc_from: str = choice(
        "rate", ("expected", "rate", "fixed"), "where t_acc = 1/(10 spin) takes the spin from"
    )
    t_acc_us: int = tunable(2000, 100, 100_000, 100, "us", "length of a slice when t_acc_from = fixed")
    expected_spin_rps: float = tunable(50.0, 1.0, 500.0, 1.0, "rps", "median of the spins expected")


@dataclass(frozen=True, slots=True, eq=False)
class FlowResult:
    """The flow of the slices that ended in this tick, one row an event that has flow.

    t_acc_us : length of the slices; None without logo events
    t_us : (n,) int64; x_px, y_px : (n,) float64, the event relative to the ball's centre at its own time
    normals : (n, 3) float64, e_r of the event
    vx_px_s, vy_px_s : (n,) float64, Triplet Matching's flow in the ball's frame
    slice_index : (n,) int64, which slice (from the shot's start)
    normal_t_us, normal_normals, normal_direction, normal_speed_px_s : the same for the normal flow of local planes:
        (m,) int64, (m, 3) float64, (m, 2) float64 unit vectors, (m,) float64
    """

    t_acc_us: int | None
    t_us: NDArray[np.int64]
    x_px: NDArray[np.float64]
    y_px: NDArray[np.float64]
    normals: NDArray[np.float64]
    vx_px_s: NDArray[np.float64]
    vy_px_s: NDArray[np.float64]
    slice_index: NDArray[np.int64]
    normal_t_us: NDArray[np.int64]
    normal_normals: NDArray[np.float64]
    normal_direction: NDArray[np.float64]
    normal_speed_px_s: NDArray[np.float64]
