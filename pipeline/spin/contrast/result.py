"""Result of the contrast method: the estimate, its rivals, and the likelihood of any other spin."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...kernels.arrays import Floats
from ...results import ReadOnlyArrays, SpinEstimate
from .estimate import LOG_ODDS_PER_SIGMA, ScoreMap

# No spin is less likely than this against the best one: of 190 answers on simulated flights and spinners none was
# grossly wrong, so that up to 3 in 190 may be (rule of three, 95 %).
UNEXPLAINED = math.log(3.0 / 190.0)


@dataclass(frozen=True, slots=True, eq=False)
class ContrastResult(ReadOnlyArrays):
    """The estimate from the present shot so far, and what it rests on.

    Attributes
    ----------
    best_rps, covariance_rps2 : (3,) and (3, 3) float64
        The best spin and its covariance, also of a refused answer; NaN without one.
    rivals_rps, rival_covariances_rps2 : (k, 3) and (k, 3, 3) float64
        Other tops of the score, and their covariances.
    rival_sigmas : (k,) float64
        By how many standard deviations the best one beats each.
    start_us, end_us : int
        Stretch of the events used (event time); 0, 0 without events.
    reference_us : float
        The event time to which the events are turned back.
    offsets_px : (3,) float64
        Centre x, y and radius of the ball, refined less tracked.
    contrast : float
        Score an event less that of permuted times; 0 = nothing turns with the spin.
    turns_seen : bool
        Whether the contrast is enough to tell a pattern that turns from chance; without it no spin is likelier.
    changes : bool
        Whether the spin changes within the flight: a contact was missed, and no estimate from all of it holds.
    full : bool
        Whether this tick made a full estimate, or followed the last one.
    magnitudes_rps, magnitude_scores : (m,) float64
        The score an event along the best axis, at the last full estimate.
    directions, direction_scores : (d, 3) and (d,) float64
        The same over all axes at the best magnitude.
    """

    estimate: SpinEstimate
    best_rps: Floats
    covariance_rps2: Floats
    rivals_rps: Floats
    rival_covariances_rps2: Floats
    rival_sigmas: Floats
    start_us: int
    end_us: int
    reference_us: float
    offsets_px: Floats
    contrast: float
    turns_seen: bool
    changes: bool
    full: bool
    magnitudes_rps: Floats
    magnitude_scores: Floats
    directions: Floats
    direction_scores: Floats

    @classmethod
    def nothing(cls, estimate: SpinEstimate) -> ContrastResult:
        """Nothing to see of a shot."""
        return cls(
            estimate=estimate,
            best_rps=np.full(3, np.nan),
            covariance_rps2=np.full((3, 3), np.nan),
            rivals_rps=np.empty((0, 3)),
            rival_covariances_rps2=np.empty((0, 3, 3)),
            rival_sigmas=np.empty(0),
            start_us=0,
            end_us=0,
            reference_us=math.nan,
            offsets_px=np.zeros(3),
            contrast=0.0,
            turns_seen=False,
            changes=False,
            full=False,
            **ScoreMap.empty()._asdict(),
        )

    def log_likelihood(self, spins_rps: Floats) -> Floats:
        """Log likelihood of spins, less that of the best one.

        Parameters
        ----------
        spins_rps : (m, 3) float64
            Camera frame.

        Returns
        -------
        (m,) float64
            Zero throughout where no pattern is seen to turn; nowhere below that of an answer grossly wrong.

        Notes
        -----
        Each candidate counts with its height, LOG_ODDS_PER_SIGMA for each sigma by which the best one beats it, and
        falls off around it as its covariance says; the largest of them holds. A pattern that stands still is a
        candidate as any other: the score is zero there (it compares with permuted times), and so the best spin's lead
        over it is `contrast` times the number of events.
        """
        spins_rps = np.asarray(spins_rps, np.float64).reshape(-1, 3)
        if not self.turns_seen:
            return np.zeros(len(spins_rps))
        heights = -LOG_ODDS_PER_SIGMA * np.concatenate([[0.0], self.rival_sigmas])
        means = np.concatenate([self.best_rps[None], self.rivals_rps])
        precisions = np.linalg.inv(np.concatenate([self.covariance_rps2[None], self.rival_covariances_rps2]))
        off = spins_rps[:, None] - means
        values = heights - 0.5 * np.einsum("mki,kij,mkj->mk", off, precisions, off)
        likeliest: Floats = np.maximum(values.max(axis=1), UNEXPLAINED)
        return likeliest
