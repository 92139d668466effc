"""One run of the chain, as the viewer takes it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from spinscope.pipeline.camera import Camera
from spinscope.pipeline.chain import Tick
from spinscope.pipeline.results import SpinEstimate, Truth
from spinscope.pipeline.shots import Shot

if TYPE_CHECKING:
    from spinscope.pipeline.session import Result

Floats = NDArray[np.float64]
Times = NDArray[np.int64]


@dataclass(frozen=True)
class ViewedRun:
    """Everything that is shown: a recording's ticks and shots, with the setting they were made in.

    name : the recording's name, for people
    ticks : in order of time, without gaps; shots : found in them; no_shot_reason : why none was
    fixed : the ball stays in place (ball spinner)
    warnings : what people should know about the recording
    """

    name: str
    ticks: Sequence[Tick]
    shots: Sequence[Shot]
    no_shot_reason: str | None
    camera: Camera
    ball_radius_m: float
    fixed: bool
    truth: Truth | None
    warnings: Sequence[str]

    @classmethod
    def of(cls, result: Result) -> ViewedRun:
        """The run of a session."""
        session = result.session
        return cls(
            name=session.recording.path.name,
            ticks=result.ticks,
            shots=result.shots,
            no_shot_reason=result.no_shot_reason,
            camera=session.camera,
            ball_radius_m=session.ball_radius_m,
            fixed=session.parameters.track.ball == "fixed",
            truth=session.truth,
            warnings=session.warnings,
        )

    @cached_property
    def start_us(self) -> int:
        """Start of the first tick: before it nothing is known, and every view says so."""
        return self.ticks[0].packet.start_us

    @cached_property
    def end_us(self) -> int:
        """End of the last tick."""
        return self.ticks[-1].packet.end_us

    @cached_property
    def ends_us(self) -> Times:
        """(n,) end of every tick: when its results are known, and where they stand on the timeline."""
        return np.array([tick.packet.end_us for tick in self.ticks], np.int64)

    @cached_property
    def times_us(self) -> Times:
        """(n + 1,) the start, then the end of every tick."""
        return np.concatenate([[self.start_us], self.ends_us])

    @cached_property
    def first_sight_us(self) -> int:
        """When the first track starts. The first tick's end if there is none."""
        found = [tick.packet.end_us for tick in self.ticks if tick.track.has_ball]
        return found[0] if found else self.ticks[0].packet.end_us

    @cached_property
    def opening_us(self) -> int:
        """When a spin is first trusted: where the viewer waits for the user. Where none is, at the first sight."""
        return next((tick.packet.end_us for tick in self.ticks if tick.best is not None), self.first_sight_us)

    @cached_property
    def true_spins_rps(self) -> Floats | None:
        """(n, 3) the true spin at the time of every tick's state; NaN where there is none, None without truth."""
        if self.truth is None:
            return None
        return self.true_values(np.array([tick.track.t_us for tick in self.ticks]), self.truth.spin_rps)

    @cached_property
    def has_ball(self) -> NDArray[np.bool_]:
        """(n,) whether there is a ball at the end of each tick."""
        return np.array([tick.track.has_ball for tick in self.ticks], np.bool_)

    @cached_property
    def means(self) -> Floats:
        """(n, 5) Kalman states, NaN without a ball."""
        return np.array([tick.track.mean for tick in self.ticks]).reshape(-1, 5)

    @cached_property
    def variances(self) -> Floats:
        """(n, 5) their variances, NaN without a ball."""
        return np.array([np.diag(tick.track.covariance) for tick in self.ticks]).reshape(-1, 5)

    @cached_property
    def methods(self) -> list[str]:
        """The names of the methods that estimate the spin."""
        return list(self.ticks[0].estimates)

    @cached_property
    def largest_radius_px(self) -> float:
        """Radius of the largest ball seen, 20 px when none was."""
        return float(np.nanmax(self.means[:, 4])) if self.has_ball.any() else 20.0

    @cached_property
    def fast_flow_px_s(self) -> float | None:
        """A speed that one in fifty of the flow's events exceed: full colour in its picture. None without flow."""
        flows = [np.hypot(tick.flow.vx_px_s, tick.flow.vy_px_s) for tick in self.ticks]
        speeds = np.concatenate([np.empty(0), *flows])
        return float(np.quantile(speeds, 0.98)) if speeds.size else None

    def centre_m(self, mean: Floats) -> Floats:
        """(n, 3) centres of the ball, camera frame, from Kalman states (n, 5) or (5,)."""
        states = np.atleast_2d(mean)
        return self.camera.ball_centre_m(states[:, 0], states[:, 1], states[:, 4], self.ball_radius_m)

    def true_values(self, t_us: Floats, values: Floats) -> Floats:
        """A column (m,) or (m, k) of the truth at times (n,); NaN more than a sample outside what the truth covers."""
        assert self.truth is not None
        known_us = self.truth.t_us
        spare_us = known_us[1] - known_us[0] if known_us.size > 1 else 0
        covered = (t_us >= known_us[0] - spare_us) & (t_us <= known_us[-1] + spare_us)
        columns = values.reshape(len(values), -1).T
        found = [np.where(covered, np.interp(t_us, known_us, column), np.nan) for column in columns]
        return np.stack(found, axis=1).reshape(len(t_us), *values.shape[1:])


def shown_estimate(tick: Tick) -> tuple[SpinEstimate | None, bool]:
    """The estimate that turns the ball in the viewer, and whether it is trusted.

    Where no method is trusted the last one that answers is shown all the same, for the eye to judge.
    """
    if tick.best is not None:
        return tick.estimates[tick.best], True
    answers = [estimate for estimate in tick.estimates.values() if estimate.vector_rps is not None]
    return (answers[-1] if answers else None), False


def vector_of(estimate: SpinEstimate | None) -> Floats:
    """(3,) its spin in rps; zeros where there is none."""
    return np.zeros(3) if estimate is None or estimate.vector_rps is None else estimate.vector_rps


def shot_starts(run: ViewedRun) -> Iterator[int | None]:
    """For each tick the start of the shot it belongs to: the moment of the body frame; None without a ball."""
    shot, start_us = None, None
    for tick in run.ticks:
        if not tick.track.has_ball:
            shot, start_us = None, None
        elif tick.track.shot != shot:
            shot, start_us = tick.track.shot, tick.packet.start_us
        yield start_us
