"""Spin from normal flow: one linear constraint an event, first from local planes, then seen by a turning observer."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..camera import Setting
from ..kernels.comoving import comoving_constraints, position_response
from ..kernels.sphere import spin_rows
from ..kernels.spin import robust_spin, sampled_spin
from ..results import SpinEstimate
from .flow import FlowResult
from .logo import LogoResult

if TYPE_CHECKING:
    from .spin import SpinParameters

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
LONGEST_US = 10_000  # within which a line is looked for however slow the spin: a flight does not last much longer
# Neighbourhood and width of a line: 3 px as for the planes; a pixel and its jitter. Lines rounder than this are blobs.
REACH_PX, WIDTH_PX, SHARPEST = 3.0, 1.2, 0.35
# Tracks are not known better than this, and neither is the speed of strokes that are curved and blurred.
POSITION_FLOOR_PX, SPEED_FLOOR = 0.2, 0.03
# By how much all speeds may be off together, differently over the ball: what blur, latency and curvature do.
BIAS = 0.05
# A line counts for a start if it drifts less than this while the fastest of the starts turns FIRST_TURNS[-1].
STANDS_PX = 0.5
# Residuals in predicted standard deviations. Below GOOD the last tick's answer needs no second thought; above DOUBT
# the events do not move like one turning ball.
GOOD, DOUBT = 1.3, 1.8
# Of the events looked at, so many must lie on lines that drift as one turning ball's do.
FEWEST_SHARE = 0.4
SEED = 1


@dataclass(frozen=True, slots=True)
class _Fit:
    """A spin (rad/s) with the constraints behind it; `share` of the events looked at carry it.

    overlap : in how many of the constraints the same event takes part
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


