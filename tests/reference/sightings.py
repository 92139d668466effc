"""Slow twin of the likelihood of spins by when the logo was seen."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from spinscope.pipeline.kernels.rotation import rotations

Floats = NDArray[np.float64]


def sighting_log_likelihood(
    spin_rad_s: Floats, times_s: Floats, views: Floats, seen: NDArray[np.bool_], places: Floats, weight: float
) -> float:
    """Logarithm of the mean likelihood over all places of the logo and all degrees to which it shows."""
    likelihoods = []
    for place in places:
        for miss in (0.05, 0.5, 0.95):
            log = 0.0
            for time_s, view, is_seen in zip(times_s, views, seen, strict=True):
                angle_deg = math.degrees(
                    math.acos(float(np.clip(rotations(time_s * spin_rad_s)[0] @ place @ view, -1, 1)))
                )
                if angle_deg < 50:
                    chance = 1 - miss
                elif angle_deg <= 115:
                    chance = (1 - miss + 0.05) / 2
                else:
                    chance = 0.05
                log += math.log(chance if is_seen else 1 - chance)
            likelihoods.append(math.exp(weight * log))
    return math.log(np.mean(likelihoods))
