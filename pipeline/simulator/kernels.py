"""The inner loops of the simulator; `run` is the entry.

Pixels are flat indices row * width + column; times are microseconds as float64. The tables are plain arrays
whose columns are named where they are used (`kernels_light`, `kernels_pixel`), for numba hands many small
arrays from function to function slowly.
"""

from __future__ import annotations

import math

import numpy as np

from ..compilation import njit
from . import kernels_pixel as pixel
from .kernels_light import EVERY, Bodies, Floats, Physics, light
from .kernels_pixel import NOBODY, Ints, Maps, Pixels


@njit(cache=True, nogil=True)
def _behind(background: Floats, shift_px: Floats, physics: Physics, height_px: int, x: int, y: int) -> float:
    """Intensity of the background at a pixel, bilinear where the camera has turned it away by `shift_px` (2,)."""
    if shift_px[0] == 0.0 and shift_px[1] == 0.0:
        return float(background[y * physics.width_px + x])
    u = min(max(x - shift_px[0], 0.0), physics.width_px - 1.001)
    w = min(max(y - shift_px[1], 0.0), height_px - 1.001)
    i, j = int(u), int(w)
    p = j * physics.width_px + i
    upper = background[p] + (u - i) * (background[p + 1] - background[p])
    p += physics.width_px
    lower = background[p] + (u - i) * (background[p + 1] - background[p])
    return float(upper + (w - j) * (lower - upper))


@njit(cache=True, nogil=True)
def _look(
    pixels: Pixels,
    view: Maps,
    bodies: Bodies,
    physics: Physics,
    shift_px: Floats,
    row: int,
    k: int,
    since_us: float,
    now_us: float,
    gain: float,
    fresh: bool,
) -> None:
    """Go over the pixels in the box of body k."""
    box, kind, pose, texture = bodies.box, bodies.kind, bodies.pose, bodies.texture
    state, role, owner, cursor = pixels.state, pixels.role, pixels.owner, pixels.cursor
    looked, resting, rest_body = pixels.looked, pixels.rest, pixels.rest_body
    events = (cursor, pixels.event_us, pixels.event_word)
    sensor = (view.threshold_on, view.threshold_off, view.normals)
    background, ray_x, ray_y = view.background, view.ray_x, view.ray_y
    floor, every = physics.floor, int(kind[k, EVERY])
    steady = physics.pause_us == 0.0
    height_px = background.size // physics.width_px
    for y in range(box[row, k, 1], box[row, k, 3]):
        for x in range(box[row, k, 0], box[row, k, 2]):
            p = y * physics.width_px + x
            if looked[p] == row or (resting[p] >= row and rest_body[p] == k):
                continue
            behind = _behind(background, shift_px[row], physics, height_px, x, y)
            covered, looks, base, intensity, plain = light(
                owner, behind, box, kind, pose, texture, physics, row, x, y, ray_x[p], ray_y[p]
            )
            looked[p] = row
            at_work = role[p] == pixel.IN_BOX or role[p] == pixel.TAIL
            if covered or at_work:
                intensity = intensity * gain + floor
                plain = plain * gain + floor
                if fresh:
                    pixel.begin(state, role, cursor, sensor, physics, p, intensity, plain, now_us)
                    continue
                if not at_work:
                    before = behind * gain + floor
                    pixel.begin(state, role, cursor, sensor, physics, p, before, before, since_us)
                pixel.advance(state, events, sensor, physics, p, owner[p], intensity, plain, now_us)
                if looks > base and not pixel.settled(state, p):  # its events want their times right
                    looks = base
            if steady and looks >= 2.0:
                resting[p] = row + every * (int(looks) - 1)
                rest_body[p] = k


