"""Evidence of a flying ball in its track: no spin is trusted of a ball that may not have flown there."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from .results import Circle

if TYPE_CHECKING:
    from .stages.track_result import BallTrack

# Three circles in a row: the first two give a velocity, the third confirms it. They must be seen over this time, for
# circles of ticks that follow each other more quickly share events (track.contour_us is 3 ms).
FEWEST_IN_ROW, SHORTEST_US = 3, 10_000.0
# The slowest shot that the tracker looks for (1 m/s, 50 radii a second) flies so many radii within SHORTEST_US.
SHORTEST_REACH = 0.5
# Centres scatter by a hundredth of a radius about a flight, by a seventh where a camera vibrates by 2 px at the worst
# frequency. Fewer differences than these tell nothing.
LARGEST_SCATTER, FEWEST_DIFFERENCES = 0.2, 4
# The circles that are compared are so far apart: the paper's tick. Nearer ones share events, and what a dot on a
# turning disc does within them is next to straight.
SPACING_US = 5000.0
# Third differences of white noise of 1 sigma have sqrt(1 + 9 + 9 + 1) sigma.
NOISE_OF_DIFFERENCE = math.sqrt(20.0)

Place = tuple[float, float, float]  # t_us, x_px, y_px


@dataclass(frozen=True, slots=True, kw_only=True)
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
    reach_px : float
        Largest distance of a measured centre from the first one.
    recent : tuple of (t_us, x_px, y_px)
        The row's last three centres that are SPACING_US apart.
    differences, sum_squares : int, float
        Number of third differences of such centres in radii, and the sum of their squares. A flight has next to none:
        it is a parabola, and perspective changes slowly.
    of_track : str, optional
        What the tracker has against one free flight (`BallTrack.doubt`).
    """

    is_fixed: bool = False
    ticks: int = 0
    in_row: int = 0
    most_in_row: int = 0
    row_since_us: float = 0.0
    longest_row_us: float = 0.0
    first: Circle | None = None
    reach_px: float = 0.0
    recent: tuple[Place, ...] = ()
    differences: int = 0
    sum_squares: float = 0.0
    of_track: str | None = None

    def with_tick(self, ball: BallTrack) -> TrackEvidence:
        """The evidence one tick later."""
        circle = ball.measured
        if circle is None:
            is_fixed = not ball.mean[2:4].any()
            return replace(self, is_fixed=is_fixed, ticks=self.ticks + 1, in_row=0, recent=(), of_track=ball.doubt)
        first, since_us = self.first or circle, self.row_since_us if self.in_row else ball.t_us
        places = self.recent
        if not places or ball.t_us - places[-1][0] > SPACING_US - 1.0:
            places = (*places, (ball.t_us, circle.x_px, circle.y_px))
        square_px2 = _third_difference_px2(places)
        return TrackEvidence(
            ticks=self.ticks + 1,
            in_row=self.in_row + 1,
            most_in_row=max(self.most_in_row, self.in_row + 1),
            row_since_us=since_us,
            longest_row_us=max(self.longest_row_us, ball.t_us - since_us),
            first=first,
            reach_px=max(self.reach_px, math.hypot(circle.x_px - first.x_px, circle.y_px - first.y_px)),
            recent=places[-3:],
            differences=self.differences + (square_px2 is not None),
            sum_squares=self.sum_squares + (square_px2 or 0.0) / circle.radius_px**2,
            of_track=ball.doubt,
        )

    @property
    def doubt(self) -> str | None:
        """Reason for trusting no spin of this ball, in words for people; None where the track gives none."""
        if self.is_fixed:
            return None
        if self.first is None or self.most_in_row < FEWEST_IN_ROW or self.longest_row_us < SHORTEST_US:
            return (
                f"too little of the track is measured: {self.most_in_row} of {self.ticks} ticks in a row, "
                f"{FEWEST_IN_ROW} over {SHORTEST_US / 1000:g} ms are needed "
                "(a ball on a spinner needs --fixed-ball auto)"
            )
        if self.reach_px < SHORTEST_REACH * self.first.radius_px:
            circle = f"{self.first.x_px:.0f} {self.first.y_px:.0f} {self.first.radius_px:.0f}"
            return (
                f"the ball stays in its place, within {self.reach_px:.1f} px "
                f"(a ball on a spinner needs --fixed-ball {circle} or --fixed-ball auto)"
            )
        if self.scatter > LARGEST_SCATTER:
            return f"the track is no flight: its circles scatter by {self.scatter:.2f} radii about a smooth path"
        return self.of_track

    @property
    def scatter(self) -> float:
        """1 sigma of the measured centres about a smooth path, radii; 0 where too few are measured in a row."""
        if self.differences < FEWEST_DIFFERENCES:
            return 0.0
        return math.sqrt(self.sum_squares / (2 * self.differences)) / NOISE_OF_DIFFERENCE


def _third_difference_px2(places: tuple[Place, ...]) -> float | None:
    """Square of the third difference of four centres at even times; None for fewer, or uneven times."""
    if len(places) < 4:
        return None
    (a_us, ax, ay), (b_us, bx, by), (c_us, cx, cy), (d_us, dx, dy) = places
    if max(abs(a_us - 2 * b_us + c_us), abs(b_us - 2 * c_us + d_us)) > 1.0:
        return None  # the last tick of a recording may be shorter
    return (dx - 3 * cx + 3 * bx - ax) ** 2 + (dy - 3 * cy + 3 * by - ay) ** 2


NO_EVIDENCE = TrackEvidence()
