"""The inner loops: light on the pixels around moving bodies, and what the pixels make of it.

`run` is the only entry. Pixels are flat indices row * width + column; times are microseconds as float64. The tables
are plain arrays whose columns are named below: a pixel's whole state lies in one or two cache lines.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Bytes = NDArray[np.uint8]
Ints = NDArray[np.int32]

BALL, ARM = 0, 1
SURE_SIGMAS = 4.0  # beyond this many sigmas from an outline its blur is less than 1e-4
NEW, LISTED, RESTING = 0, 1, 2  # a pixel's role; the list holds the pixels at work

# Columns of a pixel's state. "Plain" is the same signal had the balls no logo.
LIGHT, PLAIN = 0, 1  # log intensity at TIME
SIGNAL, SIGNAL_PLAIN = 2, 3  # after the low-pass
REFERENCE, REFERENCE_PLAIN = 4, 5  # signal at the end of the last dead time
TIME = 6
FREE = 7  # end of the running dead time, infinite when none runs
OFF_FROM = 8  # no OFF event before
UP, DOWN = 9, 10  # thresholds until the next event, noise included
STATE_COLUMNS = 11

# Columns of a pose. A ball: centre in metres, then camera frame -> ball frame. An arm: (x, y, radius) of elbow and of
# hand in pixels.
CENTRE = 0
TURN = 3
SIGMA = 12  # blur of the outline in px
POSE_COLUMNS = 13

# Columns of what a body is like.
KIND, OWNER, EVERY, SLOWER, RADIUS, ALBEDO, ALBEDO_2, HALF_EXTENT, TEXELS, CAP_COSINE, INK_X, INK_Y, SAMPLE = range(13)
BODY_COLUMNS = 13  # SLOWER: so many looks pass while a ball's outline moves as far as its surface in one

LOOKS_A_PIXEL = 4  # at least, of any motion


class Pixels(NamedTuple):
    """What `run` writes: the state of every pixel, the list of those at work, the events."""

    state: Floats  # (n, STATE_COLUMNS)
    role: Bytes  # (n,)
    owner: Bytes  # (n,) body that changed the light last
    looked: Ints  # (n,) row of the last look
    rest: Ints  # (n,) the body below needs no look up to and including this row
    rest_body: Bytes  # (n,)
    listing: Ints  # (n,) the pixels at work, in front
    cursor: NDArray[np.int64]  # [pixels at work, events written, normals used]
    event_us: Floats
    event_word: NDArray[np.int64]  # pixel << 16 | owner << 8 | logo << 1 | on


class View(NamedTuple):
    """The camera and what stands still, each (n,)."""

    ray_x: Floats  # rays through the pixels, z = 1
    ray_y: Floats
    background: Floats  # intensity
    threshold_on: Singles
    threshold_off: Singles
    normals: Floats  # standard normals, a power of two of them, used round and round


class Bodies(NamedTuple):
    """k bodies from far to near at n times."""

    pose: Floats  # (n, k, POSE_COLUMNS)
    box: Ints  # (n, k, 4) x0, y0, x1, y1 (x1, y1 not included), empty while away
    kind: Floats  # (k, BODY_COLUMNS)
    ink: Singles  # (k, m, m) textures


class Physics(NamedTuple):
    """Light and pixel."""

    tau_us: float
    dark_tau_us: float
    forget_per_us: float
    refractory_us: float
    off_after_on_us: float
    contrast_noise: float
    up_x: float
    up_y: float
    up_z: float
    sky: float
    bounce: float
    brightness: float  # illuminance over the reference
    floor: float  # dark current as an intensity
    flicker_depth: float
    flicker_per_us: float  # angular frequency
    focal_px: float
    width_px: int


@njit(cache=True, nogil=True)
def _ink_at(ink, body, pose, k, row, x, y, z):
    """Ink of body k in the direction (x, y, z) of the camera frame, bilinear."""
    bz = pose[row, k, TURN + 6] * x + pose[row, k, TURN + 7] * y + pose[row, k, TURN + 8] * z
    if bz <= body[k, CAP_COSINE]:
        return 0.0
    bx = pose[row, k, TURN] * x + pose[row, k, TURN + 1] * y + pose[row, k, TURN + 2] * z
    by = pose[row, k, TURN + 3] * x + pose[row, k, TURN + 4] * y + pose[row, k, TURN + 5] * z
    last = body[k, TEXELS] - 1.0
    scale = math.sqrt(2.0 / (1.0 + bz)) / body[k, HALF_EXTENT]
    u = (bx * scale + 1.0) * 0.5 * last
    w = (by * scale + 1.0) * 0.5 * last
    if not (0.0 <= u < last and 0.0 <= w < last):
        return 0.0
    i, j = int(u), int(w)
    fu, fw = u - i, w - j
    return (ink[k, j, i] * (1.0 - fu) + ink[k, j, i + 1] * fu) * (1.0 - fw) + (
        ink[k, j + 1, i] * (1.0 - fu) + ink[k, j + 1, i + 1] * fu
    ) * fw


@njit(cache=True, nogil=True)
def _ball_light(ink, body, pose, k, row, physics, ray_x, ray_y):
    """(cover 0..1, intensity, intensity without logo, looks) of ball k seen along a ray.

    looks : the next look that matters is so many ahead, for neither outline nor logo comes near before, and shading
        moves by less than a pixel
    """
    cx, cy, cz = pose[row, k, CENTRE], pose[row, k, CENTRE + 1], pose[row, k, CENTRE + 2]
    radius = body[k, RADIUS]
    spare = cx * cx + cy * cy + cz * cz - radius * radius
    along = ray_x * cx + ray_y * cy + cz
    length2 = ray_x * ray_x + ray_y * ray_y + 1.0
    inside = along * along - length2 * spare  # > 0 on the disc
    slope_x, slope_y = 2.0 * (along * cx - ray_x * spare), 2.0 * (along * cy - ray_y * spare)
    slope2 = (slope_x * slope_x + slope_y * slope_y) / (physics.focal_px * physics.focal_px)
    sigma = pose[row, k, SIGMA]
    cover = 1.0
    if inside * inside < SURE_SIGMAS * SURE_SIGMAS * sigma * sigma * slope2:
        cover = 0.5 * math.erfc(-inside / (math.sqrt(slope2) * sigma * 1.4142135623730951))
    elif inside < 0.0:
        away = -inside / math.sqrt(slope2) - SURE_SIGMAS * sigma
        return 0.0, 0.0, 0.0, 1.0 + away * LOOKS_A_PIXEL * body[k, SLOWER]
    # The surface point; beyond the outline the nearest point of the limb stands in.
    far = (along - math.sqrt(max(inside, 0.0))) / length2
    nx, ny, nz = far * ray_x - cx, far * ray_y - cy, far - cz
    norm = 1.0 / math.sqrt(nx * nx + ny * ny + nz * nz)
    nx, ny, nz = nx * norm, ny * norm, nz * norm
    lift = nx * physics.up_x + ny * physics.up_y + nz * physics.up_z
    shade = (
        physics.sky * 0.5 * (1.0 + lift)
        + (1.0 - physics.sky) * max(lift, 0.0)
        + physics.bounce * 0.5 * (1.0 - lift)
    )
    plain = body[k, ALBEDO] * shade
    bx = pose[row, k, TURN] * nx + pose[row, k, TURN + 1] * ny + pose[row, k, TURN + 2] * nz
    by = pose[row, k, TURN + 3] * nx + pose[row, k, TURN + 4] * ny + pose[row, k, TURN + 5] * nz
    bz = pose[row, k, TURN + 6] * nx + pose[row, k, TURN + 7] * ny + pose[row, k, TURN + 8] * nz
    # How far the samples around this pixel reach on the sphere: wider where it is seen at a slant.
    step = body[k, SAMPLE] / physics.focal_px
    slant = 1.5 * cz / (radius * max(-nz, 0.2))
    reach = step * slant
    pixel = slant / physics.focal_px
    gap = max(body[k, CAP_COSINE] - bz, abs(bx) - body[k, INK_X], abs(by) - body[k, INK_Y])
    if gap >= reach:
        looks = body[k, SLOWER]
        deep = SURE_SIGMAS * sigma + 1.0
        if inside > 0.0 and inside * inside > deep * deep * slope2:
            looks *= LOOKS_A_PIXEL
        return cover, plain, plain, min(looks, 1.0 + (gap - reach) / pixel * LOOKS_A_PIXEL)
    # Gauss-Hermite, three points an axis: the blur left over from the texture's own.
    dark = 0.0
    for i in range(-1, 2):
        weight_x = 0.6666666666666666 if i == 0 else 0.16666666666666666
        x = ray_x + i * step
        for j in range(-1, 2):
            weight = weight_x * (0.6666666666666666 if j == 0 else 0.16666666666666666)
            y = ray_y + j * step
            s = x * cx + y * cy + cz
            d2 = x * x + y * y + 1.0
            far = (s - math.sqrt(max(s * s - d2 * spare, 0.0))) / d2
            mx, my, mz = far * x - cx, far * y - cy, far - cz
            norm = 1.0 / math.sqrt(mx * mx + my * my + mz * mz)
            dark += weight * _ink_at(ink, body, pose, k, row, mx * norm, my * norm, mz * norm)
    return cover, plain + dark * (body[k, ALBEDO_2] - body[k, ALBEDO]) * shade, plain, 1.0


@njit(cache=True, nogil=True)
def _arm_light(body, pose, k, row, x, y):
    """(cover, intensity, looks, looks while it moves here) of arm k at a pixel; see `_ball_light`.

    The nearer to the elbow, the slower the arm moves.
    """
    ax, ay, ar = pose[row, k, 0], pose[row, k, 1], pose[row, k, 2]
    bx, by, br = pose[row, k, 3] - ax, pose[row, k, 4] - ay, pose[row, k, 5]
    share = ((x - ax) * bx + (y - ay) * by) / max(bx * bx + by * by, 1e-9)
    held = min(max(share, 0.0), 1.0)
    base = 1.0 / min(max(held, 0.1), 1.0)
    distance = ar + held * (br - ar) - math.hypot(x - ax - held * bx, y - ay - held * by)
    sigma = pose[row, k, SIGMA]
    if distance <= -SURE_SIGMAS * sigma:
        return 0.0, 0.0, base + (-distance - SURE_SIGMAS * sigma) * LOOKS_A_PIXEL, base
    cover = 1.0
    if distance < SURE_SIGMAS * sigma:
        cover = 0.5 * math.erfc(-distance / (sigma * 1.4142135623730951))
    # The sleeve ends at three quarters of the way to the hand.
    beyond = (share - 0.75) * math.sqrt(bx * bx + by * by)
    hand = 0.5 * math.erfc(-min(max(beyond / sigma, -5.0), 5.0) / 1.4142135623730951)
    spare = min(distance, abs(beyond)) - SURE_SIGMAS * sigma
    looks = base + max(spare, 0.0) * LOOKS_A_PIXEL
    return cover, body[k, ALBEDO] + hand * (body[k, ALBEDO_2] - body[k, ALBEDO]), looks, base


@njit(cache=True, nogil=True)
def _advance(state, events, sensor, physics, p, owner, intensity, plain_intensity, now_us):
    """Take pixel p to now_us, its light running straight to the new value, and write its events into `events`."""
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
def _draw_thresholds(state, cursor, sensor, physics, p, intensity):
    """Noise on pixel p's thresholds until its next event; never below a quarter of the nominal."""
    threshold_on, threshold_off, normals = sensor
    used = cursor[2]
    cursor[2] = used + 1
    noise = physics.contrast_noise / math.sqrt(intensity) * normals[used & (normals.size - 1)]
    state[p, UP] = max(threshold_on[p] + noise, 0.25 * threshold_on[p])
    state[p, DOWN] = max(threshold_off[p] + noise, 0.25 * threshold_off[p])


