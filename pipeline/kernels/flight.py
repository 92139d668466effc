"""Flight of a ball fitted to its silhouettes.

A `motion` is (16,) float64: position (m) and velocity (m/s) at the reference time, the accelerations (m/s^2) at three
`nodes` (the begin, the middle and the end of a span of 2 half_s around the reference time; quadratic between them),
and the error of the radius (px), the same at all times. Camera frame.

Silhouettes are given as (n, 3) float64 `places` focal_px (X / Z, Y / Z, ball radius / Z) of the ball's centre, px.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .arrays import Floats
from .hinged_path import solve
from .small_matrices import inverse_matrix, product

# Student's t for the circles: with 4 degrees of freedom one that is 10 sigma off counts for a fifteenth.
T_FREEDOM = 4.0
# From a first guess that is a few pixels off to the noise of hundredths in steps that let no bad circle lead.
ROUNDS, FIRST_NOISE_PX, SHRINK = 8, 4.0, 0.25
# Where position, velocity and the radius' error stand in a motion: all but the accelerations.
OTHERS = (0, 1, 2, 3, 4, 5, 15)


@njit(cache=True, nogil=True)
def basis_at(tau_s: float, half_s: float) -> tuple[float, float, float]:
    """Factors of the accelerations at the three nodes in the position at tau_s: double integrals from 0, s^2."""
    s = tau_s / half_s
    square = half_s * half_s * s * s
    slant, bow = square * s / 12.0, square * s * s / 24.0
    return bow - slant, 0.5 * square - 2.0 * bow, bow + slant


@njit(cache=True, nogil=True)
def guess_motion(motion: Floats, centres_m: Floats, tau_s: Floats, gravity_m_s2: Floats, drag_per_m: float) -> None:
    """Write the motion with gravity and drag alone that is nearest to centres (n, 3) in space."""
    n = tau_s.size
    mean_s, spread = 0.0, 0.0
    for i in range(n):
        mean_s += tau_s[i]
    mean_s /= n
    for i in range(n):
        spread += (tau_s[i] - mean_s) ** 2
    motion[15] = 0.0
    # First the velocity, for the drag; then the line through what is left without the bend.
    for bent in (False, True):
        for c in range(3):
            value, slope = 0.0, 0.0
            for i in range(n):
                there = centres_m[i, c]
                if bent:
                    there -= 0.5 * tau_s[i] ** 2 * motion[9 + c]
                value += there
                slope += there * (tau_s[i] - mean_s)
            motion[3 + c] = slope / spread
            motion[c] = value / n - mean_s * motion[3 + c]
        if not bent:
            speed = np.sqrt(motion[3] ** 2 + motion[4] ** 2 + motion[5] ** 2)
            for c in range(3):
                motion[6 + c] = gravity_m_s2[c] - drag_per_m * speed * motion[3 + c]
                motion[9 + c] = motion[12 + c] = motion[6 + c]


@njit(cache=True, nogil=True)
def predict_places(
    places: Floats, motion: Floats, tau_s: Floats, half_s: float, focal_px: float, ball_radius_m: float
) -> None:
    """Write the places (n, 3) at which a motion shows the ball at tau_s (n,) after the reference time."""
    for i in range(tau_s.size):
        first, middle, last = basis_at(tau_s[i], half_s)
        for c in range(3):
            bent = first * motion[6 + c] + middle * motion[9 + c] + last * motion[12 + c]
            places[i, c] = motion[c] + motion[3 + c] * tau_s[i] + bent
        scale = focal_px / places[i, 2]
        places[i, 0] *= scale
        places[i, 1] *= scale
        places[i, 2] = ball_radius_m * scale + motion[15]


@njit(cache=True, nogil=True)
def _subtract(differences: Floats, places: Floats, seen: Floats) -> None:
    """Write `places` less `seen`, (n, 3) each, into `differences`."""
    for i in range(places.shape[0]):
        for c in range(3):
            differences[i, c] = places[i, c] - seen[i, c]


@njit(cache=True, nogil=True)
def _add_circles(
    system: Floats,
    motion: Floats,
    off_px: Floats,
    places: Floats,
    weights: Floats,
    precision: Floats,
    tau_s: Floats,
    half_s: float,
    camera: tuple[float, float],
) -> None:
    """Add the circles' normal equations to zeros (16, 17): information and, in the last column, gradient."""
    focal_px, ball_radius_m = camera
    terms = np.empty(5)
    slope = np.zeros((3, 3))
    for i in range(tau_s.size):
        z = focal_px * ball_radius_m / (places[i, 2] - motion[15])
        slope[0, 0] = slope[1, 1] = focal_px / z
        slope[0, 2], slope[1, 2] = -places[i, 0] / z, -places[i, 1] / z
        slope[2, 2] = -focal_px * ball_radius_m / (z * z)
        terms[0], terms[1] = 1.0, tau_s[i]
        terms[2], terms[3], terms[4] = basis_at(tau_s[i], half_s)
        for a in range(3):
            pull = 0.0
            for row in range(3):
                pull += slope[row, a] * precision[row] * off_px[i, row]
            pull *= weights[i]
            cross = weights[i] * slope[2, a] * precision[2]
            for j in range(5):
                system[3 * j + a, 16] += terms[j] * pull
                system[3 * j + a, 15] += terms[j] * cross
            for b in range(3):
                block = 0.0
                for row in range(3):
                    block += slope[row, a] * precision[row] * slope[row, b]
                block *= weights[i]
                for j in range(5):
                    scaled = terms[j] * block
                    for k in range(j, 5):
                        system[3 * j + a, 3 * k + b] += scaled * terms[k]
        system[15, 15] += weights[i] * precision[2]
        system[15, 16] += weights[i] * precision[2] * off_px[i, 2]
    for i in range(16):  # symmetric: only blocks on and above the diagonal are added up
        for j in range(i):
            system[i, j] = system[j, i]


