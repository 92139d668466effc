"""The tracker's Kalman filter (section 3.1): state [x, y, vx, vy, radius], observation [x, y, radius]."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
OBSERVED = np.array([0, 1, 4])


def kalman_class() -> Any:
    """filterpy's KalmanFilter; the first call loads scipy.stats with it, which takes two seconds."""
    from filterpy.kalman import KalmanFilter

    return KalmanFilter


class BallFilter:
    """filterpy's Kalman filter with the paper's F and H, and process noise from what moves a ball.

    acceleration_px_s2 : 1 sigma of the ball's acceleration, constant over one step
    growth_px_s : 1 sigma of the rate at which the radius changes, constant over one step
    """

    def __init__(self, mean: Floats, covariance: Floats, acceleration_px_s2: float, growth_px_s: float) -> None:
        kalman = kalman_class()(dim_x=5, dim_z=3)
        kalman.x = np.array(mean, np.float64)
        kalman.P = np.array(covariance, np.float64)
        kalman.H = np.eye(5)[OBSERVED]
        self._kalman = kalman
        self._acceleration_px_s2 = acceleration_px_s2
        self._growth_px_s = growth_px_s
        self._dt_s = 0.0

    @property
    def mean(self) -> Floats:
        """(5,) float64, a copy."""
        return np.array(self._kalman.x, np.float64)

    @property
    def covariance(self) -> Floats:
        """(5, 5) float64, a copy."""
        return np.array(self._kalman.P, np.float64)

    def predict(self, dt_s: float) -> None:
        """Advance by dt_s."""
        if dt_s != self._dt_s:
            self._set_step(dt_s)
        self._kalman.predict()

    def _set_step(self, dt_s: float) -> None:
        transition = np.eye(5)
        transition[0, 2] = transition[1, 3] = dt_s
        push = np.zeros((5, 3))
        push[0, 0] = push[1, 1] = self._acceleration_px_s2 * dt_s**2 / 2
        push[2, 0] = push[3, 1] = self._acceleration_px_s2 * dt_s
        push[4, 2] = self._growth_px_s * dt_s
        self._kalman.F = transition
        self._kalman.Q = push @ push.T
        self._dt_s = dt_s

    def update(self, observed: Floats, noise: Floats, most_surprise: float) -> bool:
        """Take in an observation (3,) [x, y, radius] with covariance noise (3, 3), unless it is no match.

        Returns False, and leaves the state as predicted, when its squared Mahalanobis distance from the
        prediction exceeds most_surprise.
        """
        kalman = self._kalman
        mean, covariance = kalman.x, kalman.P
        kalman.update(observed, R=noise)
        if kalman.y @ kalman.SI @ kalman.y <= most_surprise:
            return True
        kalman.x, kalman.P = mean, covariance
        return False
