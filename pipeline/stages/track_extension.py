"""Extension of a track to the ticks before its ball was known, by outlines measured in their events.

A ball must be seen twice, or for a while, before it is followed: in low contrast and in clutter that takes several
ticks. Its path then tells where it was before, and its outline is measured there as in any other tick.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..events import EventBatch
from ..results import Packet
from .track_ball import Measuring, TrackedBall
from .track_path import PathPoint

# Longer than it takes to tell that a slow ball is a shot (`track_initiation.WATCH_US`) where it is missed for a while
# (`track_initiation.HELD_US`), and half of what the chain keeps for shots that are announced late.
EXTENDED_US = 50_000
# The centre lies so many radii inside the image where 0.6 of the outline is visible, as of a trusted sighting.
LEAST_INSIDE = 0.3


@dataclass(slots=True, eq=False)
class Past:
    """Ticks of the last EXTENDED_US, and balls of that time.

    Attributes
    ----------
    ticks : list of Packet
        Their contour events, oldest first, without gaps, the present one among them.
    gone : list of TrackedBall
        Those that are no longer followed, as they were last.
    """

    ticks: list[Packet] = field(default_factory=list)
    gone: list[TrackedBall] = field(default_factory=list)

    def add(self, tick: Packet) -> None:
        """Take the present tick."""
        since_us = tick.end_us - EXTENDED_US
        self.ticks = [*(one for one in self.ticks if one.start_us >= since_us), tick]
        self.gone = [ball for ball in self.gone if ball.seen_us > since_us]

    def path_before(
        self, ball: TrackedBall, flying: list[TrackedBall], measuring: Measuring, coast_us: int
    ) -> tuple[list[PathPoint], NDArray[np.float64]]:
        """The path of a ball found in the present tick, from the first tick in which it is measured to this one.

        Also its state (5,) at the end of that first tick. It is followed back in time as it would be forwards: to
        where it is not measured for coast_us, comes into the image, or meets a ball that was followed then, one of
        those flying or gone.
        """
        back = replace(ball, filter=copy.copy(ball.filter), path=list(ball.path))
        path, others = list(ball.path), [*flying, *self.gone]
        for tick in reversed(self.ticks[:-1]):
            back.filter.predict((tick.end_us - path[-1].end_us) * 1e-6)
            mean, unseen_us = back.filter.mean, back.seen_us - tick.end_us
            if unseen_us > coast_us or not _is_inside(mean, measuring.camera):
                break
            if any(other.was_near(mean, tick.end_us) for other in others):
                break
            events = self._events(tick.end_us - measuring.contour_us, tick.end_us)
            if back.measure(measuring, events, tick.start_us, tick.end_us) is None:
                back.coast(tick.end_us)
            path.append(back.path[-1])
        while path[-1].circle is None:
            path.pop()
        return path[::-1], back.seen

    def _events(self, start_us: int, end_us: int) -> EventBatch:
        parts = [tick.events for tick in self.ticks if start_us < tick.end_us <= end_us]
        return EventBatch.concatenate(parts).between(start_us, end_us)


def _is_inside(mean: NDArray[np.float64], camera: Camera) -> bool:
    """Whether most of the outline of a ball (5,) is visible."""
    x, y, _, _, radius = mean.tolist()
    return bool(min(x, y, camera.width_px - 1 - x, camera.height_px - 1 - y) >= LEAST_INSIDE * radius)
