"""Calibration of lift, drag and plumb line by flights of one set-up whose spin the logo tells."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...kernels.arrays import Floats
from ...kernels.lift import lift_at, lift_likelihood
from ...results import SpinEstimate
from .likelihood import GRAVITY_M_S2, SetUp
from .motion import FittedMotion

# Lift, drag, and the three components of gravity.
UNKNOWNS = 5
# Rounds in which flights that the others contradict come to count less.
ROUNDS = 5
# What a calibration leaves open however many flights there are: the law of lift over the spin parameter holds within
# a few percent, and an error that the radii of all shots have in common (0.3 px of 17) is one of all distances, which
# appears in drag more than twice.
LEAST_LIFT_STD, LEAST_DRAG_SHARE = 0.03, 0.05
# A change of the spin for the derivative of the lift: 1 % of a fast one.
SPIN_STEP_RPS = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class KnownFlight:
    """A flight whose spin is known from the logo.

    Attributes
    ----------
    motion : FittedMotion
        The flight.
    spin : SpinEstimate
        The spin with its covariance.
    """

    motion: FittedMotion
    spin: SpinEstimate


def calibrate(flights: Sequence[KnownFlight], set_up: SetUp, ball_radius_m: float) -> SetUp:
    """The set-up as these flights correct it.

    Parameters
    ----------
    flights : sequence of KnownFlight
        Of one set-up; without any the set-up stays as it is.
    set_up : SetUp
        What is known beforehand.
    ball_radius_m : float
        Radius of the ball.

    Notes
    -----
    Least squares: the accelerations of every flight are gravity, drag and lift, linear in what is sought. The spin's
    covariance is carried into the lift. A flight whose misfit is larger than chance allows counts less by that factor.
    """
    lean = GRAVITY_M_S2 * math.radians(set_up.plumb_std_deg)
    up = set_up.up[:, None]
    prior = np.zeros((UNKNOWNS, UNKNOWNS))
    prior[0, 0], prior[1, 1] = (set_up.lift_scale / set_up.lift_std) ** 2, set_up.drag_std_per_m**-2
    # Across `up` by the plumb line; along it gravity is known: a ten-thousandth is the change over 30 km of height.
    prior[2:, 2:] = (np.eye(3) - up @ up.T) / lean**2 + up @ up.T / (1e-3 * GRAVITY_M_S2) ** 2
    change, covariance = _solved(flights, set_up, ball_radius_m, prior)
    scale = 1 + change[0]
    gravity = set_up.gravity_m_s2 + change[2:]
    leaning = (np.trace(covariance[2:, 2:]) - float((up.T @ covariance[2:, 2:] @ up).item())) / 2
    drag_per_m = set_up.drag_per_m + float(change[1])
    return SetUp(
        -gravity / np.linalg.norm(gravity),
        math.degrees(math.sqrt(leaning) / GRAVITY_M_S2),
        drag_per_m,
        max(math.sqrt(covariance[1, 1]), LEAST_DRAG_SHARE * drag_per_m),
        set_up.lift_scale * scale,
        max(math.sqrt(covariance[0, 0]), LEAST_LIFT_STD),
    )


def up_from_flights(flights: Sequence[KnownFlight], set_up: SetUp, ball_radius_m: float) -> tuple[Floats, Floats]:
    """Direction of gravity told by flights alone, whatever `up` is believed to be.

    Returns
    -------
    up : (3,) float64
        Opposite to the acceleration that neither drag nor lift explains: of length 1 where all fits.
    covariance : (3, 3) float64
        Of `up`.
    """
    prior = np.zeros((UNKNOWNS, UNKNOWNS))
    prior[0, 0], prior[1, 1] = (set_up.lift_scale / set_up.lift_std) ** 2, set_up.drag_std_per_m**-2
    prior[2:, 2:] = np.eye(3) / (10 * GRAVITY_M_S2) ** 2
    change, covariance = _solved(flights, set_up, ball_radius_m, prior)
    up: Floats = set_up.up - change[2:] / GRAVITY_M_S2
    return up, covariance[2:, 2:] / GRAVITY_M_S2**2


def _solved(
    flights: Sequence[KnownFlight], set_up: SetUp, ball_radius_m: float, prior: Floats
) -> tuple[Floats, Floats]:
    """Changes of lift (as a share), drag and gravity (UNKNOWNS,) that fit best, and their covariance."""
    parts = [_equations(flight, set_up, ball_radius_m) for flight in flights]
    change, scales = np.zeros(UNKNOWNS), np.ones(len(parts))
    covariance = prior
    for _ in range(ROUNDS):
        information, pull = prior.copy(), np.zeros(UNKNOWNS)
        for scale, (columns, inverse, gradient, _) in zip(scales, parts, strict=True):
            information += columns.T @ inverse @ columns / scale
            pull += columns.T @ gradient / scale
        covariance = np.linalg.inv(information).astype(np.float64)
        change = covariance @ pull
        for number, (columns, inverse, gradient, most) in enumerate(parts):
            shift = columns @ change
            chi2 = 2 * (most - float(gradient @ shift - 0.5 * shift @ inverse @ shift))
            scales[number] = max(chi2 / len(shift), 1.0)
    return change, covariance


def _equations(flight: KnownFlight, set_up: SetUp, ball_radius_m: float) -> tuple[Floats, Floats, Floats, float]:
    """Accelerations (9, UNKNOWNS) by one unit of each unknown; information and gradient, at the set-up as given.

    The last one is the logarithm of the largest likelihood over that of the set-up.
    """
    motion, spin = flight.motion, flight.spin
    assert spin.vector_rps is not None and spin.covariance_rps2 is not None
    velocity, air = motion.velocity_m_s, set_up.air(ball_radius_m)
    lift, beside = np.empty(9), np.empty(9)
    lift_at(lift, spin.vector_rps, velocity, air)
    slopes = np.empty((9, 3))
    for c in range(3):
        lift_at(beside, spin.vector_rps + SPIN_STEP_RPS * np.eye(3)[c], velocity, air)
        slopes[:, c] = (beside - lift) / SPIN_STEP_RPS
    brake = (-np.linalg.norm(velocity, axis=1)[:, None] * velocity).ravel()
    columns = np.column_stack([lift, brake, np.tile(np.eye(3), (3, 1))])
    expected = lift + set_up.drag_per_m * brake + np.tile(set_up.gravity_m_s2, 3)
    values, vectors = np.linalg.eigh(spin.covariance_rps2)
    spread = np.ascontiguousarray(slopes @ (vectors * np.sqrt(np.maximum(values, 0.0))))
    gradient = np.empty(9)
    information, most = lift_likelihood(
        gradient, motion.information, motion.gradient, spread, expected - motion.acceleration_m_s2.ravel()
    )
    return columns, information, gradient, most
