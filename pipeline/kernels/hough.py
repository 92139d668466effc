"""Hough transform for circles: votes, peak and its refinement (section 3.1)."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .arrays import Bytes, Integers, Pixels


@njit(cache=True, nogil=True)
def vote(votes: Pixels, x_px: Integers, y_px: Integers, x0_px: int, y0_px: int, radius0_px: int) -> None:
    """Let each pixel vote for every circle that runs through it; adds into `votes` only.

    Parameters
    ----------
    votes : (height, width, radii) uint16
        votes[b, a, k] counts the pixels whose distance from the centre (x0 + a, y0 + b) rounds to radius0 + k, k >= 0.
    x_px, y_px : (n,) int64
        The pixels.
    """
    height, width, radii = votes.shape
    reach = radius0_px + radii - 1
    # Which radius each squared distance rounds to, so that no root is taken in the loop: 2 x faster.
    radius_of = np.full(2 * reach * reach + 1, radii, np.int64)
    for k in range(radii):
        radius = radius0_px + k
        # d rounds to the radius where (radius - 1/2)^2 <= d^2 < (radius + 1/2)^2; d^2 is a whole number.
        first = radius * radius - radius + 1 if radius > 0 else 0
        radius_of[first : radius * radius + radius + 1] = k
    for i in range(x_px.size):
        x = x_px[i] - x0_px
        y = y_px[i] - y0_px
        for b in range(max(0, y - reach), min(height, y + reach + 1)):
            dy2 = (y - b) * (y - b)
            for a in range(max(0, x - reach), min(width, x + reach + 1)):
                k = radius_of[(x - a) * (x - a) + dy2]
                if k < radii:
                    votes[b, a, k] += np.uint16(1)


@njit(cache=True, nogil=True)
def peak(votes: Pixels, radius0_px: int) -> tuple[float, int, int, int]:
    """Best supported circle: (support, a, b, k), its indices in the votes.

    The support is votes^2 / (2 pi radius): the number of votes times the share of the outline that they fill,
    so that neither a short arc of a large circle nor a full but tiny one wins. (0, 0, 0, 0) without votes.
    """
    best, best_a, best_b, best_k = 0.0, 0, 0, 0
    # The fewest votes, for each radius, that can be better than the best so far: the division is rarely needed.
    least = np.ones(votes.shape[2], np.int64)
    for b in range(votes.shape[0]):
        for a in range(votes.shape[1]):
            for k in range(votes.shape[2]):
                if votes[b, a, k] >= least[k]:
                    count = float(votes[b, a, k])
                    support = count * count / (2.0 * math.pi * max(radius0_px + k, 1))
                    if support > best:
                        best, best_a, best_b, best_k = support, a, b, k
                        for n in range(least.size):
                            least[n] = int(math.sqrt(best * 2.0 * math.pi * max(radius0_px + n, 1)))
    return best, best_a, best_b, best_k


def bright_pixels(image: Bytes, least: int, most_pixels: int) -> tuple[Integers, Integers]:
    """Columns and rows (m,) int64 of the pixels of at least this value, thinned evenly to most_pixels."""
    rows, columns = np.nonzero(image >= least)
    stride = max(1, -(-rows.size // max(most_pixels, 1))) | 1  # odd: even ones would pick out whole columns
    return columns[::stride].copy(), rows[::stride].copy()


@njit(cache=True, nogil=True)
def active_cells(values: Bytes, x_px: Pixels, y_px: Pixels, least: int, cell_px: int) -> tuple[Integers, Integers]:
    """Cells of cell_px x cell_px pixels in which one of these pixels is at least `least` in `values`.

    Cells without an active neighbour among their eight are left out: what remains of the noise is isolated.

    Parameters
    ----------
    values : (height, width) uint8
        A surface.
    x_px, y_px : (n,) uint16
        Pixels of events.

    Returns
    -------
    columns, rows : (m,) int64
        The cells, rising by row, then column. None with fewer than eight bright events: the most frequent case,
        answered without making the grid.
    """
    bright = 0
    for i in range(x_px.size):
        bright += values[y_px[i], x_px[i]] >= least
    if bright < 8:
        return np.empty(0, np.int64), np.empty(0, np.int64)
    rows = -(-values.shape[0] // cell_px)
    columns = -(-values.shape[1] // cell_px)
    active = np.zeros((rows + 2, columns + 2), np.uint8)
    first, last = rows, 1
    for i in range(x_px.size):
        if values[y_px[i], x_px[i]] >= least:
            row = y_px[i] // cell_px + 1
            active[row, x_px[i] // cell_px + 1] = 1
            first, last = min(first, row), max(last, row)
    xs, ys = np.empty(rows * columns, np.int64), np.empty(rows * columns, np.int64)
    m = 0
    for b in range(first, last + 1):
        for a in range(1, columns + 1):
            if active[b, a] and active[b - 1 : b + 2, a - 1 : a + 2].sum() > 1:
                xs[m], ys[m] = a - 1, b - 1
                m += 1
    return xs[:m].copy(), ys[:m].copy()


def twice_as_wide(columns: Integers, rows: Integers) -> tuple[Integers, Integers]:
    """Columns and rows (m,) int64 of the cells of twice the width in which these cells lie, rising by row."""
    if columns.size == 0:
        return columns, rows
    width = int(columns.max()) // 2 + 1
    wide = np.unique(rows // 2 * width + columns // 2)
    return wide % width, wide // width


@njit(cache=True, nogil=True)
def refined(votes: Pixels, a: int, b: int, k: int) -> tuple[float, float, float]:
    """Peak (a, b, k) to sub-pixel: the centre of mass of the squared votes in the 3 x 3 x 3 around it."""
    height, width, radii = votes.shape
    total, sum_a, sum_b, sum_k = 0.0, 0.0, 0.0, 0.0
    for j in range(max(0, b - 1), min(height, b + 2)):
        for i in range(max(0, a - 1), min(width, a + 2)):
            for n in range(max(0, k - 1), min(radii, k + 2)):
                # Squared, so that the even floor of votes under the peak weighs little.
                weight = float(votes[j, i, n]) ** 2
                total += weight
                sum_a, sum_b, sum_k = sum_a + weight * i, sum_b + weight * j, sum_k + weight * n
    if total == 0.0:
        return float(a), float(b), float(k)
    return sum_a / total, sum_b / total, sum_k / total


@njit(cache=True, nogil=True)
def best_circle(
    x_px: Integers, y_px: Integers, left_px: int, top_px: int, side_px: int, radius0_px: int, radii: int
) -> tuple[float, float, float, float]:
    """Circle through these pixels (n,) with the best support.

    Its centre is in a window of side_px x side_px from (left, top) on, and its radius rounds to one of `radii` from
    radius0 on.

    Returns
    -------
    x_px, y_px, radius_px, share : float
        Centre, radius, and share of the outline that voted. All 0 without votes.
    """
    votes = np.zeros((side_px, side_px, radii), np.uint16)
    vote(votes, x_px, y_px, left_px, top_px, radius0_px)
    support, a, b, k = peak(votes, radius0_px)
    if support == 0.0:
        return 0.0, 0.0, 0.0, 0.0
    x, y, radius = refined(votes, a, b, k)
    share = min(1.0, votes[b, a, k] / (2.0 * math.pi * (radius0_px + k)))
    return left_px + x, top_px + y, radius0_px + radius, share
