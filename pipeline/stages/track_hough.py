"""Hough circles for the tracker: near a prediction and anywhere in the surface."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from ..events import EventBatch
from ..kernels import hough as kernels
from ..results import Circle
from .surface import SurfaceResult

# A surface pixel at half of full brightness or more counts as an edge that is there now.
EDGE_LEVEL = 128
# Votes reach this far around a predicted centre, at least.
REACH_PX = 6
# Cells of the coarse search: a ball of 5 px radius is then still a ring around an empty cell.
CELL_PX = 4
# More edge pixels than this are thinned: a ring of 40 px radius two pixels wide has 500.
MOST_PIXELS = 250


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
    margin = first_radius + radii + reach_px
    height, width = surface.values.shape
    x0, y0 = max(0, round(x_px) - margin), max(0, round(y_px) - margin)
    x1, y1 = min(width, round(x_px) + margin + 1), min(height, round(y_px) + margin + 1)
    if x0 >= x1 or y0 >= y1:
        return None
    window = surface.cleaned(x0, y0, x1, y1)
    corner = round(x_px) - reach_px, round(y_px) - reach_px
    limits = first_radius, radii
    columns, rows = kernels.bright_pixels(window, EDGE_LEVEL, MOST_PIXELS)
    return _circle(kernels.best_circle(columns + x0, rows + y0, *corner, 2 * reach_px + 1, *limits))


def candidates(
    surface: SurfaceResult,
    events: EventBatch,
    radius_min_px: float,
    radius_max_px: float,
    most: int,
) -> Iterator[Circle]:
    """Circles anywhere, best first: a coarse vote of the cells with fresh edges, refined pixel by pixel.

    Nothing comes when fewer than five cells are active.

    Parameters
    ----------
    events : EventBatch
        The contour events that may belong to an edge (where the surface is bright).
    """
    columns, rows = kernels.active_cells(surface.values, events.x_px, events.y_px, EDGE_LEVEL, CELL_PX)
    if columns.size < 5:
        return
    first_radius = max(1, math.floor(radius_min_px / CELL_PX))
    radii = math.ceil(radius_max_px / CELL_PX) - first_radius + 1
    reach = first_radius + radii
    left, top = int(columns.min()) - reach, int(rows.min()) - reach
    shape = (int(rows.max()) + reach + 1 - top, int(columns.max()) + reach + 1 - left, radii)
    votes = np.zeros(shape, np.uint16)
    kernels.vote(votes, columns, rows, left, top, first_radius)
    for _ in range(most):
        support, a, b, k = kernels.peak(votes, first_radius)
        if support < 1.0:
            return
        x, y = ((left + a + 0.5) * CELL_PX - 0.5, (top + b + 0.5) * CELL_PX - 0.5)
        radius = (first_radius + k) * CELL_PX
        near = max(1, (first_radius + k) // 2)
        votes[max(0, b - near) : b + near + 1, max(0, a - near) : a + near + 1] = 0
        found = hough_near(
            surface,
            x,
            y,
            max(radius - 1.5 * CELL_PX, radius_min_px),
            min(radius + 1.5 * CELL_PX, radius_max_px),
            2 * CELL_PX,
        )
        if found is not None:
            yield found


def _circle(found: tuple[float, float, float, float]) -> Circle | None:
    return Circle(*found) if found[3] > 0.0 else None
