"""Hough transform for circles: votes, peak and its refinement (section 3.1)."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .arrays import Bytes, Integers, Pixels

BLOCK_PIXELS = 16  # of `peak`: a vector instruction takes 16 votes


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
    # Where the votes reach around the pixels, all of one pixel's are at the same offsets: 4 x faster than clipping.
    flat = votes.reshape(-1)
    offsets = np.empty((2 * reach + 1) ** 2 if min(width, height) > 2 * reach else 0, np.int64)
    m = 0
    if offsets.size > 0:
        for dy in range(-reach, reach + 1):
            for dx in range(-reach, reach + 1):
                k = radius_of[dx * dx + dy * dy]
                if k < radii:
                    offsets[m] = (dy * width + dx) * radii + k
                    m += 1
    for i in range(x_px.size):
        x = x_px[i] - x0_px
        y = y_px[i] - y0_px
        if reach <= x < width - reach and reach <= y < height - reach:
            centre = (y * width + x) * radii
            for n in range(m):
                flat[np.uint64(centre + offsets[n])] += np.uint16(1)
            continue
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
    best, best_n = 0.0, 0
    radii, cells = votes.shape[2], votes.reshape(-1)
    # The fewest votes, for each cell of a block, that can be better than the best so far. Blocks without such a cell,
    # nearly all of them, are seen with vector instructions: 2.5 x faster.
    least = np.ones(BLOCK_PIXELS * radii, np.uint16)
    for start in range(0, cells.size, least.size):
        block = cells[start : start + least.size]
        is_better = np.uint16(0)
        for n in range(block.size):
            is_better |= np.uint16(block[n] >= least[n])
        if not is_better:
            continue
        for n in range(block.size):
            if block[n] >= least[n]:
                count = float(block[n])
                support = count * count / (2.0 * math.pi * max(radius0_px + n % radii, 1))
                if support > best:
                    best, best_n = support, start + n
                    for m in range(least.size):
                        least[m] = int(math.sqrt(best * 2.0 * math.pi * max(radius0_px + m % radii, 1)))
    pixel = best_n // radii
    return best, pixel % votes.shape[1], pixel // votes.shape[1], best_n % radii


@njit(cache=True, nogil=True)
def bright_pixels(image: Bytes, least: int, most_pixels: int) -> tuple[Integers, Integers]:
    """Columns and rows (m,) int64 of the pixels of at least this value, thinned evenly to most_pixels."""
    height, width = image.shape
    bright = 0
    for y in range(height):
        for x in range(width):
            bright += image[y, x] >= least
    stride = max(1, -(-bright // max(most_pixels, 1))) | 1  # odd: even ones would pick out whole columns
    columns, rows = np.empty(-(-bright // stride), np.int64), np.empty(-(-bright // stride), np.int64)
    n = 0
    for y in range(height):
        for x in range(width):
            if image[y, x] >= least:
                if n % stride == 0:
                    columns[n // stride], rows[n // stride] = x, y
                n += 1
    return columns, rows


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
    stride = _stride(values.shape[1] // cell_px + 3)
    active = np.zeros((values.shape[0] // cell_px + 3) * stride, np.uint8)
    for i in range(x_px.size):
        if values[y_px[i], x_px[i]] >= least:
            active[(y_px[i] // cell_px + 1) * stride + x_px[i] // cell_px + 1] = 1
    columns, rows = _marked_cells(active, stride, bright)
    m = 0
    for n in range(columns.size):
        a, b = columns[n], rows[n]
        neighbours = 0
        for row in range(b - 1, b + 2):
            for column in range(a - 1, a + 2):
                neighbours += active[row * stride + column]
        columns[m], rows[m] = a - 1, b - 1
        m += neighbours > 1
    return columns[:m].copy(), rows[:m].copy()


@njit(cache=True, nogil=True)
def _stride(width: int) -> int:
    """Distance from one row of cells to the next: the width rounded up to whole words."""
    return (width + 7) // 8 * 8


@njit(cache=True, nogil=True)
def _marked_cells(cells: Bytes, stride: int, most: int) -> tuple[Integers, Integers]:
    """Columns and rows (m,) int64 of the at most `most` cells that are not 0, rising by row, then column."""
    columns, rows = np.empty(most, np.int64), np.empty(most, np.int64)
    words = cells.view(np.uint64)
    m = 0
    for n in range(words.size):
        if words[n] != 0:
            for cell in range(8 * n, 8 * n + 8):
                if cells[cell]:
                    columns[m], rows[m] = cell % stride, cell // stride
                    m += 1
    return columns[:m].copy(), rows[:m].copy()


@njit(cache=True, nogil=True)
def twice_as_wide(columns: Integers, rows: Integers) -> tuple[Integers, Integers]:
    """Columns and rows (m,) int64 of the cells of twice the width in which these cells lie, rising by row."""
    if columns.size == 0:
        return columns, rows
    stride = _stride(columns.max() // 2 + 1)
    wide = np.zeros((rows.max() // 2 + 1) * stride, np.uint8)
    for n in range(columns.size):
        wide[rows[n] // 2 * stride + columns[n] // 2] = 1
    return _marked_cells(wide, stride, columns.size)


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
