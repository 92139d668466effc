"""Result of the tracker in one tick: the balls in view, the shots that ended, and why there is no ball."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..results import Circle, ReadOnlyArrays

Status = Literal["searching", "starting", "tracking", "coasting", "lost"]
# How a shot began: across the border, at a contact, with the recording, or first seen in the middle of the view.
BeganBy = Literal["entered", "bounce", "hit", "start", "found"]
# How it ended: across the border, at a contact, with the recording, or out of sight.
EndedBy = Literal["left", "bounce", "hit", "end", "lost"]


@dataclass(frozen=True, slots=True, eq=False)
class BallTrack(ReadOnlyArrays):
    """One ball at the end of the tick, as a robot would have had it.

    Attributes
    ----------
    shot : int
        Number of the shot, from 0.
    t_us : float
        Scene time of the state: the tick's end less the pixels' latency.
    latency_us : float
        That latency: an event stamped t shows the scene of t - latency_us.
    mean : (5,) float64
        Kalman state [x_px, y_px, vx_px_s, vy_px_s, radius_px].
    covariance : (5, 5) float64
        Its covariance.
    measured : Circle, optional
        The refined circle that entered the filter, None if none did: the ball is coasting.
    start_us : int
        Start of the shot (file time); at a contact to within 2 ms, or later where the contact is less certain.
    began_by : str
        How the shot began: entered, bounce, hit, start (of the recording) or found (in the middle of the view).
    is_shot : bool
        Whether the ball is in free flight. False from the tick on in which it is seen to roll, or to be the shadow of
        another one: the last state decides whether this was a shot.
    earlier : tuple of BallTrack
        States at the ends of the ticks since start_us before this one, oldest first: a contact is known only some ticks
        later, and so is a ball that must be seen more than once. Given in the one tick in which the shot is announced,
        else empty.
    doubt : str, optional
        What speaks against one free flight so far, in words for people; None where nothing does.
    """

    shot: int
    t_us: float
    latency_us: float
    mean: NDArray[np.float64]
    covariance: NDArray[np.float64]
    measured: Circle | None
    start_us: int
    began_by: BeganBy
    is_shot: bool = True
    earlier: tuple[BallTrack, ...] = ()
    doubt: str | None = None

    def centre_px(
        self, event_t_us: NDArray[np.int64] | NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Centre (x, y) in px at the scene times behind these event times (section 3.2, eq. ball_pos)."""
        dt_s = (event_t_us - self.latency_us - self.t_us) * 1e-6
        return self.mean[0] + self.mean[2] * dt_s, self.mean[1] + self.mean[3] * dt_s


@dataclass(frozen=True, slots=True)
class ShotEnd:
    """End of a shot.

    Attributes
    ----------
    shot : int
        Number of the shot.
    end_us : int
        When it ended (file time); at a contact to within 2 ms, or sooner where the contact is less certain; before
        the tick's start where it is known late. No result of the shot from ticks that end later counts.
    ended_by : str
        left (across the border), bounce, hit, end (of the recording) or lost.
    doubt : str, optional
        What speaks against this end, and so against one free flight before it, in words for people.
    """

    shot: int
    end_us: int
    ended_by: EndedBy
    doubt: str | None = None


NO_STATE, NO_COVARIANCE = np.full(5, np.nan), np.full((5, 5), np.nan)


@dataclass(frozen=True, slots=True, eq=False)
class TrackResult:
    """The balls at the end of the tick, and why there is none.

    Attributes
    ----------
    status : str
        searching (nothing yet), starting (candidates, not yet trusted), tracking (measured now), coasting (predicted,
        not measured), lost (just given up); of the followed ball where there is one.
    reason : str, optional
        Why there is no ball (searching, starting, lost), in words for people; None while there is one.
    t_us : float
        Scene time: the tick's end less the pixels' latency.
    balls : tuple of BallTrack
        Every ball in view. The first one is followed by the detail views: the one in view for longest, of the shots if
        there are any.
    hough : Circle, optional
        Circle of the Hough transform on the surface, before refinement and gating.
    candidate : Circle, optional
        The tick's best circle while the track is not trusted yet.
    ended : tuple of ShotEnd
        The shots whose end became known in this tick.
    """

    status: Status
    reason: str | None
    t_us: float
    balls: tuple[BallTrack, ...]
    hough: Circle | None
    candidate: Circle | None = None
    ended: tuple[ShotEnd, ...] = ()

    @property
    def ball(self) -> BallTrack | None:
        """The followed ball; None without one."""
        return self.balls[0] if self.balls else None

    @property
    def has_ball(self) -> bool:
        """Whether there is a ball that later stages may use."""
        return bool(self.balls)

    @property
    def shot(self) -> int | None:
        """Shot of the followed ball; None without one."""
        return self.balls[0].shot if self.balls else None

    @property
    def measured(self) -> Circle | None:
        """Measured circle of the followed ball; None without one."""
        return self.balls[0].measured if self.balls else None

    @property
    def mean(self) -> NDArray[np.float64]:
        """(5,) float64 Kalman state of the followed ball; NaN without one."""
        return self.balls[0].mean if self.balls else NO_STATE

    @property
    def covariance(self) -> NDArray[np.float64]:
        """(5, 5) float64 covariance of the followed ball; NaN without one."""
        return self.balls[0].covariance if self.balls else NO_COVARIANCE
