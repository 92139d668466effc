"""Likelihood of spins by when the logo was seen and when it was not, wherever it is on the ball."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .arrays import Flags, Floats
from .rotation import axis_and_length, rotate

# Cosine of the angle between the logo's middle and the direction to the camera up to which the whole logo is within the
# mask, and from which on all of it is behind the ball: a ball's pad leaves 58 degrees of 90, a logo reaches 25.
IN_VIEW, OUT_OF_VIEW = math.cos(math.radians(50.0)), math.cos(math.radians(115.0))
# Probabilities of not seeing a logo in view: a clear one, a faint one, one that hardly shows. All three are as likely,
# so that the sightings themselves tell which it is. And of seeing something (another mark, noise) without it.
MISSES, GHOST = np.array([0.05, 0.5, 0.95]), 0.05


@njit(cache=True, nogil=True)
def sighting_log_likelihoods(
    values: Floats,
    spins_rad_s: Floats,
    times_s: Floats,
    views: Floats,
    seen: Flags,
    places: Floats,
    weight: float,
) -> None:
    """Write logarithmic likelihoods (k,) of spins, averaged over places of the logo and over how clearly it shows.

    Parameters
    ----------
    values : (k,) float64
        Written.
    spins_rad_s : (k, 3) float64
        Camera frame.
    times_s : (n,) float64
        Times at which something was seen or nothing was.
    views : (n, 3) float64
        Unit vectors from the ball to the camera at these times, camera frame.
    seen : (n,) bool
        Whether the logo was seen.
    places : (m, 3) float64
        Unit vectors from the ball's middle to possible places of the logo, as the ball lies at time 0.
    weight : float
        Number of independent observations that each of the times stands for.
    """
    turned, counts, logs = np.empty((times_s.size, 3)), np.empty(6), np.empty((places.shape[0], MISSES.size))
    for k in range(values.size):
        ax, ay, az, speed = axis_and_length(spins_rad_s[k])
        for t in range(times_s.size):  # the camera as the ball sees it
            sine, cosine = math.sin(-speed * times_s[t]), math.cos(speed * times_s[t])
            view = views[t, 0], views[t, 1], views[t, 2]
            turned[t, 0], turned[t, 1], turned[t, 2] = rotate(view, (ax, ay, az), sine, cosine, 1.0 - cosine)
        for m in range(places.shape[0]):
            x, y, z = places[m, 0], places[m, 1], places[m, 2]
            counts[:] = 0.0  # nothing seen, something seen: with the logo in view, at the rim, out of view
            for t in range(times_s.size):
                near = x * turned[t, 0] + y * turned[t, 1] + z * turned[t, 2]
                counts[(3 if seen[t] else 0) + (near < IN_VIEW) + (near < OUT_OF_VIEW)] += 1.0
            for one in range(MISSES.size):
                shown = 1.0 - MISSES[one]
                logs[m, one] = 0.0
                for zone, chance in enumerate((shown, 0.5 * (shown + GHOST), GHOST)):
                    logs[m, one] += counts[zone] * math.log(1.0 - chance) + counts[3 + zone] * math.log(chance)
        logs *= weight
        highest = logs.max()
        values[k] = highest + math.log(np.exp(logs - highest).mean())
