"""Slow, obvious twins of the kernels of flight and lift."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def naive_places(motion: Floats, tau_s: Floats, half_s: float, focal_px: float, ball_radius_m: float) -> Floats:
    """Accelerations interpolated by a parabola through the nodes, integrated twice, and projected."""
    centres = np.empty((len(tau_s), 3))
    for c in range(3):
        through = Polynomial.fit([-half_s, 0.0, half_s], motion[6 + c : 15 : 3], 2).convert()
        path = through.integ(2, k=[motion[3 + c], motion[c]])
        centres[:, c] = path(tau_s)
    scale = focal_px / centres[:, 2]
    return np.column_stack([centres[:, 0] * scale, centres[:, 1] * scale, ball_radius_m * scale + motion[15]])


def naive_slopes(motion: Floats, tau_s: Floats, half_s: float, focal_px: float, ball_radius_m: float) -> Floats:
    """(3 n, 16) derivative of the places by differences."""
    slopes = []
    for c in range(16):
        step = np.zeros(16)
        step[c] = 1e-4
        ahead, behind = (
            naive_places(motion + sign * step, tau_s, half_s, focal_px, ball_radius_m) for sign in (1.0, -1.0)
        )
        slopes.append((ahead - behind).ravel() / 2e-4)
    return np.array(slopes).T


def naive_lift(spin_rps: Floats, velocity_m_s: Floats, air: tuple[float, float, float]) -> Floats:
    """(9,) lift at the nodes: size most v^2 tanh(S / saturation), across v and the spin."""
    most, saturation, ball_radius_m = air
    lift = []
    for velocity in velocity_m_s:
        speed = np.linalg.norm(velocity)
        forward = velocity / speed
        across = spin_rps - (spin_rps @ forward) * forward
        parameter = 2 * np.pi * np.linalg.norm(across) * ball_radius_m / speed
        direction = np.cross(across / np.linalg.norm(across), forward)
        lift.append(most * speed**2 * np.tanh(parameter / saturation) * direction)
    return np.concatenate(lift)


def naive_log_likelihood(
    spin_rps: Floats,
    velocity_m_s: Floats,
    information: Floats,
    pull: Floats,
    air: tuple[float, float, float],
    lift_std: float,
) -> float:
    """The average over the scale of the lift, by summation.

    Circles that exclude the lift prefer a scale near zero, which is 1 / lift_std standard deviations off.
    """
    lift = naive_lift(spin_rps, velocity_m_s, air)
    most = 30.0 + 1.0 / lift_std
    scales = np.linspace(-most, most, 100_001)
    factors = 1 + lift_std * scales
    values = factors * (pull @ lift) - 0.5 * factors**2 * (lift @ information @ lift)
    logs = values - 0.5 * scales**2 - 0.5 * np.log(2 * np.pi)
    top = logs.max()
    return float(top + np.log(np.sum(np.exp(logs - top)) * (scales[1] - scales[0])))
