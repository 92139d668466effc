"""Kalman filter by the textbook's matrices, slow and obvious."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
OBSERVATION = np.eye(5)[[0, 1, 4]]


def matrices(dt_s: float, acceleration_px_s2: float, growth_px_s: float) -> tuple[Floats, Floats]:
    """Transition F and process noise Q of one step."""
    transition = np.eye(5)
    transition[0, 2] = transition[1, 3] = dt_s
    push = np.zeros((5, 3))
    push[0, 0] = push[1, 1] = acceleration_px_s2 * dt_s**2 / 2
    push[2, 0] = push[3, 1] = acceleration_px_s2 * dt_s
    push[4, 2] = growth_px_s * dt_s
    return transition, push @ push.T


def predict(mean: Floats, covariance: Floats, transition: Floats, process_noise: Floats) -> tuple[Floats, Floats]:
    return transition @ mean, transition @ covariance @ transition.T + process_noise


def update(mean: Floats, covariance: Floats, observed: Floats, noise: Floats) -> tuple[float, Floats, Floats]:
    """Squared Mahalanobis distance of an observation, and the state and covariance with it."""
    off = observed - OBSERVATION @ mean
    inverse = np.linalg.inv(OBSERVATION @ covariance @ OBSERVATION.T + noise)
    gain = covariance @ OBSERVATION.T @ inverse
    kept = np.eye(5) - gain @ OBSERVATION
    return float(off @ inverse @ off), mean + gain @ off, kept @ covariance @ kept.T + gain @ noise @ gain.T
