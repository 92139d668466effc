"""One ball in view: its Kalman filter, the path of its measured circles, and how it is measured in the events."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..events import EventBatch
from ..kernels import crossing
from ..kernels.moving_circle import HALF_AHEAD
from ..kernels.take_events import take_events
from ..results import Circle, Packet
from .track_contact import Contact
from .track_kalman import OBSERVED, BallFilter, observation_noise
from .track_outline import FREE, LEAST_ARC, Edge, Sighting, measure
from .track_path import PathPoint
from .track_result import BallTrack, BeganBy
from .track_rim import Rim
from .track_rolling import JUDGED_US, ROLLING_M_S, SLOWEST_FLIGHT_M_S, rolls

Floats = NDArray[np.float64]

# Share of the half outline ahead that a tracked ball must show to be measured: a third pins down its circle.
LEAST_AHEAD = 0.3
# Arcs of both halves lag behind the ball by so much more, 1 sigma: in low contrast the pixels answer late. They may be
# arcs of the ball's shading: their radii are off by so much on white walls of our simulator (seeds 96000-96010).
ARCS_LAG_STD_PX, ARCS_RADIUS_STD_PX = 0.5, 1.2
# Squared Mahalanobis distance (three degrees of freedom) beyond which an outline is not the ball's: 5 sigma.
MOST_SURPRISE = 25.0
# Scatter of an outline's centre and radius from tick to tick beyond the statistical one, on the samples.
OUTLINE_STD_PX = 0.05
# The same of arcs, on white walls of our simulator (seeds 96000-96010): mostly 0.2 to 0.5 px, single ones 2 px.
ARCS_STD_PX = 0.5
# What no filtering takes away: the calibration of latency, place and radius. The first two differ from shot to shot;
# how far outside the outline is seen, from sensor to sensor: two simulators with the same biases are 0.3 px apart.
LATENCY_STD_US = 12.0
PLACE_STD_PX, RADIUS_STD_PX = 0.06, 0.3
COMMON_COVARIANCE = np.diag([PLACE_STD_PX**2, PLACE_STD_PX**2, 0.0, 0.0, RADIUS_STD_PX**2])
# A velocity from one outline is wrong by what the ball accelerates within its window; the paper: high enough to
# converge fast.
FIRST_SPEED_STD_M_S = 0.2
# A ball keeps its radius: an outline this much larger or smaller is another's.
SAME_RADIUS = 0.1
# Two tracks of one ball agree in velocity to this share.
SAME_VELOCITY = 0.2
# A ball's shadow on a level table keeps pace with it: from above, its image is slower by the share that the table is
# farther away, and under a slanted light it moves on by what the ball falls or rises.
SHADOW_VELOCITY, REVERSED_CONTRAST = 0.3, 0.5
# Outlines nearer to each other than this share events.
APART_PX = 5.0
# Error of the centre and radius of an outline that the border cuts, for each radius of it that is out of view.
HIDDEN_ERROR = 0.3
# A ball that turned is taken for one that flies on for up to so long: paths are compared from so long before.
MEETING_US = 10_000
# 1 sigma of the state in which a path known afterwards begins, of place and radius: what a few circles leave open.
FIRST_COVARIANCE = np.diag([0.3**2, 0.3**2, 0.0, 0.0, 0.3**2])


@dataclass(frozen=True, slots=True)
class Measuring:
    """Inputs of measuring a ball beside the ball.

    Attributes
    ----------
    camera : Camera
    ball_radius_m : float
    edge : Edge
    contour_us : int
        How far back the outline's events are taken.
    acceleration_m_s2, approach_m_s : float
        1 sigma of the acceleration and of the speed towards the camera.
    """

    camera: Camera
    ball_radius_m: float
    edge: Edge
    contour_us: int
    acceleration_m_s2: float
    approach_m_s: float

    def filter_at(self, mean: Floats, covariance: Floats) -> BallFilter:
        """A filter that starts at this state (5,) with this covariance (5, 5) of a single outline."""
        per_m = self.edge.outline(mean)[4] / self.ball_radius_m
        spread = covariance.copy()
        spread[OBSERVED, OBSERVED] += OUTLINE_STD_PX**2
        spread[[2, 3], [2, 3]] += (FIRST_SPEED_STD_M_S * per_m) ** 2
        growth = self.approach_m_s * per_m * mean[4] / self.camera.focal_px
        return BallFilter(mean, spread, self.acceleration_m_s2 * per_m, growth)

    def circle(self, sighting: Sighting) -> Circle:
        """The ball's silhouette as sighted."""
        x, y, _, _, radius = self.edge.ball(sighting.ring).tolist()
        return Circle(x, y, radius, sighting.score)


