"""Track: Hough circle and Kalman filter together (section 3.1)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..parameters import ParameterGroup, choice, tunable
from ..results import Circle

INPUTS = ("packet", "filter", "surface")
Status = Literal["searching", "starting", "tracking", "coasting", "lost"]


@dataclass(frozen=True, kw_only=True)
class TrackParameters(ParameterGroup):
    """The tick, the search for the circle, and the Kalman filter."""

    ball: str = choice(
        "flying", ("flying", "fixed"), "flying ball, or a ball spinner's ball that stays in place"
    )
    tick_us: int = tunable(5000, 200, 100_000, 100, "us", "time between two steps of the pipeline (200 Hz)")
    radius_min_px: float = tunable(5.0, 2.0, 500.0, 0.5, "px", "smallest radius looked for")
    radius_max_px: float = tunable(40.0, 3.0, 500.0, 0.5, "px", "largest radius looked for")
    latency_us: float = tunable(100.0, 0.0, 10_000.0, 10.0, "us", "how late the pixels report an edge")
    fixed_x_px: float | None = tunable(None, 0.0, 10_000.0, 0.1, "px", "fixed ball: column of the centre")
    fixed_y_px: float | None = tunable(None, 0.0, 10_000.0, 0.1, "px", "fixed ball: row of the centre")
    fixed_radius_px: float | None = tunable(None, 1.0, 1000.0, 0.1, "px", "fixed ball: radius")
    fixed_std_px: float = tunable(0.5, 0.0, 100.0, 0.1, "px", "fixed ball: 1 sigma of centre and radius")


@dataclass(frozen=True, slots=True, eq=False)
class TrackResult:
    """The ball at the end of the tick, as a robot would have had it.

    status : searching (nothing yet), starting (candidates, not yet trusted), tracking (measured in this tick),
        coasting (predicted, not measured), lost (just given up)
    reason : why there is no ball (searching, starting, lost), in words for people; None while there is one
    shot : number of the shot, from 0; None while there is no ball
    t_us : scene time of the state: the tick's end less the pixels' latency
    latency_us : that latency; an event stamped t shows the scene of t - latency_us
    mean : (5,) float64 Kalman state [x_px, y_px, vx_px_s, vy_px_s, radius_px]; NaN while there is no ball
    covariance : (5, 5) float64, its covariance
    hough : the circle of the Hough transform on the surface, before refinement and gating; None if none was found
    measured : the refined circle that entered the filter, None if none did
    candidate : the tick's best circle while the track is not trusted yet (for the viewer)
    """

    status: Status
    reason: str | None
    shot: int | None
    t_us: float
    latency_us: float
    mean: NDArray[np.float64]
    covariance: NDArray[np.float64]
    hough: Circle | None
    measured: Circle | None

    @property
    def has_ball(self) -> bool:
        """Whether there is a ball that later stages may use."""
        return self.status in ("tracking", "coasting")

    def centre_px(self, event_t_us: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Centre (x, y) in px at the scene times behind these event time stamps (section 3.2, eq. ball_pos)."""
        dt_s = (event_t_us - self.latency_us - self.t_us) * 1e-6
        return self.mean[0] + self.mean[2] * dt_s, self.mean[1] + self.mean[3] * dt_s
