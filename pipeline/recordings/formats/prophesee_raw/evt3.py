"""Decoder of Prophesee EVT3: 16-bit words that each change one part of the present event."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from . import decoding
from .decoding import MAX_COORDINATE, TIME_HIGH, Decoded, take_time_high

ADDR_Y, ADDR_X, VECT_BASE_X, VECT_12, VECT_8, TIME_LOW = 0x0, 0x2, 0x3, 0x4, 0x5, 0x6
CONTINUED_4, EXT_TRIGGER, OTHERS, CONTINUED_12 = 0x7, 0xA, 0xE, 0xF
TIME_BITS = 12  # of TIME_HIGH, and of TIME_LOW
UNCHECKED_STEPS = 1  # 4096 us; with a wrong TIME_LOW on top still within the 10 ms that are put in order
MAX_EVENTS_PER_WORD = 12


@njit(cache=True, nogil=True)
def decode_evt3(out: Decoded, words: NDArray[np.uint16], final: bool) -> int:
    """Decode words (n,) into `out`, which has room for MAX_EVENTS_PER_WORD events or more.

    final: these are the last words of the file.

    Returns
    -------
    int
        Number of words done. Fewer than n when `out` is full, or before a TIME_HIGH word that has to wait for the next
        one, which may come after these words.
    """
    t_us, x_px, y_px, on = out.t_us, out.x_px, out.y_px, out.on
    state = out.state
    last_start, trigger_room = t_us.size - MAX_EVENTS_PER_WORD, out.trigger_t_us.size
    events, triggers, done = 0, 0, words.size
    row, column, polarity = state[decoding.ROW], state[decoding.COLUMN], state[decoding.ON] != 0
    now_us = (state[decoding.HIGH] << TIME_BITS) | state[decoding.LOW]
    time_known = state[decoding.TIME_KNOWN] != 0
    for i in range(words.size):
        if events > last_start or triggers >= trigger_room:
            done = i
            break
        word = int(words[i])
        kind, value = word >> TIME_BITS, word & 0xFFF
        if kind == ADDR_X:
            if time_known and row >= 0:
                t_us[events] = now_us
                x_px[events] = value & 0x7FF
                y_px[events] = row
                on[events] = value >> 11 != 0
                events += 1
            else:
                state[decoding.UNTIMED] += 1
        elif kind == ADDR_Y:
            row = value & 0x7FF
        elif kind == TIME_LOW:
            state[decoding.LOW] = value
            now_us = (state[decoding.HIGH] << TIME_BITS) | value
        elif kind in (VECT_12, VECT_8):
            width = 12 if kind == VECT_12 else 8
            for bit in range(width):
                if (value >> bit) & 1:
                    if not (time_known and row >= 0 and column >= 0):
                        state[decoding.UNTIMED] += 1
                    elif column + bit > MAX_COORDINATE:
                        state[decoding.OUTSIDE] += 1
                    else:
                        t_us[events] = now_us
                        x_px[events] = column + bit
                        y_px[events] = row
                        on[events] = polarity
                        events += 1
            if column >= 0:
                column += width
        elif kind == VECT_BASE_X:
            column = value & 0x7FF
            polarity = value >> 11 != 0
        elif kind == TIME_HIGH:
            before = state[decoding.HIGH]
            if not take_time_high(state, words, i, TIME_BITS, TIME_BITS, UNCHECKED_STEPS, final):
                done = i
                break
            if state[decoding.HIGH] != before:
                state[decoding.LOW] = 0  # the new TIME_LOW comes right after
            now_us = (state[decoding.HIGH] << TIME_BITS) | state[decoding.LOW]
            time_known = state[decoding.TIME_KNOWN] != 0
        elif kind == EXT_TRIGGER:
            if time_known:
                out.trigger_t_us[triggers] = now_us
                out.trigger_value[triggers] = value & 1
                out.trigger_id[triggers] = value >> 8
                triggers += 1
        elif kind not in (CONTINUED_4, CONTINUED_12, OTHERS):
            state[decoding.BAD_WORDS] += 1
    state[decoding.ROW], state[decoding.COLUMN], state[decoding.ON] = row, column, polarity
    state[decoding.EVENTS], state[decoding.TRIGGERS] = events, triggers
    return done
