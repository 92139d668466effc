"""Counts of events by tiles of the image."""

from __future__ import annotations

import numpy as np
from numba import njit

from .arrays import Integers, Pixels

# Counts by turns: those of one tile's events, one after the other, wait for each other.
PARTS = np.uint64(4)


@njit(cache=True, nogil=True)
def events_by_tile(x_px: Pixels, y_px: Pixels, width_px: int, height_px: int, tiles: int) -> Integers:
    """Number (tiles, tiles) int64 of events in each tile of an image of this size, by row and column.

    Tiles are looked up by row and column, for a division an event would take most of the time: with NumPy's functions
    4 x as slow.
    """
    tile_of_column, tile_of_row = _tile_of_line(width_px, tiles), _tile_of_line(height_px, tiles)
    parts = np.zeros((PARTS, tiles, tiles), np.int64)
    for n in range(x_px.size):
        i = np.uint64(n)
        parts[i % PARTS, tile_of_row[y_px[i]], tile_of_column[x_px[i]]] += 1
    counts = np.zeros((tiles, tiles), np.int64)
    for part in parts:
        counts += part
    return counts


@njit(cache=True, nogil=True)
def _tile_of_line(size_px: int, tiles: int) -> Integers:
    """Tile (size,) int64 of each line of pixels along one axis: line * tiles // size, without a division a line."""
    tile_of_line = np.empty(size_px, np.int64)
    for tile in range(tiles):
        first, end = -(-tile * size_px // tiles), -(-(tile + 1) * size_px // tiles)
        tile_of_line[first:end] = tile
    return tile_of_line
