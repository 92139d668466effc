"""Finding the ball anywhere: full-frame Hough circles, each tried for an outline that moves like a ball's."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..events import EventBatch
from ..kernels import moving_circle as kernels
from ..kernels.take_events import take_events
from ..results import Circle
from .surface import SurfaceResult
from .track_hough import candidates
from .track_outline import Limits, Sighting, sight

# Circles of the full-frame vote looked at in one tick, without a track and beside one.
MOST_CANDIDATES, MOST_RIVALS = 4, 2

Found = list[tuple[Sighting, Circle]]


def look(
    surface: SurfaceResult, events: EventBatch, end_us: int, camera: Camera, limits: Limits, most: int
) -> tuple[Circle | None, Found]:
    """The best Hough circle anywhere, and those that move like a ball: trusted ones first, then by speed."""
    first: Circle | None = None
    found: Found = []
    for circle in candidates(surface, events, limits.radius_min_px, limits.radius_max_px, most):
        first = first or circle
        if any(np.hypot(circle.x_px - s.ring[0], circle.y_px - s.ring[1]) < s.ring[4] for s, _ in found):
            continue
        sighting = sight(events, end_us, camera, circle, limits)
        if sighting is not None and (sighting.trusted or sighting.promising):
            found.append((sighting, circle))
    return first, sorted(found, key=lambda one: (one[0].trusted, one[0].speed_px_s), reverse=True)


def outside_balls(events: EventBatch, rings: list[NDArray[np.float64]], end_us: int) -> EventBatch:
    """The events outside these balls' rings (5,) at end_us."""
    for ring in rings:
        margin = 0.3 * ring[4] + 2.0  # for trails
        rows = kernels.outside_circle(ring, events.columns, end_us, margin)
        events = EventBatch(*take_events(rows, events.columns))
    return events


def moved(ring: NDArray[np.float64], by_us: int) -> NDArray[np.float64]:
    """The ring (5,) that much later."""
    later = ring.copy()
    later[:2] += ring[2:4] * by_us * 1e-6
    return later


def agree(before: Sighting, now: Sighting, tick_us: int) -> bool:
    """Whether a sighting is the one of the tick before, moved on."""
    off = (now.ring - moved(before.ring, tick_us))[:2]
    turned = now.ring[2:4] - before.ring[2:4]
    return bool(
        np.hypot(*off) <= 2.0 + 0.1 * before.speed_px_s * tick_us * 1e-6
        and abs(now.ring[4] - before.ring[4]) <= 1.0 + 0.1 * before.ring[4]
        and np.hypot(*turned) <= 0.3 * before.speed_px_s
    )