@njit(cache=True, nogil=True)
def _begin(state, role, listing, cursor, sensor, physics, p, intensity, plain_intensity, now_us):
    """Put pixel p on the list, at rest at now_us under this light."""
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
    if role[p] != LISTED:
        role[p] = LISTED
        listing[cursor[0]] = p
        cursor[0] += 1


@njit(cache=True, nogil=True)
def _light(owner, background, box, kind, pose, ink, physics, row, x, y, ray_x, ray_y):
    """(covered, looks, looks while it moves here, intensity, intensity without logos) at a pixel.

    Writes the nearest body into owner.
    """
    p = y * physics.width_px + x
    intensity = background[p]
    plain = intensity
    covered, looks, base, bodies = False, 1.0, 1.0, 0
    for k in range(kind.shape[0]):
        if x < box[row, k, 0] or y < box[row, k, 1] or x >= box[row, k, 2] or y >= box[row, k, 3]:
            continue
        if kind[k, KIND] == BALL:
            cover, body, body_plain, ahead = _ball_light(ink, kind, pose, k, row, physics, ray_x, ray_y)
            pace = kind[k, SLOWER]
        else:
            cover, body, ahead, pace = _arm_light(kind, pose, k, row, float(x), float(y))
            body_plain = body
        bodies += 1
        looks, base = (ahead, pace) if bodies == 1 else (1.0, 1.0)
        if cover > 0.0:
            covered = True
            intensity += cover * (body - intensity)
            plain += cover * (body_plain - plain)
            if cover > 0.02:
                owner[p] = int(kind[k, OWNER])
    return covered, looks, base, intensity, plain


