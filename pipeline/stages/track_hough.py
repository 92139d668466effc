"""Hough circles for the tracker: near a prediction and anywhere in the surface."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ..events import EventBatch
from ..kernels import hough as kernels
from ..kernels.coarse_circles import coarse_circles
from ..results import Circle
from .surface import CLEANINGS, SurfaceResult

# A surface pixel at half of full brightness or more counts as an edge that is there now.
EDGE_LEVEL = 128
# Votes reach this far around a predicted centre, at least.
REACH_PX = 6
# Cells of the coarse search: a ball of 5 px radius is then still a ring around an empty cell. Beyond MOST_CELLS the
# cells are twice as wide, and so on: each octave of radii costs less than the one before.
CELL_PX, MOST_CELLS = 4, 10
# More edge pixels than this are thinned: a ring of 40 px radius two pixels wide has 500.
MOST_PIXELS = 250
# Fewer cells than one, times the share of the outline that they fill, are no circle.
LEAST_SUPPORT = 1.0


def hough_near(
    surface: SurfaceResult,
    x_px: float,
    y_px: float,
    radius_from_px: float,
    radius_to_px: float,
    reach_px: int = REACH_PX,
) -> Circle | None:
    """The surface's best circle with its centre within reach_px of this place and a radius between these.

    None when no edge pixel votes for such a circle.
    """
    first_radius = max(1, round(radius_from_px))
    radii = max(1, round(radius_to_px) - first_radius + 1)
    rule = CLEANINGS[surface.cleaning]
    found = kernels.circle_near(
        surface.levels,
        rule is not None,
        bool(rule),
        surface.level_of(EDGE_LEVEL),
        MOST_PIXELS,
        round(x_px),
        round(y_px),
        reach_px,
        first_radius,
        radii,
    )
    return Circle(*found) if found[3] > 0.0 else None


def empty_votes(width_px: int, height_px: int) -> NDArray[np.uint16]:
    """Votes of `candidates` for an image of this size, flat zeros."""
    columns, rows = (-(-size_px // CELL_PX) + 2 * MOST_CELLS for size_px in (width_px, height_px))
    return np.zeros(rows * columns * MOST_CELLS, np.uint16)


def candidates(
    surface: SurfaceResult,
    events: EventBatch,
    radius_min_px: float,
    radius_max_px: float,
    most: int,
    votes: NDArray[np.uint16],
) -> Iterator[Circle]:
    """Circles anywhere, best first: a coarse vote of the cells with fresh edges.

    Those of the smallest cells are refined pixel by pixel. Those of wider ones are as near to a larger ball, in
    proportion, as its fit needs.

    Nothing comes when fewer than five cells are active.

    Parameters
    ----------
    events : EventBatch
        The contour events that may belong to an edge (where the surface is bright).
    most : int
        Circles in the first octave of radii; half as many in the next ones, but one at least.
    votes : flat uint16
        `empty_votes`, and so again afterwards: new ones cost more than the vote.
    """
    coarse = coarse_circles(
        votes,
        surface.levels,
        events.x_px,
        events.y_px,
        surface.level_of(EDGE_LEVEL),
        CELL_PX,
        MOST_CELLS,
        float(radius_min_px),
        float(radius_max_px),
        most,
        LEAST_SUPPORT,
    )
    for _, cell_px, x, y, radius, share in sorted(coarse.tolist(), key=lambda one: one[0], reverse=True):
        if cell_px == CELL_PX:
            low, high = max(radius - 1.5 * CELL_PX, radius_min_px), min(radius + 1.5 * CELL_PX, radius_max_px)
            refined = hough_near(surface, x, y, low, high, 2 * CELL_PX)
            if refined is not None:
                yield refined
        else:
            yield Circle(x, y, radius, share)
