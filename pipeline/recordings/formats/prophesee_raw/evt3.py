"""Decoder of Prophesee EVT3: 16-bit words that each change one part of the present event."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ....compilation import njit
from . import decoding
from .decoding import MAX_COORDINATE, TIME_HIGH, Decoded, take_time_high

ADDR_Y, ADDR_X, VECT_BASE_X, VECT_12, VECT_8, TIME_LOW = 0x0, 0x2, 0x3, 0x4, 0x5, 0x6
CONTINUED_4, EXT_TRIGGER, OTHERS, CONTINUED_12 = 0x7, 0xA, 0xE, 0xF
TIME_BITS = 12  # of TIME_HIGH, and of TIME_LOW
UNCHECKED_STEPS = 1  # 4096 us; with a wrong TIME_LOW on top still within the 10 ms that are put in order
MAX_EVENTS_PER_WORD = 12

COMMON_KINDS = (1 << ADDR_Y) | (1 << ADDR_X) | (1 << TIME_LOW)  # of nearly all words, as bits
VECTORS = ((np.arange(1 << MAX_EVENTS_PER_WORD)[:, None] >> np.arange(MAX_EVENTS_PER_WORD)) & 1).astype(np.bool_)
VECTOR_SIZES = VECTORS.sum(axis=1).astype(np.uint8)  # events in each value of a vector
# Their columns from the vector's first on, then the others.
VECTOR_STEPS = np.argsort(~VECTORS, axis=1, kind="stable").astype(np.uint8)


@njit(cache=True, nogil=True)
def decode_evt3(out: Decoded, words: NDArray[np.uint16], final: bool) -> int:
    """Decode words (n,) into `out`, which has room for MAX_EVENTS_PER_WORD events or more.

    final: these are the last words of the file.

    Returns
    -------
    int
        Number of words done. Fewer than n when `out` is full, or before a TIME_HIGH word that has to wait for the next
        one, which may come after these words.

    Notes
    -----
    Words of the common kinds follow each other in no order that a processor could predict, so that a branch for each
    kind costs more than all that it decides on: every one of them is written as an event that counts if it is ADDR_X.
    Indices are unsigned because signed ones are tested for being from the end.
    """
    t_us, x_px, y_px, on = out.t_us, out.x_px, out.y_px, out.on
    state = out.state
    last_start, trigger_room = np.uint64(t_us.size - MAX_EVENTS_PER_WORD), out.trigger_t_us.size
    events, triggers, at, size = np.uint64(0), 0, np.uint64(0), np.uint64(words.size)
    one = np.uint64(1)
    row, column, polarity = state[decoding.ROW], state[decoding.COLUMN], state[decoding.ON] != 0
    high_us = state[decoding.HIGH] << TIME_BITS
    now_us = high_us | state[decoding.LOW]
    time_known = state[decoding.TIME_KNOWN] != 0
    while at < size and events <= last_start and triggers < trigger_room:
        if time_known and row >= 0:
            same_high = (TIME_HIGH << TIME_BITS) | (state[decoding.HIGH] & 0xFFF)  # repeated every 16 us, says nothing
            upto = min(size, at + last_start + one - events)
            while at < upto:
                word = np.int64(words[at])
                kind, value = word >> TIME_BITS, word & 0xFFF
                if not ((COMMON_KINDS >> kind) & 1 or word == same_high):
                    break
                row ^= (row ^ (value & 0x7FF)) & -np.int64(kind == ADDR_Y)
                now_us ^= (now_us ^ (high_us | value)) & -np.int64(kind == TIME_LOW)
                t_us[events] = now_us
                x_px[events] = value & 0x7FF
                y_px[events] = row
                on[events] = value >> 11 != 0
                events += np.uint64(kind == ADDR_X)
                at += one
            if at == upto:
                continue
        word = np.int64(words[at])
        kind, value = word >> TIME_BITS, word & 0xFFF
        if kind == ADDR_X:
            state[decoding.UNTIMED] += 1
        elif kind == ADDR_Y:
            row = value & 0x7FF
        elif kind == TIME_LOW:
            now_us = high_us | value
        elif kind in (VECT_12, VECT_8):
            width = 12 if kind == VECT_12 else 8
            value &= (1 << width) - 1
            is_placed = time_known and row >= 0 and column >= 0
            for k in range(VECTOR_SIZES[value]):
                x = column + np.int64(VECTOR_STEPS[value, k])
                if is_placed and x <= MAX_COORDINATE:
                    t_us[events] = now_us
                    x_px[events] = x
                    y_px[events] = row
                    on[events] = polarity
                    events += one
                else:
                    state[decoding.OUTSIDE if is_placed else decoding.UNTIMED] += 1
            if column >= 0:
                column += width
        elif kind == VECT_BASE_X:
            column = value & 0x7FF
            polarity = value >> 11 != 0
        elif kind == TIME_HIGH:
            before = state[decoding.HIGH]
            if not take_time_high(state, words, int(at), TIME_BITS, TIME_BITS, UNCHECKED_STEPS, final):
                break
            if state[decoding.HIGH] != before:
                high_us = now_us = state[decoding.HIGH] << TIME_BITS  # the new TIME_LOW comes right after
            time_known = state[decoding.TIME_KNOWN] != 0
        elif kind == EXT_TRIGGER:
            if time_known:
                out.trigger_t_us[triggers] = now_us
                out.trigger_value[triggers] = value & 1
                out.trigger_id[triggers] = value >> 8
                triggers += 1
        elif kind not in (CONTINUED_4, CONTINUED_12, OTHERS):
            state[decoding.BAD_WORDS] += 1
        at += one
    state[decoding.ROW], state[decoding.COLUMN], state[decoding.ON] = row, column, polarity
    state[decoding.LOW] = now_us - high_us
    state[decoding.EVENTS], state[decoding.TRIGGERS] = events, triggers
    return int(at)
