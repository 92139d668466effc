"""Trajectory: the spin that bends the flight, from the circles of the shot so far."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from ...kernels.arrays import Floats
from ...parameters import ParameterGroup, tunable
from ...results import Packet, ReadOnlyArrays, SpinEstimate
from ...stage import Context, SpinMethod
from ...stages.track_result import BallTrack
from .likelihood import LIFT_MAX, FlightLikelihood, SetUp, SpinAcross, bend_over_largest_lift, spin_across
from .motion import FittedMotion, fit_flight

METHOD = "trajectory"
# A lift stronger than any spin's explains a bend if it leaves a quarter of the misfit: one that does not saturate
# leaves 0.03 to 0.15 of it (six flights of a simulator that is not ours), a wrong camera.up or a contact most.
STRONG_LIFT_SHARE = 0.25


@dataclass(frozen=True, kw_only=True)
class TrajectoryParameters(ParameterGroup):
    """Lift, drag and plumb line of a set-up, and the demands on a flight."""

    lift_scale: float = tunable(1.0, 0.1, 5.0, 0.01, "", "lift of the spin over that measured on real balls")
    lift_std: float = tunable(0.12, 0.001, 1.0, 0.01, "", "1 sigma of lift_scale")
    # Real flights: 0.145 to 0.19 /m (quartiles) in one set-up, 0.125 in another.
    drag_per_m: float = tunable(0.155, 0.01, 1.0, 0.005, "1/m", "drag slows the ball by drag_per_m times speed squared")
    drag_std_per_m: float = tunable(0.02, 0.0001, 0.5, 0.005, "1/m", "1 sigma of drag_per_m")
    plumb_std_deg: float = tunable(
        1.0, 0.01, 45.0, 0.1, "deg", "1 sigma of camera.up against the plumb line, in each direction"
    )
    # A ball at rest that is struck spins about an axis across its flight: the push changes the velocity along itself
    # and the spin across itself. Flights whose spin and heading each have a spread of 8 degrees, as the paper's thrower
    # and our simulator, leave 11. Of 4,024 real shots 68 % lie within about 10, one in twenty is more than 35 degrees
    # out (docs/trajectory.md).
    gyro_std_deg: float = tunable(
        11.0, 0.0, 60.0, 1.0, "deg", "1 sigma of the axis out of the plane across the flight, which bends nothing"
    )
    fewest_circles: int = tunable(6, 4, 1000, 1, "circles", "measured circles needed for an answer")
    shortest_us: int = tunable(25_000, 1000, 1_000_000, 1000, "us", "time of flight needed for an answer")
    scatter_px: float = tunable(
        0.5, 0.05, 20.0, 0.05, "px", "scatter of the circles about one flight beyond which it is none"
    )
    misfit: float = tunable(
        8.0, 1.0, 1000.0, 1.0, "", "chi-squared per degree of freedom beyond which no spin explains the bend"
    )
    axis_std_deg: float = tunable(30.0, 1.0, 180.0, 1.0, "deg", "largest stated error of the axis (1 sigma)")


@dataclass(frozen=True, slots=True, eq=False)
class TrajectoryResult(ReadOnlyArrays):
    """Spin by the flight of the present shot so far, and what it rests on.

    Attributes
    ----------
    estimate : SpinEstimate
        The spin across the flight; along it there is none on average, with the error that this may have.
    motion : FittedMotion, optional
        The flight; None where it is too short or the ball does not fly.
    likelihood : FlightLikelihood, optional
        Likelihood of spins by the flight; None without a motion, or where the motion is no free flight.
    across : SpinAcross, optional
        What the estimate is made of, also of a refused one; None without a likelihood.
    """

    estimate: SpinEstimate
    motion: FittedMotion | None = None
    likelihood: FlightLikelihood | None = None
    across: SpinAcross | None = None

    def log_likelihood(self, spins_rps: ArrayLike) -> Floats:
        """(k,) logarithmic likelihood of spins (k, 3) in rps by the flight; zeros where the flight tells nothing.

        See `FlightLikelihood.log_likelihood`; logarithms of independent witnesses add up.
        """
        if self.likelihood is None:
            return np.zeros(len(np.atleast_2d(np.asarray(spins_rps))))
        return self.likelihood.log_likelihood(spins_rps)


@dataclass(slots=True)
class TrajectoryState:
    """The shot's circles: scene time (us), centre x, y and radius (px)."""

    context: Context
    circles: list[tuple[float, float, float, float]] = field(default_factory=list)
    result: TrajectoryResult | None = None


def start(parameters: TrajectoryParameters, context: Context) -> TrajectoryState:
    """No circles yet."""
    return TrajectoryState(context)


def absent(parameters: TrajectoryParameters, reason: str) -> TrajectoryResult:
    """Refusal, because there is no ball."""
    return TrajectoryResult(SpinEstimate.refused(METHOD, reason))


def step(parameters: TrajectoryParameters, state: TrajectoryState, packet: Packet, ball: BallTrack) -> TrajectoryResult:
    """The estimate from the circles up to the end of this tick."""
    if ball.measured is not None:
        state.circles.append((ball.t_us, ball.measured.x_px, ball.measured.y_px, ball.measured.radius_px))
        state.result = None
    if state.result is None:
        reason = _no_flight(parameters, state, ball)
        state.result = absent(parameters, reason) if reason else _estimated(parameters, state)
    return state.result


