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
