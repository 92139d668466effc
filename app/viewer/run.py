"""A run of the chain as the viewer takes it: columns over all ticks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from spinscope.pipeline.camera import Camera
from spinscope.pipeline.recordings import CameraFrame, Recording
from spinscope.pipeline.registry import STAGES, methods, rival_methods
from spinscope.pipeline.results import SpinEstimate, Truth
from spinscope.pipeline.shots import Shot
from spinscope.pipeline.stage import SpinMethod
from spinscope.pipeline.tick import Tick

from .followed_ball import followed_ticks

if TYPE_CHECKING:
    from spinscope.pipeline.session import Result

Floats = NDArray[np.float64]
Times = NDArray[np.int64]


FRAMES_SHOWN = 200  # 8 s of a DAVIS346, 18 MB


def _frames(result: Result) -> tuple[CameraFrame, ...]:
    """Pictures of the camera while the ticks last, the first FRAMES_SHOWN of them."""
    recording, ticks = result.session.recording, result.ticks
    if not isinstance(recording, Recording) or not ticks:
        return ()
    return tuple(islice(recording.frames(ticks[0].packet.start_us, ticks[-1].packet.end_us), FRAMES_SHOWN))


@dataclass(frozen=True)
class ViewedRun:
    """A recording's ticks and shots with the camera and ball behind them.

    Attributes
    ----------
    name : str
        Name of the recording, for people.
    ticks : sequence of Tick
        In order of time, without gaps; at least one. Their first ball is the one that the detail views follow.
    shots : sequence of Shot
        Found in the ticks.
    no_shot_reason : str, optional
        Why no shot was found; None when one was.
    camera : Camera
        The camera on this sensor.
    ball_radius_m : float
        Radius of the ball, m.
    fixed : bool
        Whether the ball stays in place (ball spinner).
    truth : Truth, optional
        The simulator's truth.
    warnings : sequence of str
        Notices about the recording, for people.
    frames : sequence of CameraFrame
        Pictures that the camera took besides the events.
    followed : int, optional
        Number of the shot, from 1, whose ball the detail views follow while it flies; by default the tracker's first
        ball.
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
    frames: Sequence[CameraFrame] = ()
    followed: int | None = None

    @classmethod
    def of(cls, result: Result, followed: int | None = None) -> ViewedRun:
        """The run behind a result; a number beyond its shots is no choice."""
        session, shots = result.session, result.shots
        followed = followed if followed is not None and 1 <= followed <= len(shots) else None

        def absent(stage: str, reason: str) -> Any:
            declared = STAGES[stage]
            assert declared.absent is not None
            return declared.absent(session.parameters.group(declared.group), reason)

        return cls(
            name=session.recording.path.name,
            ticks=followed_ticks(result.ticks, shots, None if followed is None else shots[followed - 1], absent),
            shots=shots,
            no_shot_reason=result.no_shot_reason,
            camera=session.camera,
            ball_radius_m=session.ball_radius_m,
            fixed=session.parameters.track.ball == "fixed",
            truth=session.truth,
            warnings=session.warnings,
            frames=_frames(result),
            followed=followed,
        )

    @cached_property
    def start_us(self) -> int:
        """Start of the first tick; before it nothing is known, and every view says so."""
        return self.ticks[0].packet.start_us

    @cached_property
    def end_us(self) -> int:
        """End of the last tick."""
        return self.ticks[-1].packet.end_us

    @cached_property
    def ends_us(self) -> Times:
        """End (n,) of every tick, us, where its results stand on the timeline."""
        return np.array([tick.packet.end_us for tick in self.ticks], np.int64)

    @cached_property
    def times_us(self) -> Times:
        """Start, then the end of every tick (n + 1,), us."""
        return np.concatenate([[self.start_us], self.ends_us])

    @cached_property
    def first_sight_us(self) -> int:
        """Time at which the first track, or the followed one, starts; the first tick's end if there is none."""
        return self._flown[0].packet.end_us if self._flown else self.ticks[0].packet.end_us

    @cached_property
    def _flown(self) -> list[Tick]:
        """Ticks with a ball, of the followed shot where one was chosen."""
        number = None if self.followed is None else self.shots[self.followed - 1].number
        return [tick for tick in self.ticks if tick.track.has_ball and number in (None, tick.track.shot)]

    @cached_property
    def opening_us(self) -> int:
        """Time at which the viewer opens.

        A spin is first trusted and the logo in view, for its pictures are empty in other ticks; without such a tick a
        spin is first trusted, and where none is the track starts.
        """
        trusted = [tick for tick in self._flown if tick.best is not None]
        with_logo = [tick for tick in trusted if (logo := tick.get("logo")) is not None and len(logo.events)]
        return next((tick.packet.end_us for tick in (with_logo or trusted)), self.first_sight_us)

    @cached_property
    def true_spins_rps(self) -> Floats | None:
        """True spin (n, 3) at the time of every tick's state, rps; NaN where there is none, None without truth."""
        if self.truth is None:
            return None
        return self.true_values(np.array([tick.track.t_us for tick in self.ticks]), self.truth.spin_rps)

    @cached_property
    def true_states(self) -> Floats | None:
        """True Kalman states (n, 5) at the ticks' scene times; NaN where the truth does not reach, None without it."""
        if self.truth is None:
            return None
        truth, seconds = self.truth, self.truth.t_us * 1e-6
        columns = [truth.x_px, truth.y_px, np.gradient(truth.x_px, seconds), np.gradient(truth.y_px, seconds)]
        t_us = np.array([tick.track.t_us for tick in self.ticks])
        return self.true_values(t_us, np.column_stack([*columns, truth.radius_px]))

    @cached_property
    def has_ball(self) -> NDArray[np.bool_]:
        """Flags (n,) of the ticks at whose end there is a ball."""
        return np.array([tick.track.has_ball for tick in self.ticks], np.bool_)

    @cached_property
    def means(self) -> Floats:
        """Kalman states (n, 5), NaN without a ball."""
        return np.array([tick.track.mean for tick in self.ticks]).reshape(-1, 5)

    @cached_property
    def variances(self) -> Floats:
        """Variances (n, 5) of the Kalman states, NaN without a ball."""
        return np.array([np.diag(tick.track.covariance) for tick in self.ticks]).reshape(-1, 5)

    @cached_property
    def shot_numbers(self) -> dict[int, int]:
        """Number of each shot for people, from 1 in order of their start, by the tracker's number."""
        return {shot.number: number for number, shot in enumerate(self.shots, 1)}

    @cached_property
    def seen_shots(self) -> list[tuple[int, int]]:
        """Times, us, from which on the detail views show another shot, and its number for people.

        Between two flights it is the one before.
        """
        seen: list[tuple[int, int]] = []
        for tick in self.ticks:
            number = self.shot_numbers.get(tick.balls[0].track.shot) if tick.balls else None
            if number is not None and (not seen or seen[-1][1] != number):
                seen.append((tick.packet.end_us, number))
        return seen

    @cached_property
    def final_shots(self) -> dict[int, Shot]:
        """Shots by the row of the tick with the result of the whole shot, of those followed there."""
        rows = {}
        for shot in self.shots:
            own = [i for i, tick in enumerate(self.ticks) if tick.track.shot == shot.number]
            whole = [i for i in own if self.ends_us[i] <= shot.end_us]
            if whole:
                rows[whole[-1]] = shot
        return rows

    @cached_property
    def contacts_us(self) -> Times:
        """Times (n,) at which a shot begins with a bounce or a hit, or ends with one, us of file time."""
        began = {shot.start_us for shot in self.shots if shot.began_by in ("bounce", "hit")}
        ended = {shot.end_us for shot in self.shots if shot.ended_by in ("bounce", "hit")}
        return np.array(sorted(began | ended), np.int64)

    @cached_property
    def stages(self) -> tuple[str, ...]:
        """Names of the stages that were run."""
        return tuple(self.ticks[0].results)

    @cached_property
    def methods(self) -> tuple[SpinMethod, ...]:
        """The spin methods that were run."""
        return tuple(method for method in methods() if method.name in self.stages)

    def results(self, stage: str) -> list[Any]:
        """A stage's result of every tick; empty where the stage was not run."""
        return [tick.results[stage] for tick in self.ticks] if stage in self.stages else []

    @cached_property
    def largest_radius_px(self) -> float:
        """Radius of the largest ball seen, 20 px when none was."""
        return float(np.nanmax(self.means[:, 4])) if self.has_ball.any() else 20.0

    @cached_property
    def fast_flow_px_s(self) -> float | None:
        """Speed that one in fifty of the flow's events exceed, full colour in its picture; None without flow."""
        flows = [np.hypot(flow.vx_px_s, flow.vy_px_s) for flow in self.results("flow")]
        speeds = np.concatenate([np.empty(0), *flows])
        return float(np.quantile(speeds, 0.98)) if speeds.size else None

    def centre_m(self, mean: Floats) -> Floats:
        """Centres of the ball (n, 3), camera frame, from Kalman states (n, 5) or (5,)."""
        states = np.atleast_2d(mean)
        return self.camera.ball_centre_m(states[:, 0], states[:, 1], states[:, 4], self.ball_radius_m)

    def true_values(self, t_us: Floats, values: Floats) -> Floats:
        """Column (m,) or (m, k) of the truth at times (n,); NaN more than a sample outside what the truth covers."""
        assert self.truth is not None
        known_us = self.truth.t_us
        spare_us = known_us[1] - known_us[0] if known_us.size > 1 else 0
        covered = (t_us >= known_us[0] - spare_us) & (t_us <= known_us[-1] + spare_us)
        columns = values.reshape(len(values), -1).T
        found = [np.where(covered, np.interp(t_us, known_us, column), np.nan) for column in columns]
        return np.stack(found, axis=1).reshape(len(t_us), *values.shape[1:])


def shown_estimate(tick: Tick) -> tuple[SpinEstimate | None, bool]:
    """Estimate that turns the ball in the viewer, and whether it is trusted.

    Where no method is trusted the last one that answers is shown all the same, for the eye to judge.
    """
    if tick.best is not None:
        return tick.estimates[tick.best], True
    rivals = [method.name for method in rival_methods()]
    answers = [one for name, one in tick.estimates.items() if one.vector_rps is not None and name not in rivals]
    return (answers[-1] if answers else None), False


def sentence(reason: str) -> str:
    """A reason with a capital letter. It names its subject itself ("no ball: ..."): nothing is set before it."""
    return reason[:1].upper() + reason[1:]


def vector_of(estimate: SpinEstimate | None) -> Floats:
    """Spin (3,) of an estimate, rps; zeros where there is none."""
    return np.zeros(3) if estimate is None or estimate.vector_rps is None else estimate.vector_rps


def shot_starts(run: ViewedRun) -> list[int | None]:
    """Start of the shot to which each tick belongs, the moment of the body frame; None without a ball."""
    return [tick.balls[0].track.start_us if tick.balls else None for tick in run.ticks]
