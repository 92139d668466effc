"""State of the tracker from tick to tick, and of a ball in it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..events import EventBatch
from ..stage import Context
from .track_ball import Measuring, TrackedBall
from .track_extension import Past
from .track_limits import Limits
from .track_outline import Sighting
from .track_parameters import TrackParameters
from .track_path import PathPoint
from .track_result import BallTrack
from .track_search import SearchMemory

# States at the ends of ticks before the one in which a shot is announced, by shot.
Earlier = dict[int, tuple[BallTrack, ...]]


@dataclass(slots=True)
class TrackState:
    """State of the tracker from tick to tick."""

    context: Context
    limits: Limits
    measuring: Measuring
    memory: SearchMemory
    contour: EventBatch = field(default_factory=EventBatch.empty)
    past: Past = field(default_factory=Past)
    balls: list[TrackedBall] = field(default_factory=list)
    pending: list[tuple[int, Sighting]] = field(default_factory=list)
    shut_out: list[tuple[int, Sighting]] = field(default_factory=list)  # outlines that a setting excludes, since when
    first_us: int | None = None
    looked_us: int = 0  # when balls were last looked for anywhere
    has_circle: bool = False  # whether a circle was found then
    shaken_us: int | None = None  # when most of the background was last seen to move
    shots: int = 0
    excluded: str | None = None  # the setting that excluded a circle since the last ball, in words

    def let_go(self, ball: TrackedBall) -> None:
        """Follow a ball no longer."""
        self.balls.remove(ball)
        self.past.gone.append(ball)


def follow_path(
    parameters: TrackParameters, ball: TrackedBall, path: list[PathPoint], own_us: int
) -> tuple[BallTrack, ...]:
    """Lead a ball along a known path (see `TrackedBall.follow`); its states there but for the last."""
    return tuple(ball_track(parameters, ball, point.end_us) for point in ball.follow(path, own_us))[:-1]


def ball_track(
    parameters: TrackParameters, ball: TrackedBall, end_us: int, earlier: tuple[BallTrack, ...] = ()
) -> BallTrack:
    """The ball's present state."""
    return ball.track(end_us, parameters.latency_us, parameters.outline_px, earlier)


def is_beyond(mean: NDArray[np.float64], camera: Camera) -> bool:
    """Whether hardly anything of the ball is in the image."""
    x, y, margin = mean[0], mean[1], 0.8 * mean[4]
    return bool(x < -margin or y < -margin or x > camera.width_px - 1 + margin or y > camera.height_px - 1 + margin)
