"""Circle of a ball spinner's ball, from the events that its turning logo leaves over a whole recording.

In steady light a ball that turns in place shows nothing of its outline: only its logo's path lights up. The path
lies inside the disc and mostly touches its limb where the logo comes round, so the ball is taken as the circle on
which the path's outer ends lie. Two things nobody can know from the path: how far a path around the middle keeps
off the limb, and which chord of the disc a narrow path across it is. The 1 sigma says so, or the ball is refused.
"""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..errors import RecordingError
from ..events import EventBatch
from ..results import Circle

Floats = NDArray[np.float64]

# Pixels this close together belong to one logo's path (a wordmark has gaps).
GAP_PX = 2
# A path of fewer events is no basis: the samples' poorest usable one has 1,600 in 100 ms.
LEAST_EVENTS = 300
# A border within this distance of a circle lies on it; a pixel is off by PIXEL_STD_PX.
ON_LIMB_PX, PIXEL_STD_PX = 0.8, 0.5
# How far inside the limb the path ends, as a share of its own radius, and the 1 sigma of that. A path across the
# ball ends on the limb. One that closes around the middle (seen from the axis) may keep off it: a wordmark at 45
# degrees from the axis reaches 0.85 to 0.94 of the radius, one at 90 degrees all of it.
OPEN_SHORT, CLOSED_SHORT, CLOSED_SCORE = (0.0, 0.04), (0.05, 0.1), 0.8
# A circle known no better than this is none.
MOST_STD_SHARE = 0.15
# A turning logo comes back to its pixels; a ball that flies, or a hand, passes most of them once. At least this share
# of the recording lies between the first and the last event of half of the path's pixels: two turns of three.
LEAST_SPAN = 1 / 3
# Share of the directions in which the path must reach the circle: it does in 0.4 to 1 of them on spinners, in 0.11
# to 0.14 where a bend of a swinging arm was taken for a limb (simulated, seeds 901 and 902, and the samples).
LEAST_SCORE = 0.25
# Points of a hull that decide on its circle, evenly spaced: all of a ball of 40 px. All circles through three corners
# of a disc as large as the image would take 30 GB.
MOST_CORNERS, MOST_BORDER = 40, 400
# Smallest path that could be told from a hot spot.
LEAST_RADIUS_PX = 3.0
REMEDY = "give the circle instead: --fixed-ball X_PX Y_PX RADIUS_PX"


