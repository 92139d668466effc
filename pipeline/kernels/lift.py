"""Lift of a spin along a flight, and the likelihood of spins by the lift that the flight shows."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .arrays import Floats
from .rotation import Vector
from .small_matrices import inverse_matrix, product

# Lift that no ball shows: 60 m/s^2 (150 rps at 30 m/s: 65). It keeps the largest likelihood finite where the circles
# say nothing.
ANY_LIFT_M_S2 = 60.0
# The grid over spins is narrowed so many times, to those not less likely than the best by this logarithm: 7 sigma, and
# 2.5 sigma where the errors are scaled by 8. It begins at this share of the fastest spin, which bends no flight.
NARROWINGS, NEGLIGIBLE, SLOWEST = 3, 25.0, 0.01


@njit(cache=True, nogil=True)
def lift_likelihood(
    pull: Floats, information: Floats, gradient: Floats, open_terms: Floats, known: Floats
) -> tuple[Floats, float]:
    """Average what circles tell of the accelerations over the causes other than lift.

    Parameters
    ----------
    pull : (9,) float64
        Written: gradient of the logarithmic likelihood of the lift at no lift.
    information, gradient : (9, 9) and (9,) float64
        Of the accelerations at the fitted motion.
    open_terms : (9, k) float64
        Accelerations by k independent causes, each at 1 sigma.
    known : (9,) float64
        Expected accelerations without lift less those of the fitted motion.

    Returns
    -------
    information : (9, 9) float64
        Of the lift.
    most : float
        Logarithm of the likelihood of the most likely lift over that of none.
    """
    causes = open_terms.shape[1]
    seen, left = product(information, open_terms), information.copy()
    overlap, along = np.zeros((causes, causes)), np.zeros(causes)
    for a in range(causes):
        overlap[a, a] = 1.0
        for i in range(9):
            along[a] += open_terms[i, a] * gradient[i]
            for b in range(causes):
                overlap[a, b] += open_terms[i, a] * seen[i, b]
    gain = product(seen, inverse_matrix(overlap))
    for i in range(9):
        pull[i] = gradient[i]
        for a in range(causes):
            pull[i] -= gain[i, a] * along[a]
            for j in range(9):
                left[i, j] -= gain[i, a] * seen[j, a]
        for j in range(9):
            pull[i] -= left[i, j] * known[j]
    bounded, total = left.copy(), 0.0
    for i in range(9):
        bounded[i, i] += 1.0 / ANY_LIFT_M_S2**2
    inverse = inverse_matrix(bounded)
    for i in range(9):
        for j in range(9):
            total += pull[i] * inverse[i, j] * pull[j]
    return left, 0.5 * total


@njit(cache=True, nogil=True)
def lift_at(acceleration: Floats, spin_rps: Floats, velocity_m_s: Floats, air: tuple[float, float, float]) -> None:
    """Write the lift (m/s^2) of a spin (3,) at the velocities (3, 3) of the nodes into acceleration (9,).

    The air is (largest lift per square of the speed, 1/m; spin parameter at which it saturates; ball radius, m).
    """
    most, saturation, ball_radius_m = air
    wx, wy, wz = spin_rps[0], spin_rps[1], spin_rps[2]
    for node in range(3):
        vx, vy, vz = velocity_m_s[node, 0], velocity_m_s[node, 1], velocity_m_s[node, 2]
        x, y, z = wy * vz - wz * vy, wz * vx - wx * vz, wx * vy - wy * vx
        across = math.sqrt(x * x + y * y + z * z)
        square = vx * vx + vy * vy + vz * vz
        factor = 0.0
        if across > 0.0 and square > 0.0:
            parameter = 2.0 * math.pi * ball_radius_m * across / square
            factor = most * square * math.tanh(parameter / saturation) / across
        acceleration[3 * node], acceleration[3 * node + 1] = factor * x, factor * y
        acceleration[3 * node + 2] = factor * z


@njit(cache=True, nogil=True)
def spin_log_likelihoods(
    values: Floats,
    spins_rps: Floats,
    velocity_m_s: Floats,
    information: Floats,
    pull: Floats,
    air: tuple[float, float, float],
    lift_std: float,
) -> None:
    """Write the logarithmic likelihoods (k,) of spins (k, 3), 0 for no lift.

    The likelihood of a lift is -1/2 lift information lift + pull lift; it is averaged over a scale of the lift that is
    normal around 1 with lift_std.
    """
    lift = np.empty(9)
    variance = lift_std * lift_std
    for k in range(values.size):
        lift_at(lift, spins_rps[k], velocity_m_s, air)
        linear, quadratic = 0.0, 0.0
        for i in range(9):
            row = 0.5 * information[i, i] * lift[i]
            for j in range(i):
                row += information[i, j] * lift[j]
            linear += pull[i] * lift[i]
            quadratic += 2.0 * row * lift[i]
        values[k] = _averaged(linear, quadratic, variance)


@njit(cache=True, nogil=True)
def _averaged(linear: float, quadratic: float, variance: float) -> float:
    """Logarithm of exp(linear s - quadratic s^2 / 2) averaged over scales s, normal around 1 with this variance."""
    spread = 1.0 + variance * quadratic
    return linear - 0.5 * quadratic + 0.5 * variance * (linear - quadratic) ** 2 / spread - 0.5 * math.log(spread)


@njit(cache=True, nogil=True)
def _lift_in_direction(
    quadratic: Floats,
    linear: Floats,
    turn: Floats,
    direction: Vector,
    velocity_m_s: Floats,
    information: Floats,
    pull: Floats,
    air: tuple[float, float, float],
) -> None:
    """Write what the likelihood of all spins in one direction has in common.

    At node a the lift of magnitude m (rps) has tanh(m turn[a]) of its largest value; with these three factors s, the
    logarithmic likelihood is s linear - 1/2 s quadratic s.
    """
    most, saturation, ball_radius_m = air
    lift = np.zeros((3, 3))
    for node in range(3):
        vx, vy, vz = velocity_m_s[node, 0], velocity_m_s[node, 1], velocity_m_s[node, 2]
        x = direction[1] * vz - direction[2] * vy
        y = direction[2] * vx - direction[0] * vz
        z = direction[0] * vy - direction[1] * vx
        across = math.sqrt(x * x + y * y + z * z)
        square = vx * vx + vy * vy + vz * vz
        turn[node] = 0.0
        if across > 0.0 and square > 0.0:
            turn[node] = 2.0 * math.pi * ball_radius_m * across / (square * saturation)
            factor = most * square / across
            lift[node, 0], lift[node, 1], lift[node, 2] = factor * x, factor * y, factor * z
    for a in range(3):
        linear[a] = 0.0
        for i in range(3):
            linear[a] += pull[3 * a + i] * lift[a, i]
        for b in range(3):
            quadratic[a, b] = 0.0
            for i in range(3):
                for j in range(3):
                    quadratic[a, b] += lift[a, i] * information[3 * a + i, 3 * b + j] * lift[b, j]


@njit(cache=True, nogil=True)
def spin_grid(
    weights: Floats,
    across: tuple[Vector, Vector],
    likelihood: tuple[Floats, Floats, Floats, float, tuple[float, float, float], float],
    max_spin_rps: float,
    freedom: float,
) -> tuple[float, float, float, float, float]:
    """Write the likelihood of spins across a flight, on a grid narrowed around the best ones, relative to the best.

    Parameters
    ----------
    weights : (directions, magnitudes) float64
        Written.
    across : ((float, float, float), (float, float, float))
        Orthonormal axes across the flight; direction a is cos(a) times the first plus sin(a) times the second.
    likelihood : tuple
        Velocities (3, 3), information (9, 9), pull (9,), logarithm of the largest likelihood, air, lift_std: see
        `spin_log_likelihoods` and `lift_likelihood`.
    max_spin_rps : float
        The grid begins with all directions and magnitudes up to this, equally spaced in the logarithm.
    freedom : float
        Degrees of freedom of what the best spin leaves unexplained. Where its chi-squared is larger, all logarithms
        are made smaller by as much: the usual scale factor of errors.

    Returns
    -------
    (float, float, float, float, float)
        Begin and step of the magnitudes (natural logarithm of rps), begin and step of the directions (rad), of which
        the weights stand in the middle; chi-squared per degree of freedom.
    """
    velocity_m_s, information, pull, most, air, lift_std = likelihood
    directions, magnitudes = weights.shape
    quadratic, linear, turn_per_rps, lift = np.empty((3, 3)), np.empty(3), np.empty(3), np.empty(3)
    rps = np.empty(magnitudes)
    low, high = math.log(SLOWEST * max_spin_rps), math.log(max_spin_rps)
    begin, width = 0.0, 2.0 * math.pi
    step, turn, misfit = 0.0, 0.0, 0.0
    for narrowing in range(NARROWINGS + 1):
        step, turn = (high - low) / magnitudes, width / directions
        for m in range(magnitudes):
            rps[m] = math.exp(low + (m + 0.5) * step)
        for a in range(directions):
            cosine, sine = math.cos(begin + (a + 0.5) * turn), math.sin(begin + (a + 0.5) * turn)
            direction = (
                cosine * across[0][0] + sine * across[1][0],
                cosine * across[0][1] + sine * across[1][1],
                cosine * across[0][2] + sine * across[1][2],
            )
            _lift_in_direction(quadratic, linear, turn_per_rps, direction, velocity_m_s, information, pull, air)
            for m in range(magnitudes):
                for node in range(3):
                    lift[node] = math.tanh(rps[m] * turn_per_rps[node])
                along, squared = 0.0, 0.0
                for node in range(3):
                    along += linear[node] * lift[node]
                    for other in range(3):
                        squared += lift[node] * quadratic[node, other] * lift[other]
                weights[a, m] = _averaged(along, squared, lift_std * lift_std)
        best = -np.inf
        for a in range(directions):
            for m in range(magnitudes):
                best = max(best, weights[a, m])
        for a in range(directions):
            for m in range(magnitudes):
                weights[a, m] -= best
        misfit = max(2.0 * (most - best) / freedom, 0.0)
        if narrowing == NARROWINGS:
            break
        # One cell more on each side: the best spin may lie between the cells. The directions are those outside the
        # widest gap of the whole circle, which has `around` cells.
        around = math.ceil(2.0 * math.pi / turn - 1e-9)
        first, last, since, widest, after = magnitudes, 0, -1, 0, 0
        for a in range(around + directions):
            is_likely = False
            if a % around < directions:
                for m in range(magnitudes):
                    if weights[a % around, m] >= -NEGLIGIBLE:
                        is_likely, first, last = True, min(first, m), max(last, m)
            if is_likely:
                if since >= 0 and a - since > widest:
                    widest, after = a - since, a % around
                since = a
        low, high = max(low + (first - 1) * step, low), min(low + (last + 2) * step, high)
        begin += (after - 1) * turn
        width = min((around - widest + 3) * turn, 2.0 * math.pi)
    for a in range(directions):
        for m in range(magnitudes):
            weights[a, m] = math.exp(weights[a, m] / max(misfit, 1.0))
    return low, step, begin, turn, misfit
