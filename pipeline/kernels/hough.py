"""Hough transform for circles: votes, peak and its refinement (section 3.1)."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .arrays import Bytes, Floats, Integers, Pixels
from .isolated import copy_cleaned

# Votes of which more than one in so many was given are set to zero all at once.
FEW_VOTES = 8
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
    radius_of = _radius_of(radius0_px, radii)
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
def _radius_of(radius0_px: int, radii: int) -> Integers:
    """Index of the radius that each squared distance rounds to, so that no root is taken in a vote: 2 x faster."""
    reach = radius0_px + radii - 1
    radius_of = np.full(2 * reach * reach + 1, radii, np.int64)
    for k in range(radii):
        radius = radius0_px + k
        # d rounds to the radius where (radius - 1/2)^2 <= d^2 < (radius + 1/2)^2; d^2 is a whole number.
        first = radius * radius - radius + 1 if radius > 0 else 0
        radius_of[first : radius * radius + radius + 1] = k
    return radius_of


@njit(cache=True, nogil=True)
def _offsets(radius0_px: int, radii: int, width: int) -> Integers:
    """Places (m,) of all votes of a pixel relative to its own in flat votes of such a width."""
    reach, radius_of = radius0_px + radii - 1, _radius_of(radius0_px, radii)
    offsets = np.empty((2 * reach + 1) ** 2, np.int64)
    m = 0
    for dy in range(-reach, reach + 1):
        for dx in range(-reach, reach + 1):
            k = radius_of[dx * dx + dy * dy]
            if k < radii:
                offsets[m] = (dy * width + dx) * radii + k
                m += 1
    return offsets[:m]


@njit(cache=True, nogil=True)
def best_circles(
    votes: Pixels, x_px: Integers, y_px: Integers, radius0_px: int, radii: int, most: int, least_support: float
) -> tuple[Floats, Integers]:
    """Circles through pixels (n,), n > 0, by `vote` and `peak`, without votes around a better one; best first.

    Pixels that are too lonely for a circle with enough votes do not vote. Where fewer votes are given than the image
    that they span has places, only circles with enough are looked at, and where far fewer, only those places are set to
    zero again: on the few cells of a large image that noise activates 9 x faster than new votes and `peak`. Where more
    are given, as along an edge, `peak` is a third faster.

    Parameters
    ----------
    votes : flat uint16
        Zeros, which they are again at the end; for each centre within the largest radius of the pixels' bounding box,
        one a radius.
    radius0_px, radii : int
        Smallest radius, and number of radii.
    most : int
        Circles at most.
    least_support : float
        Least support (see `peak`) of a circle.

    Returns
    -------
    supports : (m,) float64
    circles : (m, 3) int64
        Centre x and y, and radius.
    """
    reach = radius0_px + radii - 1
    fewest = math.ceil(math.sqrt(least_support * 2.0 * math.pi * max(radius0_px, 1)))
    voters = _pixels_with_others(x_px, y_px, 2 * reach, fewest)
    if voters.size == 0:
        return np.empty(0), np.empty((0, 3), np.int64)
    left, top, right, bottom = x_px[voters[0]], y_px[voters[0]], x_px[voters[0]], y_px[voters[0]]
    for voter in voters:
        left, right = min(left, x_px[voter]), max(right, x_px[voter])
        top, bottom = min(top, y_px[voter]), max(bottom, y_px[voter])
    left, top = left - reach, top - reach
    width, height = right + reach + 1 - left, bottom + reach + 1 - top
    offsets, centres = _offsets(radius0_px, radii, width), np.empty(voters.size, np.int64)
    for n in range(voters.size):
        centres[n] = ((y_px[voters[n]] - top) * width + x_px[voters[n]] - left) * radii
    box, given = votes[: width * height * radii], centres.size * offsets.size
    is_dense = box.size < given
    enough = np.empty(0, np.int64)
    if is_dense:
        for centre in centres:
            for n in range(offsets.size):
                box[np.uint64(centre + offsets[n])] += np.uint16(1)
    else:
        enough = _vote_noting(box, centres, offsets, radius0_px, radii, least_support)
    supports, circles = np.empty(most), np.empty((most, 3), np.int64)
    found = 0
    while found < most:
        if is_dense:
            best, a, b, k = peak(box.reshape(height, width, radii), radius0_px, least_support)
        else:
            best, cell = _best_cell(box, enough, radius0_px, radii)
            a, b, k = cell // radii % width, cell // radii // width, cell % radii
        if best < least_support:
            break
        supports[found], circles[found, 0], circles[found, 1] = best, left + a, top + b
        circles[found, 2] = radius0_px + k
        found += 1
        near = max(1, (radius0_px + k) // 2)
        for row in range(max(0, b - near), min(height, b + near + 1)):
            box[(row * width + max(0, a - near)) * radii : (row * width + min(width, a + near + 1)) * radii] = 0
    if box.size < FEW_VOTES * given:
        box[:] = 0
    else:
        for centre in centres:
            for n in range(offsets.size):
                box[np.uint64(centre + offsets[n])] = 0
    return supports[:found].copy(), circles[:found].copy()


@njit(cache=True, nogil=True)
def _vote_noting(
    votes: Pixels, centres: Integers, offsets: Integers, radius0_px: int, radii: int, least_support: float
) -> Integers:
    """Let pixels vote at these offsets from their places (n,); the places (m,) of circles with enough support."""
    least = np.empty(offsets.size, np.uint16)  # votes of a circle with enough support, at each offset
    fewest = 65535
    for n in range(offsets.size):
        perimeter = 2.0 * math.pi * max(radius0_px + offsets[n] % radii, 1)
        least[n] = math.ceil(math.sqrt(least_support * perimeter))
        fewest = min(fewest, int(least[n]))
    enough = np.empty(centres.size * offsets.size // max(fewest, 1) + 1, np.int64)
    m = 0
    for centre in centres:
        for n in range(offsets.size):
            cell = np.uint64(centre + offsets[n])
            count = votes[cell] + np.uint16(1)
            votes[cell] = count
            if count == least[n]:
                enough[m] = cell
                m += 1
    return enough[:m]


@njit(cache=True, nogil=True)
def _best_cell(votes: Pixels, cells: Integers, radius0_px: int, radii: int) -> tuple[float, int]:
    """Support and place of the best supported circle at these places of flat votes, the first of equal ones."""
    best, best_cell = 0.0, 0
    for cell in cells:
        count = float(votes[np.uint64(cell)])
        support = count * count / (2.0 * math.pi * max(radius0_px + cell % radii, 1))
        if support > best or (support == best and cell < best_cell):
            best, best_cell = support, cell
    return best, best_cell


@njit(cache=True, nogil=True)
def _pixels_with_others(x_px: Integers, y_px: Integers, apart_px: int, least: int) -> Integers:
    """Indices (m,) int64 of pixels (n,) with so many, itself among them, no farther apart in columns and in rows."""
    chosen = np.empty(x_px.size, np.int64)
    m = 0
    for i in range(x_px.size):
        count = 1
        for gap in range(1, x_px.size):  # from the nearest in order on, which mostly lie near
            if count >= least:
                break
            for j in (i - gap, i + gap):
                if 0 <= j < x_px.size:
                    count += (abs(x_px[j] - x_px[i]) <= apart_px) & (abs(y_px[j] - y_px[i]) <= apart_px)
        chosen[m] = i
        m += count >= least
    return chosen[:m].copy()


@njit(cache=True, nogil=True)
def peak(votes: Pixels, radius0_px: int, least_support: float = 0.0) -> tuple[float, int, int, int]:
    """Best supported circle: (support, a, b, k), its indices in the votes; of equal ones the first.

    The support is votes^2 / (2 pi radius): the number of votes times the share of the outline that they fill,
    so that neither a short arc of a large circle nor a full but tiny one wins. (0, 0, 0, 0) without votes; one with
    less than the least support need not be found.
    """
    best, best_n = 0.0, 0
    radii, cells = votes.shape[2], votes.reshape(-1)
    # The fewest votes, for each cell of a block, that can be better than the best so far. Blocks without such a cell,
    # nearly all of them, are seen with vector instructions: 2.5 x faster.
    least = np.empty(BLOCK_PIXELS * radii, np.uint16)
    for n in range(least.size):
        least[n] = max(1, int(math.sqrt(least_support * 2.0 * math.pi * max(radius0_px + n % radii, 1))))
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
    chosen = np.empty(x_px.size, np.int64)
    bright = 0
    for n in range(x_px.size):
        i = np.uint64(n)
        chosen[bright] = n  # stays only if counted: no branch to mispredict
        bright += values[y_px[i], x_px[i]] >= least
    if bright < 8:
        return np.empty(0, np.int64), np.empty(0, np.int64)
    stride = _stride(values.shape[1] // cell_px + 3)
    active = np.zeros((values.shape[0] // cell_px + 3) * stride, np.uint8)
    for n in range(bright):
        i = chosen[n]
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
    last_column, last_row = 0, 0
    for n in range(columns.size):
        last_column, last_row = max(last_column, columns[n]), max(last_row, rows[n])
    stride = _stride(last_column // 2 + 1)
    wide = np.zeros((last_row // 2 + 1) * stride, np.uint8)
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


@njit(cache=True, nogil=True)
def circle_near(
    levels: Bytes,
    is_cleaned: bool,
    full_blocks_only: bool,
    least: int,
    most_pixels: int,
    x_px: int,
    y_px: int,
    reach_px: int,
    radius0_px: int,
    radii: int,
) -> tuple[float, float, float, float]:
    """`best_circle` through a surface's `bright_pixels`, its centre within reach_px of a pixel.

    Parameters
    ----------
    levels : (height, width) uint8
        The surface.
    is_cleaned, full_blocks_only : bool
        Whether its isolated pixels do not count, and by which rule, see `copy_cleaned`.
    """
    height, width = levels.shape
    margin = radius0_px + radii + reach_px
    left, top = max(0, x_px - margin), max(0, y_px - margin)
    right, bottom = min(width, x_px + margin + 1), min(height, y_px + margin + 1)
    if left >= right or top >= bottom:
        return 0.0, 0.0, 0.0, 0.0
    window = levels[top:bottom, left:right].copy()
    if is_cleaned:
        copy_cleaned(window, levels, left, top, full_blocks_only)
    columns, rows = bright_pixels(window, least, most_pixels)
    for n in range(columns.size):
        columns[n] += left
        rows[n] += top
    return best_circle(columns, rows, x_px - reach_px, y_px - reach_px, 2 * reach_px + 1, radius0_px, radii)
