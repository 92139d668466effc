"""Decoder of Prophesee EVT3: 16-bit words that each change one part of the present event."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from .evt_time import (
    BAD_WORDS,
    COLUMN,
    EVENTS,
    HIGH,
    LOOK_AHEAD_WORDS,
    LOW,
    MAX_COORDINATE,
    MISSING,
    ON,
    OUTSIDE,
    ROW,
    SURE,
    TRIGGERS,
    UNREAD,
    UNTIMED,
    Decoded,
    settle_time,
)

ROW_WORD, EVENT_WORD, BASE_WORD, VECTOR_12, VECTOR_8, TIME_LOW = 0x0, 0x2, 0x3, 0x4, 0x5, 0x6
CONTINUED_4, TIME_HIGH, TRIGGER, OTHERS, CONTINUED_12 = 0x7, 0x8, 0xA, 0xE, 0xF
TIME_BITS = 12  # of TIME_HIGH, and of TIME_LOW
FREE_STEPS = 1  # 4096 us; with a wrong TIME_LOW on top still within the 10 ms that are put in order
MOST_EVENTS_OF_WORD = 12


@njit(cache=True, nogil=True)
def following_time(words: NDArray[np.uint16], at: int, final: bool) -> int:
    """Value of the first TIME_HIGH word after `at`, MISSING or UNREAD."""
    end = min(words.size, at + 1 + LOOK_AHEAD_WORDS)
    for i in range(at + 1, end):
        if words[i] >> 12 == TIME_HIGH:
            return int(words[i] & 0xFFF)
    return UNREAD if end == words.size and not final else MISSING


@njit(cache=True, nogil=True)
def decode_evt3(out: Decoded, words: NDArray[np.uint16], final: bool) -> int:
    """Decode words (n,) uint16 into `out` (see `Decoded`); returns how many words are done.

    It stops early when `out` is full, or before a TIME_HIGH word that has to wait for the next one, which
    may come after these words (final: nothing comes).
    """
    t_us, x_px, y_px, on = out.t_us, out.x_px, out.y_px, out.on
    state = out.state
    room, trigger_room = t_us.size - MOST_EVENTS_OF_WORD, out.trigger_t_us.size
    events, triggers, done = 0, 0, words.size
    row, column, polarity = state[ROW], state[COLUMN], state[ON] != 0
    now_us = (state[HIGH] << TIME_BITS) | state[LOW]
    sure = state[SURE] != 0
    for i in range(words.size):
        if events > room or triggers >= trigger_room:
            done = i
            break
        word = int(words[i])
        kind, value = word >> 12, word & 0xFFF
        if kind == EVENT_WORD:
            if sure and row >= 0:
                t_us[events] = now_us
                x_px[events] = value & 0x7FF
                y_px[events] = row
                on[events] = value >> 11 != 0
                events += 1
            else:
                state[UNTIMED] += 1
        elif kind == ROW_WORD:
            row = value & 0x7FF
        elif kind == TIME_LOW:
            state[LOW] = value
            now_us = (state[HIGH] << TIME_BITS) | value
        elif kind in (VECTOR_12, VECTOR_8):
            width = 12 if kind == VECTOR_12 else 8
            for bit in range(width):
                if (value >> bit) & 1:
                    if not (sure and row >= 0 and column >= 0):
                        state[UNTIMED] += 1
                    elif column + bit > MAX_COORDINATE:
                        state[OUTSIDE] += 1
                    else:
                        t_us[events] = now_us
                        x_px[events] = column + bit
                        y_px[events] = row
                        on[events] = polarity
                        events += 1
            if column >= 0:
                column += width
        elif kind == BASE_WORD:
            column = value & 0x7FF
            polarity = value >> 11 != 0
        elif kind == TIME_HIGH:
            before = state[HIGH]
            if before >= 0 and (value - before) & 0xFFF <= FREE_STEPS:
                following = MISSING  # not asked for
            else:
                following = following_time(words, i, final)
                if following == UNREAD:
                    done = i
                    break
            settle_time(state, value, following, TIME_BITS, TIME_BITS, FREE_STEPS)
            if state[HIGH] != before:
                state[LOW] = 0  # the new TIME_LOW comes right after
            now_us = (state[HIGH] << TIME_BITS) | state[LOW]
            sure = state[SURE] != 0
        elif kind == TRIGGER:
            if sure:
                out.trigger_t_us[triggers] = now_us
                out.trigger_value[triggers] = value & 1
                out.trigger_id[triggers] = value >> 8
                triggers += 1
        elif kind not in (CONTINUED_4, CONTINUED_12, OTHERS):
            state[BAD_WORDS] += 1
    state[ROW], state[COLUMN], state[ON] = row, column, polarity
    state[EVENTS], state[TRIGGERS] = events, triggers
    return done
