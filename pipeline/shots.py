"""Shots: the free flights (or the one fixed ball) found in a run of ticks, each with its track and spin."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .camera import Camera
from .chain import EARLIER_US
from .errors import ParameterError
from .registry import distrust_reason, trusted_method
from .results import ReadOnlyArrays, SpinEstimate, Truth, spin_errors
from .spin.combined.result import CombinedResult
from .spin.trajectory.motion import FittedMotion
from .stages.track_result import BallTrack, BeganBy, EndedBy, ShotEnd
from .tick import BallTick, Tick

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
class ShotHistory(ReadOnlyArrays):
    """Results of the stages for a shot at the end of each of its n ticks, from all events up to there.

    Attributes
    ----------
    logo_rate_hz : (n,) float64
        Logo events of the tick over its length; NaN where the logo was not asked for.
    rate_rps : (n,) float64
        Magnitude by the rhythm of the logo's events; NaN where it tells none or was not asked for.
    methods : tuple of str
        Names of the m spin methods that were run.
    vector_rps, covariance_rps2 : (n, m, 3) and (n, m, 3, 3) float64
        Spin by each method, as in `SpinEstimate`; NaN where it refused.
    """

    logo_rate_hz: Floats
    rate_rps: Floats
    methods: tuple[str, ...]
    vector_rps: Floats
    covariance_rps2: Floats

    def estimates(self, tick: int) -> list[SpinEstimate]:
        """The spins at the end of a tick (from 0), of the methods that did not refuse."""
        rows = zip(self.methods, self.vector_rps[tick], self.covariance_rps2[tick], strict=True)
        return [
            SpinEstimate(method, vector, None if np.isnan(covariance).any() else covariance, None)
            for method, vector, covariance in rows
            if not np.isnan(vector).any()
        ]


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
    history : ShotHistory, optional
        Results at the end of each tick, one for each row of `state`.
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
    history: ShotHistory | None = None

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
        self._flying: dict[int, _FlyingShot] = {}
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
            self._end(ends.get(shot) or ShotEnd(shot, self._flying[shot].end_us, "lost"))
        for shot, ball in balls.items():
            flying = self._flying.setdefault(shot, _FlyingShot())
            for one in (*ball.earlier, ball):
                flying.add(one)
        if not balls and tick.track.reason:
            self._last_reason = tick.track.reason

    def close(self) -> None:
        """End the shots that are still in flight, with the recording."""
        for shot, flying in list(self._flying.items()):
            self._end(ShotEnd(shot, flying.end_us, "end"))

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
        flying = self._flying.pop(end.shot)
        ticks = flying.ticks_until(end.end_us)
        if ticks and not flying.last_until(end.end_us).track.is_shot:
            self._last_reason = "no shot: what is seen rolls, lies or is a shadow, it does not fly"
        elif ticks > 1 or (ticks and self._tick_count == 1):
            self._ended.append(flying.shot(end))
        else:
            self._last_reason = "no shot: a ball was seen for a single tick only"


class _FlyingShot:
    """A shot in flight: some numbers of each tick, and all results of the last ticks, with one of which it ends.

    A ball on a spinner is one shot of 120,000 ticks in ten minutes, and all results of a tick take 6 kB.
    """

    def __init__(self) -> None:
        self._numbers: list[Floats] = []  # see `_numbers`
        self._recent: deque[BallTick] = deque()  # a contact is known EARLIER_US later at most
        self._first: BallTrack | None = None

    @property
    def end_us(self) -> int:
        """End of the last tick."""
        return self._recent[-1].packet.end_us

    def add(self, ball: BallTick) -> None:
        """Take the next tick."""
        self._first = self._first or ball.track
        self._numbers.append(_numbers(ball))
        self._recent.append(ball)
        while len(self._recent) > 1 and self._recent[1].packet.end_us <= self.end_us - EARLIER_US:
            self._recent.popleft()

    def ticks_until(self, end_us: int) -> int:
        """Number of ticks that end by a time."""
        later = next((number for number, row in enumerate(reversed(self._numbers)) if row[_END_US] <= end_us), None)
        return 0 if later is None else len(self._numbers) - later

    def last_until(self, end_us: int) -> BallTick:
        """The last tick that ends by a time, of those that are kept whole."""
        return next((ball for ball in reversed(self._recent) if ball.packet.end_us <= end_us), self._recent[0])

    def shot(self, end: ShotEnd) -> Shot:
        """The shot, whose end is known now."""
        first, last = self._first, self.last_until(end.end_us)
        assert first is not None
        rows = np.array(self._numbers[: self.ticks_until(end.end_us)])
        methods = tuple(last.estimates)
        spins = rows[:, _SPINS].reshape(len(rows), len(methods), 12)
        counted = rows[:, _LOGO_EVENTS]
        trajectory, doubt = last.results.get("trajectory"), last.evidence.doubt or end.doubt
        return Shot(
            start_us=first.start_us,
            end_us=end.end_us,
            t_us=rows[:, _T_US].copy(),
            state=rows[:, _STATE].copy(),
            std=rows[:, _STD].copy(),
            measured=rows[:, _MEASURED] > 0,
            logo_events=None if np.isnan(counted).all() else int(np.nansum(counted)),
            estimates=last.estimates,
            best=trusted_method(last.estimates, doubt),
            best_reason=distrust_reason(last.estimates, doubt),
            began_by=first.began_by,
            ended_by=end.ended_by,
            number=end.shot,
            motion=None if trajectory is None else trajectory.motion,
            combined=last.results.get("combined"),
            history=ShotHistory(
                logo_rate_hz=counted / (rows[:, _LENGTH_US] * 1e-6),
                rate_rps=rows[:, _RATE_RPS].copy(),
                methods=methods,
                vector_rps=spins[:, :, :3].copy(),
                covariance_rps2=spins[:, :, 3:].reshape(*spins.shape[:2], 3, 3).copy(),
            ),
        )


# Places in a row of `_numbers`.
_END_US, _LENGTH_US, _T_US, _MEASURED, _LOGO_EVENTS, _RATE_RPS = range(6)
_STATE, _STD, _SPINS = slice(6, 11), slice(11, 16), slice(16, None)


def _numbers(ball: BallTick) -> Floats:
    """One row of numbers of a tick, 0.7 kB: last the spins, 12 numbers a method; NaN for what is not told."""
    packet, track, logo, rate = ball.packet, ball.track, ball.results.get("logo"), ball.results.get("rate")
    row = np.full(_SPINS.start + 12 * len(ball.estimates), np.nan)
    row[_END_US], row[_LENGTH_US], row[_T_US] = packet.end_us, packet.end_us - packet.start_us, track.t_us
    row[_MEASURED] = track.measured is not None
    if logo is not None:
        row[_LOGO_EVENTS] = len(logo.events)
    if rate is not None and rate.spin_rps is not None:
        row[_RATE_RPS] = rate.spin_rps
    row[_STATE], row[_STD] = track.mean, np.sqrt(np.diag(track.covariance))
    for spin, estimate in zip(row[_SPINS].reshape(-1, 12), ball.estimates.values(), strict=True):
        if estimate.vector_rps is not None:
            spin[:3] = estimate.vector_rps
        if estimate.covariance_rps2 is not None:
            spin[3:] = estimate.covariance_rps2.ravel()
    return row
