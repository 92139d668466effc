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
X_BITS = Y_BITS = 14  # of the second word; the polarity has the four above
COORDINATE_MASK = (1 << X_BITS) - 1
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
def decode_dat(out: DatEvents, words: NDArray[np.uint32], final: bool) -> int:
    """Decode events into `out`.

    Parameters
    ----------
    out : DatEvents
        Room for as many events as there are words.
    words : (n, 2) uint32
        Time, then x, y and polarity.
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
    """
    state = out.state
    now, events, jumps, outside, done = state[NOW], 0, 0, 0, words.shape[0]
    ignored = -1  # index of the last event that was
    for i in range(words.shape[0]):
        value, pixel = np.int64(words[i, 0]), words[i, 1]
        x_px, y_px = pixel & COORDINATE_MASK, (pixel >> X_BITS) & COORDINATE_MASK
        if x_px > MAX_COORDINATE or y_px > MAX_COORDINATE:
            outside += 1
            continue
        t = value
        ahead = (value - now) & (TURN_US - 1)
        if now >= 0 and ahead <= MAX_DISORDER_US:
            t = now + ahead
        elif now >= TURN_US - ahead and TURN_US - ahead <= MAX_DISORDER_US:
            t = now + ahead - TURN_US
        else:
            believed = 0
            if not (i > 0 and ignored == i - 1 and _is_copy(words, i)):
                believed = _goes_on(words, i, now, final)
            if believed == UNREAD:
                done = i
                break
            if not believed:
                ignored = i
                jumps += 1
                continue
            if now >= 0:
                t = now + ahead
                if ahead > TURN_US >> 1 and t >= TURN_US:
                    t -= TURN_US
        now = t
        out.t_us[events] = t
        out.x_px[events], out.y_px[events] = x_px, y_px
        out.on[events] = pixel >> (X_BITS + Y_BITS) != 0
        events += 1
    state[NOW], state[EVENTS], state[TIME_JUMPS], state[OUTSIDE] = now, events, jumps, outside
    return int(done)


@njit(cache=True, nogil=True)
def _goes_on(words: NDArray[np.uint32], at: int, now: int, final: bool) -> int:
    """Whether the events after `at` go on from its time: 1, 0, or UNREAD.

    The way from the present time over that of `at` and those of the next CONFIRMING_EVENTS has to end before it comes
    round to the present again; at the start of a file (`now` < 0), before it has gone half round.
    """
    before = np.int64(words[at, 0])
    way = (before - now) & (TURN_US - 1) if now >= 0 else 0
    limit = TURN_US - MAX_DISORDER_US if now >= 0 else TURN_US >> 1
    confirming = 0
    end = min(words.shape[0], at + 1 + LOOK_AHEAD_EVENTS)
    for i in range(at + 1, end):
        pixel = words[i, 1]
        outside = max(pixel & COORDINATE_MASK, (pixel >> X_BITS) & COORDINATE_MASK) > MAX_COORDINATE
        if outside or _is_copy(words, i):
            continue
        value = np.int64(words[i, 0])
        step = (value - before) & (TURN_US - 1)
        if step > TURN_US - MAX_DISORDER_US:
            step -= TURN_US
        way += step
        if way >= limit:
            return 0
        before = value
        confirming += 1
        if confirming == CONFIRMING_EVENTS:
            return 1
    if end == words.shape[0] and not final:
        return UNREAD
    return 1 if confirming or way <= UNCONFIRMED_JUMP_US else 0


@njit(cache=True, nogil=True)
def _is_copy(words: NDArray[np.uint32], at: int) -> bool:
    """Whether an event is the same as the one before it in all bits."""
    return bool(words[at, 0] == words[at - 1, 0] and words[at, 1] == words[at - 1, 1])
