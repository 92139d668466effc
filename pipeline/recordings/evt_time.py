"""What the decoders of Prophesee's RAW words share: their output, and the rule for the time words.

Time comes in two parts: rare TIME_HIGH words count units of 64 us (EVT2) or 4096 us (EVT3) and wrap; the low
part comes with the events. One flipped bit in a TIME_HIGH word would throw all later events seconds or hours
ahead, so a step that is not small must not be contradicted by the TIME_HIGH word after it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

# Places in `Decoded.state`.
HIGH = 0  # TIME_HIGH with the wraps counted in; -1 before the first
LOW = 1  # low part (EVT3)
ROW = 2  # y of the row (EVT3); -1 before the first
COLUMN = 3  # next x of a vector (EVT3); -1 before the first
ON = 4  # polarity of a vector (EVT3)
SURE = 5  # 0 while the time is in doubt: events are dropped
EVENTS, TRIGGERS = 6, 7  # how many the last call wrote
BAD_WORDS, TIME_JUMPS, UNTIMED, OUTSIDE = 8, 9, 10, 11  # counts since the start
STATE_SIZE = 12

LOOK_AHEAD_WORDS = 1 << 20  # more than a sensor sends between two TIME_HIGH (4 ms at 100 Mev/s: 0.4 M)
UNCONFIRMED_JUMP_US = 1_000_000  # longest step believed of the last TIME_HIGH, which nothing can confirm
MAX_COORDINATE = 2047  # 11 bits in all formats

MISSING = -1  # no further TIME_HIGH word
UNREAD = -2  # it may come in the part of the file that is not read yet


class Decoded(NamedTuple):
    """Where a decoder writes: events and triggers from the start of the arrays, and what it must remember.

    t_us (n,) int64, x_px, y_px (n,) uint16, on (n,) bool; trigger_t_us (m,) int64, trigger_value, trigger_id
    (m,) uint8; state (12,) int64, see the constants.
    """

    t_us: NDArray[np.int64]
    x_px: NDArray[np.uint16]
    y_px: NDArray[np.uint16]
    on: NDArray[np.bool_]
    trigger_t_us: NDArray[np.int64]
    trigger_value: NDArray[np.uint8]
    trigger_id: NDArray[np.uint8]
    state: NDArray[np.int64]


def fresh_state() -> NDArray[np.int64]:
    """The state before a file's first word."""
    state = np.zeros(STATE_SIZE, np.int64)
    state[[HIGH, ROW, COLUMN]] = -1
    return state


@njit(cache=True, nogil=True)
def settle_time(
    state: NDArray[np.int64], value: int, following: int, bits: int, low_bits: int, free_steps: int
) -> None:
    """Take a TIME_HIGH `value` into state[HIGH] and state[SURE], given the value of the one that follows it.

    following : MISSING when there is none
    free_steps : steps ahead that are taken without asking; so small that `TimeOrder` repairs a wrong one

    A value is ignored when the following one lies before it on the way round from the present time. One that
    is not ignored and lies more than half a turn ahead is a step back (but not to before 0).
    """
    turn = np.int64(1) << bits
    high = state[HIGH]
    if high < 0:
        if following >= 0 and ((following - value) & (turn - 1)) >= turn >> 1:
            state[TIME_JUMPS] += 1
        else:
            state[HIGH], state[SURE] = value, 1
        return
    ahead = (value - high) & (turn - 1)
    if ahead > free_steps:
        if following == MISSING:
            if ahead << low_bits > UNCONFIRMED_JUMP_US:
                state[TIME_JUMPS] += 1
                state[SURE] = 0
                return
        elif ((following - high) & (turn - 1)) < ahead:
            state[TIME_JUMPS] += 1
            return
    if ahead > turn >> 1 and high + ahead >= turn:
        ahead -= turn
    state[HIGH], state[SURE] = high + ahead, 1
