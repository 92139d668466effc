"""Finding the ball anywhere: full-frame Hough circles, each tried for an outline that moves like a ball's."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..events import EventBatch
from ..kernels import eros, neighbour_support
from ..kernels import moving_circle as kernels
from ..kernels.take_events import take_events, take_others
from ..results import Circle, Packet
from ..stage import Context
from .filter import STC_MODES
from .surface import OrdinalSurface, SurfaceParameters, SurfaceResult
from .track_hough import candidates, empty_votes
from .track_limits import Limits
from .track_outline import VOTE_US, Sighting, disc_share, moving_circles, sight, sight_arcs

# Circles of the full-frame vote looked at in one tick, without a track and beside one.
MOST_CANDIDATES, MOST_RIVALS = 4, 2
# Events of the second route: the latest of a busy scene's. An edge that moves on a pixel in SUPPORT_US (the slowest
# ball of 20 px radius does) has its neighbour within that time.
LEAST_EVENTS, MOST_EVENTS, SUPPORT_US = 40, 10_000, 2000
# The velocity vote and the first fit take in circles that are off by 0.15 radii.
SAME_SHARE = 0.15
# Share of the events around a circle that its disc must explain. Marks and shading on the ball draw circles as well, of
# which the ball's own outline lies outside.
LEAST_SHARE = 0.7
# The same of an outline that shows only in part, where nothing else may move nearby.
ISOLATED_SHARE = 0.95


@dataclass(frozen=True, slots=True, eq=False)
class SearchMemory:
    """Arrays that each search leaves empty again: new ones cost more than the work in them.

    Attributes
    ----------
    last_us : (height + 2, width + 2) uint16
        Times of each pixel's last event, see `neighbour_support.supported_events`.
    votes : flat uint16
        See `track_hough.candidates`.
    drawing : OrdinalSurface
        Surface of the second route's events.
    """

    last_us: NDArray[np.uint16]
    votes: NDArray[np.uint16]
    drawing: OrdinalSurface

    @classmethod
    def of(cls, camera: Camera) -> SearchMemory:
        """Empty memory for images of this camera."""
        width_px, height_px = camera.width_px, camera.height_px
        return cls(
            np.zeros((height_px + 2, width_px + 2), np.uint16),
            empty_votes(width_px, height_px),
            OrdinalSurface(SurfaceParameters(), width_px, height_px, table=eros.value_table),
        )


Found = list[tuple[Sighting, Circle]]
# Outlines that a setting excludes, and that setting in words.
Excluded = list[tuple[Sighting, str]]
# Where balls are looked for: the paper's surface, and the contour events (see `look`).
Route = Literal["surface", "contour"]
ROUTES: tuple[Route, Route] = ("surface", "contour")


def look(
    surface: SurfaceResult,
    events: EventBatch,
    end_us: int,
    camera: Camera,
    limits: Limits,
    memory: SearchMemory,
    most: int,
    routes: tuple[Route, ...] = ROUTES,
    expected: tuple[Circle, ...] = (),
) -> tuple[Circle | None, Found, Excluded]:
    """The best Hough circle anywhere; those that move like a ball; those that a setting excludes, if none is left.

    Trusted ones come first, then the faster ones. The paper's surface is searched first. Where it shows no ball, the
    contour events that a neighbour supports: in low contrast an outline gives one event a pixel, of which STC lets
    nothing pass.

    Outlines are also looked for at `expected` circles, where those seen before must be now: in low contrast the Hough
    transform finds one in every second tick.
    """
    stated = limits.radius_min_px, limits.radius_max_px
    searching = _Searching(end_us, camera, limits, most, expected, memory.votes)
    first: Circle | None = None
    found: Found = []
    excluded: Excluded = []
    if "surface" in routes:
        first, found, excluded = searching.circles(surface, events, stated, signed=True)
    if found or "contour" not in routes or len(events) < LEAST_EVENTS:
        return first, found, excluded
    supported = supported_events(events, memory.last_us)
    if len(supported) < LEAST_EVENTS:
        return first, found, excluded
    levels, table = memory.drawing.drawn(supported)
    drawn = SurfaceResult(levels, surface.cleaning, table)
    second, found, excluded_there = searching.circles(drawn, supported, stated, signed=False)
    excluded = excluded or excluded_there
    if not found and not excluded and stated != limits.possible_px:
        # Only to tell which setting to change.
        _, _, excluded = searching.circles(drawn, supported, limits.possible_px, signed=False)
    memory.drawing.clear(supported)
    return first or second, found, excluded


def removed_by_filter(
    context: Context, packet: Packet, passed: int, surface: SurfaceResult, limits: Limits, memory: SearchMemory
) -> Excluded:
    """The outlines in the packet that the setting of the outline's filter removes.

    A ball is looked for in the packet's unfiltered events. Only where STC filters the outline, which needs a second
    event at a pixel: TRAIL passes the first one of every edge, no outline is lost by it.

    Parameters
    ----------
    passed : int
        Events that the filter passed.
    """
    mode, camera = context["filter.contour_mode"], context.camera
    if mode not in STC_MODES or len(packet.events) <= passed:
        return []
    _, found, _ = look(surface, packet.events, packet.end_us, camera, limits, memory, MOST_CANDIDATES, ("contour",))
    moves, removes = "moves like a ball in the unfiltered events", f"filter.contour_mode = {mode} removes it"
    return [
        (one, f"a circle of radius {one.ring[4]:.3g} px {moves}, {removes}: off keeps it")
        for one, _ in found
        if one.trusted or one.explained
    ]


@dataclass(frozen=True, slots=True)
class _Searching:
    """Settings of one search."""

    end_us: int
    camera: Camera
    limits: Limits
    most: int
    expected: tuple[Circle, ...]
    votes: NDArray[np.uint16]

    def circles(
        self, surface: SurfaceResult, events: EventBatch, radii_px: tuple[float, float], *, signed: bool
    ) -> tuple[Circle | None, Found, Excluded]:
        """The best circle with such a radius, those that move like a ball, and those that do and are excluded."""
        tried: list[Circle] = []
        found: Found = []
        excluded: Excluded = []
        recent = events.between(self.end_us - VOTE_US, self.end_us)
        by_hough = candidates(surface, events, *radii_px, self.most, self.votes)
        first = next(by_hough, None)
        for circle in chain([] if first is None else [first], by_hough, self.expected):
            if any(np.hypot(circle.x_px - s.ring[0], circle.y_px - s.ring[1]) < s.ring[4] for s, _ in found):
                continue
            if any(_is_same(circle, other) for other in tried):
                continue
            tried.append(circle)
            sighting = self._sighting(circle, recent, events, signed=signed)
            if sighting is None:
                continue
            reason = self.limits.excluding(sighting)
            if reason is None:
                found.append((sighting, circle))
            elif sighting.trusted or sighting.explained:
                excluded.append((sighting, reason))
        found.sort(key=lambda one: (one[0].trusted, one[0].speed_px_s), reverse=True)
        return first, found, excluded

    def _sighting(self, circle: Circle, recent: EventBatch, events: EventBatch, *, signed: bool) -> Sighting | None:
        """The outline behind a circle that may be a ball's, None if there is none."""
        moving = moving_circles(recent, self.end_us, circle, self.limits.speed_max_radii_s)
        sighting = sight(moving, recent, events, self.end_us, self.camera, signed=signed)
        if sighting is not None and self._is_likely(sighting, events, signed=signed):
            return sighting
        arcs = None if signed else sight_arcs(moving, recent, events, self.end_us, self.camera)
        is_likely = arcs is not None and disc_share(arcs.ring, events, self.end_us) >= ISOLATED_SHARE
        return arcs if is_likely else None

    def _is_likely(self, sighting: Sighting, events: EventBatch, *, signed: bool) -> bool:
        """Whether an outline may be a ball's: trusted, or one that alone explains the events around it."""
        if signed and sighting.trusted:
            return True
        if sighting.promising if signed else sighting.explained:
            return disc_share(sighting.ring, events, self.end_us) >= LEAST_SHARE
        return not signed and sighting.isolated and disc_share(sighting.ring, events, self.end_us) >= ISOLATED_SHARE


def _is_same(one: Circle, other: Circle) -> bool:
    """Whether two Hough circles are within each other's error: a coarse cell, in proportion to the radius."""
    error_px = SAME_SHARE * one.radius_px
    apart_px = np.hypot(one.x_px - other.x_px, one.y_px - other.y_px)
    return bool(apart_px < error_px and abs(one.radius_px - other.radius_px) < error_px)


def supported_events(events: EventBatch, last_us: NDArray[np.uint16]) -> EventBatch:
    """The events, of many the latest MOST_EVENTS, that a neighbour supports."""
    latest = events[-MOST_EVENTS:]
    rows = neighbour_support.supported_events(last_us, latest.columns, SUPPORT_US)
    return EventBatch(*take_events(rows, latest.columns))


def outside_balls(events: EventBatch, rings: list[NDArray[np.float64]], end_us: int) -> EventBatch:
    """The events outside these balls' rings (5,) at end_us."""
    if not rings:
        return events
    circles = np.array(rings)
    rows = kernels.inside_circles(circles, events.columns, end_us, 0.3 * circles[:, 4] + 2.0)  # margins for trails
    return EventBatch(*take_others(rows, events.columns)) if rows.size else events


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
