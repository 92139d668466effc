"""Rate: spin magnitude and t_acc from the rhythm of the logo's event rate (section 3.3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..parameters import ParameterGroup, tunable

INPUTS = ("packet", "track", "logo")


@dataclass(frozen=True, kw_only=True)
class RateParameters(ParameterGroup):
    """Histogram, moving average and low-pass."""

    bin_us: int = tunable(500, 50, 20_000, 50, "us", "width of the histogram's bins")
    ema_us: int = tunable(2000, 100, 100_000, 100, "us", "time constant of the exponential moving average")
    low_pass_hz: float = tunable(200.0, 5.0, 2000.0, 5.0, "Hz", "cut-off of the low-pass filter")
    window_us: int = tunable(500_000, 10_000, 5_000_000, 10_000, "us", "how far back in time it looks")


@dataclass(frozen=True, slots=True, eq=False)
class RateResult:
    """The event rate of the present shot so far (the last window of it).

    t_us : (n,) int64, the bins' starts
    rate_hz, ema_hz, smooth_hz : (n,) float64, histogram, its moving average, and that less its mean and low-passed
    crossings_us : (m,) float64, times at which smooth_hz falls through zero
    spin_rps : magnitude from the crossings; None with its reason when there is no rhythm
    spin_std_rps : its 1 sigma; None with spin_rps
    reason : why spin_rps is None
    """

    t_us: NDArray[np.int64]
    rate_hz: NDArray[np.float64]
    ema_hz: NDArray[np.float64]
    smooth_hz: NDArray[np.float64]
    crossings_us: NDArray[np.float64]
    spin_rps: float | None
    spin_std_rps: float | None
    reason: str | None
