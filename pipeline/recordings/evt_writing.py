"""Encoders of Prophesee EVT2 and EVT3 words, the inverse of `evt2.py` and `evt3.py`."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from . import evt2, evt3

HIGH, LOW, ROW = 0, 1, 2  # places in `Encoded.state`: what was written last, -1 before the first

# TIME_HIGH runs ahead in steps of at most a quarter turn, so that every step is plain to a decoder.
EVT3_STEP = 1 << (evt3.TIME_BITS - 2)
EVT2_STEP = 1 << (evt2.HIGH_BITS - 2)
EVT3_MASK = (1 << evt3.TIME_BITS) - 1


class Encoded(NamedTuple):
    """Where an encoder writes: words (n,) uint16 or uint32, state (3,) int64."""

    words: NDArray[Any]
    state: NDArray[np.int64]


class Edges(NamedTuple):
    """Triggers to encode among the events: t_us (n,) int64 in order, value and id (n,) uint8."""

    t_us: NDArray[np.int64]
    value: NDArray[np.uint8]
    id: NDArray[np.uint8]


@njit(cache=True, nogil=True)
def _raise_high(out: Encoded, at: int, high: int, mask: int, step: int, head: int) -> int:
    """Write TIME_HIGH words up to `high`; returns where the next word goes."""
    state = out.state
    if state[HIGH] < 0:
        state[HIGH] = high if high <= mask else 0  # farther times are counted up to
        out.words[at] = head | state[HIGH]
        at += 1
    while state[HIGH] < high:
        state[HIGH] = min(state[HIGH] + step, high)
        state[LOW] = -1
        out.words[at] = head | (state[HIGH] & mask)
        at += 1
    return at


@njit(cache=True, nogil=True)
def _evt3_time(out: Encoded, at: int, t_us: int) -> int:
    at = _raise_high(out, at, t_us >> evt3.TIME_BITS, EVT3_MASK, EVT3_STEP, evt3.TIME_HIGH << 12)
    low = t_us & EVT3_MASK
    if out.state[LOW] != low:
        out.state[LOW] = low
        out.words[at] = (evt3.TIME_LOW << 12) | low
        at += 1
    return at


@njit(cache=True, nogil=True)
def encode_evt3(
    out: Encoded,
    t_us: NDArray[np.int64],
    x_px: NDArray[np.uint16],
    y_px: NDArray[np.uint16],
    on: NDArray[np.bool_],
    edges: Edges,
) -> int:
    """Encode events and triggers into out; returns the number of words."""
    at, edge = 0, 0
    for i in range(t_us.size + 1):
        while edge < edges.t_us.size and (i == t_us.size or edges.t_us[edge] <= t_us[i]):
            at = _evt3_time(out, at, edges.t_us[edge])
            out.words[at] = (evt3.TRIGGER << 12) | ((int(edges.id[edge]) & 0xF) << 8) | int(edges.value[edge])
            at += 1
            edge += 1
        if i == t_us.size:
            break
        at = _evt3_time(out, at, t_us[i])
        if out.state[ROW] != y_px[i]:
            out.state[ROW] = y_px[i]
            out.words[at] = (evt3.ROW_WORD << 12) | int(y_px[i])
            at += 1
        out.words[at] = (evt3.EVENT_WORD << 12) | (int(on[i]) << 11) | int(x_px[i])
        at += 1
    return at


@njit(cache=True, nogil=True)
def encode_evt2(
    out: Encoded,
    t_us: NDArray[np.int64],
    x_px: NDArray[np.uint16],
    y_px: NDArray[np.uint16],
    on: NDArray[np.bool_],
    edges: Edges,
) -> int:
    """Encode events and triggers into out; returns the number of words."""
    at, edge = 0, 0
    head = evt2.TIME_HIGH << 28
    for i in range(t_us.size + 1):
        while edge < edges.t_us.size and (i == t_us.size or edges.t_us[edge] <= t_us[i]):
            now_us = edges.t_us[edge]
            at = _raise_high(out, at, now_us >> evt2.LOW_BITS, evt2.HIGH_MASK, EVT2_STEP, head)
            low = (now_us & evt2.LOW_MASK) << 22
            out.words[at] = (evt2.TRIGGER << 28) | low | ((int(edges.id[edge]) & 0x1F) << 8) | int(edges.value[edge])
            at += 1
            edge += 1
        if i == t_us.size:
            break
        at = _raise_high(out, at, t_us[i] >> evt2.LOW_BITS, evt2.HIGH_MASK, EVT2_STEP, head)
        kind = evt2.ON_WORD if on[i] else evt2.OFF_WORD
        low = (t_us[i] & evt2.LOW_MASK) << 22
        out.words[at] = (kind << 28) | low | (int(x_px[i]) << 11) | int(y_px[i])
        at += 1
    return at
