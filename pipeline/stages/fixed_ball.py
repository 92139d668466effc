"""Where a ball spinner's ball is, from the events that its turning logo leaves over a whole recording.

In steady light a ball that turns in place shows nothing of its outline: only its logo's path lights up. The path lies
inside the disc and mostly touches its limb where the logo comes round, so the ball is taken as the circle on which
the path's outer ends lie. A logo near the axis that points at the camera keeps off the limb: then the circle is too
small by an amount that nobody can know, which the 1 sigma says.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..camera import Setting
from ..errors import RecordingError
from ..events import EventBatch
from ..results import Circle

Floats = NDArray[np.float64]

# Pixels this close together belong to one logo's path (a wordmark has gaps).
GAP_PX = 2
# A path of fewer events is no basis: the samples' poorest usable one has 1,600 in 100 ms.
LEAST_EVENTS = 300
# The directions in which the path's outer end is looked for.
DIRECTIONS = 72
# How far inside the limb a path typically ends, as a share of the radius, and its 1 sigma: a wordmark at 45 degrees
# from the axis reaches 0.94 of it seen from the pole, one that comes round the limb reaches it.
SHORT_SHARE, SHORT_STD_SHARE = 0.02, 0.03
REMEDY = "give the circle instead: --fixed-ball X_PX Y_PX RADIUS_PX"


def find_fixed_ball(
    events: EventBatch, setting: Setting, radius_min_px: float, radius_max_px: float
) -> tuple[Circle, float]:
    """The ball's circle and its 1 sigma in px (the larger of centre and radius), best effort.

    The score is the share of the directions from the centre in which the path reaches the circle.
    Raises RecordingError when the events draw no path that could be a logo's, or too little of one.
    """
    camera = setting.camera
    counts = np.zeros((camera.height_px, camera.width_px), np.int64)
    np.add.at(counts, (events.y_px, events.x_px), 1)
    rows, columns = _path(counts, radius_max_px)
    drawn = int(counts[rows, columns].sum())
    if drawn < LEAST_EVENTS:
        raise RecordingError(
            f"no ball found: the busiest spot has {drawn} events, fewer than the {LEAST_EVENTS} of a turning logo; "
            f"{REMEDY}"
        )
    circle, std_px = _limb(columns.astype(np.float64), rows.astype(np.float64))
    if not radius_min_px <= circle.radius_px <= radius_max_px:
        raise RecordingError(
            f"no ball found: the busiest spot fits a radius of {circle.radius_px:.1f} px, outside "
            f"track.radius_min_px = {radius_min_px:g} to track.radius_max_px = {radius_max_px:g}; {REMEDY}"
        )
    if std_px > 0.25 * circle.radius_px:
        raise RecordingError(
            f"no ball found: the logo shows on one side only, its circle is uncertain by {std_px:.1f} px; {REMEDY}"
        )
    return circle, std_px


def _path(counts: NDArray[np.int64], radius_max_px: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows and columns of the pixels on the busiest path that is no larger than a ball."""
    from scipy import ndimage  # 0.2 s to load

    # Noise is the same everywhere, so its rate is that of the whole image's typical pixel. Five sigma above it.
    typical = float(np.minimum(counts, 3).mean())
    busy = counts >= max(2.0, typical + 5.0 * math.sqrt(typical) + 1.0)
    # A hot pixel has no busy neighbours; a logo's pixel has several.
    neighbours = ndimage.convolve(busy.astype(np.int64), np.ones((3, 3), np.int64), mode="constant")
    busy &= neighbours >= 4
    joined = ndimage.binary_dilation(busy, np.ones((3, 3), bool), iterations=GAP_PX)
    labels, found = ndimage.label(joined, np.ones((3, 3), int))
    labels[~busy] = 0
    best, most = 0, 0
    widest = 2 * radius_max_px + 2
    for number, box in enumerate(ndimage.find_objects(labels, found), start=1):
        if box is None or box[0].stop - box[0].start > widest or box[1].stop - box[1].start > widest:
            continue
        total = int(counts[box][labels[box] == number].sum())
        if total > most:
            best, most = number, total
    rows, columns = np.nonzero(labels == best) if best else (np.empty(0, np.int64), np.empty(0, np.int64))
    return rows, columns


def _limb(x_px: Floats, y_px: Floats) -> tuple[Circle, float]:
    """The circle on which the outer ends of these pixels lie, and its 1 sigma."""
    from scipy.optimize import least_squares  # 0.3 s to load

    start = _enclosing(x_px, y_px)

    def outer(circle: Floats) -> tuple[Floats, Floats]:
        """Per direction with pixels: the angle, and how far the outermost one is from the circle (> 0 outside)."""
        dx, dy = x_px - circle[0], y_px - circle[1]
        sector = np.floor((np.arctan2(dy, dx) / (2 * math.pi) % 1.0) * DIRECTIONS).astype(np.int64) % DIRECTIONS
        reach = np.full(DIRECTIONS, -np.inf)
        np.maximum.at(reach, sector, np.hypot(dx, dy))
        seen = np.isfinite(reach)
        return (np.flatnonzero(seen) + 0.5) * 2 * math.pi / DIRECTIONS, reach[seen] - circle[2]

    def cost(circle: Floats) -> Floats:
        """An end outside is impossible (weight 3); one far inside is no limb and weighs little."""
        _, off = outer(circle)
        residual = np.full(DIRECTIONS, 0.0)
        inside = np.sqrt(np.minimum(-np.minimum(off, 0.0), 2.0))
        residual[: off.size] = np.where(off > 0, 3.0 * off, inside)
        return residual

    answer = least_squares(cost, start, x_scale=np.array([1.0, 1.0, 1.0]), diff_step=0.02).x
    angle, off = outer(answer)
    on = off > -1.5
    design = np.stack([np.cos(angle[on]), np.sin(angle[on]), np.ones(int(on.sum()))], axis=1)
    information = design.T @ design + 1e-6 * np.eye(3)
    spread = np.sqrt(np.diag(np.linalg.inv(information))) * 1.0
    radius = answer[2] * (1 + SHORT_SHARE)
    std = max(float(spread.max()), SHORT_STD_SHARE * radius, 0.5)
    return Circle(float(answer[0]), float(answer[1]), float(radius), float(on.sum()) / DIRECTIONS), std


def _enclosing(x_px: Floats, y_px: Floats) -> Floats:
    """(3,) the smallest circle around all points, by walking towards the farthest (Badoiu and Clarkson)."""
    centre = np.array([x_px.mean(), y_px.mean()])
    for step in range(1, 500):
        far = int(np.argmax((x_px - centre[0]) ** 2 + (y_px - centre[1]) ** 2))
        centre += (np.array([x_px[far], y_px[far]]) - centre) / (step + 1)
    return np.append(centre, np.hypot(x_px - centre[0], y_px - centre[1]).max())
