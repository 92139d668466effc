"""Likelihood of spins by the bend of a flight, and the estimate that follows from it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from ...kernels.arrays import Floats
from ...kernels.lift import lift_at, lift_likelihood, spin_grid, spin_log_likelihoods
from ...kernels.rotation import orthonormal_axes
from ...results import ReadOnlyArrays
from .motion import FittedMotion

GRAVITY_M_S2, AIR_KG_M3, BALL_KG = 9.81, 1.2, 0.0027  # air at 20 degrees C; mass by the rules of the game
# Lift coefficient of a fast spin, and the spin parameter |spin across the flight| radius / speed at which it saturates:
# C_L = 0.26 tanh(S / 0.4), fitted on 203 real flights with measured spin (2.8-10 m/s; recordings of SpinDOE, 2023).
LIFT_MAX, LIFT_SATURATION = 0.26, 0.4
# The grid over the spins across the flight: the middles of its cells, in cells.
DIRECTIONS, MAGNITUDES = 20, 16
DIRECTION_CELLS, MAGNITUDE_CELLS = np.arange(DIRECTIONS) + 0.5, np.arange(MAGNITUDES) + 0.5
# Degrees of freedom of the nine accelerations less those of the spin across the flight.
FREEDOM = 7.0
# A spin whose lift has saturated whatever the speed, and the directions in which it is tried: 5 degrees apart.
SATURATED_RPS, TRIED_DIRECTIONS = 1e4, 72


@dataclass(frozen=True, slots=True, eq=False)
class SetUp(ReadOnlyArrays):
    """Lift, drag and plumb line, which flights of one set-up share, each with its 1 sigma.

    Attributes
    ----------
    up : (3,) float64
        Unit vector, camera frame.
    plumb_std_deg : float
        Of `up` in each direction.
    drag_per_m, drag_std_per_m : float
        Drag is -drag_per_m |v| v.
    lift_scale, lift_std : float
        Lift over that of LIFT_MAX tanh(S / LIFT_SATURATION).
    """

    up: Floats
    plumb_std_deg: float
    drag_per_m: float
    drag_std_per_m: float
    lift_scale: float
    lift_std: float

    @property
    def gravity_m_s2(self) -> Floats:
        """(3,) float64, camera frame."""
        return -GRAVITY_M_S2 * self.up

    def air(self, ball_radius_m: float) -> tuple[float, float, float]:
        """The air as the kernels take it, see `kernels.flight.lift_at`."""
        pressure = 0.5 * AIR_KG_M3 * math.pi * ball_radius_m**2 / BALL_KG
        return LIFT_MAX * pressure * self.lift_scale, LIFT_SATURATION, ball_radius_m


@dataclass(frozen=True, slots=True, eq=False)
class FlightLikelihood(ReadOnlyArrays):
    """Likelihood of spins by the accelerations of one flight.

    The likelihood of a lift (9,) at the nodes is -1/2 lift information lift + pull lift, with drag and plumb line
    averaged over what is known of them.

    Attributes
    ----------
    velocity_m_s : (3, 3) float64
        At the nodes of the motion.
    information : (9, 9) float64
        Inverse covariance of the lift, (m/s^2)^-2.
    pull : (9,) float64
        Gradient of the logarithmic likelihood at no lift.
    most : float
        Logarithm of the likelihood of the lift that fits best, by whatever cause, over that of no lift.
    air : (float, float, float)
        See `SetUp.air`.
    lift_std : float
        1 sigma of the lift's scale.
    """

    velocity_m_s: Floats
    information: Floats
    pull: Floats
    most: float
    air: tuple[float, float, float]
    lift_std: float

    @classmethod
    def of(cls, motion: FittedMotion, set_up: SetUp, ball_radius_m: float) -> FlightLikelihood:
        """The likelihood by a motion; what the set-up leaves open is averaged over (Gaussian, in closed form)."""
        velocity = motion.velocity_m_s
        brake = -np.linalg.norm(velocity, axis=1)[:, None] * velocity
        known = set_up.gravity_m_s2 + set_up.drag_per_m * brake - motion.acceleration_m_s2
        open_terms = np.empty((3, 3, 3))
        open_terms[:, :, 0] = set_up.drag_std_per_m * brake
        lean = GRAVITY_M_S2 * math.radians(set_up.plumb_std_deg)
        open_terms[:, :, 1:] = lean * np.array(orthonormal_axes(*set_up.up)[1:]).T
        pull = np.empty(9)
        information, most = lift_likelihood(
            pull, motion.information, motion.gradient, open_terms.reshape(9, 3), known.ravel()
        )
        return cls(velocity, information, pull, most, set_up.air(ball_radius_m), set_up.lift_std)

    def scaled(self, factor: float) -> FlightLikelihood:
        """The likelihood with all variances of the circles this many times as large."""
        return replace(self, information=self.information / factor, pull=self.pull / factor, most=self.most / factor)

    def log_likelihood(self, spins_rps: ArrayLike) -> Floats:
        """(k,) float64 natural logarithm of the likelihood of spins (k, 3) in the camera frame, rps; 0 for no spin.

        No prior over spins is in it. What else the flight depends on (place, velocity, error of the radius, drag,
        plumb line, scale of the lift) is averaged over its own prior. It is flat along the direction of flight, for
        such a spin bends nothing, and in magnitude where lift saturates.
        """
        spins = np.ascontiguousarray(np.atleast_2d(np.asarray(spins_rps, np.float64)))
        values = np.empty(len(spins))
        spin_log_likelihoods(values, spins, self.velocity_m_s, self.information, self.pull, self.air, self.lift_std)
        return values


@dataclass(frozen=True, slots=True, eq=False)
class SpinAcross(ReadOnlyArrays):
    """Spin across the flight, where beforehand any direction and any order of magnitude are as likely.

    Attributes
    ----------
    axis : (3,) float64
        Unit vector across the flight, camera frame.
    along : (3,) float64
        Unit vector of the flight.
    magnitude_rps, magnitude_std_rps : float
        Geometric mean and standard deviation: the flight tells the magnitude to a share.
    axis_std_rad : float
        Of the direction, within the plane across the flight.
    least_rps, most_rps : float
        Range in which the magnitude is 2.5 % likely to be below, and above.
    misfit : float
        Chi-squared per degree of freedom of the bend by the best spin; variances are that much larger where it is
        above 1.
    """

    axis: Floats
    along: Floats
    magnitude_rps: float
    magnitude_std_rps: float
    axis_std_rad: float
    least_rps: float
    most_rps: float
    misfit: float


def spin_across(likelihood: FlightLikelihood, max_spin_rps: float) -> SpinAcross:
    """The spin across the flight of up to max_spin_rps, from its likelihood on a grid."""
    velocity = likelihood.velocity_m_s[1]
    along, first, second = orthonormal_axes(*(velocity / math.sqrt(velocity @ velocity)))
    weights = np.empty((DIRECTIONS, MAGNITUDES))
    low, step, begin, turn, misfit = spin_grid(
        weights,
        (first, second),
        (
            likelihood.velocity_m_s,
            likelihood.information,
            likelihood.pull,
            likelihood.most,
            likelihood.air,
            likelihood.lift_std,
        ),
        max_spin_rps,
        FREEDOM,
    )
    magnitudes, angles = np.exp(low + step * MAGNITUDE_CELLS), begin + turn * DIRECTION_CELLS
    weights /= weights.sum()
    of_angle, of_magnitude = weights.sum(axis=1), weights.sum(axis=0)
    cosine, sine = float(of_angle @ np.cos(angles)), float(of_angle @ np.sin(angles))
    length = min(math.hypot(cosine, sine), 1.0)
    logs, summed = np.log(magnitudes), np.cumsum(of_magnitude)
    middle = float(of_magnitude @ logs)
    share = math.sqrt(float(of_magnitude @ (logs - middle) ** 2) + step**2 / 12)
    return SpinAcross(
        (cosine * np.array(first) + sine * np.array(second)) / length,
        np.array(along),
        math.exp(middle),
        share * math.exp(middle),
        math.sqrt(-2 * math.log(length) + turn**2 / 12) if length > 1e-6 else math.pi,
        float(magnitudes[np.searchsorted(summed, 0.025)]) * math.exp(-step / 2),
        float(magnitudes[np.searchsorted(summed, 0.975)]) * math.exp(step / 2),
        misfit,
    )


def bend_over_largest_lift(likelihood: FlightLikelihood) -> tuple[float, float]:
    """Bend of a flight that may be stronger than any spin's.

    Returns
    -------
    times : float
        How many times as large as the largest lift of a spin the lift is that fits best, with its direction free.
    misfit : float
        Chi-squared per degree of freedom of that lift.
    """
    velocity = likelihood.velocity_m_s[1]
    _, first, second = orthonormal_axes(*(velocity / math.sqrt(velocity @ velocity)))
    angles = 2 * math.pi / TRIED_DIRECTIONS * np.arange(TRIED_DIRECTIONS)[:, None]
    lifts = np.empty((TRIED_DIRECTIONS, 9))
    for lift, spin_rps in zip(lifts, SATURATED_RPS * (np.cos(angles) * first + np.sin(angles) * second), strict=True):
        lift_at(lift, spin_rps, likelihood.velocity_m_s, likelihood.air)
    slopes = lifts @ likelihood.pull
    bows = np.einsum("ki,ij,kj->k", lifts, likelihood.information, lifts)
    best = int(np.argmax(np.where(slopes > 0, slopes**2 / bows, 0.0)))
    gain = slopes[best] ** 2 / (2 * bows[best])
    return float(slopes[best] / bows[best]), max(2 * (likelihood.most - float(gain)) / FREEDOM, 0.0)