def find_fixed_ball(
    events: EventBatch, camera: Camera, radius_min_px: float | None = None, radius_max_px: float | None = None
) -> tuple[Circle, float]:
    """The ball's circle and its 1 sigma in px (the larger of centre and radius), best effort.

    Radii that are not stated may be whatever fits into the image: a spinner stands at any distance, and turning discs
    of any size take a ball's place. The score is the share of the directions from the centre in which the path reaches
    the circle.
    Raises RecordingError when the events draw no path that could be a logo's, or one that fits many circles.
    """
    low = LEAST_RADIUS_PX if radius_min_px is None else radius_min_px
    high = min(camera.width_px, camera.height_px) / 2 if radius_max_px is None else radius_max_px
    pixel = events.y_px.astype(np.int64) * camera.width_px + events.x_px
    counts = np.bincount(pixel, minlength=camera.width_px * camera.height_px)
    counts = counts.reshape(camera.height_px, camera.width_px)
    rows, columns = _path(counts, high)
    drawn = int(counts[rows, columns].sum())
    if drawn < LEAST_EVENTS:
        raise RecordingError(
            f"no ball found: the busiest spot has {drawn} events, fewer than the {LEAST_EVENTS} of a turning logo; "
            f"{REMEDY}"
        )
    span = _span(events, pixel, rows * camera.width_px + columns)
    if span < LEAST_SPAN:
        raise RecordingError(
            f"no ball found: what moves passes by once (half of its pixels have all their events within {span:.0%} of "
            f"the time), it does not turn in place; {REMEDY}"
        )
    limb = _limb(columns.astype(np.float64), rows.astype(np.float64), low, high)
    if limb is None:
        raise RecordingError(
            f"no ball found: the busiest spot ({np.ptp(columns) + 1} x {np.ptp(rows) + 1} px) fits no circle with a "
            f"radius of {low:g} to {high:g} px (track.radius_min_px, track.radius_max_px); {REMEDY}"
        )
    circle, std_px = limb
    if std_px > MOST_STD_SHARE * circle.radius_px:
        raise RecordingError(
            f"no ball found: the logo's path fits many circles, this one is uncertain by {std_px:.1f} px; {REMEDY}"
        )
    if circle.score < LEAST_SCORE:
        raise RecordingError(
            f"no ball found: what moves reaches its circle in {circle.score:.0%} of the directions only, as any bend "
            f"does; {REMEDY}"
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


def _span(events: EventBatch, pixel: NDArray[np.int64], path: NDArray[np.int64]) -> float:
    """Median over the path's pixels of the time between first and last event, as a share of the recording's."""
    on_path = np.isin(pixel, path)
    where = np.searchsorted(path, pixel[on_path])  # the path rises by row, then column
    t_us = events.t_us[on_path]
    first, last = np.full(path.size, events.t_us[-1]), np.full(path.size, events.t_us[0])
    np.minimum.at(first, where, t_us)
    np.maximum.at(last, where, t_us)
    return float(np.median(last - first) / max(events.t_us[-1] - events.t_us[0], 1))


def _limb(x_px: Floats, y_px: Floats, radius_min_px: float, radius_max_px: float) -> tuple[Circle, float] | None:
    """The circle around all these pixels on which the most of their hull lies, and its 1 sigma; None without one.

    Every circle through three corners of the convex hull is tried; the best is fitted to what lies on it.
    """
    every_corner, every_border = _hull(x_px, y_px)
    if len(every_corner) < 3:
        return None
    corners, border = _evenly(every_corner, MOST_CORNERS), _evenly(every_border, MOST_BORDER)
    threes = np.array(list(combinations(range(len(corners)), 3)))
    centre, radius = _through(*(corners[threes[:, k]] for k in range(3)))
    sane = (radius >= radius_min_px) & (radius <= radius_max_px)
    centre, radius = centre[sane], radius[sane]
    if radius.size == 0:
        return None
    ray = border[None] - centre[:, None]
    distance = np.hypot(ray[..., 0], ray[..., 1])
    off = distance - radius[:, None]
    on_it = (np.abs(off) < ON_LIMB_PX) & (off.max(axis=1) < ON_LIMB_PX)[:, None]
    # Pieces of border all in one direction would fit any large circle: what counts is how much they surround.
    pull = np.hypot(*((ray / distance[..., None]) * on_it[..., None]).sum(axis=1).T)
    lying = on_it.sum(axis=1)
    best = int(np.argmax(lying - pull**2 / np.maximum(lying, 1)))
    answer = np.append(centre[best], radius[best])
    for _ in range(5):
        ray = every_border - answer[:2]
        distance = np.hypot(*ray.T)
        near = np.abs(distance - answer[2]) < ON_LIMB_PX
        if np.count_nonzero(near) < 5:
            return None
        design = np.column_stack([ray[near] / distance[near, None], np.ones(np.count_nonzero(near))])
        answer = answer + np.linalg.lstsq(design, distance[near] - answer[2], rcond=None)[0]
    if not radius_min_px <= answer[2] <= radius_max_px:
        return None
    angle = np.arctan2(*(every_border[near] - answer[:2]).T[::-1]) % (2 * math.pi)
    score = np.unique((angle * 18 / math.pi).astype(np.int64)).size / 36
    # Points of a border are not independent: the logo's own shape bends it over about sixteen pixels.
    spread = 4 * PIXEL_STD_PX * np.sqrt(np.diag(np.linalg.pinv(design.T @ design)))
    short, short_std = CLOSED_SHORT if score > CLOSED_SCORE else OPEN_SHORT
    radius_px = float(answer[2]) * (1 + short)
    std = max(float(spread.max()), short_std * radius_px, PIXEL_STD_PX)
    return Circle(float(answer[0]), float(answer[1]), radius_px, score), std


def _hull(x_px: Floats, y_px: Floats) -> tuple[Floats, Floats]:
    """(n, 2) corners of the convex hull of these points, in order, and (m, 2) points on it, a pixel apart."""
    points = sorted(set(zip(x_px.tolist(), y_px.tolist(), strict=True)))
    chains: list[list[tuple[float, float]]] = []
    for ordered in (points, points[::-1]):
        chain: list[tuple[float, float]] = []
        for x, y in ordered:
            while len(chain) > 1 and _left(chain[-2], chain[-1], (x, y)) <= 0:
                chain.pop()
            chain.append((x, y))
        chains.append(chain[:-1])
    corners = np.array(chains[0] + chains[1])
    pieces = []
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        steps = max(1, round(float(np.hypot(*(end - start)))))
        pieces.append(start + (end - start) * (np.arange(steps) / steps)[:, None])
    return corners, np.concatenate(pieces)


def _evenly(points: Floats, most: int) -> Floats:
    """As many of these points (n, 2) at the most, evenly spaced."""
    return points[np.linspace(0, len(points), min(most, len(points)), endpoint=False).astype(np.int64)]


def _left(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _through(a: Floats, b: Floats, c: Floats) -> tuple[Floats, Floats]:
    """Centres (n, 2) and radii (n,) of the circles through three points (n, 2) each; infinite on a line."""
    ab, ac = b - a, c - a
    twice = 2 * (ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0])
    b2, c2 = (ab**2).sum(axis=1), (ac**2).sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        x = (ac[:, 1] * b2 - ab[:, 1] * c2) / twice
        y = (ab[:, 0] * c2 - ac[:, 0] * b2) / twice
    return a + np.stack([x, y], axis=1), np.hypot(x, y)
