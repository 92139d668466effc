"""Paths of measured circles and events of crossing balls, slow and obvious."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


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