@njit(cache=True, nogil=True)
def fit_motion(
    motion: Floats,
    places: Floats,
    tau_s: Floats,
    half_s: float,
    camera: tuple[float, float],
    prior: Floats,
    noise_px: tuple[float, float, float],
    radius_std_px: float,
) -> tuple[Floats, Floats, Floats, Floats]:
    """Fit a motion to the places of circles by reweighted Gauss-Newton, and say what they tell of its accelerations.

    Parameters
    ----------
    motion : (16,) float64
        First guess; its accelerations are the expected ones. Becomes the fit.
    places : (n, 3) float64
        See the module.
    tau_s : (n,) float64
        Times after the reference time.
    half_s : float
        Half the span of the nodes.
    camera : (float, float)
        Focal length in px, radius of the ball in m.
    prior : (9, 9) float64
        Inverse covariance of the accelerations around the expected ones, for the fit alone.
    noise_px : (float, float, float)
        Expected noise of centre and radius, and the number of circles for which this expectation counts.
    radius_std_px : float
        1 sigma of the error that all radii have in common.

    Returns
    -------
    information : (9, 9) float64
        Inverse covariance of the accelerations by the circles alone, positions and velocity unknown.
    gradient : (9,) float64
        Of the logarithmic likelihood at the fit.
    residuals_px : (n, 3) float64
        Circles less fit.
    noise_px : (2,) float64
        Noise of centre and radius as it was found.
    """
    n = tau_s.size
    expected = motion.copy()
    seen, off = np.empty((n, 3)), np.empty((n, 3))
    system, step, weights, precision = np.zeros((16, 17)), np.empty(16), np.ones(n), np.empty(3)
    centre_2, radius_2 = noise_px[0] ** 2, noise_px[1] ** 2
    floor = FIRST_NOISE_PX
    for _ in range(ROUNDS):
        predict_places(seen, motion, tau_s, half_s, camera[0], camera[1])
        _subtract(off, places, seen)
        precision[0] = precision[1] = 1.0 / max(centre_2, floor * floor)
        precision[2] = 1.0 / max(radius_2, floor * floor)
        centre_sum, radius_sum = 0.0, 0.0
        for i in range(n):
            centre = off[i, 0] ** 2 + off[i, 1] ** 2
            radius = off[i, 2] ** 2
            weights[i] = (T_FREEDOM + 3.0) / (T_FREEDOM + centre * precision[0] + radius * precision[2])
            centre_sum += weights[i] * centre
            radius_sum += weights[i] * radius
        # A fit takes about seven of the centres' and three of the radii's degrees of freedom.
        centre_2 = (2 * noise_px[2] * noise_px[0] ** 2 + centre_sum) / (2 * noise_px[2] + max(2 * n - 7, 0))
        radius_2 = (noise_px[2] * noise_px[1] ** 2 + radius_sum) / (noise_px[2] + max(n - 3, 0))
        system[:] = 0.0
        _add_circles(system, motion, off, seen, weights, precision, tau_s, half_s, camera)
        system[15, 15] += 1.0 / radius_std_px**2
        system[15, 16] -= motion[15] / radius_std_px**2
        whole = system.copy()
        for i in range(9):
            for j in range(9):
                whole[6 + i, 6 + j] += prior[i, j]
                whole[6 + i, 16] -= prior[i, j] * (motion[6 + j] - expected[6 + j])
        solve(step, whole, whole[:, 16], 16)
        for i in range(16):
            motion[i] += step[i]
        floor *= SHRINK
    predict_places(seen, motion, tau_s, half_s, camera[0], camera[1])
    _subtract(off, places, seen)
    system[:] = 0.0
    _add_circles(system, motion, off, seen, weights, precision, tau_s, half_s, camera)
    system[15, 15] += 1.0 / radius_std_px**2
    system[15, 16] -= motion[15] / radius_std_px**2
    inner, cross = np.empty((7, 7)), np.empty((9, 7))
    for i in range(7):
        for j in range(7):
            inner[i, j] = system[OTHERS[i], OTHERS[j]]
        for j in range(9):
            cross[j, i] = system[6 + j, OTHERS[i]]
    gain = product(cross, inverse_matrix(inner))
    information, gradient, found_px = system[6:15, 6:15].copy(), system[6:15, 16].copy(), np.empty(2)
    for i in range(9):
        for k in range(7):
            gradient[i] -= gain[i, k] * system[OTHERS[k], 16]
            for j in range(9):
                information[i, j] -= gain[i, k] * cross[j, k]
    found_px[0], found_px[1] = math.sqrt(centre_2), math.sqrt(radius_2)
    return information, gradient, off, found_px
