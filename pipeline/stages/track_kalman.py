"""The tracker's Kalman filter (section 3.1): state [x, y, vx, vy, radius], observation [x, y, radius]."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..kernels import kalman

Floats = NDArray[np.float64]
OBSERVED, observation_noise = kalman.OBSERVED, kalman.observation_noise


class BallFilter:
    """Kalman filter with the paper's F and H, and process noise from what moves a ball.

    Parameters
    ----------
    acceleration_px_s2 : float
        1 sigma of the ball's acceleration, constant over one step.
    growth_px_s : float
        1 sigma of the rate at which the radius changes, constant over one step.
    mean, covariance : (5,)
        And (5, 5) float64, never written into.
    """

    def __init__(self, mean: Floats, covariance: Floats, acceleration_px_s2: float, growth_px_s: float) -> None:
        self.mean: Floats = np.array(mean, np.float64)
        self.covariance: Floats = np.array(covariance, np.float64)
        self._acceleration_px_s2 = acceleration_px_s2
        self._growth_px_s = growth_px_s

    def predict(self, dt_s: float) -> None:
        """Advance by dt_s."""
        self.mean, self.covariance = kalman.predict(
            self.mean, self.covariance, dt_s, self._acceleration_px_s2, self._growth_px_s
        )

    def update(self, observed: Floats, noise: Floats, most_surprise: float) -> bool:
        """Take in an observation (3,) [x, y, radius] with covariance noise (3, 3), unless it is no match.

        Returns False, and leaves the state as predicted, when its squared Mahalanobis distance from the
        prediction exceeds most_surprise.
        """
        matches, self.mean, self.covariance = kalman.update(self.mean, self.covariance, observed, noise, most_surprise)
        return matches
