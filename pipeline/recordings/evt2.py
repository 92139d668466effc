"""Decoder of Prophesee EVT2 (32-bit words, one event each) and EVT2.1 (64 bits, up to 32 pixels of a row)."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from .evt_time import (
    BAD_WORDS,
    EVENTS,
    HIGH,
    LOOK_AHEAD_WORDS,
    MAX_COORDINATE,
    MISSING,
    OUTSIDE,
    SURE,
    TRIGGERS,
    UNREAD,
    UNTIMED,
    Decoded,
    settle_time,
)

OFF_WORD, ON_WORD, TIME_HIGH, TRIGGER, OTHERS, CONTINUED = 0x0, 0x1, 0x8, 0xA, 0xE, 0xF
HIGH_BITS, LOW_BITS = 28, 6
HIGH_MASK, LOW_MASK = 0xFFFFFFF, 0x3F
FREE_STEPS = 155  # 9920 us: within the 10 ms that are put in order
MOST_EVENTS_OF_WORD = 32


@njit(cache=True, nogil=True)
def following_time(heads: NDArray[np.uint32], at: int, final: bool) -> int:
    """Value of the first TIME_HIGH word after `at`, MISSING or UNREAD."""
    end = min(heads.size, at + 1 + LOOK_AHEAD_WORDS)
    for i in range(at + 1, end):
        if heads[i] >> 28 == TIME_HIGH:
            return int(heads[i] & HIGH_MASK)
    return UNREAD if end == heads.size and not final else MISSING


@njit(cache=True, nogil=True)
def decode_evt2(out: Decoded, heads: NDArray[np.uint32], masks: NDArray[np.uint32], final: bool) -> int:
    """Decode words into `out` (see `Decoded`); returns how many words are done, as `decode_evt3`.

    heads (n,) uint32 : type, low time, x, y
    masks (n,) uint32 : EVT2.1's other half, bit k = there is an event at x + k; (0,) for EVT2
    """
    state = out.state
    room, trigger_room = out.t_us.size - MOST_EVENTS_OF_WORD, out.trigger_t_us.size
    events, triggers, done = 0, 0, heads.size
    high_us, sure = state[HIGH] << LOW_BITS, state[SURE] != 0
    vectors = masks.size > 0
    for i in range(heads.size):
        if events > room or triggers >= trigger_room:
            done = i
            break
        word = int(heads[i])
        kind = word >> 28
        if kind in (OFF_WORD, ON_WORD):
            x, y = (word >> 11) & 0x7FF, word & 0x7FF
            now_us = high_us | ((word >> 22) & LOW_MASK)
            mask = int(masks[i]) if vectors else 1
            while mask:
                if mask & 1:
                    if not sure:
                        state[UNTIMED] += 1
                    elif x > MAX_COORDINATE:
                        state[OUTSIDE] += 1
                    else:
                        out.t_us[events] = now_us
                        out.x_px[events] = x
                        out.y_px[events] = y
                        out.on[events] = kind == ON_WORD
                        events += 1
                mask >>= 1
                x += 1
        elif kind == TIME_HIGH:
            value = word & HIGH_MASK
            if state[HIGH] >= 0 and (value - state[HIGH]) & HIGH_MASK <= FREE_STEPS:
                following = MISSING  # not asked for
            else:
                following = following_time(heads, i, final)
                if following == UNREAD:
                    done = i
                    break
            settle_time(state, value, following, HIGH_BITS, LOW_BITS, FREE_STEPS)
            high_us, sure = state[HIGH] << LOW_BITS, state[SURE] != 0
        elif kind == TRIGGER:
            if sure:
                out.trigger_t_us[triggers] = high_us | ((word >> 22) & LOW_MASK)
                out.trigger_value[triggers] = word & 1
                out.trigger_id[triggers] = (word >> 8) & 0x1F
                triggers += 1
        elif kind not in (OTHERS, CONTINUED):
            state[BAD_WORDS] += 1
    state[EVENTS], state[TRIGGERS] = events, triggers
    return done
