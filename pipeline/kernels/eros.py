"""EROS, the exponential reduced ordinal surface (section 3.1; Gava 2022), exactly, with one byte a pixel; and TOS.

The reference multiplies the k x k block (k odd) around each event by d = 0.3^(1/k) and sets the event's pixel
to 255, in float64, and rounds when the surface is read. After n such fades a pixel holds 255 d^n, which reads
0 from some n on (57 for k = 11). So it is enough to count: an event sets its pixel's level to that n, each
fade takes one off, never below 0, and a table turns levels into values. Equal to the reference bit for bit;
the benchmark compares the speed with the reference and with the naive loop in float32 (16 x slower at k =
21).

TOS, the threshold-ordinal surface (Glover 2022), takes 1 off the block around each event and sets to 0 what falls
below 255 - 2 k: the same count with another table.

Levels are kept flat, the rows MARGIN_PX apart and so many rows above and below them: a block needs no check
for the image's border. The margins' levels are always 0, for no event sets them.

References
----------
L. Gava, M. Monforte, M. Iacono, C. Bartolozzi, A. Glover, "PUCK: parallel surface and convolution-kernel tracking for
event-based cameras", 2022.
A. Glover, A. Dinale, L. De Souza Rosa, S. Bamford, C. Bartolozzi, "luvHarris: a practical corner detector for
event-cameras", IEEE Transactions on Pattern Analysis and Machine Intelligence 44(12), 2022.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numba import njit

from .arrays import Bytes, Pixels

# Widest block: its levels (254 at the event) still fit a byte. Half of it is the margin; being a multiple of
# 8, it lets the image's rows start at whole words.
K_MAX_PX = 49
MARGIN_PX = K_MAX_PX // 2
# Pixels faded at once: one AVX2 register. A constant trip, or the compiler will not vectorise it.
BAND_PX = np.uint64(32)


def odd_px(k_px: int) -> int:
    """Width of the block as the reference uses it: the next odd number (10 -> 11)."""
    return k_px | 1


@cache
def value_table(k_px: int) -> Bytes:
    """Value of each level: (levels + 1,) uint8, not to be written into; the last is 255, at the level an event sets.

    By multiplying again and again, as the reference does: 255 x 0.3 = 76.5 is a tie that rounding errors
    decide.
    """
    decay = 0.3 ** (1 / odd_px(k_px))
    falling = [255.0]
    while np.rint(falling[-1]) > 0:
        falling.append(falling[-1] * decay)
    return np.rint(falling[::-1]).astype(np.uint8)


def threshold_table(k_px: int) -> Bytes:
    """Value of each level of TOS: (levels + 1,) uint8; 0, then from 255 - 2 k to 255 (k = 7: 241, as published)."""
    lowest = 255 - 2 * odd_px(k_px)
    return np.array([0, *range(lowest, 256)], np.uint8)


@njit(cache=True, nogil=True)
def _stride_px(width_px: int) -> int:
    """Distance from one row of levels to the next: a margin, and the width rounded up to whole words."""
    return MARGIN_PX + (width_px + 7) // 8 * 8


def empty_levels(width_px: int, height_px: int) -> Bytes:
    """Levels of an empty surface: flat uint8, with margins, and room behind for the last block's last band."""
    return np.zeros((height_px + 2 * MARGIN_PX) * _stride_px(width_px) + 64, np.uint8)


@njit(cache=True, nogil=True)
def update(levels: Bytes, width_px: int, k_px: int, full: int, x_px: Pixels, y_px: Pixels) -> None:
    """Add events in their order: fade the block around each, then set its pixel; writes into `levels` only.

    Parameters
    ----------
    levels : flat uint8
        As made by `empty_levels` for this width of the image.
    k_px : int
        Width of the block, odd, at most K_MAX_PX.
    full : int
        Level that an event sets.
    x_px, y_px : (n,) uint16
        Pixels of the events.
    """
    stride = np.uint64(_stride_px(width_px))
    corner_px, half = np.uint64(MARGIN_PX - k_px // 2), np.uint64(k_px // 2)
    for i in range(x_px.size):
        corner = (np.uint64(y_px[i]) + corner_px) * stride + np.uint64(x_px[i]) + corner_px
        for left in range(0, k_px, 32):
            columns = np.uint64(k_px - left)
            for row in range(k_px):
                start = corner + np.uint64(row) * stride + np.uint64(left)
                for c in range(BAND_PX):
                    # `min` and unsigned indices make this one saturating subtraction of 32 bytes.
                    level = levels[start + np.uint64(c)]
                    levels[start + np.uint64(c)] = level - min(level, np.uint8(c < columns))
        levels[corner + half * stride + half] = full


def image_levels(levels: Bytes, width_px: int, height_px: int) -> Bytes:
    """The image's part of the levels: a view, (height, width) uint8."""
    stride = _stride_px(width_px)
    first = MARGIN_PX * stride + MARGIN_PX
    return levels[first : first + height_px * stride].reshape(height_px, stride)[:, :width_px]


@njit(cache=True, nogil=True)
def render(values: Bytes, levels: Bytes, table: Bytes) -> None:
    """Write the values of levels, (height, width) uint8 both, into `values`, which must hold zeros.

    Skips what is empty, 32 pixels at a time.
    """
    out, flat = values.reshape(-1), levels.reshape(-1)
    size = np.uint64(flat.size)
    for start in range(np.uint64(0), size, BAND_PX):
        end = min(np.uint64(start) + BAND_PX, size)
        occupied = np.uint8(0)
        for n in range(np.uint64(start), end):
            occupied |= flat[np.uint64(n)]
        if occupied != 0:
            for n in range(np.uint64(start), end):
                out[np.uint64(n)] = table[flat[np.uint64(n)]]
