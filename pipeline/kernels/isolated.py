"""Removal of isolated pixels (section 3.1; supplement, 'Cleaning the EROS time surface').

The supplement prints a 4 x 4 hit-or-miss kernel: 2 x 2 pixels set, the ring of 12 around them empty. Taken
literally it finds a noise event only where four of them fill a square: lone pixels, pairs and threes stay,
against what the text says. The rule of the text, `isolated`, asks for the empty ring alone: a pixel is
removed if one of the four 2 x 2 windows that hold it has an empty ring around it, whatever else the window
holds. `printed` removes a pixel only if that window is full besides: all four pixels of it, because each is
part of what was found. (A library's hit-or-miss marks just the anchor, and an even kernel has none in its
middle.)

Whatever lies outside the image is empty. The work does not depend on what the image shows.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .arrays import Bytes

ONE, TWO, THREE = np.uint64(1), np.uint64(2), np.uint64(3)


@njit(cache=True, nogil=True)
def _load(line: Bytes, values: Bytes, y: int, x0: int) -> None:
    """Copy row y of values from column x0; zeros outside the image (assigning slices is 18 x slower)."""
    height, width = values.shape
    line[:] = 0
    if 0 <= y < height:
        first = max(x0, 0)
        source, target = values[y, first : x0 + line.size], line[first - x0 :]
        for c in range(np.uint64(min(x0 + line.size, width) - first)):
            target[c] = source[c]


@njit(cache=True, nogil=True)
def _ring(ring: Bytes, a: Bytes, b: Bytes, c: Bytes, d: Bytes) -> None:
    """Write, for each 4 x 4 block of four lines, not 0 into `ring` where one of its 12 outer pixels is set."""
    for n in range(np.uint64(ring.size)):
        i = np.uint64(n)
        ends = a[i] | a[i + THREE] | b[i] | b[i + THREE] | c[i] | c[i + THREE] | d[i] | d[i + THREE]
        ring[i] = ends | a[i + ONE] | a[i + TWO] | d[i + ONE] | d[i + TWO]


@njit(cache=True, nogil=True)
def _spare_unless_full(ring: Bytes, b: Bytes, c: Bytes) -> None:
    """Count the ring as set where not all four inner pixels are."""
    for n in range(np.uint64(ring.size)):
        i = np.uint64(n)
        least = min(min(b[i + ONE], b[i + TWO]), min(c[i + ONE], c[i + TWO]))
        ring[i] = ring[i] if least != 0 else np.uint8(255)


@njit(cache=True, nogil=True)
def _keep(out: Bytes, line: Bytes, above: Bytes, below: Bytes) -> None:
    """Write the line without its pixels in a window with an empty ring; above, below: rings of the windows there."""
    for n in range(np.uint64(out.size)):
        i = np.uint64(n)
        value = line[i + TWO]
        least = min(min(above[i], above[i + ONE]), min(below[i], below[i + ONE]))
        out[i] = value if least != 0 else np.uint8(0)


@njit(cache=True, nogil=True)
def copy_cleaned(window: Bytes, values: Bytes, x0_px: int, y0_px: int, full_blocks_only: bool) -> None:
    """Write a window of `values` without its isolated pixels into `window`, and into nothing else.

    Parameters
    ----------
    window : (rows, columns) uint8
        Output, within the image.
    values : (height, width) uint8
        The image; not 0 = occupied. Pixels around the window, whose first is (x0, y0), count as neighbours.
    full_blocks_only : bool
        Use the printed kernel; otherwise the rule of the text.
    """
    rows, columns = window.shape
    lines = np.empty((4, columns + 4), np.uint8)  # the last four rows, from two columns left to two right
    rings = np.empty((2, columns + 1), np.uint8)  # of the windows above and below a row
    for j in range(rows + 4):
        _load(lines[j & 3], values, y0_px - 2 + j, x0_px - 2)
        if j >= 3:
            b, c = lines[(j - 2) & 3], lines[(j - 1) & 3]
            _ring(rings[j & 1], lines[(j - 3) & 3], b, c, lines[j & 3])
            if full_blocks_only:
                _spare_unless_full(rings[j & 1], b, c)
        if j >= 4:
            _keep(window[j - 4], lines[(j - 2) & 3], rings[(j - 1) & 1], rings[j & 1])