class NormalFlowSpin:
    """Normal flow's spin of one shot, from all its logo events so far (those of the last spin.window_us).

    Every event whose neighbours lie on an edge says how fast the ball's surface moves across that edge: one linear
    constraint on the spin. Averaging such normal flow as if it were full flow is what costs the paper its axis.

    1. Start: planes fitted in the ball's frame and in the image (flow), RANSAC, iteratively reweighted least squares.
    2. Refinement: the same constraints as an observer sees them who turns with the start (kernels.comoving), which
       keeps apart the strokes of the logo, and again from there.
    3. Uncertainty: the scatter of the constraints, taken in blocks of one radian of turning because neighbouring
       ones share their events, plus what the uncertainty of the ball's place and radius does to the spin.
    """

    def __init__(self, parameters: SpinParameters, setting: Setting) -> None:
        self.parameters = parameters
        self.setting = setting
        self.t_us = np.empty(0, np.int64)
        self.on = np.empty(0, np.bool_)
        self.normals = np.empty((0, 3))
        self.sights = np.empty((0, 3))  # unit vectors from the ball's centre to the camera
        self.deep = np.empty(0, np.bool_)
        self.plane_t_us = np.empty(0, np.int64)
        self.plane_rows = np.empty((0, 3))
        self.plane_speeds = np.empty(0)
        self.plane_in_image = np.empty(0, np.bool_)
        self.tracks = np.empty((0, 4))  # radius, and 1 sigma of position, radius (px) and velocity (px/s), a tick
        self.last: _Fit | None = None

    def estimate(self, end_us: int, logo: LogoResult, flow: FlowResult) -> SpinEstimate:
        """The estimate at the end of a tick."""
        self._add(logo, flow)
        self._forget(end_us - self.parameters.window_us)
        count, deep = len(self.t_us), int(self.deep.sum())
        if count < FEWEST_EVENTS:
            return self._refused(f"the logo is hardly seen: {count} events, {FEWEST_EVENTS} are needed")
        if deep < FEWEST_DEEP:
            return self._refused(f"the logo is hardly seen: {deep} events off the rim, {FEWEST_DEEP} are needed")
        if len(self.plane_speeds) < FEWEST_PLANES:
            return self._refused(f"{len(self.plane_speeds)} events with normal flow, {FEWEST_PLANES} are needed")
        self.last = self._fit()
        if self.last is None:
            return self._refused("the normal flow agrees on no spin")
        return self._judged(self.last)

    def _refused(self, reason: str) -> SpinEstimate:
        self.last = None
        return SpinEstimate.refused("normal_flow", reason, len(self.t_us))

    def _add(self, logo: LogoResult, flow: FlowResult) -> None:
        """Take in the tick's events, less those that may be the outline's."""
        own = ~logo.of_outline
        normals, points = logo.normals[own], logo.points_m[own]
        away = points - self.setting.ball_radius_m * normals
        depth_px = logo.radius_px - logo.pad_px - np.hypot(logo.x_px[own], logo.y_px[own])
        self.t_us = np.concatenate([self.t_us, logo.events.t_us[own]])
        self.on = np.concatenate([self.on, logo.events.on[own]])
        self.normals = np.concatenate([self.normals, normals])
        self.sights = np.concatenate([self.sights, -away / np.linalg.norm(away, axis=1, keepdims=True)])
        self.deep = np.concatenate([self.deep, depth_px > DEEP_PX])
        rows = spin_rows(
            flow.normal_points_m, flow.normal_normals, flow.normal_direction, self.setting.camera.focal_px,
            self.setting.ball_radius_m,
        )  # fmt: skip
        self.plane_t_us = np.concatenate([self.plane_t_us, flow.normal_t_us])
        self.plane_rows = np.concatenate([self.plane_rows, rows])
        self.plane_speeds = np.concatenate([self.plane_speeds, flow.normal_speed_px_s])
        self.plane_in_image = np.concatenate([self.plane_in_image, flow.normal_in_image])
        tick = [logo.radius_px, logo.position_std_px, logo.radius_std_px, logo.velocity_std_px_s]
        self.tracks = np.concatenate([self.tracks, [tick]])

    def _forget(self, before_us: int) -> None:
        if len(self.t_us) and self.t_us[0] < before_us:
            first = int(np.searchsorted(self.t_us, before_us))
            self.t_us, self.on, self.deep = self.t_us[first:], self.on[first:], self.deep[first:]
            self.normals, self.sights = self.normals[first:], self.sights[first:]
        if len(self.plane_t_us) and self.plane_t_us[0] < before_us:
            keep = self.plane_t_us >= before_us
            self.plane_t_us, self.plane_rows = self.plane_t_us[keep], self.plane_rows[keep]
            self.plane_speeds, self.plane_in_image = self.plane_speeds[keep], self.plane_in_image[keep]

    def _fit(self) -> _Fit | None:
        """The best spin: last tick's brought up to date if it was good, else the best of all starts."""
        if self.last is not None and self.last.scale < GOOD:
            fit = self._refined(self.last.spin, NEXT_TURNS)
            if fit is not None and fit.scale < GOOD:
                return fit
        starts = [self._start(~self.plane_in_image), self._start(self.plane_in_image)]
        fits = [self._refined(start, FIRST_TURNS) for start in starts if start is not None]
        if self.last is not None:
            fits.append(self._refined(self.last.spin, NEXT_TURNS))
        found = [fit for fit in fits if fit is not None]
        if len(found) < 2:
            return found[0] if found else None
        turn_s = FIRST_TURNS[-1] / max(float(np.linalg.norm(fit.spin)) for fit in found)
        return max(found, key=lambda fit: self._standing(fit.spin, turn_s))

    def _standing(self, spin: Floats, turn_s: float) -> float:
        """Share of the events that lie on a line which stands still for so long if the ball turns like this."""
        radius_px = self._track()[0]
        (t_us, normals, on), stride, looked_at = self._looked_at()
        _, rows, speeds, _, _, _ = comoving_constraints(
            t_us, normals, on, spin, stride, REACH_PX / radius_px, turn_s * 1e6, WIDTH_PX / radius_px, SHARPEST
        )
        return float(np.sum(np.abs(speeds - rows @ spin) * turn_s * radius_px < STANDS_PX)) / looked_at

    def _start(self, which: NDArray[np.bool_]) -> Floats | None:
        """Spin (rad/s) that most of these planes support; None if there are too few."""
        rows, speeds = self.plane_rows[which], self.plane_speeds[which]
        if len(speeds) < FEWEST_PLANES:
            return None
        stride = max(1, len(speeds) // PLANES)
        rows, speeds = np.ascontiguousarray(rows[::stride]), np.ascontiguousarray(speeds[::stride])
        highest = 1.1 * TAU * self.setting.max_spin_rps
        spin, supported = sampled_spin(rows, speeds, PLANE_SHARE, highest, TRIES, SEED)
        if supported == 0.0:
            return None
        return robust_spin(rows, speeds, PLANE_SHARE * speeds, spin, 10)[0]

    def _refined(self, spin: Floats, turns: tuple[float, ...]) -> _Fit | None:
        """The spin that the lines ask for which an observer sees who turns with the guess; None if they do not."""
        (t_us, normals, on), stride, looked_at = self._looked_at()
        sights = self.sights[:: self._thinning()]
        radius_px, position_px, _, velocity_px_s = self._track()
        fit = None
        for turn in turns:
            speed = float(np.linalg.norm(spin))
            if not 1.0 < speed < 1.3 * TAU * self.setting.max_spin_rps:
                return None
            events, rows, speeds, variances, sizes, tried = comoving_constraints(
                t_us, normals, on, spin, stride, REACH_PX / radius_px, min(turn / speed * 1e6, LONGEST_US),
                WIDTH_PX / radius_px, SHARPEST,
            )  # fmt: skip
            if len(events) < FEWEST_LINES:
                return None
            facing = np.sum(sights[events] * normals[events], axis=1)
            variances += (speed * position_px / radius_px / facing) ** 2 + (velocity_px_s / radius_px) ** 2
            stds = np.sqrt(variances + (SPEED_FLOOR * speed) ** 2)
            spin, weights, matrix, scale = robust_spin(rows, speeds, stds, spin, 10)
            share = float(np.sum(weights * stds**2)) / looked_at; self.agree=float(np.sum(weights * stds**2)) / tried; self.lineshare=len(events)/tried
            overlap = max(float(sizes.mean()) / stride, 1.0)
            fit = _Fit(spin, events * self._thinning(), rows, speeds, weights, matrix, scale, share, overlap)
        return fit

    def _thinning(self) -> int:
        return max(1, len(self.t_us) // EVENTS)

    def _looked_at(self) -> tuple[tuple[NDArray[np.int64], Floats, NDArray[np.bool_]], int, int]:
        """Thinned columns t_us, normals, on; every which event of them is looked at; and how many those are."""
        thin = self._thinning()
        t_us = np.ascontiguousarray(self.t_us[::thin])
        stride = max(1, len(t_us) // LINES)
        looked_at = len(range(stride // 2, len(t_us), stride))
        return (t_us, np.ascontiguousarray(self.normals[::thin]), self.on[::thin].copy()), stride, looked_at

    def _track(self) -> tuple[float, float, float, float]:
        """Radius of the ball now, and mean 1 sigmas of position, radius and velocity over the shot."""
        _, position_px, radius_std_px, velocity_px_s = (float(value) for value in self.tracks.mean(axis=0))
        floor = POSITION_FLOOR_PX
        return float(self.tracks[-1, 0]), max(position_px, floor), max(radius_std_px, floor), velocity_px_s

    def _judged(self, fit: _Fit) -> SpinEstimate:
        """The estimate, or the reason to doubt it."""
        if fit.share < FEWEST_SHARE:
            return self._doubted(f"only {100 * fit.share:.0f} % of the events move like one turning ball")
        if fit.scale > DOUBT:
            return self._doubted(f"the events scatter {fit.scale:.1f} times more than one turning ball's")
        speed = float(np.linalg.norm(fit.spin))
        if speed > TAU * self.setting.max_spin_rps:
            return self._doubted(f"{speed / TAU:.0f} rps is above spin.max_spin_rps")
        covariance = self._covariance(fit)
        if covariance is None:
            return self._doubted("the logo's place leaves a part of the spin open")
        return SpinEstimate("normal_flow", fit.spin / TAU, covariance / TAU**2, None, len(fit.events))

    def _doubted(self, reason: str) -> SpinEstimate:
        """A refusal that keeps the fit: the next tick may start from it."""
        return SpinEstimate.refused("normal_flow", reason, len(self.t_us))

    def _covariance(self, fit: _Fit) -> Floats | None:
        """(3, 3) covariance of the spin, (rad/s)^2; None where the constraints do not fix it."""
        lengths = np.linalg.eigvalsh(fit.matrix)
        if lengths[0] <= 1e-4 * lengths[-1]:
            return None
        inverse = np.linalg.inv(fit.matrix)
        pull = (fit.weights * (fit.speeds - fit.rows @ fit.spin))[:, None] * fit.rows
        turned = self.t_us[fit.events] * (float(np.linalg.norm(fit.spin)) * 1e-6)
        _, block = np.unique(np.floor(turned).astype(np.int64), return_inverse=True)
        blocks = int(block.max()) + 1
        pulls = np.zeros((blocks, 3))
        np.add.at(pulls, block, pull)
        scatter = inverse @ (pulls.T @ pulls) @ inverse * blocks / max(blocks - 1, 1)
        radius_px, position_px, radius_std_px, _ = self._track()
        response = position_response(
            self.normals[fit.events], self.sights[fit.events], fit.rows, fit.spin, radius_px
        )
        gain = inverse @ (fit.rows * fit.weights[:, None]).T
        moved = gain @ response
        place = moved @ np.diag([position_px**2, position_px**2, radius_std_px**2]) @ moved.T
        bent = gain @ (fit.speeds[:, None] * self.normals[fit.events])
        shared = inverse * fit.overlap * max(fit.scale, 1.0) ** 2
        total: Floats = scatter + shared + place + BIAS**2 * bent @ bent.T
        return total
