"""Spin from normal flow: one linear constraint an event, first from local planes, then seen by a turning observer."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ..events import ColumnBatch
from ..kernels.derotated_normal_flow import correlated_covariance, derotated_constraints, position_response
from ..kernels.sphere import spin_rows
from ..kernels.spin import robust_spin, sampled_spin
from ..results import MethodResult, Packet, SpinEstimate
from ..stage import Context, SpinMethod
from ..stages.flow import FlowResult
from ..stages.logo import LogoResult
from ..stages.rate import RateResult
from .parameters import TAKES_RATE, SpinParameters

Floats = NDArray[np.float64]

TAU = 2 * math.pi

# A visible logo gives 100 events in 10 ms before filtering; fewer than this are noise and leftovers of the outline.
FEWEST_EVENTS, FEWEST_PLANES, FEWEST_LINES = 30, 12, 20
# The outline bleeds into the mask where the radius is a pixel or two wrong; so many events must lie deeper.
DEEP_PX, FEWEST_DEEP = 2.0, 20
# Events, lines and planes looked at in one tick. Neighbours overlap some twentyfold, so more cost time and say
# nothing new.
EVENTS, LINES, PLANES, TRIES = 6000, 300, 400, 200
PLANE_SHARE = 0.25  # speeds of planes are good to about a quarter
# How far (rad) the ball may turn within the neighbourhood of an event: little while the guess may be wrong by a
# quarter, which blurs lines by a quarter of the way turned; then far enough to see a line drift.
FIRST_TURNS, NEXT_TURNS = (0.25, 0.5, 0.5), (0.5,)
LONGEST_US = 10_000.0  # within which a line is looked for however slow the spin: a flight does not last much longer
# Neighbourhood and width of a line: 3 px as for the planes; a pixel and its jitter. Lines rounder than this are blobs.
REACH_PX, WIDTH_PX, SHARPEST = 3.0, 1.2, 0.35
# Tracks are not known better than this, and neither is the speed of strokes that are curved and blurred.
POSITION_FLOOR_PX, SPEED_FLOOR = 0.2, 0.03
# By how much speeds may be off together, differently over the ball: at the true spin of simulated balls the lines are
# off by 2 to 5 percent towards the rim that the logo leaves by, by up to 9 in flight (blur, latency, curvature).
BIAS = 0.05
# A line counts for a start if it drifts less than this while the fastest of the starts turns FIRST_TURNS[-1].
STANDS_PX = 0.5
# Residuals in predicted standard deviations. Below GOOD the last tick's answer needs no second thought; above DOUBT
# the events do not move like one turning ball.
GOOD, DOUBT = 1.3, 1.6
# Of the events looked at, so many must lie on lines that drift as one turning ball's do.
FEWEST_SHARE = 0.4
SEED = 1
# The weakest direction of the spin must weigh this much against the strongest, or it is open; and an axis that is not
# known to OPEN_DEG (1 sigma) is no answer: the paper's errors are as large.
OPEN, OPEN_DEG = 1e-4, 25.0
# Nearer to the axis than 30 degrees the line of sight's turning about it says nothing of when the logo reappears.
STEADY_SIGHT = 0.5


@dataclass(frozen=True, slots=True)
class _Fit:
    """A spin (rad/s) with the constraints behind it.

    Attributes
    ----------
    events, rows, speeds, weights : int64 array
        The constraints rows . spin = speeds with their final weights.
    matrix : (3, 3)
        Normal matrix of these.
    scale : float
        Their residuals in predicted standard deviations.
    share : float
        Of the events looked at, how many carry the spin.
    overlap : float
        In how many of the constraints the same event takes part.
    """

    spin: Floats
    events: NDArray[np.int64]
    rows: Floats
    speeds: Floats
    weights: Floats
    matrix: Floats
    scale: float
    share: float
    overlap: float


@dataclass(frozen=True, slots=True, eq=False)
class _Seen(ColumnBatch):
    """Logo events: time, polarity, place on the ball, unit vector from its centre to the camera, off the rim."""

    KINDS: ClassVar = ("i8", "?", "3f8", "3f8", "?")
    t_us: NDArray[np.int64]
    on: NDArray[np.bool_]
    normals: Floats
    sights: Floats
    deep: NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class _Planes(ColumnBatch):
    """Constraints rows . spin = speeds of local planes, fitted in the ball's frame or in the image."""

    KINDS: ClassVar = ("i8", "3f8", "f8", "?")
    t_us: NDArray[np.int64]
    rows: Floats
    speeds: Floats
    in_image: NDArray[np.bool_]


