"""Candidates of the combined answer: spins that explain the logo's pattern, or that its rhythm and the flight leave."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...kernels.arrays import Floats
from ...stages.rate import RateResult
from ..contrast import ContrastResult
from ..contrast.events import LOG_ODDS_PER_SIGMA
from ..trajectory.stage import TrajectoryResult
from .likelihoods import rhythms_of

# Beyond this spread (1 sigma) the flight names no axis; what it tells is drawn so many times as widely as it states.
WIDEST_RAD, WIDER = math.radians(30.0), 1.5
# Without a pattern nothing tells how many marks the ball has: a seam, or stamps on both sides, come back twice a turn.
# Few balls show these alone.
TWO_SIDED = 0.05
# People's shots: median 46 rps, 95 % below 120 (4,024 real shots). Counts where the rhythm leaves two.
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


def pattern_candidates(contrast: ContrastResult) -> list[Candidate]:
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


def rhythm_candidates(rate: RateResult, trajectory: TrajectoryResult, gyro_std_deg: float) -> list[Candidate]:
    """The rhythm's magnitudes about the axis that the flight tells; none where either says nothing."""
    rhythms = rhythms_of(rate)
    if not rhythms or not _tells_axis(trajectory):
        return []
    directions, log_weights = _directions(trajectory, gyro_std_deg)
    return [
        Candidate(
            ((magnitude + std * SAMPLES[:, 0]) / marks)[:, None] * directions,
            log_weights,
            log + math.log(share) + _log_prior(magnitude / marks),
        )
        for magnitude, std, log in rhythms
        for marks, share in ((1, 1.0 - TWO_SIDED), (2, TWO_SIDED))
    ]


def flight_candidates(trajectory: TrajectoryResult, gyro_std_deg: float, max_spin_rps: float) -> list[Candidate]:
    """The spin that the flight tells, with any order of magnitude up to `max_spin_rps`; none where it tells no axis."""
    across = trajectory.across
    if across is None or not _tells_axis(trajectory):
        return []
    directions, log_weights = _directions(trajectory, gyro_std_deg)
    share = WIDER * across.magnitude_std_rps / across.magnitude_rps
    magnitudes = across.magnitude_rps * np.exp(share * SAMPLES[:, 0])
    log_weights = log_weights + 0.5 * SAMPLES[:, 0] ** 2
    log_weights[magnitudes > max_spin_rps] = -np.inf
    return [Candidate(magnitudes[:, None] * directions, log_weights, 0.0)]


def _tells_axis(trajectory: TrajectoryResult) -> bool:
    return trajectory.across is not None and trajectory.across.axis_std_rad <= WIDEST_RAD


def _directions(trajectory: TrajectoryResult, gyro_std_deg: float) -> tuple[Floats, Floats]:
    """Axes (n, 3) about that of the flight, drawn wider than its own likelihood, which then weighs them.

    Their logarithmic weights (n,) make up for the drawing.
    """
    across = trajectory.across
    assert across is not None
    side, gyro = np.cross(across.along, across.axis), math.tan(math.radians(gyro_std_deg))
    directions = (
        across.axis
        + WIDER * across.axis_std_rad * SAMPLES[:, 1, None] * side
        + gyro * SAMPLES[:, 2, None] * across.along
    )
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    return directions, 0.5 * SAMPLES[:, 1] ** 2


def _log_prior(magnitude_rps: float) -> float:
    """Logarithmic density of a magnitude among people's shots, per logarithm of the magnitude, less the highest."""
    return -0.5 * (math.log(magnitude_rps / HUMAN_RPS) / HUMAN_SPREAD) ** 2
