"""Decoder of the events of Event Stream: a byte of time and polarity, then two of x and two of y."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ....compilation import njit

EVENT_BYTES = 5
NOW, EVENTS = 0, 1  # indices of `EventStreamEvents.state`: time of the last event, number written by the last call
STATE_SIZE = 2


class EventStreamEvents(NamedTuple):
    """Output of the decoder, filled from its start, and the state between calls, (STATE_SIZE,) int64."""

    t_us: NDArray[np.int64]
    x_px: NDArray[np.uint16]
    y_px: NDArray[np.uint16]
    on: NDArray[np.bool_]
    state: NDArray[np.int64]


@njit(cache=True, nogil=True)
def decode_event_stream(out: EventStreamEvents, data: NDArray[np.uint8], is_atis: bool) -> int:
    """Decode bytes (n,) of version 2 into `out`; returns the number of bytes done.

    A first byte whose bits of time are all set is no event: it lets time pass (overflow), or is skipped (reset). ATIS
    has a bit of time fewer, several overflows in one byte, and measurements of exposure, which are skipped.

    References
    ----------
    .. [1] Event Stream, version 2.0, https://github.com/neuromorphic-paris/event_stream
    """
    state, room = out.state, out.t_us.size
    at, events, now_us = 0, 0, state[NOW]
    low_bits = 2 if is_atis else 1
    full = 0xFF >> low_bits
    while at < data.size and events < room:
        first = int(data[at])
        low, passed = first & ((1 << low_bits) - 1), first >> low_bits
        if passed == full:
            now_us += low * full
            at += 1
            continue
        if at + EVENT_BYTES > data.size:
            break
        now_us += passed
        is_event = not (is_atis and low & 1)
        if is_event:
            out.t_us[events] = now_us
            out.x_px[events] = data[at + 1] | np.uint16(data[at + 2]) << 8
            out.y_px[events] = data[at + 3] | np.uint16(data[at + 4]) << 8
            out.on[events] = low >> (low_bits - 1) != 0
            events += 1
        at += EVENT_BYTES
    state[NOW], state[EVENTS] = now_us, events
    return at