def set_up_of(parameters: TrajectoryParameters, up: tuple[float, ...]) -> SetUp:
    """The set-up by these parameters and camera.up."""
    return SetUp(
        np.array(up),
        parameters.plumb_std_deg,
        parameters.drag_per_m,
        parameters.drag_std_per_m,
        parameters.lift_scale,
        parameters.lift_std,
    )


def _no_flight(parameters: TrajectoryParameters, state: TrajectoryState, ball: BallTrack) -> str | None:
    """Reason why there is no flight to look at; None if there is one."""
    if state.context["track.ball"] == "fixed":
        return "a ball that stays in place has no flight"
    if not ball.is_shot:
        return "the ball rolls or lies: only a free flight tells of the spin"
    count = len(state.circles)
    span_us = state.circles[-1][0] - state.circles[0][0] if count else 0.0
    if count < parameters.fewest_circles or span_us < parameters.shortest_us:
        return (
            f"the flight is too short: {count} circles in {span_us / 1000:.0f} ms, {parameters.fewest_circles} in "
            f"{parameters.shortest_us / 1000:.0f} ms are needed"
        )
    return None


def _estimated(parameters: TrajectoryParameters, state: TrajectoryState) -> TrajectoryResult:
    """The spin by all circles so far."""
    circles, context = np.array(state.circles), state.context
    set_up = set_up_of(parameters, context.camera.up)
    motion = fit_flight(
        circles[:, 0],
        circles[:, 1:],
        context.camera,
        context.ball_radius_m,
        set_up.gravity_m_s2,
        set_up.drag_per_m,
        max(1.0, context["track.contour_us"] / context["track.tick_us"]),
    )
    count, scatter_px = motion.circles, float(motion.noise_px[0])
    if not scatter_px <= parameters.scatter_px:
        reason = f"the circles lie {scatter_px:.1f} px off one free flight, {parameters.scatter_px:g} are allowed"
        return TrajectoryResult(SpinEstimate.refused(METHOD, reason, count), motion)
    likelihood = FlightLikelihood.of(motion, set_up, context.ball_radius_m)
    across = spin_across(likelihood, context["spin.max_spin_rps"])
    if across.misfit > parameters.misfit:
        reason = _unexplained(parameters, likelihood, across.misfit)
        return TrajectoryResult(SpinEstimate.refused(METHOD, reason, count), motion)
    likelihood = likelihood.scaled(max(across.misfit, 1.0))
    estimate = _estimate(parameters, across, count)
    return TrajectoryResult(estimate, motion, likelihood, across)


def _unexplained(parameters: TrajectoryParameters, likelihood: FlightLikelihood, misfit: float) -> str:
    """Reason why a flight's bend is no spin's, in words."""
    times, misfit_by_lift = bend_over_largest_lift(likelihood)
    if times > 1.0 and misfit_by_lift <= STRONG_LIFT_SHARE * misfit:
        return (
            f"the flight is bent like a spinning ball's, but {times:.1f} times as strongly as any spin bends a real "
            f"one (lift coefficient up to {LIFT_MAX * parameters.lift_scale:.2g}): a simulation whose lift does not "
            "saturate, or wrong optics or ball.diameter_mm"
        )
    return (
        f"no spin bends a flight like this one ({math.sqrt(misfit):.1f} sigma): check camera.up and the optics, or the "
        "ball touched something"
    )


def _estimate(parameters: TrajectoryParameters, across: SpinAcross, count: int) -> SpinEstimate:
    """The spin across the flight with its covariance, wide where lift saturates, or a refusal without an axis."""
    gyro_rad = math.radians(parameters.gyro_std_deg)
    axis_std_deg = math.degrees(math.hypot(across.axis_std_rad, gyro_rad))
    if axis_std_deg > parameters.axis_std_deg:
        reason = f"the flight is bent too little: the axis is known to +- {min(axis_std_deg, 180.0):.0f} degrees"
        return SpinEstimate.refused(METHOD, reason, count)
    axis, along = across.axis, across.along
    side = np.cross(along, axis)
    covariance = across.magnitude_std_rps**2 * np.outer(axis, axis) + across.magnitude_rps**2 * (
        across.axis_std_rad**2 * np.outer(side, side) + gyro_rad**2 * np.outer(along, along)
    )
    return SpinEstimate(METHOD, across.magnitude_rps * axis, covariance, None, count)


# Trusted where the axis is known to 20 degrees (1 sigma), the error up to which the paper's tables count an answer as
# right, and the magnitude to a third: three sigma from no spin at all.
TRUSTED_AXIS_DEG, TRUSTED_SHARE = 20.0, 0.333


def is_trusted(estimates: Mapping[str, SpinEstimate]) -> bool:
    """Whether the flight tells the spin closely enough, and no other method excludes that it is one flight."""
    estimate = estimates[METHOD]
    if any(other.against == METHOD for other in estimates.values()):
        return False
    magnitude, std, axis_std = estimate.magnitude_rps, estimate.magnitude_std_rps, estimate.axis_std_deg
    if magnitude is None or std is None or axis_std is None:
        return False
    return axis_std <= TRUSTED_AXIS_DEG and std <= TRUSTED_SHARE * magnitude


STAGE = SpinMethod(
    name=METHOD,
    label="Trajectory",
    help="Spin that bends the flight as the circles show it: gravity, drag and saturating Magnus lift. Needs no logo.",
    inputs=("packet", "ball"),
    parameters=TrajectoryParameters,
    reads=("track.ball", "track.contour_us", "track.tick_us", "spin.max_spin_rps"),
    start=start,
    step=step,
    absent=absent,
    colour=(165, 60, 165),
    is_trusted=is_trusted,
    is_last_resort=True,
)
