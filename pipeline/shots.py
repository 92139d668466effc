"""Shots: the flights (or the one fixed ball) found in a run of ticks, each with its track and spin."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .camera import Camera
from .chain import Tick
from .methods import best_of
from .results import SpinEstimate, Truth
from .stages.track import TrackResult

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Shot:
    """One ball from the tick in which it was found to the last tick in which it was there.

    number : counts from 0 in the order of time
    start_us, end_us : time of the first packet's start and the last one's end (file time)
    t_us : (n,) float64, scene time of each tick's state
    state : (n, 5) float64, [x_px, y_px, vx_px_s, vy_px_s, radius_px]: the causal filter's values
    std : (n, 5) float64, their 1 sigma
    measured : (n,) bool, whether a circle was measured in the tick (else the filter coasted)
    logo_events : number of events inside the circle less pad
    estimates : the spin by method, from the whole shot; best : the method that is trusted, None where none is
    """

    number: int
    start_us: int
    end_us: int
    t_us: Floats
    state: Floats
    std: Floats
    measured: NDArray[np.bool_]
    logo_events: int
    estimates: dict[str, SpinEstimate]
    best: str | None

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

    def error_against(self, truth: Truth, method: str) -> tuple[float, float] | None:
        """(magnitude error in rps, signed-axis error in degrees) of one method; None where it refused."""
        estimate = self.estimates[method]
        if estimate.vector_rps is None or estimate.axis is None:
            return None
        middle = (self.start_us + self.end_us) / 2
        spin = np.array([np.interp(middle, truth.t_us, truth.spin_rps[:, axis]) for axis in range(3)])
        magnitude = float(np.linalg.norm(spin))
        cosine = float(np.clip(estimate.axis @ spin / magnitude, -1, 1)) if magnitude > 0 else 1.0
        return abs(float(np.linalg.norm(estimate.vector_rps)) - magnitude), float(np.degrees(np.arccos(cosine)))


@dataclass(slots=True)
class ShotLog:
    """Gathers shots from ticks in order of time, keeping of each tick only what a shot needs.

    A ball that was followed for a single tick of several, before a faster one took over, is no shot.

    shots : the shots that have ended
    """

    shots: list[Shot] = field(default_factory=list)
    _last_reason: str | None = None
    _ticks: int = 0
    _rows: list[_Row] = field(default_factory=list)

    def add(self, tick: Tick) -> None:
        """Take the next tick."""
        self._ticks += 1
        if self._rows and tick.track.shot != self._rows[-1].track.shot:
            self.close()
        if tick.track.has_ball:
            self._rows.append(
                _Row(tick.packet.start_us, tick.packet.end_us, tick.track, len(tick.logo.events), tick.estimates)
            )
        elif tick.track.reason:
            self._last_reason = tick.track.reason

    @property
    def no_shot_reason(self) -> str | None:
        """Why there are no shots, in words; None when there are some."""
        return None if self.shots else self._last_reason or "no ball, because there are no events"

    def close(self) -> None:
        """End the present shot, if there is one."""
        if len(self._rows) > 1 or (self._rows and self._ticks == 1):
            self.shots.append(_shot(len(self.shots), self._rows))
        elif self._rows:
            self._last_reason = "no shot: a ball was seen for a single tick only"
        self._rows = []


@dataclass(frozen=True, slots=True, eq=False)
class _Row:
    start_us: int
    end_us: int
    track: TrackResult
    logo_events: int
    estimates: dict[str, SpinEstimate]


def _shot(number: int, rows: list[_Row]) -> Shot:
    return Shot(
        number=number,
        start_us=rows[0].start_us,
        end_us=rows[-1].end_us,
        t_us=np.array([row.track.t_us for row in rows]),
        state=np.array([row.track.mean for row in rows]),
        std=np.array([np.sqrt(np.diag(row.track.covariance)) for row in rows]),
        measured=np.array([row.track.measured is not None for row in rows]),
        logo_events=sum(row.logo_events for row in rows),
        estimates=rows[-1].estimates,
        best=best_of(rows[-1].estimates),
    )