@njit(cache=True, nogil=True)
def _look(pixels, view, bodies, physics, row, k, since_us, now_us, gain, fresh):
    """Go over the pixels in the box of body k."""
    box, kind, pose, ink = bodies.box, bodies.kind, bodies.pose, bodies.ink
    state, role, owner, listing, cursor = pixels.state, pixels.role, pixels.owner, pixels.listing, pixels.cursor
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
            covered, looks, base, intensity, plain = _light(
                owner, background, box, kind, pose, ink, physics, row, x, y, ray_x[p], ray_y[p]
            )
            looked[p] = row
            listed = role[p] == LISTED
            if covered or listed:
                intensity = intensity * gain + floor
                plain = plain * gain + floor
                if fresh:
                    _begin(state, role, listing, cursor, sensor, physics, p, intensity, plain, now_us)
                    continue
                if not listed:
                    before = background[p] * gain + floor
                    _begin(state, role, listing, cursor, sensor, physics, p, before, before, since_us)
                _advance(state, events, sensor, physics, p, owner[p], intensity, plain, now_us)
                if looks > base and not _settled(state, p):  # its events want their times right
                    looks = base
            if steady and looks >= 2.0:
                resting[p] = row + every * (int(looks) - 1)
                rest_body[p] = k


@njit(cache=True, nogil=True)
def _settled(state, p):
    """Whether pixel p, its light at rest, will write no further event."""
    if state[p, FREE] != math.inf:
        return False
    return -state[p, DOWN] < state[p, LIGHT] - state[p, REFERENCE] < state[p, UP]


