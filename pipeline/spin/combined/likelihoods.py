"""Likelihoods of spins by the witnesses beside the logo's pattern: normal flow, rhythm, flight and sightings."""

from __future__ import annotations

import math

import numpy as np

from ...kernels.arrays import Floats
from ...results import SpinEstimate
from ...stages.rate import RateResult
from ..trajectory.stage import TrajectoryResult
from .sightings import Sightings

# Probability that a witness is wrong altogether: normal flow that saw the outline, a period of something else than the
# logo's visits, a flight of another ball or other air, sightings of a seam or of dirt.
BLUNDER = {"normal_flow": 0.2, "rate": 0.1, "trajectory": 0.03, "logo": 0.1}
# The line of sight's own turn while the ball passes (0.7 rps at 9 m/s and 2 m), and the share to which the visits'
# rhythm follows the spin: both are in the difference between the rhythm and the spin.
SIGHT_RPS, RHYTHM_SHARE = 0.7, 0.01


def rhythms_of(rate: RateResult) -> list[tuple[float, float, float]]:
    """Magnitudes by which the logo's pattern comes back, rps: each with its 1 sigma and logarithmic likelihood."""
    if rate.period_reason is not None:
        return []
    share = rate.period_std_rps / rate.period_spins_rps[0]
    return [
        (magnitude, math.hypot(share * magnitude, RHYTHM_SHARE * magnitude, SIGHT_RPS), log)
        for magnitude, log in zip(rate.period_spins_rps, rate.period_log_likelihoods, strict=True)
    ]


def by_rate(rate: RateResult, spins_rps: Floats) -> Floats:
    """(candidates, samples) logarithmic likelihood of the logo's rhythm; zeros where there is none."""
    rhythms = rhythms_of(rate)
    if not rhythms:
        return np.zeros(spins_rps.shape[:2])
    magnitudes = np.linalg.norm(spins_rps, axis=2)
    parts = [log - 0.5 * ((magnitudes - magnitude) / std) ** 2 for magnitude, std, log in rhythms]
    return fallible(np.logaddexp.reduce(parts), BLUNDER["rate"])


def by_flow(estimate: SpinEstimate, spins_rps: Floats) -> Floats:
    """(candidates, samples) logarithmic likelihood of the normal flow; zeros where it refused."""
    if estimate.vector_rps is None or estimate.covariance_rps2 is None:
        return np.zeros(spins_rps.shape[:2])
    off = spins_rps - estimate.vector_rps
    squares = np.einsum("ksi,ij,ksj->ks", off, np.linalg.inv(estimate.covariance_rps2), off)
    return fallible(-0.5 * squares, BLUNDER["normal_flow"])


def by_flight(trajectory: TrajectoryResult, spins_rps: Floats) -> Floats:
    """(candidates, samples) logarithmic likelihood of the flight's bend, less that of the likeliest spin; or zeros."""
    across = trajectory.across
    if across is None:
        return np.zeros(spins_rps.shape[:2])
    logs = trajectory.log_likelihood(spins_rps.reshape(-1, 3)).reshape(spins_rps.shape[:2])
    highest = float(trajectory.log_likelihood(across.magnitude_rps * across.axis)[0])
    relative: Floats = logs - max(highest, float(logs.max()))
    return relative


def by_sightings(sightings: Sightings, spins_rps: Floats) -> Floats:
    """(candidates, samples) logarithmic likelihood of when the logo was seen and when not."""
    logs = sightings.log_likelihood(spins_rps.reshape(-1, 3)).reshape(spins_rps.shape[:2])
    return fallible(logs - logs.max(), BLUNDER["logo"])


def fallible(logs: Floats, blunder: float) -> Floats:
    """Logarithmic likelihoods, 0 at most, of a witness that is wrong altogether with this probability."""
    mixed: Floats = np.logaddexp(math.log(1.0 - blunder) + logs, math.log(blunder))
    return mixed


def log_mean(logs: Floats) -> Floats:
    """Logarithm of the mean over samples (candidates,)."""
    mean: Floats = np.logaddexp.reduce(logs, axis=1) - math.log(logs.shape[1])
    return mean