@dataclass(slots=True, eq=False)
class TrackedBall:
    """A ball in view, from tick to tick.

    Attributes
    ----------
    shot : int
        Number of its shot.
    start_us : int
        Start of the shot (file time).
    began_by : str
        How it began.
    filter : BallFilter
    seen_us : int
        End of the last tick in which it was measured.
    seen : (5,) float64
        Its state then.
    path : list of PathPoint
        The shot's ticks of the last JUDGED_US.
    is_shot : bool
        Whether it is taken for a flight: until it is seen to roll, or to be another's shadow.
    doubt : str, optional
        What speaks against one free flight so far, in words for people.
    contrast : float
        Of its outline when it was last measured (see `Sighting`).
    rim : Rim
        What the events behind tell of its rim.
    part : int
        Part of the outline that it is measured by.
    """

    shot: int
    start_us: int
    began_by: BeganBy
    filter: BallFilter
    seen_us: int
    seen: Floats
    path: list[PathPoint] = field(default_factory=list)
    is_shot: bool = True
    doubt: str | None = None
    contrast: float = 0.0
    rim: Rim = Rim()
    part: int = HALF_AHEAD

    @classmethod
    def at(cls, sighting: Sighting, measuring: Measuring, shot: int, packet: Packet, began_by: BeganBy) -> TrackedBall:
        """The ball of a sighting at a packet's end."""
        state = measuring.edge.ball(sighting.ring)
        ball = cls(shot, packet.start_us, began_by, measuring.filter_at(state, sighting.covariance), 0, state)
        noise = ball._noise(measuring, sighting, packet.start_us, packet.end_us)
        ball._see(measuring.circle(sighting), sighting, noise, packet.end_us)
        return ball

    def after(self, contact: Contact, measuring: Measuring, shot: int) -> TrackedBall:
        """The ball's next shot, at the end of the first tick after a contact, by the path since."""
        first_us = next(point.end_us for point in self.path if point.end_us > contact.latest_us)
        state = contact.path.state(first_us)
        new = measuring.filter_at(state, FIRST_COVARIANCE)
        return TrackedBall(
            shot,
            contact.latest_us,
            contact.kind,
            new,
            first_us,
            state,
            contrast=self.contrast,
            rim=self.rim,
            part=self.part,
        )

    def extended(self, path: list[PathPoint], start_us: int, state: Floats, measuring: Measuring) -> TrackedBall:
        """The ball as found in the first tick of a path, where its state was this (5,)."""
        return replace(
            self,
            start_us=start_us,
            filter=measuring.filter_at(state, FIRST_COVARIANCE),
            seen_us=path[0].end_us,
            seen=state,
            path=[],
        )

    def follow(self, path: list[PathPoint], own_us: int) -> Iterator[PathPoint]:
        """Go along a path from the shot's first tick on, with the circles since own_us, which show no other shot."""
        for point in path:
            if point.end_us < self.seen_us and not self.path:
                continue
            if self.path:
                self.filter.predict((point.end_us - self.path[-1].end_us) * 1e-6)
            circle = point.circle if point.end_us >= own_us else None
            if circle is not None:
                observed = np.array([circle.x_px, circle.y_px, circle.radius_px])
                self.filter.update(observed, point.noise, math.inf)
                self.seen_us, self.seen = point.end_us, self.filter.mean
            self._add(replace(point, circle=circle))
            yield point

    def rolls(self, measuring: Measuring) -> bool | None:
        """Whether it rolls; None where that cannot be told of a ball that is hardly fast enough for a flight."""
        speed_m_s = self.speed_m_s(measuring.ball_radius_m)
        if speed_m_s >= ROLLING_M_S:
            return False
        seen = rolls(self.path, measuring.camera, measuring.ball_radius_m, measuring.contour_us)
        return False if seen is None and speed_m_s >= SLOWEST_FLIGHT_M_S else seen

    def speed_m_s(self, ball_radius_m: float) -> float:
        """Speed across the view."""
        _, _, vx, vy, radius = self.filter.mean.tolist()
        return float(math.hypot(vx, vy) / radius * ball_radius_m)

    @property
    def measured(self) -> Circle | None:
        """The circle measured in the present tick, None if the ball coasts."""
        return self.path[-1].circle if self.path else None

    def own_events(self, events: EventBatch, others: list[TrackedBall], end_us: int) -> EventBatch:
        """Events without those that are nearer to the outline of another ball which this one's touches."""
        x, y, _, _, radius = self.filter.mean.tolist()
        near = []
        for other in others:
            other_x, other_y, _, _, other_radius = other.filter.mean.tolist()
            if math.hypot(other_x - x, other_y - y) < other_radius + radius + APART_PX:
                near.append(other.filter.mean)
        if not near:
            return events
        rows = crossing.nearest_outline(self.filter.mean, np.array(near), events.columns, end_us)
        return EventBatch(*take_events(rows, events.columns))

    def measure(self, measuring: Measuring, events: EventBatch, start_us: int, end_us: int) -> Sighting | None:
        """Measure the outline near the predicted ball and give it to the filter; None if it is not there."""
        variances = self.filter.covariance.diagonal().tolist()
        x_std, y_std, vx_std, vy_std, _ = (math.sqrt(variance) for variance in variances)
        expected = measuring.edge.outline(self.filter.mean)
        # The velocity may leave the prediction by ten radii a second and the radius by half a pixel: loose for a
        # ball wholly in view, and it keeps the fit sane on short arcs.
        loose = np.array([1e9, 1e9, 10 * expected[4] + vx_std, 10 * expected[4] + vy_std, 0.5])
        gate = 2.0 + 3.0 * max(x_std, y_std)
        sighting = measure(events, end_us, measuring.camera, expected, gate, loose, self.part)
        if sighting is None or not self._is_pinned(sighting):
            return None
        noise, circle = self._noise(measuring, sighting, start_us, end_us), measuring.circle(sighting)
        observed = np.array([circle.x_px, circle.y_px, circle.radius_px])
        if not self.filter.update(observed, noise, MOST_SURPRISE):
            return None
        self._see(circle, sighting, noise, end_us)
        return sighting

    def measure_off_path(self, measuring: Measuring, events: EventBatch, start_us: int, end_us: int) -> Sighting | None:
        """A clear outline of the ball's size up to half a radius off its path, as after a contact: start anew there."""
        expected = measuring.edge.outline(self.filter.mean)
        sighting = measure(events, end_us, measuring.camera, expected, 0.5 * expected[4], FREE)
        if sighting is None or not sighting.trusted or not self.has_size(sighting):
            return None
        self.restart(measuring, sighting, start_us, end_us)
        return sighting

    def has_size(self, sighting: Sighting) -> bool:
        """Whether an outline is as large as the ball's."""
        return bool(abs(sighting.ring[4] / self.filter.mean[4] - 1.0) < SAME_RADIUS)

    def restart(self, measuring: Measuring, sighting: Sighting, start_us: int, end_us: int) -> None:
        """Start the filter anew at a sighting of the ball off its path."""
        self.filter = measuring.filter_at(measuring.edge.ball(sighting.ring), sighting.covariance)
        noise = self._noise(measuring, sighting, start_us, end_us)
        self._see(measuring.circle(sighting), sighting, noise, end_us)

    def _is_pinned(self, sighting: Sighting) -> bool:
        """Whether enough of the outline is seen to pin down its circle."""
        if sighting.part == HALF_AHEAD:
            return sighting.ahead >= LEAST_AHEAD
        return min(sighting.ahead, sighting.behind) >= LEAST_ARC

    def add_shake(self, std_px: float, since_us: int) -> None:
        """Note that a shaking camera moved the circles since by so much, 1 sigma: so much of a bend is no contact."""
        self.path = [
            replace(one, shake_px=max(one.shake_px, std_px)) if one.end_us > since_us else one for one in self.path
        ]

    def coast(self, end_us: int) -> None:
        """Note a tick in which it was not measured."""
        self._add(PathPoint(end_us, None, np.zeros((3, 3))))

    def covers(self, sighting: Sighting) -> bool:
        """Whether a sighting's centre lies within the ball: it is the ball again, or not to be told from it."""
        return bool(np.hypot(*(sighting.ring - self.filter.mean)[:2]) < self.filter.mean[4])

    def is_found(self, sighting: Sighting, end_us: int) -> bool:
        """Whether a sighting is this ball, out of sight: at its place, or on a path that meets its own of late."""
        times_s = np.linspace(self.seen_us - MEETING_US - end_us, 0.0, 50)[:, None] * 1e-6
        old = self.seen[:2] + (times_s + (end_us - self.seen_us) * 1e-6) * self.seen[2:4]
        new = sighting.ring[:2] + times_s * sighting.ring[2:4]
        meets = np.hypot(*(old - new).T).min() < 0.5 * self.seen[4]
        return self.has_size(sighting) and bool(meets or self.covers(sighting))

    def shares_outline(self, other: TrackedBall) -> bool:
        """Whether both are measured at the same place and fly the same way: crossing balls differ in velocity."""
        if self.measured is None or other.measured is None:
            return False
        x, y, vx, vy, radius = self.filter.mean.tolist()
        other_x, other_y, other_vx, other_vy, _ = other.filter.mean.tolist()
        return math.hypot(other_x - x, other_y - y) < 0.5 * radius and math.hypot(
            other_vx - vx, other_vy - vy
        ) < SAME_VELOCITY * math.hypot(vx, vy)

    def was_near(self, mean: Floats, end_us: int) -> bool:
        """Whether its circle of the tick with this end touched, or nearly, the outline of a ball of this state (5,)."""
        circle = next((point.circle for point in self.path if point.end_us == end_us), None)
        if circle is None:
            return False
        apart_px = math.hypot(circle.x_px - mean[0], circle.y_px - mean[1])
        return bool(apart_px < circle.radius_px + mean[4] + APART_PX)

    def is_shadow_of(self, other: TrackedBall) -> bool:
        """Whether it is darker than what is around it and keeps pace with one that is brighter."""
        if self.contrast > -REVERSED_CONTRAST or other.contrast < REVERSED_CONTRAST:
            return False
        off = np.hypot(*(self.filter.mean - other.filter.mean)[2:4])
        return bool(off < SHADOW_VELOCITY * np.hypot(*other.filter.mean[2:4]))

    def total_covariance(self, observed_std_px: float = 0.0) -> Floats:
        """(5, 5) float64: the filter's covariance plus the errors that every tick has in common.

        And a further one of place and radius.
        """
        _, _, vx, vy, _ = self.filter.mean.tolist()
        covariance: Floats = self.filter.covariance + COMMON_COVARIANCE
        _shift(covariance, vx * LATENCY_STD_US * 1e-6, vy * LATENCY_STD_US * 1e-6)
        if self.part != HALF_AHEAD:
            speed = math.hypot(vx, vy)
            _shift(covariance, vx / speed * ARCS_LAG_STD_PX, vy / speed * ARCS_LAG_STD_PX)
            covariance[4, 4] += ARCS_RADIUS_STD_PX**2
        if observed_std_px > 0.0:
            covariance[OBSERVED, OBSERVED] += observed_std_px**2
        return covariance

    def track(self, end_us: int, latency_us: float, outline_px: float, earlier: tuple[BallTrack, ...]) -> BallTrack:
        """Its present state, to the ball's rim; with `outline_px` = 0 to where the events ahead lie."""
        mean, circle = self.filter.mean.copy(), self.measured
        _, _, vx, vy, radius = mean.tolist()
        rim_px = self.rim.outside_px(math.hypot(vx, vy)) if outline_px > 0.0 else 0.0
        mean[4] += rim_px
        return BallTrack(
            self.shot,
            end_us - latency_us,
            latency_us,
            mean,
            self.total_covariance(self.rim.std_px(radius)),
            None if circle is None else Circle(circle.x_px, circle.y_px, circle.radius_px + rim_px, circle.score),
            self.start_us,
            self.began_by,
            self.is_shot,
            earlier,
            self.doubt,
        )

    def _noise(self, measuring: Measuring, sighting: Sighting, start_us: int, end_us: int) -> Floats:
        # Outlines taken further back than one tick share events with the tick before and so count for less.
        shared = max(1.0, measuring.contour_us / (end_us - start_us))
        scatter_px = OUTLINE_STD_PX if sighting.part == HALF_AHEAD else ARCS_STD_PX
        return observation_noise(sighting.covariance, scatter_px**2, shared)

    def _see(self, circle: Circle, sighting: Sighting, noise: Floats, end_us: int) -> None:
        self.seen_us, self.seen = end_us, self.filter.mean
        self.contrast, self.part = sighting.contrast, sighting.part
        if sighting.visible < 1.0:
            hidden = HIDDEN_ERROR * (1.0 - sighting.visible) * sighting.ring[4]
            noise = noise + hidden**2 * np.eye(3)
        elif sighting.part == HALF_AHEAD:
            self.rim = self.rim.with_outline(sighting)
        self._add(PathPoint(end_us, circle, noise, self.rim.unsteady_px(circle.radius_px)))

    def _add(self, point: PathPoint) -> None:
        if self.path and self.path[-1].end_us == point.end_us:  # found again elsewhere after all
            del self.path[-1]
        self.path.append(point)
        while self.path[0].end_us < point.end_us - JUDGED_US:
            del self.path[0]


def _shift(covariance: Floats, x_px: float, y_px: float) -> None:
    """Add an error of the place by this, 1 sigma, to a covariance (5, 5)."""
    covariance[0, 0] += x_px * x_px
    covariance[0, 1] += x_px * y_px
    covariance[1, 0] += y_px * x_px
    covariance[1, 1] += y_px * y_px
