"""Kernels of the light on a pixel: bodies in front of the background; see `kernels`."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compilation import njit

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Ints = NDArray[np.int32]

BALL, CAPSULE = 0, 1
SURE_SIGMAS = 4.0  # beyond this many sigmas from an outline its blur is less than 1e-4

# Columns of a pose. A ball: centre in metres, then camera frame -> ball frame. A capsule: (x, y, radius) of
# both ends in pixels.
CENTRE = 0
TURN = 3
SIGMA = 12  # blur of the outline in px
POSE_COLUMNS = 13

# Columns of what a body is like; SLOWER: so many looks may pass where it moves slowest.
KIND, OWNER, EVERY, SLOWER, RADIUS, ALBEDO, ALBEDO_2 = range(7)
HALF_EXTENT, TEXELS, CAP_COSINE, EXTENT_X, EXTENT_Y, SAMPLE, SIDES = range(7, 14)  # of a ball's logo
OPACITY = 14  # of a capsule: a shadow lets light through
BODY_COLUMNS = 15

LOOKS_A_PIXEL = 4  # at least, of any motion


class Bodies(NamedTuple):
    """k bodies from far to near at n times; of a body alone without the axis k."""

    pose: Floats  # (n, k, POSE_COLUMNS)
    box: Ints  # (n, k, 4) x0, y0, x1, y1 (x1, y1 not included), empty while away
    kind: Floats  # (k, BODY_COLUMNS)
    texture: Singles  # (k, m, m) textures


class Physics(NamedTuple):
    """Light and pixel."""

    tau_us: float
    dark_tau_us: float
    forget_per_us: float
    refractory_us: float
    off_after_on_us: float
    contrast_noise: float
    up: tuple[float, float, float]
    sky: float
    bounce: float
    brightness: float  # illuminance over the reference
    floor: float  # dark current as an intensity
    flicker_depth: float
    flicker_per_us: float  # angular frequency
    pause_us: float  # between two looks at pixels that work all the time, under flicker or shaking; 0 = they may rest
    focal_px: float
    width_px: int


@njit(cache=True, nogil=True)
def _texture_at(texture: Singles, body: Floats, pose: Floats, k: int, row: int, x: float, y: float, z: float) -> float:
    """Printing of body k in the direction (x, y, z) of the camera frame, bilinear."""
    bz = pose[row, k, TURN + 6] * x + pose[row, k, TURN + 7] * y + pose[row, k, TURN + 8] * z
    side = -1.0 if bz < 0.0 and body[k, SIDES] == 2.0 else 1.0  # the other side's print: half a turn about the ball's x
    bz *= side
    if bz <= body[k, CAP_COSINE]:
        return 0.0
    bx = pose[row, k, TURN] * x + pose[row, k, TURN + 1] * y + pose[row, k, TURN + 2] * z
    by = pose[row, k, TURN + 3] * x + pose[row, k, TURN + 4] * y + pose[row, k, TURN + 5] * z
    by *= side
    last = body[k, TEXELS] - 1.0
    scale = math.sqrt(2.0 / (1.0 + bz)) / body[k, HALF_EXTENT]
    u = (bx * scale + 1.0) * 0.5 * last
    w = (by * scale + 1.0) * 0.5 * last
    if not (0.0 <= u < last and 0.0 <= w < last):
        return 0.0
    i, j = int(u), int(w)
    fu, fw = u - i, w - j
    upper = texture[k, j, i] * (1.0 - fu) + texture[k, j, i + 1] * fu
    lower = texture[k, j + 1, i] * (1.0 - fu) + texture[k, j + 1, i + 1] * fu
    return float(upper * (1.0 - fw) + lower * fw)


@njit(cache=True, nogil=True)
def ball_light(
    texture: Singles, body: Floats, pose: Floats, k: int, row: int, physics: Physics, ray_x: float, ray_y: float
) -> tuple[float, float, float, float]:
    """(cover 0..1, intensity, intensity without logo, looks) of ball k seen along a ray.

    The fourth value is the number of looks until the next one that matters: neither outline nor logo comes near before,
    and shading moves by less than a pixel.
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
    lift = nx * physics.up[0] + ny * physics.up[1] + nz * physics.up[2]
    shade = (
        physics.sky * 0.5 * (1.0 + lift) + (1.0 - physics.sky) * max(lift, 0.0) + physics.bounce * 0.5 * (1.0 - lift)
    )
    plain = body[k, ALBEDO] * shade
    bx = pose[row, k, TURN] * nx + pose[row, k, TURN + 1] * ny + pose[row, k, TURN + 2] * nz
    by = pose[row, k, TURN + 3] * nx + pose[row, k, TURN + 4] * ny + pose[row, k, TURN + 5] * nz
    bz = pose[row, k, TURN + 6] * nx + pose[row, k, TURN + 7] * ny + pose[row, k, TURN + 8] * nz
    if body[k, SIDES] == 2.0:
        bz = abs(bz)
    # How far the samples around this pixel reach on the sphere: wider where it is seen at a slant.
    step = body[k, SAMPLE] / physics.focal_px
    slant = 1.5 * cz / (radius * max(-nz, 0.2))
    reach = step * slant
    pixel = slant / physics.focal_px
    gap = max(body[k, CAP_COSINE] - bz, abs(bx) - body[k, EXTENT_X], abs(by) - body[k, EXTENT_Y])
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
            dark += weight * _texture_at(texture, body, pose, k, row, mx * norm, my * norm, mz * norm)
    return cover, plain + dark * (body[k, ALBEDO_2] - body[k, ALBEDO]) * shade, plain, 1.0


