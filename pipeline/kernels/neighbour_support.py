"""Events with a neighbour's support: a noise filter that spares outlines of one event a pixel (Delbruck 2008)."""

from __future__ import annotations

import numpy as np
from numba import njit

from .arrays import Bytes, Events, Integers, Pixels

# Events that span more are all taken for simultaneous at the end.
MOST_US = 65_535
ONE = np.uint64(1)


@njit(cache=True, nogil=True)
def supported_events(last_us: Pixels, events: Events, within_us: int) -> Integers:
    """Indices (m,) int64 of events with an earlier one in one of the eight pixels around; writes into `last_us` only.

    Times are looked up for events with any other one around alone, of which noise has few: 3 x faster on noise.

    Parameters
    ----------
    last_us : (height + 2, width + 2) uint16
        Time of each pixel's last event less the first one's, plus one, at most 65,535; zeros at the start and again at
        the end, so that it can be used again: a new one costs more than the work. Two bytes a pixel, as fetching them
        is most of that. The frame of one pixel around the image stays empty.
    within_us : int
        Longest time between an event and its neighbour's.
    """
    t_us, x_px, y_px, _ = events
    chosen = _events_in_company(last_us.shape[1], last_us.shape[0], x_px, y_px)
    last, stride = last_us.reshape(-1), np.uint64(last_us.shape[1])
    pixels = np.empty(chosen.size, np.uint64)
    m = 0
    for n in range(chosen.size):
        i = np.uint64(chosen[n])
        pixel = (np.uint64(y_px[i]) + ONE) * stride + np.uint64(x_px[i]) + ONE
        pixels[n] = pixel
        above, below = pixel - stride, pixel + stride
        newest_us = np.int64(
            max(
                max(max(last[above - ONE], last[above]), max(last[above + ONE], last[pixel - ONE])),
                max(max(last[pixel + ONE], last[below - ONE]), max(last[below], last[below + ONE])),
            )
        )
        now_us = min(t_us[i] - t_us[0] + 1, MOST_US)
        last[pixel] = now_us
        chosen[m] = i
        m += (newest_us > 0) & (now_us - newest_us <= within_us)
    for n in range(pixels.size):
        last[pixels[n]] = 0
    return chosen[:m].copy()


@njit(cache=True, nogil=True)
def _events_in_company(width_px: int, height_px: int, x_px: Pixels, y_px: Pixels) -> Integers:
    """Indices (m,) int64 of events with another one, earlier or later, in one of the eight pixels around.

    One bit a pixel stays in the processor's nearer caches. The image is smaller than the size by one pixel all around.
    """
    stride = np.uint64(width_px // 8 + 2)
    bits = np.zeros(height_px * stride, np.uint8)
    for n in range(x_px.size):
        i = np.uint64(n)
        x = np.uint64(x_px[i]) + ONE
        bits[(np.uint64(y_px[i]) + ONE) * stride + x // np.uint64(8)] |= np.uint8(ONE << x % np.uint64(8))
    chosen = np.empty(x_px.size, np.int64)
    m = 0
    for n in range(x_px.size):
        i = np.uint64(n)
        at, shift = np.uint64(y_px[i]) * stride + np.uint64(x_px[i]) // np.uint64(8), np.uint64(x_px[i]) % np.uint64(8)
        above = _two_bytes(bits, at) >> shift
        level = _two_bytes(bits, at + stride) >> shift
        below = _two_bytes(bits, at + stride + stride) >> shift
        chosen[m] = n
        m += ((above | below) & np.uint64(0b111) | level & np.uint64(0b101)) != np.uint64(0)
    return chosen[:m].copy()


@njit(cache=True, nogil=True, inline="always")
def _two_bytes(numbers: Bytes, at: np.uint64) -> np.uint64:
    """Two bytes as one number, the lower one first."""
    return np.uint64(numbers[at]) | np.uint64(numbers[at + ONE]) << np.uint64(8)
