"""Paths of measured circles and events of crossing balls, slow and obvious."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def edge_channels(times_s: Floats, circles: Floats, noises: Floats, errors_px2: Floats) -> tuple[Floats, Floats, float]:
    """One matrix turns the circles into channels, and their covariances with them."""
    steps = np.diff(circles[:, :2], axis=0)
    along = circles[-1, :2] - circles[0, :2]
    if along.any():
        along /= np.hypot(*along)
    channels = np.array([[*along, 1.0], [-along[1], along[0], 0.0], [0.0, 0.0, 1.0]])
    variances = np.diagonal(channels @ noises @ channels.T, axis1=1, axis2=2) + errors_px2
    return circles @ channels.T, 1.0 / variances, float(np.hypot(*steps.T).sum() / (times_s[-1] - times_s[0]))


def flight_precisions(speed_px_s: float, radius_px: float, focal_px: float, ball_radius_m: float) -> Floats:
    """One over the variances: gravity, lift 0.07 / m, drag 0.16 / m, jumps of 30 m/s, in px across and along."""
    depth_m = focal_px * ball_radius_m / radius_px
    per_m = np.array([radius_px / ball_radius_m, radius_px / ball_radius_m, radius_px / depth_m])
    speed_m_s = speed_px_s / per_m[0]
    acceleration = 2 * (9.81 + (0.07 + 0.16) * speed_m_s**2)
    jerk = 3 * acceleration * max(speed_m_s, 1) / depth_m + 2 * 0.16**2 * speed_m_s**3
    largest = np.array([1e6, 1e6, acceleration / 2, jerk / 6, 30.0, acceleration / 4])
    return 1.0 / np.outer(per_m, largest) ** 2


def path_costs(times_s: Floats, circles: Floats, weights: Floats, precisions: Floats, hinges_s: Floats) -> Floats:
    """Each channel's least squares by `lstsq`, the priors as further rows."""
    costs = []
    for hinge_s in (None, *hinges_s):
        terms = [times_s**power for power in range(4)]
        if hinge_s is not None:
            after = np.maximum(times_s - hinge_s, 0.0)
            terms += [after, after**2]
        cost = 0.0
        for values, weight, precision in zip(circles.T, weights.T, precisions, strict=True):
            rows = np.vstack(
                [np.sqrt(weight)[:, None] * np.stack(terms, axis=1), np.diag(np.sqrt(precision[: len(terms)]))]
            )
            target = np.concatenate([np.sqrt(weight) * values, np.zeros(len(terms))])
            cost += float(np.sum((rows @ np.linalg.lstsq(rows, target, rcond=None)[0] - target) ** 2))
        costs.append(cost)
    return np.array(costs)


def nearest_outline(circle: Floats, others: Floats, tau_s: Floats, x_px: Floats, y_px: Floats) -> NDArray[np.intp]:
    """Indices of the events no nearer to another outline."""

    def off(ring: Floats) -> Floats:
        return np.abs(np.hypot(x_px - ring[0] - ring[2] * tau_s, y_px - ring[1] - ring[3] * tau_s) - ring[4])

    return np.flatnonzero(np.all([off(circle) <= off(other) for other in others], axis=0))
