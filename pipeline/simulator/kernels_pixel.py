"""Kernels of the event pixel: low-pass, thresholds, dead time; see `kernels`.

"Plain" is the same signal had the balls no logo: it tells the logo's events from the others.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compilation import njit
from .kernels_light import Physics

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Bytes = NDArray[np.uint8]
Ints = NDArray[np.int32]

# A pixel's role: untouched so far, in the box of a body, still answering to a body that has left, at rest again.
NEW, IN_BOX, TAIL, RESTING = 0, 1, 2, 3

NOBODY = 255  # owner of a pixel that no body has covered

# Columns of a pixel's state: it lies in one or two cache lines.
LIGHT, PLAIN = 0, 1  # log intensity at TIME
SIGNAL, SIGNAL_PLAIN = 2, 3  # after the low-pass
REFERENCE, REFERENCE_PLAIN = 4, 5  # signal at the end of the last dead time
TIME = 6
FREE = 7  # end of the running dead time, infinite when none runs
OFF_FROM = 8  # no OFF event before
UP, DOWN = 9, 10  # thresholds until the next event, noise included
STATE_COLUMNS = 11


class Pixels(NamedTuple):
    """Output of `run`: the state of every pixel, the list of tails, the events."""

    state: Floats  # (n, STATE_COLUMNS)
    role: Bytes  # (n,)
    owner: Bytes  # (n,) body that changed the light last
    looked: Ints  # (n,) row of the last look
    rest: Ints  # (n,) the body below needs no look up to and including this row
    rest_body: Bytes  # (n,)
    listing: Ints  # (n,) the tails, in front
    cursor: NDArray[np.int64]  # [tails, events written, normals used]
    event_us: Floats
    event_word: NDArray[np.int64]  # pixel << 16 | owner << 8 | logo << 1 | on


Events = tuple[NDArray[np.int64], Floats, NDArray[np.int64]]  # cursor, event_us, event_word
Thresholds = tuple[Singles, Singles, Floats]  # threshold_on, threshold_off, normals


class Maps(NamedTuple):
    """Maps over the pixels that do not change, each (n,)."""

    ray_x: Floats  # rays through the pixels, z = 1
    ray_y: Floats
    background: Floats  # intensity
    threshold_on: Singles
    threshold_off: Singles
    normals: Floats  # standard normals, a power of two of them, used round and round


@njit(cache=True, nogil=True)
def advance(
    state: Floats,
    events: Events,
    sensor: Thresholds,
    physics: Physics,
    p: int,
    owner: int,
    intensity: float,
    plain_intensity: float,
    now_us: float,
) -> None:
    """Take pixel p to now_us, its light running straight to the new value; write its events into `events`."""
    cursor, event_us, event_word = events
    before = state[p, TIME]
    span = now_us - before
    if span <= 0.0:
        return
    light0, plain0 = state[p, LIGHT], state[p, PLAIN]
    light1 = math.log(intensity)
    plain1 = light1 if plain_intensity == intensity else math.log(plain_intensity)
    tau = physics.tau_us + physics.dark_tau_us / intensity
    decay = math.exp(-span / tau)
    # First-order low-pass of a straight line, exact.
    v0 = state[p, SIGNAL]
    lag = (light1 - light0) / span * tau
    v1 = light1 - lag + (v0 - light0 + lag) * decay
    u0 = state[p, SIGNAL_PLAIN]
    lag = (plain1 - plain0) / span * tau
    u1 = plain1 - lag + (u0 - plain0 + lag) * decay
    state[p, LIGHT], state[p, PLAIN] = light1, plain1
    state[p, SIGNAL], state[p, SIGNAL_PLAIN] = v1, u1
    state[p, TIME] = now_us

    at = before  # where in the span we are
    if state[p, FREE] != math.inf:
        if state[p, FREE] > now_us:
            return
        at = max(state[p, FREE], before)
        share = (at - before) / span
        state[p, REFERENCE] = v0 + share * (v1 - v0)
        state[p, REFERENCE_PLAIN] = u0 + share * (u1 - u0)
        state[p, FREE] = math.inf
    if physics.forget_per_us > 0.0:
        kept = math.exp(-span * physics.forget_per_us)
        state[p, REFERENCE] = v1 + (state[p, REFERENCE] - v1) * kept
        state[p, REFERENCE_PLAIN] = u1 + (state[p, REFERENCE_PLAIN] - u1) * kept
    while True:
        reference = state[p, REFERENCE]
        if v1 - reference >= state[p, UP]:
            target, on = reference + state[p, UP], 1
        elif v1 - reference <= -state[p, DOWN]:
            target, on = reference - state[p, DOWN], 0
        else:
            return
        here = v0 + (at - before) / span * (v1 - v0)
        when = at
        if (on == 1 and here < target) or (on == 0 and here > target):
            when = before + (target - v0) / (v1 - v0) * span
        if on == 0 and when < state[p, OFF_FROM]:
            when = state[p, OFF_FROM]
            if when > now_us:
                return
        share = (when - before) / span
        change = v0 + share * (v1 - v0) - reference
        change_plain = u0 + share * (u1 - u0) - state[p, REFERENCE_PLAIN]
        # The logo's event: a blank ball would have changed by less than half.
        logo = 1 if change_plain / change < 0.5 else 0
        count = cursor[1]
        event_us[count] = when
        event_word[count] = (np.int64(p) << 16) | (np.int64(owner) << 8) | (logo << 1) | on
        cursor[1] = count + 1
        _draw_thresholds(state, cursor, sensor, physics, p, intensity)
        if on == 1:
            state[p, OFF_FROM] = when + physics.off_after_on_us
        at = when + physics.refractory_us
        if at > now_us:
            state[p, FREE] = at
            return
        share = (at - before) / span
        state[p, REFERENCE] = v0 + share * (v1 - v0)
        state[p, REFERENCE_PLAIN] = u0 + share * (u1 - u0)


@njit(cache=True, nogil=True)
def _draw_thresholds(
    state: Floats, cursor: NDArray[np.int64], sensor: Thresholds, physics: Physics, p: int, intensity: float
) -> None:
    """Noise on pixel p's thresholds until its next event; never below a quarter of the nominal."""
    threshold_on, threshold_off, normals = sensor
    used = cursor[2]
    cursor[2] = used + 1
    noise = physics.contrast_noise / math.sqrt(intensity) * normals[used & (normals.size - 1)]
    state[p, UP] = max(threshold_on[p] + noise, 0.25 * threshold_on[p])
    state[p, DOWN] = max(threshold_off[p] + noise, 0.25 * threshold_off[p])


