"""Output and state of the decoders of Prophesee's RAW words, and the rule for the time words.

Time comes in two parts: rare TIME_HIGH words count units of 64 us (EVT2) or 4096 us (EVT3) and wrap; the low
part comes with the events. One flipped bit in a TIME_HIGH word would throw all later events seconds or hours
ahead, so a step that is not small must not be contradicted by the TIME_HIGH words after it, of which the first that
others go on from is the witness: among random words there is none.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

# Indices of `Decoded.state`.
HIGH = 0  # TIME_HIGH with the wraps counted in; -1 before the first
LOW = 1  # low part (EVT3)
ROW = 2  # y of the row (EVT3); -1 before the first
COLUMN = 3  # next x of a vector (EVT3); -1 before the first
ON = 4  # polarity of a vector (EVT3)
TIME_KNOWN = 5  # 0 while the time is in doubt: events are dropped
EVENTS, TRIGGERS = 6, 7  # numbers written by the last call
BAD_WORDS, TIME_JUMPS, UNTIMED, OUTSIDE = 8, 9, 10, 11  # counts since the start
STATE_SIZE = 12

TIME_HIGH = 0x8  # type of the word, in all encodings
LOOK_AHEAD_WORDS = 1 << 20  # more than a sensor sends between two TIME_HIGH (4 ms at 100 Mev/s: 0.4 M)
LOOK_AHEAD_STEPS = 256  # TIME_HIGH words among which the witness is sought; 8 kB of random EVT3 words hold as many
GOING_ON_US = 1 << 16  # longest step between the witness and the two words after it; a sensor sends one each 4 ms
UNCONFIRMED_JUMP_US = 1_000_000  # longest step believed of the last TIME_HIGH, which nothing can confirm
MAX_COORDINATE = 2047  # 11 bits in all encodings

MISSING = -1  # no further TIME_HIGH word
UNREAD = -2  # it may come in the part of the file that is not read yet


class Decoded(NamedTuple):
    """Output arrays of a decoder, filled from their start: n events, m triggers, and the state between calls.

    The indices of the state (STATE_SIZE,) are the constants above.
    """

    t_us: NDArray[np.int64]
    x_px: NDArray[np.uint16]
    y_px: NDArray[np.uint16]
    on: NDArray[np.bool_]
    trigger_t_us: NDArray[np.int64]
    trigger_value: NDArray[np.uint8]
    trigger_id: NDArray[np.uint8]
    state: NDArray[np.int64]


def initial_state() -> NDArray[np.int64]:
    """State before a file's first word."""
    state = np.zeros(STATE_SIZE, np.int64)
    state[[HIGH, ROW, COLUMN]] = -1
    return state


@njit(cache=True, nogil=True)
def _witness(words: NDArray[Any], at: int, high: int, bits: int, low_bits: int, final: bool) -> int:
    """Value of the TIME_HIGH word by which words[at] is judged.

    That is the first one from `at` on from which the two after it go on, or where there is none the first one after
    `at`. It is words[at] itself if no step from `high` (unless negative) over it up to there is longer than a quarter
    turn: so gaps of many turns are written. MISSING without later words, UNREAD when they may not be among these.
    """
    mask, quarter, longest_step = (1 << bits) - 1, 1 << bits - 2, GOING_ON_US >> low_bits
    own = int(words[at] & mask)
    orderly = high < 0 or (own - high) & mask <= quarter
    first, witness, before = MISSING, own, own
    count, steps = 0, 0
    end = min(words.size, at + 1 + LOOK_AHEAD_WORDS)
    for i in range(at + 1, end):
        if words[i] >> bits != TIME_HIGH:
            continue
        value = int(words[i] & mask)
        step = (value - before) & mask
        steps += 1
        if step > longest_step:
            witness, steps = value, 0
        if steps == 2:
            return own if orderly else witness
        orderly = orderly and step <= quarter
        first = value if first == MISSING else first
        before = value
        count += 1
        if count == LOOK_AHEAD_STEPS:
            break
    else:
        if end == words.size and not final:
            return UNREAD
    return own if orderly and first != MISSING else first


@njit(cache=True, nogil=True)
def take_time_high(
    state: NDArray[np.int64], words: NDArray[Any], at: int, bits: int, low_bits: int, unchecked_steps: int, final: bool
) -> bool:
    """Take the TIME_HIGH word words[at] into state[HIGH] and state[TIME_KNOWN].

    Parameters
    ----------
    bits, low_bits : int
        Bits of TIME_HIGH, which has the type above them, and of the low part below it.
    unchecked_steps : int
        Steps ahead that are taken without looking at the next TIME_HIGH; so small that `TimeOrder` repairs a wrong one.
    final : bool
        Whether no words follow these.

    Returns
    -------
    bool
        False when the word has to wait for TIME_HIGH words that are not among these.

    Notes
    -----
    A value is ignored when that of the witness lies before it on the way round from the present time. One that is not
    ignored and lies more than half a turn ahead is a step back (but not to before 0).
    """
    turn = np.int64(1) << bits
    value = np.int64(words[at]) & (turn - 1)
    high = state[HIGH]
    ahead = (value - high) & (turn - 1)
    if high >= 0 and ahead <= unchecked_steps:
        state[HIGH], state[TIME_KNOWN] = high + ahead, 1
        return True
    witness = _witness(words, at, high, bits, low_bits, final)
    if witness == UNREAD:
        return False
    if high < 0:
        if witness >= 0 and ((witness - value) & (turn - 1)) >= turn >> 1:
            state[TIME_JUMPS] += 1
        else:
            state[HIGH], state[TIME_KNOWN] = value, 1
        return True
    if witness == MISSING:
        if ahead << low_bits > UNCONFIRMED_JUMP_US:
            state[TIME_JUMPS] += 1
            state[TIME_KNOWN] = 0
            return True
    elif ((witness - high) & (turn - 1)) < ahead:
        state[TIME_JUMPS] += 1
        return True
    if ahead > turn >> 1 and high + ahead >= turn:
        ahead -= turn
    state[HIGH], state[TIME_KNOWN] = high + ahead, 1
    return True
