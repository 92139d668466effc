"""The ball's outline measured in the events, to sub-pixel: the refinement of the tracker's Hough circles.

The half of the outline that moves outwards is fitted, the background-to-ball edge: it is as sharp as the
pixels allow whatever the light. At the other half the ball's own shading fires before the edge comes, by up
to 0.8 px on the samples, which differs from shot to shot. Where the ground is as bright as the lit side of the ball,
only arcs of its shaded side show: those of both halves are fitted, by their polarity (`sight_arcs`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..events import EventBatch
from ..kernels import outline as kernels
from ..kernels.moving_circle import HALF_AHEAD, OF_BRIGHT, OF_DARK
from ..kernels.velocity_vote import SIGNED, UNSIGNED, find_moving_circle
from ..results import Circle

Floats = NDArray[np.float64]

# Share of an outline that has events, less the events around it for each one on it. In low contrast on our simulator
# (seeds 901-926) it is 0.7 to 1 on balls, 0.4 to 0.67 on circles that marks and shading draw inside them.
LEAST_EXPLAINED = 0.7
# Least share of either half of an outline that shows in arcs, error of its radius, and events just outside for each one
# on it. On white walls of our simulator (seeds 41000-41011) balls show 0.2 to 0.6 of each half and hardly an event
# outside; circles that a logo draws have a tenth and more there.
LEAST_ARC, MOST_RADIUS_ERROR, MOST_OUTSIDE = 0.2, 0.03, 0.02
# The velocity vote looks this far back in time; longer bends the test, shorter leaves too few events.
VOTE_US = 1500
# Rings (2, 5) by both votes, NaN with too few events, and the width of the vote in px.
MovingCircles = tuple[Floats, float]
# 1 sigma (5,) of an expected ring that holds nothing.
FREE = np.full(5, 1e9)


@dataclass(frozen=True, slots=True)
class Edge:
    """Difference between the outline that the pixels report and the ball's.

    It lies outline_px outside, because a pixel answers as soon as part of it sees the ball, and lag_px
    behind.
    """

    outline_px: float
    lag_px: float

    def outline(self, ball: Floats) -> Floats:
        """The ring (5,) that a ball (5,) [x, y, vx, vy, radius] shows."""
        return self._shifted(ball, 1.0)

    def ball(self, ring: Floats) -> Floats:
        """The ball (5,) behind a ring (5,)."""
        return self._shifted(ring, -1.0)

    def _shifted(self, ring: Floats, sign: float) -> Floats:
        x, y, vx, vy, radius = ring.tolist()
        speed = math.hypot(vx, vy)
        lag_s = sign * self.lag_px / speed if speed > 0 else 0.0
        return np.array([x - lag_s * vx, y - lag_s * vy, vx, vy, radius + sign * self.outline_px])


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """One measured outline at the end of a tick.

    Attributes
    ----------
    ring : (5,) float64
        [x, y, vx, vy, radius] of the outline as the events show it (px, px/s).
    covariance : (5, 5) float64
        From the scatter of the events alone.
    scatter_px : float
        1 sigma of the events' distances from the outline.
    events : int
        Events on the outline, both halves.
    ahead, behind : float
        Share of the visible outline that has events, where it moves outwards and inwards.
    contrast : float
        Share of ON events ahead less that behind: +1 for a bright ball, -1 for a dark one.
    visible : float
        Share of the outline that is in the image.
    clutter : float
        Events just outside the outline, for each one on it.
    behind_px : float
        How far outside the outline the events behind lie, px: see `kernels.outline.distance_behind`.
    part : int
        Part of the outline that was fitted, see `kernels.moving_circle.near_outline`.
    """

    ring: Floats
    covariance: Floats
    scatter_px: float
    events: int
    ahead: float
    behind: float
    contrast: float
    ahead_on: float
    visible: float
    clutter: float
    behind_px: float = math.nan
    part: int = HALF_AHEAD

    @property
    def speed_px_s(self) -> float:
        """Speed of the outline, px/s."""
        return math.hypot(self.ring[2], self.ring[3])

    @property
    def score(self) -> float:
        """Share of the visible outline that has events."""
        return (self.ahead + self.behind) / 2

    @property
    def trusted(self) -> bool:
        """Whether this outline alone is enough to start a track.

        Both halves, each of its own polarity, hardly anything around them, and a speed known to a tenth.
        """
        return (
            self.ahead >= 0.8
            and self.behind >= 0.6
            and abs(self.contrast) >= 0.8
            and self.visible >= 0.6
            and self.clutter <= 0.3
            and self._is_velocity_known
        )

    @property
    def promising(self) -> bool:
        """Whether this may be a ball coming in: the half ahead is there and of one polarity."""
        return self.ahead >= 0.7 and max(self.ahead_on, 1 - self.ahead_on) >= 0.85 and self.clutter <= 0.5

    @property
    def explained(self) -> bool:
        """Whether one moving disc explains the events on and around its outline, whatever their polarity.

        Over ground brighter here and darker there the polarity changes along the outline. Both halves must be there; of
        a ball that comes in, the half ahead of one polarity.
        """
        shown = self.ahead if self.visible < 0.8 and self.promising else self.score
        return self.ahead >= 0.8 and shown - self.clutter >= LEAST_EXPLAINED and self._is_velocity_known

    @property
    def isolated(self) -> bool:
        """Whether half of the half ahead is there and hardly an event around it.

        So looks a ball before ground that is as bright as a part of its shaded rim.
        """
        return self.ahead >= 0.5 and self.clutter <= 0.1 and self._is_velocity_known

    @property
    def in_arcs(self) -> bool:
        """Whether an arc of each half is there, they alone fix the circle, and next to nothing lies around it."""
        return (
            min(self.ahead, self.behind) >= LEAST_ARC
            and self.clutter <= MOST_OUTSIDE
            and _is_fixed_by_arcs(self.ring, self.covariance)
        )

    @property
    def _is_velocity_known(self) -> bool:
        return _is_velocity_known(self.ring, self.covariance)


def _is_velocity_known(ring: Floats, covariance: Floats) -> bool:
    """Whether the speed of a ring (5,) with this covariance is known to a tenth."""
    return bool(covariance[2, 2] + covariance[3, 3] <= (0.1 * math.hypot(ring[2], ring[3])) ** 2)


def _is_fixed_by_arcs(ring: Floats, covariance: Floats) -> bool:
    """Whether a ring (5,) with this covariance is known well enough where only arcs of it show."""
    return bool(covariance[4, 4] <= (MOST_RADIUS_ERROR * ring[4]) ** 2) and _is_velocity_known(ring, covariance)


def disc_share(ring: Floats, events: EventBatch, end_us: int) -> float:
    """Share of the events within twice the radius of a moving ring (5,) that lie on its disc or outline; 0 of none."""
    on_disc, around = kernels.disc_events(ring, events.columns, end_us)
    return on_disc / around if around else 0.0


def _optics_px(camera: Camera) -> tuple[float, float, float]:
    return camera.focal_px, camera.principal_x_px, camera.principal_y_px


def measure(
    events: EventBatch,
    end_us: int,
    camera: Camera,
    expected: Floats,
    gate_px: float,
    prior_std: Floats,
    part: int = HALF_AHEAD,
) -> Sighting | None:
    """Fit the outline near an expected ring (5,) at end_us; None with too few events or without a result.

    Parameters
    ----------
    gate_px : float
        Events this near the expected outline take part.
    prior_std : (5,)
        How firmly the expectation holds.
    part : int
        Part of the outline that is fitted, see `kernels.moving_circle.near_outline`.
    """
    size, optics_px = (camera.width_px, camera.height_px), _optics_px(camera)
    ring, covariance, scatter_px, found, behind_px = kernels.measured_outline(
        expected, prior_std, optics_px, events.columns, end_us, gate_px, part, *size
    )
    return None if math.isnan(ring[0]) else _sighting(ring, covariance, scatter_px, found, behind_px, part)


def _sighting(
    ring: Floats, covariance: Floats, scatter_px: float, found: Floats, behind_px: float, part: int
) -> Sighting:
    """The outline of a fit, with its evidence as `kernels.outline.evidence` gives it."""
    events_on, ahead_on, behind_on, ahead, behind, visible, outside, _ = found.tolist()
    return Sighting(
        ring,
        covariance,
        scatter_px,
        int(events_on),
        ahead,
        behind,
        ahead_on - behind_on,
        ahead_on,
        visible,
        outside / max(events_on, 1.0),
        behind_px,
        part,
    )


def moving_circles(recent: EventBatch, end_us: int, circle: Circle, fastest_radii_s: float) -> MovingCircles:
    """The rings of a Hough circle that move as most events say, up to so many radii a second.

    Parameters
    ----------
    recent : EventBatch
        The events of the last VOTE_US.
    """
    radius = circle.radius_px
    return find_moving_circle(
        circle.x_px, circle.y_px, radius, recent.columns, end_us, VOTE_US * 1e-6, fastest_radii_s * radius
    )


def sight(
    moving: MovingCircles, recent: EventBatch, events: EventBatch, end_us: int, camera: Camera, *, signed: bool
) -> Sighting | None:
    """The outline of a moving circle: fitted to the events of the last VOTE_US, then to all; None when there is none.

    The circle is that of the signed or of the unsigned vote, see `kernels.velocity_vote.vote_velocity`.
    """
    circles, gate_px = moving
    expected = circles[SIGNED if signed else UNSIGNED]
    if math.isnan(expected[0]):
        return None
    first = measure(recent, end_us, camera, expected, 1.5 * gate_px, FREE)
    if first is None or first.ahead < 0.3:
        return None
    return measure(events, end_us, camera, first.ring, 3.0, FREE)


def sight_arcs(
    moving: MovingCircles, recent: EventBatch, events: EventBatch, end_us: int, camera: Camera
) -> Sighting | None:
    """The outline of a moving circle of which only arcs show; None when there is none.

    As `sight` with the signed vote, but fitted to the events of both halves that a darker or a brighter disc gives: it
    takes the arcs' whole span to fix the circle, and a logo beside them gives events of the other polarity as well.
    """
    circles, gate = moving
    ring = circles[SIGNED]
    if math.isnan(ring[0]):
        return None
    columns, size = events.columns, (camera.width_px, camera.height_px)
    optics_px = _optics_px(camera)
    oval = kernels.ellipticity_at(ring[0], ring[1], optics_px)
    for part in (OF_DARK, OF_BRIGHT):
        first, _, _ = kernels.fit_outline(ring, FREE, oval, recent.columns, end_us, 1.5 * gate, part)
        if math.isnan(first[0]):
            continue
        first_oval = kernels.ellipticity_at(first[0], first[1], optics_px)
        fitted, covariance, scatter_px = kernels.fit_outline(first, FREE, first_oval, columns, end_us, 3.0, part)
        if math.isnan(fitted[0]) or not _is_fixed_by_arcs(fitted, covariance):
            continue  # before its support is counted, which takes as long as the fit
        evidence = kernels.evidence(fitted, first_oval, columns, end_us, *size)
        sighting = _sighting(fitted, covariance, scatter_px, *evidence, part)
        if sighting.in_arcs:
            return sighting
    return None
