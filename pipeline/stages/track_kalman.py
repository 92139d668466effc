"""The tracker's Kalman filter (section 3.1): state [x, y, vx, vy, radius], observation [x, y, radius]."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..kernels.moving_circle import inverse_matrix

Floats = NDArray[np.float64]
OBSERVED = np.array([0, 1, 4])
OBSERVED_BLOCK = np.ix_(OBSERVED, OBSERVED)
OBSERVATION = np.eye(5)[OBSERVED]


def load_filter() -> Any:
    """filterpy's Kalman equations; the first call loads scipy.stats with them, which takes two seconds."""
    from filterpy import kalman

    return kalman


class BallFilter:
    """filterpy's Kalman equations with the paper's F and H, and process noise from what moves a ball.

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
        self._dt_s = 0.0
        self._transition, self._push_covariance = np.eye(5), np.zeros((5, 5))

    def predict(self, dt_s: float) -> None:
        """Advance by dt_s."""
        if dt_s != self._dt_s:
            self._set_step(dt_s)
        self.mean, self.covariance = load_filter().predict(
            self.mean, self.covariance, self._transition, self._push_covariance
        )

    def _set_step(self, dt_s: float) -> None:
        transition = np.eye(5)
        transition[0, 2] = transition[1, 3] = dt_s
        push = np.zeros((5, 3))
        push[0, 0] = push[1, 1] = self._acceleration_px_s2 * dt_s**2 / 2
        push[2, 0] = push[3, 1] = self._acceleration_px_s2 * dt_s
        push[4, 2] = self._growth_px_s * dt_s
        self._transition, self._push_covariance = transition, push @ push.T
        self._dt_s = dt_s

    def update(self, observed: Floats, noise: Floats, most_surprise: float) -> bool:
        """Take in an observation (3,) [x, y, radius] with covariance noise (3, 3), unless it is no match.

        Returns False, and leaves the state as predicted, when its squared Mahalanobis distance from the
        prediction exceeds most_surprise.
        """
        off = observed - self.mean[OBSERVED]
        if off @ inverse_matrix(self.covariance[OBSERVED_BLOCK] + noise) @ off > most_surprise:
            return False
        self.mean, self.covariance = load_filter().update(self.mean, self.covariance, observed, noise, OBSERVATION)
        return True