@njit(cache=True, nogil=True)
def _tails(pixels, view, bodies, physics, row, now_us, gain):
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
        intensity = background[p] * gain + physics.floor
        _advance(state, events, sensor, physics, p, owner[p], intensity, intensity, now_us)
        if physics.flicker_depth == 0.0 and _settled(state, p):
            state[p, SIGNAL], state[p, SIGNAL_PLAIN] = state[p, LIGHT], state[p, PLAIN]
            role[p] = RESTING
            i -= 1
            cursor[0] -= 1
            listing[i] = listing[cursor[0]]


@njit(cache=True, nogil=True)
def run(pixels, view, bodies, physics, time_us, first, fresh):
    """Simulate the rows from `first` of time_us on, writing into `pixels`; return the next row.

    Returns early when the event buffers are more than half full: empty them (cursor[1] = 0) and call again. With
    `fresh` the row `first` only sets the pixels to what stands there at that time, without events.
    """
    row = first
    while row < time_us.size and 2 * pixels.cursor[1] <= pixels.event_us.size:
        now_us = time_us[row]
        gain = physics.brightness * (1.0 + physics.flicker_depth * math.sin(physics.flicker_per_us * now_us))
        start = fresh and row == first
        for k in range(bodies.kind.shape[0]):
            every = int(bodies.kind[k, EVERY])
            if start or row % every == 0:
                _look(pixels, view, bodies, physics, row, k, time_us[max(row - every, 0)], now_us, gain, start)
        _tails(pixels, view, bodies, physics, row, now_us, gain)
        row += 1
    return row


@njit(cache=True, nogil=True)
def begin_all(pixels, view, physics):
    """Put every pixel of `pixels` to work on its background at time 0."""
    for p in range(view.background.size):
        intensity = view.background[p] * physics.brightness + physics.floor
        _begin(
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