class NormalFlowSpin:
    """Normal flow's spin of one shot, from all its logo events so far (those of the last spin.window_us).

    Every event whose neighbours lie on an edge says how fast the ball's surface moves across that edge: one linear
    constraint on the spin. Averaging such normal flow as if it were full flow is what costs the paper its axis.

    1. Start: planes fitted in the ball's frame and in the image (flow), RANSAC, iteratively reweighted least squares.
    2. Refinement: the same constraints as an observer sees them who turns with the start (derotated), which
       keeps apart the strokes of the logo, and again from there.
    3. Magnitude: where the period of the event rate agrees, it sharpens the length of the vector.
    4. Uncertainty: see `_covariance`.
    """

    def __init__(self, parameters: SpinParameters, context: Context) -> None:
        self.parameters = parameters
        self.context = context
        self.seen, self.planes = _Seen.empty(), _Planes.empty()
        self.tracks = np.empty((0, 4))  # radius, and 1 sigma of position, radius (px) and velocity (px/s), a tick
        self.last: _Fit | None = None
        self.restarted_with = 0  # number of events at the last start from scratch

    def estimate(self, end_us: int, logo: LogoResult, flow: FlowResult, rate: RateResult) -> SpinEstimate:
        """The estimate at the end of a tick."""
        self._add(logo, flow)
        self._forget(end_us - self.parameters.window_us)
        count, deep = len(self.seen), int(self.seen.deep.sum())
        if count < FEWEST_EVENTS:
            return self._refused(f"the logo is hardly seen: {count} events, {FEWEST_EVENTS} are needed")
        if deep < FEWEST_DEEP:
            return self._refused(f"the logo is hardly seen: {deep} events off the rim, {FEWEST_DEEP} are needed")
        if len(self.planes) < FEWEST_PLANES:
            return self._refused(f"{len(self.planes)} events with normal flow, {FEWEST_PLANES} are needed")
        self.last = self._fit()
        if self.last is None:
            return self._refused("the normal flow agrees on no spin")
        return self._judged(self.last, rate)

    def _refused(self, reason: str) -> SpinEstimate:
        self.last = None
        return SpinEstimate.refused("normal_flow", reason, len(self.seen))

    def _add(self, logo: LogoResult, flow: FlowResult) -> None:
        """Take in the tick's events, less those that may be the outline's."""
        own = ~logo.of_outline
        normals, points = logo.normals[own], logo.points_m[own]
        away = points - self.context.ball_radius_m * normals
        depth_px = logo.radius_px - logo.pad_px - np.hypot(logo.x_px[own], logo.y_px[own])
        sights = -away / np.linalg.norm(away, axis=1, keepdims=True)
        seen = _Seen(logo.events.t_us[own], logo.events.on[own], normals, sights, depth_px > DEEP_PX)
        self.seen = _Seen.concatenate([self.seen, seen])
        events, directions = flow.normal_events, flow.normal_direction
        focal_px, ball_radius_m = self.context.camera.focal_px, self.context.ball_radius_m
        rows = spin_rows(events.points_m, events.normals, directions, focal_px, ball_radius_m)
        planes = _Planes(events.t_us, rows, flow.normal_speed_px_s, flow.normal_in_image)
        self.planes = _Planes.concatenate([self.planes, planes])
        tick = [logo.radius_px, logo.position_std_px, logo.radius_std_px, logo.velocity_std_px_s]
        self.tracks = np.concatenate([self.tracks, [tick]])

    def _forget(self, before_us: int) -> None:
        if len(self.seen) and self.seen.t_us[0] < before_us:
            self.seen = self.seen.between(before_us, math.inf)
        if len(self.planes) and self.planes.t_us[0] < before_us:
            self.planes = self.planes[self.planes.t_us >= before_us]

    def _fit(self) -> _Fit | None:
        """The best spin: last tick's brought up to date if that is good, else the best of all starts.

        A spin that is not good is only tried anew when the events are a quarter more, which bounds the time a tick
        takes on events that no spin explains.
        """
        if self.last is not None:
            fit = self._refined(self.last.spin, NEXT_TURNS)
            if fit is not None and (fit.scale < GOOD or len(self.seen) < 1.25 * self.restarted_with):
                return fit
        self.restarted_with = len(self.seen)
        starts = [self._start(~self.planes.in_image), self._start(self.planes.in_image)]
        fits = [self._refined(start, FIRST_TURNS) for start in starts if start is not None]
        if self.last is not None:
            fits.append(self._refined(self.last.spin, NEXT_TURNS))
        found = [fit for fit in fits if fit is not None]
        if len(found) < 2:
            return found[0] if found else None
        turn_s = min(FIRST_TURNS[-1] / max(float(np.linalg.norm(fit.spin)) for fit in found), LONGEST_US * 1e-6)
        return max(found, key=lambda fit: self._standing(fit.spin, turn_s))

    def _standing(self, spin: Floats, turn_s: float) -> float:
        """Share of the events that lie on a line which stands still for so long if the ball turns like this."""
        radius_px = self._track()[0]
        (t_us, normals, on), stride, looked_at = self._looked_at()
        _, rows, speeds, _, _ = derotated_constraints(
            t_us, normals, on, spin, stride, REACH_PX / radius_px, turn_s * 1e6, WIDTH_PX / radius_px, SHARPEST
        )
        return float(np.sum(np.abs(speeds - rows @ spin) * turn_s * radius_px < STANDS_PX)) / looked_at

    def _start(self, which: NDArray[np.bool_]) -> Floats | None:
        """Spin (rad/s) that most of these planes support; None if there are too few."""
        rows, speeds = self.planes.rows[which], self.planes.speeds[which]
        if len(speeds) < FEWEST_PLANES:
            return None
        stride = max(1, len(speeds) // PLANES)
        rows, speeds = np.ascontiguousarray(rows[::stride]), np.ascontiguousarray(speeds[::stride])
        highest = 1.1 * TAU * self.parameters.max_spin_rps
        spin, supported = sampled_spin(rows, speeds, PLANE_SHARE, highest, TRIES, SEED)
        if supported == 0.0:
            return None
        return robust_spin(rows, speeds, PLANE_SHARE * speeds, spin, 10)[0]

    def _refined(self, spin: Floats, turns: tuple[float, ...]) -> _Fit | None:
        """The spin that the lines ask for which an observer sees who turns with the guess; None if they do not."""
        (t_us, normals, on), stride, looked_at = self._looked_at()
        sights = self.seen.sights[:: self._thinning()]
        radius_px, position_px, _, velocity_px_s = self._track()
        fit = None
        for turn in turns:
            speed = float(np.linalg.norm(spin))
            if not 1.0 < speed < 1.3 * TAU * self.parameters.max_spin_rps:
                return None
            events, rows, speeds, variances, sizes = derotated_constraints(
                t_us, normals, on, spin, stride, REACH_PX / radius_px, min(turn / speed * 1e6, LONGEST_US),
                WIDTH_PX / radius_px, SHARPEST,
            )  # fmt: skip
            if len(events) < FEWEST_LINES:
                return None
            facing = np.sum(sights[events] * normals[events], axis=1)
            variances += (speed * position_px / radius_px / facing) ** 2 + (velocity_px_s / radius_px) ** 2
            stds = np.sqrt(variances + (SPEED_FLOOR * speed) ** 2)
            spin, weights, matrix, scale = robust_spin(rows, speeds, stds, spin, 10)
            share = float(np.sum(weights * stds**2)) / looked_at
            overlap = max(float(sizes.mean()) / stride, 1.0)
            fit = _Fit(spin, events * self._thinning(), rows, speeds, weights, matrix, scale, share, overlap)
        return fit

    def _thinning(self) -> int:
        return max(1, len(self.seen) // EVENTS)

    def _looked_at(self) -> tuple[tuple[NDArray[np.int64], Floats, NDArray[np.bool_]], int, int]:
        """Thinned columns t_us, normals, on; every which event of them is looked at; and how many those are."""
        thin = self._thinning()
        t_us = np.ascontiguousarray(self.seen.t_us[::thin])
        stride = max(1, len(t_us) // LINES)
        looked_at = len(range(stride // 2, len(t_us), stride))
        return (t_us, np.ascontiguousarray(self.seen.normals[::thin]), self.seen.on[::thin].copy()), stride, looked_at

    def _track(self) -> tuple[float, float, float, float]:
        """Radius of the ball now, and mean 1 sigmas of position, radius and velocity over the shot."""
        _, position_px, radius_std_px, velocity_px_s = (float(value) for value in self.tracks.mean(axis=0))
        floor = POSITION_FLOOR_PX
        return float(self.tracks[-1, 0]), max(position_px, floor), max(radius_std_px, floor), velocity_px_s

    def _judged(self, fit: _Fit, rate: RateResult) -> SpinEstimate:
        """The estimate, or the reason to doubt it."""
        if fit.share < FEWEST_SHARE:
            return self._doubted(f"only {100 * fit.share:.0f} % of the events move like one turning ball")
        if fit.scale > DOUBT:
            return self._doubted(f"the flow is not that of one turning ball: it scatters {fit.scale:.1f} times as much")
        covariance = self._covariance(fit)
        if covariance is None:
            return self._doubted("the logo's place leaves a part of the spin open")
        spin_rps, covariance_rps2 = fit.spin / TAU, covariance / TAU**2
        if TAKES_RATE[self.parameters.magnitude_from] and rate.spin_rps is not None:
            spin_rps, covariance_rps2 = self._with_rate(spin_rps, covariance_rps2, rate)
        estimate = SpinEstimate("normal_flow", spin_rps, covariance_rps2, None, len(self.seen))
        if estimate.axis_std_deg is None or estimate.axis_std_deg > OPEN_DEG:
            return self._doubted(
                f"the logo's place leaves the axis open by {estimate.axis_std_deg or 180.0:.0f} degrees"
            )
        return estimate.up_to(self.parameters.max_spin_rps)

    def _doubted(self, reason: str) -> SpinEstimate:
        """A refusal that keeps the fit: the next tick may start from it."""
        return SpinEstimate.refused("normal_flow", reason, len(self.seen))

    def _with_rate(self, spin_rps: Floats, covariance_rps2: Floats, rate: RateResult) -> tuple[Floats, Floats]:
        """The estimate after seeing the event rate's magnitude, if the two are within three sigma (Kalman update).

        The logo reappears when the ball has turned once as seen from the camera. While the ball flies past, the line
        of sight turns about the axis too, and that is added. A rate that disagrees has caught the strokes of the logo
        or one of its multiples, and is left alone.
        """
        assert rate.spin_rps is not None and rate.spin_std_rps is not None
        axis = spin_rps / np.linalg.norm(spin_rps)
        seen = [sight - axis * (sight @ axis) for sight in (self.seen.sights[0], self.seen.sights[-1])]
        turned_rps = 0.0
        if min(float(np.linalg.norm(across)) for across in seen) > STEADY_SIGHT:
            turned = math.atan2(float(np.linalg.det([axis, *seen])), float(seen[0] @ seen[1]))
            turned_rps = turned / TAU / max((self.seen.t_us[-1] - self.seen.t_us[0]) * 1e-6, 1e-6)
        off_rps = rate.spin_rps + turned_rps - float(np.linalg.norm(spin_rps))
        variance = float(axis @ covariance_rps2 @ axis) + rate.spin_std_rps**2
        if off_rps**2 > 9.0 * variance:
            return spin_rps, covariance_rps2
        gain = covariance_rps2 @ axis / variance
        return spin_rps + gain * off_rps, covariance_rps2 - np.outer(gain, axis @ covariance_rps2)

    def _covariance(self, fit: _Fit) -> Floats | None:
        """(3, 3) covariance of the spin, (rad/s)^2; None where the constraints do not fix it.

        The sum of what is known to go wrong: the scatter from block to block of one radian of turning (constraints
        within a block share events and a track); the scatter of the constraints, counted as if each event took part
        in one only; the uncertainty of the ball's place and radius; and a bias of speeds that differs over the ball.
        All of it grows with the square of a misfit.
        """
        lengths = np.linalg.eigvalsh(fit.matrix)
        if lengths[0] <= OPEN * lengths[-1]:
            return None
        inverse = np.linalg.inv(fit.matrix)
        gain = (fit.rows * fit.weights[:, None]) @ inverse
        radius_px, position_px, radius_std_px, _ = self._track()
        normals = self.seen.normals[fit.events]
        bias: Floats = BIAS * fit.speeds[:, None] * normals
        common = correlated_covariance(
            gain,
            fit.speeds - fit.rows @ fit.spin,
            np.linalg.norm(fit.spin) * 1e-6 * self.seen.t_us[fit.events],
            position_response(normals, self.seen.sights[fit.events], fit.rows, fit.spin, radius_px),
            bias,
            np.array([position_px, position_px, radius_std_px]),
        )
        total: Floats = (common + fit.overlap * inverse) * max(fit.scale, 1.0) ** 2
        return total


# Normal flow is trusted where it knows the axis to 7 degrees (1 sigma) and the magnitude to 3 rps or a tenth: as good
# as the best of the paper's table at 100 ms. On simulated shots the error beyond which one answer in ten lies is 1.4
# of these sigmas.
TRUSTED_AXIS_DEG, TRUSTED_RPS, TRUSTED_SHARE = 7.0, 3.0, 0.1


def is_trusted(estimates: Mapping[str, SpinEstimate]) -> bool:
    """Whether normal flow is sure of itself, no other method excludes it, and `contrast` has no answer.

    Where that is not trusted, all witnesses together leave another spin open, of whom the normal flow is one.
    """
    estimate, contrast = estimates["normal_flow"], estimates.get("contrast")
    if contrast is not None and contrast.status == "ok":
        return False
    if any(other.against == "normal_flow" for other in estimates.values()):
        return False
    magnitude, std, axis_std = estimate.magnitude_rps, estimate.magnitude_std_rps, estimate.axis_std_deg
    if magnitude is None or std is None or axis_std is None:
        return False
    return axis_std <= TRUSTED_AXIS_DEG and std <= max(TRUSTED_RPS, TRUSTED_SHARE * magnitude)


def start(parameters: SpinParameters, context: Context) -> NormalFlowSpin:
    """No events yet."""
    return NormalFlowSpin(parameters, context)


def absent(parameters: SpinParameters, reason: str) -> MethodResult:
    """Refusal, because there is no ball."""
    return MethodResult(SpinEstimate.refused("normal_flow", reason))


def step(
    parameters: SpinParameters,
    state: NormalFlowSpin,
    packet: Packet,
    logo: LogoResult,
    flow: FlowResult,
    rate: RateResult,
) -> MethodResult:
    """The estimate from the shot up to the end of the tick."""
    return MethodResult(state.estimate(packet.end_us, logo, flow, rate))


STAGE = SpinMethod(
    name="normal_flow",
    label="Normal flow",
    help="Each event's normal flow as one linear constraint on the spin: RANSAC, then reweighted least squares.",
    inputs=("packet", "logo", "flow", "rate"),
    parameters=SpinParameters,
    start=start,
    step=step,
    absent=absent,
    colour=(60, 195, 210),
    is_trusted=is_trusted,
)
