"""Decoder of DAT's events, whose 32-bit times are checked against those that follow.

One flipped bit in a time, or a damaged block of the disk, would throw all later events up to 71 minutes ahead. A time
that is not near the one before is therefore believed only if the events after it go on from it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ....compilation import njit
from ...reader import MAX_DISORDER_US
from ...sensor import MAX_SIDE_PX

TURN_US = 1 << 32  # times are counted modulo this
TIME_MASK = TURN_US - 1
X_SHIFT, Y_SHIFT, ON_SHIFT = 32, 46, 60  # places in a word
COORDINATE_MASK = (1 << 14) - 1
ON_MASK = (1 << 4) - 1
BLOCK_EVENTS = 256  # 64 take half as long again, 1024 as long, and one damaged event costs its block the speed
MAX_COORDINATE = MAX_SIDE_PX - 1  # an event beyond it is none, and its time means nothing
# Random times go on from each other over n events with a probability of 1 / (n + 1)!: never in gigabytes.
CONFIRMING_EVENTS = 12
LOOK_AHEAD_EVENTS = 1 << 16  # half a megabyte of copies of one event, like zeros from a disk, confirm nothing
UNCONFIRMED_JUMP_US = 1_000_000  # longest step believed of the last event, which nothing can confirm

# Indices of `DatEvents.state`: last time or -1, numbers of the last call.
NOW, EVENTS, TIME_JUMPS, OUTSIDE = 0, 1, 2, 3
STATE_SIZE = 4

UNREAD = -1  # what decides is in the part of the file that is not read yet


class DatEvents(NamedTuple):
    """Output of the decoder: t_us (n,) int64, x_px, y_px (n,) uint16, on (n,) bool, state (STATE_SIZE,) int64."""

    t_us: NDArray[np.int64]
    x_px: NDArray[np.uint16]
    y_px: NDArray[np.uint16]
    on: NDArray[np.bool_]
    state: NDArray[np.int64]


@njit(cache=True, nogil=True)
def decode_dat(out: DatEvents, words: NDArray[np.int64], final: bool) -> int:
    """Decode events into `out`.

    Parameters
    ----------
    out : DatEvents
        Room for as many events as there are words.
    words : (n,) int64
        From the lowest bit up: time (32 bits), x (14), y (14), polarity (4).
    final : bool
        Whether no words follow these.

    Returns
    -------
    int
        Number of words done. Fewer than n when a time has to wait for later ones to confirm it.

    Notes
    -----
    Times up to MAX_DISORDER_US before or behind the last one are taken as they are, and wrap with it. A larger step is
    taken unless `_goes_on` denies it; one of more than half a turn ahead is a step back (but not to before 0).

    Blocks without any step back or such a larger one are found and converted in vectorized loops, 2.2 times as fast.
    """
    state = out.state
    now, events, jumps, outside = state[NOW], 0, 0, 0
    ignored = -1  # index of the last event that was
    block_end = i = 0
    while i < words.size:
        if i == block_end:
            block_end = min(i + BLOCK_EVENTS, words.size)
            if now >= 0 and _is_steady(words[i:block_end], now):
                _write_block(out, events, words[i:block_end], now)
                events += block_end - i
                now, i = out.t_us[events - 1], block_end
                continue
        word = words[i]
        if _is_outside(word):
            outside += 1
            i += 1
            continue
        t = value = word & TIME_MASK
        ahead = (value - now) & TIME_MASK
        if now >= 0 and ahead <= MAX_DISORDER_US:
            t = now + ahead
        elif now >= TURN_US - ahead and TURN_US - ahead <= MAX_DISORDER_US:
            t = now + ahead - TURN_US
        else:
            believed = 0
            if not (i > 0 and ignored == i - 1 and _is_copy(words, i)):
                believed = _goes_on(words, i, now, final)
            if believed == UNREAD:
                break
            if not believed:
                ignored = i
                jumps += 1
                i += 1
                continue
            if now >= 0:
                t = now + ahead
                if ahead > TURN_US >> 1 and t >= TURN_US:
                    t -= TURN_US
        now = t
        _write_event(out, events, word, t)
        events += 1
        i += 1
    state[NOW], state[EVENTS], state[TIME_JUMPS], state[OUTSIDE] = now, events, jumps, outside
    return i


@njit(cache=True, nogil=True)
def _is_steady(words: NDArray[np.int64], now_us: int) -> bool:
    """Whether no event (n,) lies outside, and each comes up to MAX_DISORDER_US after the one before it.

    `now_us` is the time of the one before the first. The loop goes on behind what is wrong: so it is vectorized.
    """
    wrong = np.int64((words[0] - now_us) & TIME_MASK > MAX_DISORDER_US) + _is_outside(words[0])
    for k in range(1, words.size):
        wrong += np.int64((words[k] - words[k - 1]) & TIME_MASK > MAX_DISORDER_US) + _is_outside(words[k])
    return bool(wrong == 0)


@njit(cache=True, nogil=True)
def _write_block(out: DatEvents, first: int, words: NDArray[np.int64], now_us: int) -> None:
    """Write events (n,) within a turn from `now_us` on into `out` from index `first` on, in a vectorized loop."""
    end = first + words.size
    block = DatEvents(out.t_us[first:end], out.x_px[first:end], out.y_px[first:end], out.on[first:end], out.state)
    for k in range(words.size):
        _write_event(block, k, words[k], now_us + ((words[k] - now_us) & TIME_MASK))


@njit(cache=True, nogil=True)
def _write_event(out: DatEvents, at: int, word: int, t_us: int) -> None:
    """Write an event with this time into `out` at an index."""
    out.t_us[at] = t_us
    out.x_px[at] = (word >> X_SHIFT) & COORDINATE_MASK
    out.y_px[at] = (word >> Y_SHIFT) & COORDINATE_MASK
    out.on[at] = (word >> ON_SHIFT) & ON_MASK != 0


@njit(cache=True, nogil=True)
def _is_outside(word: int) -> bool:
    """Whether a coordinate is one that no sensor has."""
    return ((word >> X_SHIFT) & COORDINATE_MASK > MAX_COORDINATE) | (
        (word >> Y_SHIFT) & COORDINATE_MASK > MAX_COORDINATE
    )


@njit(cache=True, nogil=True)
def _goes_on(words: NDArray[np.int64], at: int, now: int, final: bool) -> int:
    """Whether the events after `at` go on from its time: 1, 0, or UNREAD.

    The way from the present time over that of `at` and those of the next CONFIRMING_EVENTS has to end before it comes
    round to the present again; at the start of a file (`now` < 0), before it has gone half round.
    """
    before = words[at] & TIME_MASK
    way = (before - now) & TIME_MASK if now >= 0 else 0
    limit = TURN_US - MAX_DISORDER_US if now >= 0 else TURN_US >> 1
    confirming = 0
    end = min(words.size, at + 1 + LOOK_AHEAD_EVENTS)
    for i in range(at + 1, end):
        if _is_outside(words[i]) or _is_copy(words, i):
            continue
        value = words[i] & TIME_MASK
        step = (value - before) & TIME_MASK
        if step > TURN_US - MAX_DISORDER_US:
            step -= TURN_US
        way += step
        if way >= limit:
            return 0
        before = value
        confirming += 1
        if confirming == CONFIRMING_EVENTS:
            return 1
    if end == words.size and not final:
        return UNREAD
    return 1 if confirming or way <= UNCONFIRMED_JUMP_US else 0


@njit(cache=True, nogil=True)
def _is_copy(words: NDArray[np.int64], at: int) -> bool:
    """Whether an event is the same as the one before it in all bits."""
    return bool(words[at] == words[at - 1])
