"""Decoder of Prophesee EVT2 (32-bit words, one event each) and EVT2.1 (64 bits, up to 32 pixels of a row)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ....compilation import njit
from . import decoding
from .decoding import MAX_COORDINATE, TIME_HIGH, Decoded, take_time_high

CD_OFF, CD_ON, EXT_TRIGGER, OTHERS, CONTINUED = 0x0, 0x1, 0xA, 0xE, 0xF
HIGH_BITS, LOW_BITS = 28, 6
HIGH_MASK, LOW_MASK = (1 << HIGH_BITS) - 1, (1 << LOW_BITS) - 1
TIME_SHIFT, X_SHIFT, TRIGGER_ID_SHIFT = 22, 11, 8  # places in a word
UNCHECKED_STEPS = 155  # 9920 us: within the 10 ms that are put in order
MAX_EVENTS_PER_WORD = 32


@njit(cache=True, nogil=True)
def decode_evt2(out: Decoded, heads: NDArray[np.uint32], masks: NDArray[np.uint32], final: bool) -> int:
    """Decode words into `out` as `decode_evt3` does; returns the number of words done.

    Parameters
    ----------
    heads : (n,) uint32
        Type, low time, x, y.
    masks : (n,) uint32
        EVT2.1's other half, bit k = there is an event at x + k; (0,) for EVT2.
    """
    t_us, x_px, y_px, on = out.t_us, out.x_px, out.y_px, out.on
    state = out.state
    last_start, trigger_room = np.uint64(t_us.size - MAX_EVENTS_PER_WORD), out.trigger_t_us.size
    events, triggers, at, size = np.uint64(0), 0, np.uint64(0), np.uint64(heads.size)  # unsigned as in `decode_evt3`
    one = np.uint64(1)
    high_us, time_known = state[decoding.HIGH] << LOW_BITS, state[decoding.TIME_KNOWN] != 0
    vectors = masks.size > 0
    while at < size and events <= last_start and triggers < trigger_room:
        if time_known and not vectors:
            upto, first = min(size, at + last_start + one - events), at
            while at < upto and heads[at] >> HIGH_BITS <= CD_ON:
                at += one
            _write_run(out, events, heads[first:at], high_us)
            events += at - first
            if at == upto:
                continue
        word = np.int64(heads[at])
        kind = word >> HIGH_BITS
        if kind in (CD_OFF, CD_ON):
            x, y = (word >> X_SHIFT) & 0x7FF, word & 0x7FF
            now_us = high_us | ((word >> TIME_SHIFT) & LOW_MASK)
            mask = np.int64(masks[at]) if vectors else 1
            while mask:
                if mask & 1:
                    if not time_known:
                        state[decoding.UNTIMED] += 1
                    elif x > MAX_COORDINATE:
                        state[decoding.OUTSIDE] += 1
                    else:
                        t_us[events] = now_us
                        x_px[events] = x
                        y_px[events] = y
                        on[events] = kind == CD_ON
                        events += one
                mask >>= 1
                x += 1
        elif kind == TIME_HIGH:
            if not take_time_high(state, heads, int(at), HIGH_BITS, LOW_BITS, UNCHECKED_STEPS, final):
                break
            high_us, time_known = state[decoding.HIGH] << LOW_BITS, state[decoding.TIME_KNOWN] != 0
        elif kind == EXT_TRIGGER:
            if time_known:
                out.trigger_t_us[triggers] = high_us | ((word >> TIME_SHIFT) & LOW_MASK)
                out.trigger_value[triggers] = word & 1
                out.trigger_id[triggers] = (word >> TRIGGER_ID_SHIFT) & 0x1F
                triggers += 1
        elif kind not in (OTHERS, CONTINUED):
            state[decoding.BAD_WORDS] += 1
        at += one
    state[decoding.EVENTS], state[decoding.TRIGGERS] = events, triggers
    return int(at)


@njit(cache=True, nogil=True)
def _write_run(out: Decoded, first: np.uint64, words: NDArray[np.uint32], high_us: int) -> None:
    """Write the events of words (n,) into `out` from index `first` on, in a loop that the compiler vectorizes."""
    end = first + np.uint64(words.size)
    t_us, x_px, y_px, on = out.t_us[first:end], out.x_px[first:end], out.y_px[first:end], out.on[first:end]
    for k in range(words.size):
        word = words[k]
        t_us[k] = high_us | np.int64((word >> TIME_SHIFT) & LOW_MASK)
        x_px[k] = (word >> X_SHIFT) & 0x7FF
        y_px[k] = word & 0x7FF
        on[k] = word >> HIGH_BITS != CD_OFF
