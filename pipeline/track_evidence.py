"""Evidence of a flying ball in its track: no spin is trusted of a ball that may not have flown there."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .results import Circle

if TYPE_CHECKING:
    from .stages.track import BallTrack

# Three circles in a row: the first two give a velocity, the third confirms it. They must be seen over this time, for
# circles of ticks that follow each other more quickly share events (track.contour_us is 3 ms).
FEWEST_IN_ROW, SHORTEST_US = 3, 10_000.0
# The slowest shot that the tracker looks for (1 m/s, 50 radii a second) flies so many radii within SHORTEST_US.
SHORTEST_REACH = 0.5
# A parabola fits flights to a tenth of a radius, in vibration of 2 px too; a hand, noise or two balls taken for one
# it does not.
ERRATIC_RADII, FEWEST_FOR_PARABOLA = 0.25, 5


@dataclass(frozen=True, eq=False)
class TrackEvidence:
    """Evidence of one track from its start to a tick, brought up to date in constant time.

    Attributes
    ----------
    is_fixed : bool
        Whether the ball stays in place because the user says so: nothing is measured.
    ticks, in_row, most_in_row : int
        Number of ticks, of measured ones in a row up to now, and most of them.
    row_since_us, longest_row_us : float
        Scene time of the first tick of the present row; longest time from a row's first tick to its last.
    first : Circle, optional
        First measured circle; None before.
    first_us : float
        Its scene time.
    reach_px : float
        Largest distance of a measured centre from the first one.
    moments : (5, 5) float64
        Sums over the measured ticks of products of [1, s, s^2, x, y], s in seconds from the first circle, x and y in px
        from its centre: what the fit of a parabola needs.
    """

    is_fixed: bool
    ticks: int
    in_row: int
    most_in_row: int
    row_since_us: float
    longest_row_us: float
    first: Circle | None
    first_us: float
    reach_px: float
    moments: NDArray[np.float64]

    def with_tick(self, ball: BallTrack) -> TrackEvidence:
        """The evidence one tick later."""
        circle = ball.measured
        if circle is None:
            return replace(self, is_fixed=not ball.mean[2:4].any(), ticks=self.ticks + 1, in_row=0)
        first, first_us = (circle, ball.t_us) if self.first is None else (self.first, self.first_us)
        since_us = self.row_since_us if self.in_row else ball.t_us
        s, x, y = (ball.t_us - first_us) * 1e-6, circle.x_px - first.x_px, circle.y_px - first.y_px
        terms = np.array([1.0, s, s * s, x, y])
        moments = self.moments + terms[:, None] * terms
        moments.flags.writeable = False
        return TrackEvidence(
            is_fixed=False,
            ticks=self.ticks + 1,
            in_row=self.in_row + 1,
            most_in_row=max(self.most_in_row, self.in_row + 1),
            row_since_us=since_us,
            longest_row_us=max(self.longest_row_us, ball.t_us - since_us),
            first=first,
            first_us=first_us,
            reach_px=max(self.reach_px, math.hypot(x, y)),
            moments=moments,
        )

    @cached_property
    def doubt(self) -> str | None:
        """Why no spin of this ball is trusted, in words for people; None where the track gives no reason to doubt."""
        if self.is_fixed:
            return None
        if self.first is None or self.most_in_row < FEWEST_IN_ROW or self.longest_row_us < SHORTEST_US:
            return (
                f"too little of the track is measured: {self.most_in_row} of {self.ticks} ticks in a row, "
                f"{FEWEST_IN_ROW} over {SHORTEST_US / 1000:g} ms are needed{_if_fixed('auto')}"
            )
        if self.reach_px < SHORTEST_REACH * self.first.radius_px:
            place = f"{self.first.x_px:.0f} {self.first.y_px:.0f} {self.first.radius_px:.0f}"
            return f"the ball stays in its place, within {self.reach_px:.1f} px{_if_fixed(place, 'auto')}"
        if (scatter_px := self.scatter_px) > ERRATIC_RADII * self.first.radius_px:
            return f"the track is no flight: its circles lie {scatter_px:.1f} px beside a parabola{_if_fixed('auto')}"
        return None

    @property
    def scatter_px(self) -> float:
        """RMS distance of the measured centres from the parabola through them, px; 0 where too few are measured."""
        count = float(self.moments[0, 0])
        if count < FEWEST_FOR_PARABOLA:
            return 0.0
        powers, places = self.moments[:3, :3], self.moments[:3, 3:]
        explained = places * np.linalg.lstsq(powers, places, rcond=None)[0]
        left = np.trace(self.moments[3:, 3:]) - explained.sum()
        return math.sqrt(max(float(left), 0.0) / count)


def _if_fixed(*circles: str) -> str:
    options = " or ".join(f"--fixed-ball {circle}" for circle in circles)
    return f" (a ball on a spinner needs {options})"


_NOWHERE = np.zeros((5, 5))
_NOWHERE.flags.writeable = False
NO_EVIDENCE = TrackEvidence(False, 0, 0, 0, 0.0, 0.0, None, 0.0, 0.0, _NOWHERE)
