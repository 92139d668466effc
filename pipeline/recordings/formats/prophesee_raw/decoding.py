"""Output and state of the decoders of Prophesee's RAW words, and the rule for the time words.

Time comes in two parts: rare TIME_HIGH words count units of 64 us (EVT2) or 4096 us (EVT3) and wrap; the low
part comes with the events. One flipped bit in a TIME_HIGH word would throw all later events seconds or hours
ahead, so a step that is not small must not be contradicted by the TIME_HIGH words after it, of which the first that
others go on from is the witness: among random words there is none.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ....compilation import njit

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
UNREAD = -2  # they may come in the part of the file that is not read yet


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
def _is_borne_out(words: NDArray[Any], at: int, high: int, bits: int, low_bits: int, final: bool) -> int:
    """Whether later TIME_HIGH words go on from words[at]: 1, 0, MISSING without any, UNREAD if not among these words.

    The witness is the first one, from `at` on, from which the two after it go on; the first one after `at` where there
    is none. A value is wrong if the witness lies before it on the way round from `high`, the present time; before that
    is known (`high` < 0), if it is not the witness itself. It is right if no step over it up to the witness is longer
    than a quarter turn: so gaps of many turns are written.
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
        orderly = orderly and step <= quarter
        first = value if first == MISSING else first
        before = value
        count += 1
        if steps == 2 or count == LOOK_AHEAD_STEPS:
            break
    else:
        if end == words.size and not final:
            return UNREAD
    if first == MISSING:
        return MISSING
    if orderly:
        return 1
    if high < 0:
        return int(witness == own if steps == 2 else (first - own) & mask <= 2 * quarter)
    if steps < 2:
        return int((first - high) & mask >= (own - high) & mask)
    is_present = (high - witness) & mask <= longest_step  # or just behind it
    return int(witness == own or not (is_present or (witness - high) & mask < (own - high) & mask))


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
    A value that later ones do not bear out is ignored. One that is not ignored and lies more than half a turn ahead is
    a step back (but not to before 0).
    """
    turn = np.int64(1) << bits
    value = np.int64(words[at]) & (turn - 1)
    high = state[HIGH]
    ahead = (value - high) & (turn - 1)
    if high >= 0 and ahead <= unchecked_steps:
        state[HIGH], state[TIME_KNOWN] = high + ahead, 1
        return True
    borne_out = _is_borne_out(words, at, high, bits, low_bits, final)
    if borne_out == UNREAD:
        return False
    if borne_out == MISSING and high >= 0 and ahead << low_bits > UNCONFIRMED_JUMP_US:
        state[TIME_JUMPS] += 1
        state[TIME_KNOWN] = 0
        return True
    if borne_out == 0:
        state[TIME_JUMPS] += 1
        return True
    if high < 0:
        high, ahead = np.int64(0), value
    if ahead > turn >> 1 and high + ahead >= turn:
        ahead -= turn
    state[HIGH], state[TIME_KNOWN] = high + ahead, 1
    return True
