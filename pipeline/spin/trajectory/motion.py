"""The motion of a ball through space, fitted to its circles in the image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...camera import Camera
from ...kernels.arrays import Floats
from ...kernels.flight import fit_motion, guess_motion
from ...results import ReadOnlyArrays

# Noise of a circle's centre and radius from tick to tick, px, and the number of circles for which this counts beside
# their own scatter: 0.02 to 0.05 px on flights of our simulator, 0.05 to 0.08 px on another's.
NOISE_PX, NOISE_CIRCLES = (0.06, 0.06), 5.0
# Error that all radii of a shot have in common: how far outside the ball its outline is seen.
RADIUS_STD_PX = 0.3
# What accelerates a ball beside gravity and drag is lift: 15 m/s^2 is that of 60 rps at 15 m/s. It changes within a
# flight by a few m/s^2. For the fit alone: the likelihood of spins has priors of its own.
_NODES = 15.0**2 * np.ones((3, 3)) + np.diag([5.0**2, 1.0, 5.0**2])
ACCELERATION_PRIOR: Floats = np.kron(np.linalg.inv(_NODES), np.eye(3))
# Velocity at the three nodes less that at the middle one, by the nodes' accelerations, in half spans.
_TO_VELOCITY = np.array([[-5 / 12, -2 / 3, 1 / 12], [0.0, 0.0, 0.0], [-1 / 12, 2 / 3, 5 / 12]])


@dataclass(frozen=True, slots=True, eq=False)
class FittedMotion(ReadOnlyArrays):
    """Motion of one ball, with accelerations at three nodes: the begin, the middle and the end of its circles.

    Attributes
    ----------
    reference_us : float
        Scene time of the middle node.
    half_s : float
        Time from node to node, s.
    position_m : (3,) float64
        At the middle node, camera frame.
    velocity_m_s : (3, 3) float64
        At each node.
    acceleration_m_s2 : (3, 3) float64
        At each node.
    radius_error_px : float
        By how much all radii seem too large.
    information : (9, 9) float64
        Inverse covariance of the accelerations by the circles alone, (m/s^2)^-2; not of full rank where they say
        nothing.
    gradient : (9,) float64
        Of the logarithmic likelihood of the accelerations at the fit, which has a prior.
    residuals_px : (n, 3) float64
        Circles less fit: centre x, y and radius.
    noise_px : (2,) float64
        Noise of centre and radius from tick to tick, 1 sigma.
    """

    reference_us: float
    half_s: float
    position_m: Floats
    velocity_m_s: Floats
    acceleration_m_s2: Floats
    radius_error_px: float
    information: Floats
    gradient: Floats
    residuals_px: Floats
    noise_px: Floats

    @property
    def circles(self) -> int:
        """Number of circles."""
        return len(self.residuals_px)


def fit_flight(
    t_us: Floats,
    circles_px: Floats,
    camera: Camera,
    ball_radius_m: float,
    gravity_m_s2: Floats,
    drag_per_m: float,
    shared: float = 1.0,
) -> FittedMotion:
    """The motion behind circles, with the accelerations that they tell of, whatever causes them.

    Parameters
    ----------
    t_us : (n,) float64
        Scene times, rising; at least three.
    circles_px : (n, 3) float64
        Silhouettes: centre x, y and radius.
    camera : Camera
        Its lens distortion is undone.
    ball_radius_m : float
        Radius of the ball.
    gravity_m_s2 : (3,) float64
        Expected, camera frame.
    drag_per_m : float
        Expected: -drag_per_m |v| v.
    shared : float
        Number of circles in which an event is seen: so much less they tell than as many independent ones.
    """
    centres_m = camera.ball_centre_m(circles_px[:, 0], circles_px[:, 1], circles_px[:, 2], ball_radius_m)
    places = camera.focal_px / centres_m[:, 2:] * [1.0, 1.0, ball_radius_m]
    places[:, :2] *= centres_m[:, :2]
    reference_us, half_s = float(t_us[0] + t_us[-1]) / 2, float(t_us[-1] - t_us[0]) * 0.5e-6
    tau_s = (t_us - reference_us) * 1e-6
    motion = np.empty(16)
    guess_motion(motion, centres_m, tau_s, gravity_m_s2, drag_per_m)
    information, gradient, residuals_px, noise_px = fit_motion(
        motion,
        places,
        tau_s,
        half_s,
        (camera.focal_px, ball_radius_m),
        ACCELERATION_PRIOR,
        (*NOISE_PX, NOISE_CIRCLES),
        RADIUS_STD_PX,
    )
    acceleration = motion[6:15].reshape(3, 3).copy()
    return FittedMotion(
        reference_us,
        half_s,
        motion[:3].copy(),
        motion[3:6] + half_s * _TO_VELOCITY @ acceleration,
        acceleration,
        float(motion[15]),
        information / shared,
        gradient / shared,
        residuals_px,
        noise_px,
    )