@njit(cache=True, nogil=True)
def _tails(
    pixels: Pixels,
    view: Maps,
    bodies: Bodies,
    physics: Physics,
    shift_px: Floats,
    row: int,
    before_us: float,
    now_us: float,
    gain: float,
) -> None:
    """Go on with the pixels that bodies have left, and let go those that have come to rest."""
    box, state, width = bodies.box, pixels.state, physics.width_px
    cursor, listing, role, owner = pixels.cursor, pixels.listing, pixels.role, pixels.owner
    events = (cursor, pixels.event_us, pixels.event_word)
    sensor = (view.threshold_on, view.threshold_off, view.normals)
    background = view.background
    height_px, rests = background.size // width, physics.pause_us == 0.0
    i = 0
    while i < cursor[0]:
        p = listing[i] + 0  # int64, as all other places: else numba compiles what follows for int32, too
        y, x = p // width, p % width
        new_role = pixel.TAIL
        for k in range(box.shape[1]):
            if box[row, k, 0] <= x < box[row, k, 2] and box[row, k, 1] <= y < box[row, k, 3]:
                new_role = pixel.IN_BOX
        if new_role == pixel.TAIL and now_us - state[p, pixel.TIME] >= 0.5 * physics.pause_us:
            if rests and pixel.settled(
                state, p
            ):  # nothing happened since its last look: a body that vanishes does so now
                state[p, pixel.TIME] = max(state[p, pixel.TIME], before_us)
            intensity = _behind(background, shift_px[row], physics, height_px, x, y) * gain + physics.floor
            pixel.advance(state, events, sensor, physics, p, owner[p], intensity, intensity, now_us)
            if not rests:
                owner[p] = NOBODY
            elif pixel.settled(state, p):
                state[p, pixel.SIGNAL], state[p, pixel.SIGNAL_PLAIN] = state[p, pixel.LIGHT], state[p, pixel.PLAIN]
                new_role = pixel.RESTING
        if new_role == pixel.TAIL:
            i += 1
        else:
            role[p] = new_role
            cursor[0] -= 1
            listing[i] = listing[cursor[0]]


@njit(cache=True, nogil=True)
def _leave(pixels: Pixels, box: Ints, old: int, new: int, k: int, width: int) -> None:
    """Make tails of the pixels that were in the box of body k in row `old` and are not in row `new`."""
    role, listing, cursor = pixels.role, pixels.listing, pixels.cursor
    for y in range(box[old, k, 1], box[old, k, 3]):
        row_stays = box[new, k, 1] <= y < box[new, k, 3]
        x = box[old, k, 0]
        while x < box[old, k, 2]:
            if row_stays and box[new, k, 0] <= x < box[new, k, 2]:
                x = box[new, k, 2]
                continue
            p = y * width + x
            if role[p] == pixel.IN_BOX:
                role[p] = pixel.TAIL
                listing[cursor[0]] = p
                cursor[0] += 1
            x += 1


@njit(cache=True, nogil=True)
def leave_all(pixels: Pixels, box: Ints, width: int) -> None:
    """Make tails of all pixels in these boxes (k, 4), into `pixels`: their bodies may come no more."""
    boxes = np.zeros((2, box.shape[0], box.shape[1]), np.int32)
    for k in range(box.shape[0]):
        for side in range(box.shape[1]):
            boxes[0, k, side] = box[k, side]
        _leave(pixels, boxes, 0, 1, k, width)


@njit(cache=True, nogil=True)
def run(
    pixels: Pixels,
    view: Maps,
    bodies: Bodies,
    physics: Physics,
    time_us: Floats,
    shift_px: Floats,
    first: int,
    fresh: bool,
) -> int:
    """Simulate the rows from `first` of time_us on, writing into `pixels`; return the next row.

    `shift_px` (rows, 2) is the shift of the background in the image at these times.
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
                _look(
                    pixels, view, bodies, physics, shift_px, row, k, time_us[max(row - every, 0)], now_us, gain, start
                )
            if row > 0:
                _leave(pixels, bodies.box, row - 1, row, k, physics.width_px)
        before_us = time_us[max(row - 1, 0)]
        pause_us = physics.pause_us
        if pause_us == 0.0 or math.floor(now_us / pause_us) != math.floor(before_us / pause_us):
            _tails(pixels, view, bodies, physics, shift_px, row, before_us, now_us, gain)
        row += 1
    return row


@njit(cache=True, nogil=True)
def begin_all(pixels: Pixels, view: Maps, physics: Physics, shift_px: Floats) -> None:
    """Put every pixel of `pixels` to work on its background at time 0, shifted by `shift_px` (2,)."""
    sensor = (view.threshold_on, view.threshold_off, view.normals)
    width_px = physics.width_px
    height_px = view.background.size // width_px
    for p in range(view.background.size):
        behind = _behind(view.background, shift_px, physics, height_px, p % width_px, p // width_px)
        intensity = behind * physics.brightness + physics.floor
        pixel.begin(pixels.state, pixels.role, pixels.cursor, sensor, physics, p, intensity, intensity, 0.0)
        pixels.role[p] = pixel.TAIL
        pixels.listing[p] = p
    pixels.cursor[0] = view.background.size
