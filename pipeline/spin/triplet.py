"""The paper's spin from Triplet Matching's flow (section 3.3), and the full-rank solve of the same flow."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..kernels.sphere import surface_velocity
from ..results import MethodResult, Packet, SpinEstimate
from ..stage import Context, SpinMethod
from ..stages.flow import FlowResult
from ..stages.rate import RateResult
from .parameters import TAKES_RATE, SpinParameters

Floats = NDArray[np.float64]

# The full-rank solve needs logo seen from several sides: with all e_r within about 6 degrees of each other
# (sin^2 = 0.01) the component along them is left to noise.
FEWEST_DIRECTIONS = 0.01
# Local flow is normal flow: its directions follow the logo's edges, and it is shorter than the flow. Beyond scatter and
# lost components the axes of 163 simulated shots are off by 15 degrees (1 sigma, both directions together), and the
# magnitudes from flow alone are 0.86 of the true ones in the median, 0.6 to 1.1 in 80 %.
FLOW_BIAS, SHORTER = math.radians(15.0) / math.sqrt(2.0), 0.3
# Directions in which less than so much of the spin is seen have no bound on what is lost: at most the spin itself.
LEAST_SEEN = 1e-3


class TripletSpin:
    """The paper's spin of one shot from flow, slice by slice; the flow is Triplet Matching's but for rivals.

    For v = omega x r the paper's omega = e_r x v / |r| is omega - (e_r . omega) e_r: each event gives the part of the
    spin perpendicular to its e_r only, and their mean loses what the logo's places have in common. A logo that stays
    60 degrees from the axis costs about 25 degrees of axis, sidespin with a logo at 45 degrees half the magnitude.
    `least_squares` solves sum(I - e_r e_r^T) omega = sum e_r x v / |r| and loses nothing by that; what is left is
    that the flow of a local method is normal flow.

    The paper has no refusal besides having no flow. Here a spin above `max_spin_rps` is refused besides: flow of the
    outline, at a pad of 0, gives hundreds of rps.

    Magnitude: section 3.3 takes "a better estimate of the spin magnitude" from the event rate, and only that explains
    the errors of 0.5 rps with 0.1 rps spread at 100 ms beside 30 rps at 10 ms (table 1). So once the event rate has
    a period, it gives the magnitude (and t_acc) and the flow gives the axis; `magnitude_from = flow` uses it for t_acc
    alone.
    """

    def __init__(self, parameters: SpinParameters, context: Context, name: str = "triplet") -> None:
        self.name = name
        self.parameters = parameters
        self.context = context
        self.end_us: list[int] = []
        self.counts: list[int] = []
        self.moments: list[Floats] = []  # a slice's sum of e_r x v / |r|, rad/s
        self.squares: list[Floats] = []  # a slice's sum of I - e_r e_r^T

    def estimate(self, end_us: int, flow: FlowResult, rate: RateResult) -> SpinEstimate:
        """The estimate from the shot's slices so far (those of the last spin.window_us)."""
        self._add(flow)
        self._forget(end_us - self.parameters.window_us)
        if not self.counts:
            return SpinEstimate.refused(self.name, "no flow")
        counts = np.array(self.counts, np.float64)
        moments, squares = np.array(self.moments), np.array(self.squares)
        solved = _SOLVERS[self.parameters.triplet_solve](counts, moments, squares)
        if solved is None:
            return SpinEstimate.refused(self.name, "the logo is seen from one side only", int(counts.sum()))
        spin, covariance = solved
        covariance = covariance + FLOW_BIAS**2 * float(spin @ spin) * np.eye(3) + SHORTER**2 * np.outer(spin, spin)
        vector_rps, covariance_rps2 = spin / (2 * math.pi), covariance / (2 * math.pi) ** 2
        if TAKES_RATE[self.parameters.magnitude_from] and rate.spin_rps is not None:
            vector_rps, covariance_rps2 = _with_magnitude(vector_rps, covariance_rps2, rate)
        estimate = SpinEstimate(self.name, vector_rps, covariance_rps2, None, int(counts.sum()))
        return estimate.up_to(self.parameters.max_spin_rps)

    def _add(self, flow: FlowResult) -> None:
        if not len(flow.events):
            return
        velocity = surface_velocity(
            flow.events.points_m, flow.events.normals, flow.vx_px_s, flow.vy_px_s, self.context.camera.focal_px
        )
        moment = np.cross(flow.events.normals, velocity) / self.context.ball_radius_m
        firsts = np.flatnonzero(np.diff(flow.slice_index, prepend=flow.slice_index[0] - 1))
        for first, last in zip(firsts, [*firsts[1:], flow.slice_index.size], strict=True):
            normals = flow.events.normals[first:last]
            self.end_us.append(int(flow.events.t_us[last - 1]))
            self.counts.append(int(last - first))
            self.moments.append(moment[first:last].sum(axis=0))
            self.squares.append((last - first) * np.eye(3) - normals.T @ normals)

    def _forget(self, before_us: int) -> None:
        keep = next((i for i, end_us in enumerate(self.end_us) if end_us >= before_us), len(self.end_us))
        for column in (self.end_us, self.counts, self.moments, self.squares):
            del column[:keep]


