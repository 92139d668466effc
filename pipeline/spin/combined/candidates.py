"""Candidates of the combined answer: spins that explain the logo's pattern, or that its rhythm and the flight leave."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...kernels.arrays import Floats
from ...stages.rate import RateResult
from ..contrast.estimate import LOG_ODDS_PER_SIGMA
from ..contrast.result import ContrastResult
from ..trajectory.stage import TrajectoryResult
from .likelihoods import rhythms_of

# Beyond this spread (1 sigma) the flight names no axis; axes are drawn so many times as widely as it states.
WIDEST_RAD, WIDER = math.radians(30.0), 1.5
# Without a pattern nothing tells how many marks the ball has: a seam, or stamps on both sides, come back twice a turn.
# Few balls show these alone.
TWO_SIDED = 0.05
# People's shots: median 46 rps, 95 % below 120 (4,024 real shots). Counts where only rhythm and flight speak.
HUMAN_RPS, HUMAN_SPREAD = 46.0, math.log(120.0 / 46.0) / 1.645
# Standard normal deviates by which every candidate's spread is sampled.
SAMPLES: Floats = np.random.default_rng(0).standard_normal((256, 3))


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A spin as samples of its spread, and its logarithmic likelihood by the witness that named it.

    `log_weights` (n,) make up for samples that were not drawn from that witness's likelihood.
    """

    spins_rps: Floats
    log_weights: Floats
    log_likelihood: float


def by_pattern(contrast: ContrastResult) -> list[Candidate]:
    """The spins that explain the logo's pattern: the best one and its rivals."""
    spins_rps = np.concatenate([contrast.best_rps[None], contrast.rivals_rps])
    covariances = np.concatenate([contrast.covariance_rps2[None], contrast.rival_covariances_rps2])
    logs = -LOG_ODDS_PER_SIGMA * np.append(0.0, contrast.rival_sigmas)
    nothing = np.zeros(len(SAMPLES))
    return [
        Candidate(_spread(spin, covariance), nothing, float(log))
        for spin, covariance, log in zip(spins_rps, covariances, logs, strict=True)
    ]


def _spread(spin_rps: Floats, covariance_rps2: Floats) -> Floats:
    """Samples (n, 3) of a spin with its covariance; across the axis they turn it, without a change of magnitude."""
    values, vectors = np.linalg.eigh(covariance_rps2)
    samples = spin_rps + SAMPLES @ (vectors * np.sqrt(np.maximum(values, 0.0))).T
    magnitudes = samples @ spin_rps / max(float(np.linalg.norm(spin_rps)), 1e-9)
    spread: Floats = samples * (magnitudes / np.linalg.norm(samples, axis=1))[:, None]
    return spread


def by_rhythm(rate: RateResult, trajectory: TrajectoryResult, gyro_std_deg: float) -> list[Candidate]:
    """The rhythm's magnitudes about the axis that the flight tells; none where either says nothing."""
    across = trajectory.across
    if across is None or across.axis_std_rad > WIDEST_RAD:
        return []
    side, gyro = np.cross(across.along, across.axis), math.tan(math.radians(gyro_std_deg))
    # Drawn wider than the flight's own likelihood, which then weighs them.
    directions = (
        across.axis
        + WIDER * across.axis_std_rad * SAMPLES[:, 1, None] * side
        + gyro * SAMPLES[:, 2, None] * across.along
    )
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    log_weights = 0.5 * SAMPLES[:, 1] ** 2
    return [
        Candidate(
            ((magnitude + std * SAMPLES[:, 0]) / marks)[:, None] * directions,
            log_weights,
            log + math.log(share) + _log_prior(magnitude / marks),
        )
        for magnitude, std, log in rhythms_of(rate)
        for marks, share in ((1, 1.0 - TWO_SIDED), (2, TWO_SIDED))
    ]


def _log_prior(magnitude_rps: float) -> float:
    """Logarithmic density of a magnitude among people's shots, per logarithm of the magnitude, less the highest."""
    return -0.5 * (math.log(magnitude_rps / HUMAN_RPS) / HUMAN_SPREAD) ** 2