@njit(cache=True, nogil=True)
def capsule_light(
    body: Floats, pose: Floats, k: int, row: int, x: float, y: float
) -> tuple[float, float, float, float]:
    """(cover, intensity, looks, looks while it moves here) of capsule k at a pixel; see `ball_light`.

    The nearer to the first end (an arm's elbow), the slower it moves.
    """
    ax, ay, ar = pose[row, k, 0], pose[row, k, 1], pose[row, k, 2]
    bx, by, br = pose[row, k, 3] - ax, pose[row, k, 4] - ay, pose[row, k, 5]
    share = ((x - ax) * bx + (y - ay) * by) / max(bx * bx + by * by, 1e-9)
    held = min(max(share, 0.0), 1.0)
    base = min(1.0 / max(held, 0.01), body[k, SLOWER])
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
    cover *= body[k, OPACITY]
    return cover, body[k, ALBEDO] + hand * (body[k, ALBEDO_2] - body[k, ALBEDO]), looks, base


@njit(cache=True, nogil=True)
def light(
    owner: NDArray[np.uint8],
    behind: float,
    box: Ints,
    kind: Floats,
    pose: Floats,
    texture: Singles,
    physics: Physics,
    row: int,
    x: int,
    y: int,
    ray_x: float,
    ray_y: float,
) -> tuple[bool, float, float, float, float]:
    """(covered, looks, looks while it moves here, intensity, intensity without logos) at a pixel before `behind`.

    Writes the nearest body into owner, its first argument.
    """
    p = y * physics.width_px + x
    intensity = plain = behind
    covered, looks, base, bodies = False, 1.0, 1.0, 0
    for k in range(kind.shape[0]):
        if x < box[row, k, 0] or y < box[row, k, 1] or x >= box[row, k, 2] or y >= box[row, k, 3]:
            continue
        if kind[k, KIND] == BALL:
            cover, body, body_plain, ahead = ball_light(texture, kind, pose, k, row, physics, ray_x, ray_y)
            pace = kind[k, SLOWER]
        else:
            cover, body, ahead, pace = capsule_light(kind, pose, k, row, float(x), float(y))
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