@njit(cache=True, nogil=True)
def begin(
    state: Floats,
    role: Bytes,
    cursor: NDArray[np.int64],
    sensor: Thresholds,
    physics: Physics,
    p: int,
    intensity: float,
    plain_intensity: float,
    now_us: float,
) -> None:
    """Put pixel p to work, at rest at now_us under this light."""
    light, plain = math.log(intensity), math.log(plain_intensity)
    rest = 0.0  # how far the signal at rest lies from the reference
    if role[p] == NEW:
        state[p, OFF_FROM] = -math.inf
        _draw_thresholds(state, cursor, sensor, physics, p, intensity)
    else:
        rest = state[p, SIGNAL] - state[p, REFERENCE]
        if physics.forget_per_us > 0.0:
            rest *= math.exp(-(now_us - state[p, TIME]) * physics.forget_per_us)
    state[p, LIGHT], state[p, SIGNAL], state[p, REFERENCE] = light, light, light - rest
    state[p, PLAIN], state[p, SIGNAL_PLAIN], state[p, REFERENCE_PLAIN] = plain, plain, plain - rest
    state[p, TIME] = now_us
    state[p, FREE] = math.inf
    if role[p] != TAIL:
        role[p] = IN_BOX


@njit(cache=True, nogil=True)
def settled(state: Floats, p: int) -> bool:
    """Whether pixel p, its light at rest, will write no further event."""
    if state[p, FREE] != math.inf:
        return False
    return bool(-state[p, DOWN] < state[p, LIGHT] - state[p, REFERENCE] < state[p, UP])
