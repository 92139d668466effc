"""The paper's spin with its magnitude from the rate of a periodic phenomenon (EEPPR) in place of zero crossings.

Events are counted in space, polarity and time; a template, the first stretch of them, is correlated with all of them
along time, and the median distance of the response's peaks is the period. The axis is Triplet Matching's mean.

Deviates: the only window is the ball as the tracker follows it, in its own frame, where the publication has a grid of
windows that stay in place; there the median of the windows' rates is the answer. The template begins with the shot's
first events and holds a quarter of the shot at most.

References
----------
J. Kolar, R. Spetlik, J. Matas, "EEPPR: Event-based estimation of periodic phenomena rate using correlation in 3D", ICMV
2024, arXiv 2408.06899.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...results import Packet, SpinEstimate
from ...stage import Context
from ...stages.flow import FlowResult
from ...stages.logo import LogoResult
from ...stages.rate import RateResult
from ..parameters import SpinParameters
from ..triplet import TripletSpin
from .rival import rival

Floats = NDArray[np.float64]

# Cells across the ball, of 3 px of the paper's; bins as wide as the stage `rate` has them.
CELLS, BIN_US = 12, 500
FEWEST_EVENTS = 100  # as of the stage `rate`
TEMPLATE_SHARE = 0.25
# A peak stands out by this share of the response's range.
PROMINENCE = 0.3


class CorrelatedRateSpin:
    """Spin of one shot: axis from flow, magnitude from the correlation of the logo's events in space and time."""

    def __init__(self, name: str, parameters: SpinParameters, context: Context) -> None:
        self.parameters = parameters
        self.spin = TripletSpin(parameters, context, name)
        self.t_us = np.empty(0, np.int64)
        self.cells = np.empty(0, np.int64)

    def estimate(self, packet: Packet, logo: LogoResult, flow: FlowResult, rate: RateResult) -> SpinEstimate:
        """The estimate at the end of a tick; no uncertainty is stated."""
        columns, rows = (
            np.clip(((place / logo.radius_px + 1.0) * 0.5 * CELLS).astype(np.int64), 0, CELLS - 1)
            for place in (logo.x_px, logo.y_px)
        )
        self.t_us = np.concatenate([self.t_us, logo.events.t_us])
        self.cells = np.concatenate([self.cells, (logo.events.on * CELLS + rows) * CELLS + columns])
        keep = self.t_us >= packet.end_us - self.parameters.window_us
        self.t_us, self.cells = self.t_us[keep], self.cells[keep]
        spin_rps = self._rate_rps()
        if spin_rps is None:
            # The flow is taken in all the same.
            self.spin.estimate(packet.end_us, flow, rate)
            return SpinEstimate.refused(self.spin.name, "the logo's events do not come back", self.t_us.size)
        found = replace(rate, spin_rps=spin_rps, spin_std_rps=0.0)
        return replace(self.spin.estimate(packet.end_us, flow, found), covariance_rps2=None)

    def _rate_rps(self) -> float | None:
        """Rotations a second by which the events come back; None where they do not."""
        if self.t_us.size < FEWEST_EVENTS:
            return None
        from scipy.signal import find_peaks  # only needed here; a quarter of a second to load

        bins = (self.t_us - self.t_us[0]) // BIN_US
        counts = np.zeros((int(bins[-1]) + 1, 2 * CELLS * CELLS))
        np.add.at(counts, (bins, self.cells), 1.0)
        response = template_response(counts, max(int(TEMPLATE_SHARE * len(counts)), 1))
        shortest = max(1, math.floor(1e6 / (self.parameters.max_spin_rps * BIN_US)))
        peaks, _ = find_peaks(response, distance=shortest, prominence=PROMINENCE * float(np.ptp(response)))
        if not peaks.size:
            return None
        # The template's own place is the first peak.
        return 1e6 / (float(np.median(np.diff(peaks, prepend=0))) * BIN_US)


def template_response(counts: Floats, depth: int) -> Floats:
    """Correlation (n - depth + 1,) of the first `depth` rows of counts (n, c) with all rows, lag by lag, of means 0."""
    varying = counts - counts.mean(axis=0)
    template = varying[:depth]
    lags = np.arange(len(counts) - depth + 1)
    return np.array([float(np.sum(template * varying[lag : lag + depth])) for lag in lags])


EEPPR = rival(
    "eeppr",
    "EEPPR",
    "the paper's axis with the magnitude from correlating events in space and time (arXiv 2408.06899).",
    (255, 213, 79),
    inputs=("packet", "logo", "flow", "rate"),
    state=CorrelatedRateSpin,
)
