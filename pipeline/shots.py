"""Shots: the free flights (or the one fixed ball) found in a run of ticks, each with its track and spin."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .camera import Camera
from .chain import BallTick, Tick
from .errors import ParameterError
from .registry import distrust_reason, trusted_method
from .results import SpinEstimate, Truth, spin_errors
from .spin.combined.result import CombinedResult
from .spin.trajectory.motion import FittedMotion
from .stages.track_result import BallTrack, BeganBy, EndedBy, ShotEnd
from .track_evidence import TrackEvidence

Floats = NDArray[np.float64]

# How shots begin and end, in words for people.
BEGAN_WORDS: dict[BeganBy, str] = {
    "entered": "came into view",
    "bounce": "from a bounce",
    "hit": "from a hit",
    "start": "in view from the start",
    "found": "found in view",
}
ENDED_WORDS: dict[EndedBy, str] = {
    "left": "left the view",
    "bounce": "bounced",
    "hit": "was hit",
    "end": "in view to the end",
    "lost": "was lost",
}


@dataclass(frozen=True, slots=True, eq=False)
class ShotTick:
    """Results of the stages for a shot at the end of one of its ticks, from all events up to there.

    Attributes
    ----------
    logo_rate_hz : float, optional
        Logo events of the tick over its length; None where the logo was not asked for.
    rate_rps : float, optional
        Magnitude by the rhythm of the logo's events; None where it tells none or was not asked for.
    estimates : dict[str, SpinEstimate]
        The spin by method.
    """

    logo_rate_hz: float | None
    rate_rps: float | None
    estimates: dict[str, SpinEstimate]


@dataclass(frozen=True, slots=True, eq=False)
class Shot:
    """One free flight of one ball, between two contacts or from where it comes into view to where it is lost.

    Attributes
    ----------
    start_us, end_us : int
        Its span (file time), at a contact to within 2 ms.
    t_us : (n,) float64
        Scene time of each tick's state.
    state : (n, 5) float64
        [x_px, y_px, vx_px_s, vy_px_s, radius_px]: the causal filter's values.
    std : (n, 5) float64
        Their 1 sigma.
    measured : (n,) bool
        Whether a circle was measured in the tick (else the filter coasted).
    logo_events : int, optional
        Number of events inside the circle less pad; None where the logo was not asked for.
    estimates : dict[str, SpinEstimate]
        The spin by method, from the whole shot.
    best : str, optional
        The method that is trusted, None where none is.
    best_reason : str, optional
        Why no method is trusted, in words for people; None where one is.
    began_by : str
        entered (across the border), bounce, hit, start (of the recording) or found (in the middle of the view).
    ended_by : str
        left (across the border), bounce, hit, end (of the recording) or lost.
    number : int
        The tracker's number of the shot (`BallTrack.shot`).
    motion : FittedMotion, optional
        The flight as fitted by the trajectory method; None where that was not run or found none.
    combined : CombinedResult, optional
        Evidence of each witness for the combined answer; None where that was not run.
    history : tuple of ShotTick
        Each tick's results, one for each row of `state`.
    """

    start_us: int
    end_us: int
    t_us: Floats
    state: Floats
    std: Floats
    measured: NDArray[np.bool_]
    logo_events: int | None
    estimates: dict[str, SpinEstimate]
    best: str | None
    best_reason: str | None = None
    began_by: BeganBy = "found"
    ended_by: EndedBy = "lost"
    number: int = 0
    motion: FittedMotion | None = None
    combined: CombinedResult | None = None
    history: tuple[ShotTick, ...] = ()

    def positions_m(self, camera: Camera, ball_radius_m: float) -> Floats:
        """(n, 3) float64 centres of the ball in the camera frame, from silhouettes, metres."""
        return camera.ball_centre_m(self.state[:, 0], self.state[:, 1], self.state[:, 4], ball_radius_m)

    def velocity_m_s(self, camera: Camera, ball_radius_m: float) -> Floats | None:
        """(3,) float64 mean velocity over the shot, m/s, camera frame; None for a single tick.

        Straight-line fit of the positions: the depth, known from the radius to about 1 % only, is smoothed with it.
        """
        if self.t_us.size < 2:
            return None
        positions = self.positions_m(camera, ball_radius_m)
        seconds = (self.t_us - self.t_us[0]) * 1e-6
        slope: Floats = np.polynomial.polynomial.polyfit(seconds, positions, 1)[1]
        return slope

    def to_dict(self, camera: Camera, ball_radius_m: float) -> dict[str, Any]:
        """The shot as `spinscope analyze` writes it, ready for JSON."""
        velocity = self.velocity_m_s(camera, ball_radius_m)
        names = ("x_px", "y_px", "vx_px_s", "vy_px_s", "radius_px")
        track = dict(zip(names, self.state.T.tolist(), strict=True))
        std = dict(zip(names, self.std.T.tolist(), strict=True))
        return {
            "start_us": self.start_us,
            "end_us": self.end_us,
            "began_by": self.began_by,
            "ended_by": self.ended_by,
            "track": {
                "t_us": self.t_us.tolist(),
                **{name: track[name] for name in ("x_px", "y_px", "radius_px", "vx_px_s", "vy_px_s")},
                "x_std_px": std["x_px"],
                "y_std_px": std["y_px"],
                "radius_std_px": std["radius_px"],
                "measured": self.measured.astype(int).tolist(),
            },
            "speed_m_s": None if velocity is None else math.sqrt(float(velocity @ velocity)),
            "logo_events": self.logo_events,
            "spin": {name: estimate.to_dict() for name, estimate in self.estimates.items()},
            "witnesses": [] if self.combined is None else [one.to_dict() for one in self.combined.witnesses],
            "best": self.best,
            "best_reason": self.best_reason,
        }

    def error_against(self, truth: Truth, method: str) -> tuple[float, float] | None:
        """(magnitude error in rps, signed-axis error in degrees) of one method; None where it refused."""
        if method not in self.estimates:
            raise ParameterError(f"{method} was not run: there are {', '.join(self.estimates)}")
        estimate = self.estimates[method]
        if estimate.vector_rps is None:
            return None
        middle = (self.start_us + self.end_us) / 2
        spin = np.array([np.interp(middle, truth.t_us, truth.spin_rps[:, axis]) for axis in range(3)])
        return spin_errors(estimate.vector_rps, spin)


class ShotLog:
    """Shots gathered from ticks in order of time, keeping of each tick only what a shot needs.

    A ball that was followed for a single tick of several is no shot, nor one that rolls, lies or is a shadow. What a
    shot's results say of ticks that end after it, before its end was known, does not count.
    """

    def __init__(self) -> None:
        self._ended: list[Shot] = []
        self._flying: dict[int, list[_Row]] = {}
        self._last_reason: str | None = None
        self._tick_count = 0

    @classmethod
    def of(cls, ticks: Iterable[Tick]) -> ShotLog:
        """The shots of all these ticks, the last ones ended."""
        log = cls()
        for tick in ticks:
            log.add(tick)
        log.close()
        return log

    def add(self, tick: Tick) -> None:
        """Take the next tick."""
        self._tick_count += 1
        balls = {ball.track.shot: ball for ball in tick.balls}
        ends = {end.shot: end for end in tick.track.ended}
        for shot in self._flying.keys() - balls.keys():
            self._end(ends.get(shot) or ShotEnd(shot, self._flying[shot][-1].end_us, "lost"))
        for shot, ball in balls.items():
            self._flying.setdefault(shot, []).extend(map(_row, (*ball.earlier, ball)))
        if not balls and tick.track.reason:
            self._last_reason = tick.track.reason

    def close(self) -> None:
        """End the shots that are still in flight, with the recording."""
        for shot, rows in list(self._flying.items()):
            self._end(ShotEnd(shot, rows[-1].end_us, "end"))

    def take_ended(self) -> list[Shot]:
        """The shots that have ended since the last call, in order of their start; they are kept no longer."""
        ended, self._ended = self.shots, []
        return ended

    def __len__(self) -> int:
        """Number of the shots that have ended."""
        return len(self._ended)

    @property
    def shots(self) -> list[Shot]:
        """The shots that have ended, in order of their start."""
        return sorted(self._ended, key=lambda shot: shot.start_us)

    @property
    def no_shot_reason(self) -> str | None:
        """Reason why there are no shots, in words; None when there are some."""
        return None if self._ended else self._last_reason or "no ball, because there are no events"

    def _end(self, end: ShotEnd) -> None:
        rows = [row for row in self._flying.pop(end.shot) if row.end_us <= end.end_us]
        if rows and not rows[-1].track.is_shot:
            self._last_reason = "no shot: what is seen rolls, lies or is a shadow, it does not fly"
        elif len(rows) > 1 or (rows and self._tick_count == 1):
            self._ended.append(_shot(rows, end))
        else:
            self._last_reason = "no shot: a ball was seen for a single tick only"


@dataclass(frozen=True, slots=True, eq=False)
class _Row:
    """One tick of a shot."""

    start_us: int
    end_us: int
    track: BallTrack
    evidence: TrackEvidence
    logo_events: int | None
    rate_rps: float | None
    estimates: dict[str, SpinEstimate]
    motion: FittedMotion | None
    combined: CombinedResult | None


def _row(ball: BallTick) -> _Row:
    logo, rate, trajectory = (ball.results.get(name) for name in ("logo", "rate", "trajectory"))
    return _Row(
        start_us=ball.packet.start_us,
        end_us=ball.packet.end_us,
        track=ball.track,
        evidence=ball.evidence,
        logo_events=None if logo is None else len(logo.events),
        rate_rps=None if rate is None else rate.spin_rps,
        estimates=ball.estimates,
        motion=None if trajectory is None else trajectory.motion,
        combined=ball.results.get("combined"),
    )


def _shot(rows: list[_Row], end: ShotEnd) -> Shot:
    events = [row.logo_events for row in rows if row.logo_events is not None]
    estimates, doubt = rows[-1].estimates, rows[-1].evidence.doubt
    return Shot(
        start_us=rows[0].track.start_us,
        end_us=end.end_us,
        t_us=np.array([row.track.t_us for row in rows]),
        state=np.array([row.track.mean for row in rows]),
        std=np.array([np.sqrt(np.diag(row.track.covariance)) for row in rows]),
        measured=np.array([row.track.measured is not None for row in rows]),
        logo_events=sum(events) if events else None,
        estimates=estimates,
        best=trusted_method(estimates, doubt),
        best_reason=distrust_reason(estimates, doubt),
        began_by=rows[0].track.began_by,
        ended_by=end.ended_by,
        number=end.shot,
        motion=rows[-1].motion,
        combined=rows[-1].combined,
        history=tuple(map(_shot_tick, rows)),
    )


def _shot_tick(row: _Row) -> ShotTick:
    events, length_us = row.logo_events, row.end_us - row.start_us
    return ShotTick(None if events is None else events / (length_us * 1e-6), row.rate_rps, row.estimates)