def _mean_of_slices(counts: Floats, moments: Floats, squares: Floats) -> tuple[Floats, Floats]:
    """Mean over the slices and its covariance; a single slice is as uncertain as it is long.

    The mean of omega - (e_r . omega) e_r lacks what all places of the logo have in common. How much that would be, were
    the mean inverted, is part of the stated error, besides the slices' spread.
    """
    spins = moments / counts[:, None]
    mean = spins.mean(axis=0)
    if len(spins) == 1:
        return mean, np.eye(3) * float(mean @ mean)
    seen = (squares / counts[:, None, None]).mean(axis=0)
    lost = np.linalg.solve(seen + LEAST_SEEN * np.eye(3), mean) - mean
    return mean, np.cov(spins.T) / len(spins) + np.outer(lost, lost)


def _full_rank(counts: Floats, moments: Floats, squares: Floats) -> tuple[Floats, Floats] | None:
    """Least squares over all slices, with the covariance from the slices' own residuals; None where rank is lost."""
    matrix = squares.sum(axis=0)
    if np.linalg.eigvalsh(matrix)[0] < FEWEST_DIRECTIONS * counts.sum():
        return None
    inverse = np.linalg.inv(matrix)
    spin = inverse @ moments.sum(axis=0)
    if len(moments) == 1:
        return spin, np.eye(3) * float(spin @ spin)
    residuals = moments - squares @ spin
    return spin, inverse @ (residuals.T @ residuals) @ inverse * len(moments) / (len(moments) - 1)


_SOLVERS: dict[str, Callable[[Floats, Floats, Floats], tuple[Floats, Floats] | None]] = {
    "paper": _mean_of_slices,
    "least_squares": _full_rank,
}


def _with_magnitude(vector_rps: Floats, covariance_rps2: Floats, rate: RateResult) -> tuple[Floats, Floats]:
    """The same axis with the event rate's magnitude: across the axis the covariance is scaled, along it replaced."""
    assert rate.spin_rps is not None and rate.spin_std_rps is not None
    length = float(np.linalg.norm(vector_rps))
    if length == 0.0:
        return vector_rps, covariance_rps2
    axis = vector_rps / length
    across = np.eye(3) - np.outer(axis, axis)
    scaled = across @ covariance_rps2 @ across * (rate.spin_rps / length) ** 2
    return rate.spin_rps * axis, scaled + np.outer(axis, axis) * rate.spin_std_rps**2


def start(parameters: SpinParameters, context: Context) -> TripletSpin:
    """No slices yet."""
    return TripletSpin(parameters, context)


def absent(parameters: SpinParameters, reason: str) -> MethodResult:
    """Refusal, because there is no ball."""
    return MethodResult(SpinEstimate.refused("triplet", reason))


def step(
    parameters: SpinParameters, state: TripletSpin, packet: Packet, flow: FlowResult, rate: RateResult
) -> MethodResult:
    """The estimate from the shot up to the end of the tick."""
    return MethodResult(state.estimate(packet.end_us, flow, rate))


STAGE = SpinMethod(
    name="triplet",
    label="Triplet Matching",
    help="The paper's method: mean of e_r x v / |r| over Triplet Matching's flow.",
    inputs=("packet", "flow", "rate"),
    parameters=SpinParameters,
    start=start,
    step=step,
    absent=absent,
    colour=(255, 165, 0),
)
