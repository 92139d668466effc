"""The inner loops of the simulator; `run` is the entry.

Pixels are flat indices row * width + column; times are microseconds as float64. The tables are plain arrays
whose columns are named where they are used (`kernels_light`, `kernels_pixel`), for numba hands many small
arrays from function to function slowly.
"""

from __future__ import annotations

import math

from numba import njit

from .kernels_light import EVERY, Bodies, Floats, Physics, light
from .kernels_pixel import (
    LIGHT,
    LISTED,
    PLAIN,
    RESTING,
    SIGNAL,
    SIGNAL_PLAIN,
    TIME,
    Pixels,
    View,
    advance,
    begin,
    settled,
)


@njit(cache=True, nogil=True)
def _look(
    pixels: Pixels,
    view: View,
    bodies: Bodies,
    physics: Physics,
    row: int,
    k: int,
    since_us: float,
    now_us: float,
    gain: float,
    fresh: bool,
) -> None:
    """Go over the pixels in the box of body k."""
    box, kind, pose, ink = bodies.box, bodies.kind, bodies.pose, bodies.ink
    state, role, owner, listing, cursor = (
        pixels.state,
        pixels.role,
        pixels.owner,
        pixels.listing,
        pixels.cursor,
    )
    looked, resting, rest_body = pixels.looked, pixels.rest, pixels.rest_body
    events = (cursor, pixels.event_us, pixels.event_word)
    sensor = (view.threshold_on, view.threshold_off, view.normals)
    background, ray_x, ray_y = view.background, view.ray_x, view.ray_y
    floor, every = physics.floor, int(kind[k, EVERY])
    steady = physics.flicker_depth == 0.0
    for y in range(box[row, k, 1], box[row, k, 3]):
        for x in range(box[row, k, 0], box[row, k, 2]):
            p = y * physics.width_px + x
            if looked[p] == row or (resting[p] >= row and rest_body[p] == k):
                continue
            covered, looks, base, intensity, plain = light(
                owner, background, box, kind, pose, ink, physics, row, x, y, ray_x[p], ray_y[p]
            )
            looked[p] = row
            listed = role[p] == LISTED
            if covered or listed:
                intensity = intensity * gain + floor
                plain = plain * gain + floor
                if fresh:
                    begin(state, role, listing, cursor, sensor, physics, p, intensity, plain, now_us)
                    continue
                if not listed:
                    before = background[p] * gain + floor
                    begin(state, role, listing, cursor, sensor, physics, p, before, before, since_us)
                advance(state, events, sensor, physics, p, owner[p], intensity, plain, now_us)
                if looks > base and not settled(state, p):  # its events want their times right
                    looks = base
            if steady and looks >= 2.0:
                resting[p] = row + every * (int(looks) - 1)
                rest_body[p] = k


@njit(cache=True, nogil=True)
def _tails(
    pixels: Pixels,
    view: View,
    bodies: Bodies,
    physics: Physics,
    row: int,
    before_us: float,
    now_us: float,
    gain: float,
) -> None:
    """Go on with the pixels that bodies have left, and let go those that have come to rest."""
    box, state, width = bodies.box, pixels.state, physics.width_px
    cursor, listing, role, owner, looked = (
        pixels.cursor,
        pixels.listing,
        pixels.role,
        pixels.owner,
        pixels.looked,
    )
    events = (cursor, pixels.event_us, pixels.event_word)
    sensor = (view.threshold_on, view.threshold_off, view.normals)
    background = view.background
    # Under flicker every pixel works: forty looks a period are enough for its sine.
    pause_us = 0.05 * math.pi / physics.flicker_per_us if physics.flicker_depth > 0.0 else 0.0
    i = 0
    while i < cursor[0]:
        p = listing[i]
        i += 1
        if looked[p] == row or now_us - state[p, TIME] < pause_us:
            continue
        y, x = p // width, p % width
        near = False
        for k in range(box.shape[1]):
            if box[row, k, 0] <= x < box[row, k, 2] and box[row, k, 1] <= y < box[row, k, 3]:
                near = True
        if near:
            continue
        if settled(state, p):  # nothing happened since its last look: a body that vanishes does so now
            state[p, TIME] = max(state[p, TIME], before_us)
        intensity = background[p] * gain + physics.floor
        advance(state, events, sensor, physics, p, owner[p], intensity, intensity, now_us)
        if physics.flicker_depth == 0.0 and settled(state, p):
            state[p, SIGNAL], state[p, SIGNAL_PLAIN] = state[p, LIGHT], state[p, PLAIN]
            role[p] = RESTING
            i -= 1
            cursor[0] -= 1
            listing[i] = listing[cursor[0]]


@njit(cache=True, nogil=True)
def run(
    pixels: Pixels,
    view: View,
    bodies: Bodies,
    physics: Physics,
    time_us: Floats,
    first: int,
    fresh: bool,
) -> int:
    """Simulate the rows from `first` of time_us on, writing into `pixels`; return the next row.

    Returns early when the event buffers are more than half full: empty them (cursor[1] = 0) and call again.
    With `fresh` the row `first` only sets the pixels to what stands there at that time, without events.
    """
    row = first
    while row < time_us.size and 2 * pixels.cursor[1] <= pixels.event_us.size:
        now_us = time_us[row]
        gain = physics.brightness * (1.0 + physics.flicker_depth * math.sin(physics.flicker_per_us * now_us))
        start = fresh and row == first
        for k in range(bodies.kind.shape[0]):
            every = int(bodies.kind[k, EVERY])
            if start or row % every == 0 or row == time_us.size - 1:
                _look(pixels, view, bodies, physics, row, k, time_us[max(row - every, 0)], now_us, gain, start)
        _tails(pixels, view, bodies, physics, row, time_us[max(row - 1, 0)], now_us, gain)
        row += 1
    return row


@njit(cache=True, nogil=True)
def begin_all(pixels: Pixels, view: View, physics: Physics) -> None:
    """Put every pixel of `pixels` to work on its background at time 0."""
    for p in range(view.background.size):
        intensity = view.background[p] * physics.brightness + physics.floor
        begin(
            pixels.state,
            pixels.role,
            pixels.listing,
            pixels.cursor,
            (view.threshold_on, view.threshold_off, view.normals),
            physics,
            p,
            intensity,
            intensity,
            0.0,
        )
