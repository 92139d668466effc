"""Background that moves as a whole, as a shaking camera sees it: what its vibration does to a ball's path."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..events import EventBatch
from ..kernels.tiles import events_by_tile
from .track_search import supported_events

# Tiles of the image along each axis, and events within the last milliseconds that show an edge moving in one.
TILES, LEAST_EVENTS = 4, 20
# In more of the tiles than this share edges move only when the camera does: an arm swings in a quarter of the image, a
# net in a row of tiles, and four balls fly through half of them at most.
MOST_STILL_SHARE = 0.5
# A vibration of 10 Hz or more comes to a stop, and moves again, within half its period.
SHAKING_US = 50_000


def background_moves(events: EventBatch, last_us: NDArray[np.uint16], camera: Camera) -> bool:
    """Whether edges move in most of the image.

    Noise does not count: an event needs a neighbour's support (`track_search.supported_events`, also for last_us).
    """
    least_tiles = MOST_STILL_SHARE * TILES**2
    if len(events) <= least_tiles * LEAST_EVENTS or _busy_tiles(events, camera) <= least_tiles:
        return False
    return _busy_tiles(supported_events(events, last_us), camera) > least_tiles


def _busy_tiles(events: EventBatch, camera: Camera) -> int:
    counts = events_by_tile(events.x_px, events.y_px, camera.width_px, camera.height_px, TILES)
    return int(np.count_nonzero(counts >= LEAST_EVENTS))
