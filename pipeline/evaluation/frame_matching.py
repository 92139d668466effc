"""Spin from frames, after Tebbe 2020 in outline: find the ball, take the logo off it, match its orientations.

Every frame gives the ink on the visible side of the ball. The spin is the one that turns the ink of each frame best
onto that of the following ones: neighbours suggest spins, frames farther apart choose among them and make the choice
exact.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.optimize import minimize

from ..camera import Camera
from .frame_camera import Frame

Floats = NDArray[np.float64]

CONTRAST = 0.1  # between ball and table, at least; half of what the ball's rim has
SEEN_COSINE = 0.45  # ink is read up to 63 degrees from the middle of the disc
LEAST_INK = 0.01  # share of the disc that must be dark for a frame to count
POINTS = 160  # of a frame that are matched
COARSE_RPS, COARSE_BLUR = 8.0, 0.1  # grid, 7.6 degrees a frame, and the blur (of the radius) that bridges it
MAX_RPS = 160.0  # beyond 190 rps neighbours are more than half a turn apart
BEST_STARTS, PEAK_RPS = 20, 12.0  # peaks that are climbed, and how far apart they are at least
FARTHEST, FINALISTS = 8, 8  # frames that are compared lie so far apart at most; spins compared in all of them
LEAST_MATCH = 0.35  # of the ink must find its like, or there is no answer


@dataclass(frozen=True, eq=False)
class Ink:
    """One frame's ball.

    centre_m : (3,); normals (n, 3) and ink (n,) 0..1 at points on it, camera frame
    sharp, soft : (side, side) ink by pixel, the latter blurred
    """

    t_s: float
    centre_m: Floats
    normals: Floats
    ink: Floats
    sharp: Floats
    soft: Floats
    x0_px: int
    y0_px: int


def spin_from_frames(
    seen: Sequence[Frame], camera: Camera, radius_m: float, rate_hz: float
) -> tuple[Floats | None, str]:
    """(3,) spin in rps, camera frame, or None, and what happened in words."""
    inked = _inks(seen, camera, radius_m)
    near = _pairs(inked, 1, rate_hz)
    follow = sum(min(inked[i].ink.mean(), inked[j].ink.mean()) >= LEAST_INK for i, j in near)
    if follow < 2:
        return None, f"the logo is seen in two frames in a row {follow} times only"
    level = float(np.mean([one.ink.mean() for one in inked]))
    score = _Score(inked, camera, radius_m, level)
    climbed = [_climbed(score, start, near, 3.0) for start in score.coarse(near)]
    climbed.sort(key=lambda spin: -score(spin, near))
    pairs = list(near)
    for gap in range(2, FARTHEST + 1):
        pairs += _pairs(inked, gap, rate_hz)
        if gap in (2, 4, FARTHEST):
            climbed = [_climbed(score, spin, pairs, 1.0 / gap) for spin in climbed[:FINALISTS]]
    found = max(climbed, key=lambda spin: score(spin, pairs))
    match = score(found, near)
    if match < LEAST_MATCH:
        return None, f"the logo's orientations match to {match:.2f} only"
    return found, "ok"


def _pairs(inked: Sequence[Ink], gap: int, rate_hz: float) -> list[tuple[int, int]]:
    """Pairs of frames so many frame times apart."""
    number = [round(one.t_s * rate_hz) for one in inked]
    place = {n: i for i, n in enumerate(number)}
    return [(i, place[n + gap]) for i, n in enumerate(number) if n + gap in place]


def _climbed(score: _Score, start: Floats, pairs: list[tuple[int, int]], step_rps: float) -> Floats:
    """The best spin near a start (Nelder-Mead)."""
    corners = np.vstack([start, start + step_rps * np.eye(3)])
    options = {"initial_simplex": corners, "xatol": 0.01, "fatol": 1e-5, "maxiter": 80}
    best: Floats = minimize(lambda spin: -score(spin, pairs), start, method="Nelder-Mead", options=options).x
    return best


class _Score:
    """How well a spin turns ink onto ink: 1 = all of it, about 0 for a wrong spin."""

    def __init__(self, inked: Sequence[Ink], camera: Camera, radius_m: float, level: float) -> None:
        self.level, self.radius_m = level, radius_m
        self.view = (camera.focal_px, camera.principal_x_px, camera.principal_y_px)
        self.time_s = np.array([one.t_s for one in inked])
        self.centre = np.array([one.centre_m for one in inked])
        self.corner = np.array([[one.x0_px, one.y0_px] for one in inked], np.float64)
        side = max(one.sharp.shape[0] for one in inked)
        self.sharp, self.soft = (np.full((len(inked), side, side), np.nan) for _ in range(2))
        self.normals, self.ink = np.empty((len(inked), POINTS, 3)), np.empty((len(inked), POINTS))
        for k, one in enumerate(inked):
            own = one.sharp.shape[0]
            self.sharp[k, :own, :own], self.soft[k, :own, :own] = one.sharp, one.soft
            rows = np.linspace(0, len(one.ink) - 1, POINTS).round().astype(np.intp)
            self.normals[k], self.ink[k] = one.normals[rows], one.ink[rows]

    def __call__(self, spin_rps: Floats, pairs: list[tuple[int, int]], soft: bool = False) -> float:
        """The score over these pairs of frames."""
        image = self.soft if soft else self.sharp
        return float(
            _match(
                np.asarray(spin_rps, np.float64),
                np.array(pairs, np.int64),
                self.time_s,
                self.centre,
                self.corner,
                self.normals,
                self.ink,
                image,
                self.view,
                self.radius_m,
                self.level,
            )
        )

    def coarse(self, pairs: list[tuple[int, int]]) -> list[Floats]:
        """The highest peaks on a grid over all that is possible."""
        axis = np.arange(-MAX_RPS, MAX_RPS + 1, COARSE_RPS)
        grid = np.stack(np.meshgrid(axis, axis, axis), axis=-1).reshape(-1, 3)
        grid = grid[np.linalg.norm(grid, axis=1) <= MAX_RPS]
        values = np.array([self(spin, pairs, soft=True) for spin in grid])
        best: list[Floats] = []
        for spin in grid[np.argsort(-values)]:
            if all(np.linalg.norm(spin - other) > PEAK_RPS for other in best):
                best.append(spin)
            if len(best) == BEST_STARTS:
                break
        return best


@njit(cache=True, nogil=True)
def _match(
    spin_rps: Floats,
    pairs: NDArray[np.int64],
    time_s: Floats,
    centre: Floats,
    corner: Floats,
    normals: Floats,
    ink: Floats,
    image: Floats,
    view: tuple[float, float, float],
    radius_m: float,
    level: float,
) -> float:
    """Covariance of ink and turned ink over all pairs' points that stay in sight, over the ink's own variance."""
    focal_px, principal_x, principal_y = view
    size = math.sqrt(spin_rps[0] ** 2 + spin_rps[1] ** 2 + spin_rps[2] ** 2)
    ax, ay, az = 1.0, 0.0, 0.0
    if size > 0.0:
        ax, ay, az = spin_rps[0] / size, spin_rps[1] / size, spin_rps[2] / size
    together, alone = 0.0, 0.0
    for k in range(pairs.shape[0]):
        i, j = pairs[k, 0], pairs[k, 1]
        angle = 2.0 * math.pi * size * (time_s[j] - time_s[i])
        cosine, sine = math.cos(angle), math.sin(angle)
        cx, cy, cz = centre[j, 0], centre[j, 1], centre[j, 2]
        away = math.sqrt(cx * cx + cy * cy + cz * cz)
        for p in range(normals.shape[1]):
            x, y, z = normals[i, p, 0], normals[i, p, 1], normals[i, p, 2]
            own = ink[i, p] - level
            alone += own * own
            dot = (ax * x + ay * y + az * z) * (1.0 - cosine)
            nx = x * cosine + (ay * z - az * y) * sine + ax * dot
            ny = y * cosine + (az * x - ax * z) * sine + ay * dot
            nz = z * cosine + (ax * y - ay * x) * sine + az * dot
            if -(nx * cx + ny * cy + nz * cz) < SEEN_COSINE * away:
                continue
            depth = cz + radius_m * nz
            u = (cx + radius_m * nx) / depth * focal_px + principal_x - corner[j, 0]
            w = (cy + radius_m * ny) / depth * focal_px + principal_y - corner[j, 1]
            column, row = int(u), int(w)
            if u < 0.0 or w < 0.0 or column + 1 >= image.shape[2] or row + 1 >= image.shape[1]:
                continue
            fu, fw = u - column, w - row
            there = (1.0 - fw) * ((1.0 - fu) * image[j, row, column] + fu * image[j, row, column + 1])
            there += fw * ((1.0 - fu) * image[j, row + 1, column] + fu * image[j, row + 1, column + 1])
            if there == there:  # not beyond the disc
                together += own * (there - level)
    return together / alone if alone > 0.0 else 0.0


def _inks(seen: Sequence[Frame], camera: Camera, radius_m: float) -> list[Ink]:
    """The ink in every frame; places and sizes of the ball are smoothed over the flight."""
    circles = [(frame, circle) for frame in seen if (circle := _circle(frame)) is not None]
    if len(circles) < 3:
        return []
    time = np.array([frame.t_s for frame, _ in circles])
    x, y, radius = np.array([circle for _, circle in circles]).T
    x, y = (np.polynomial.Polynomial.fit(time, place, 2)(time) for place in (x, y))
    radius = np.polynomial.Polynomial.fit(time, radius, 1)(time)
    centres = camera.ball_centre_m(x, y, radius, radius_m)
    return [_ink_of(frame, centre, camera, radius_m) for (frame, _), centre in zip(circles, centres, strict=True)]


def _circle(frame: Frame) -> tuple[float, float, float] | None:
    """(x, y, radius) in px of the ball, from what differs from the background; None when nothing does.

    Motion draws the disc out to a stadium: its middle is the centre, its width twice the radius.
    """
    finer = 4
    change = np.abs(frame.image - frame.background).astype(np.float32)
    large = cv2.resize(change, None, fx=finer, fy=finer, interpolation=cv2.INTER_LINEAR)
    outlines, _ = cv2.findContours((large > CONTRAST).astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    if not outlines:
        return None
    hull = cv2.convexHull(max(outlines, key=cv2.contourArea))
    if len(hull) < 5:
        return None
    moments = cv2.moments(hull)
    (_, sides, _) = cv2.minAreaRect(hull)
    x, y = ((moments[m] / moments["m00"] + 0.5) / finer - 0.5 for m in ("m10", "m01"))
    return frame.x0_px + x, frame.y0_px + y, (min(sides) + 1) / 2 / finer


def _ink_of(frame: Frame, centre_m: Floats, camera: Camera, radius_m: float) -> Ink:
    """The ink of one frame: how much darker the ball is than its shading, which a smooth fit gives."""
    side = frame.image.shape[0]
    column, row = np.meshgrid(np.arange(side) + frame.x0_px, np.arange(side) + frame.y0_px)
    rays = camera.rays(column.ravel(), row.ravel())
    along, length2 = rays @ centre_m, np.sum(rays**2, axis=1)
    inside = along**2 - length2 * (centre_m @ centre_m - radius_m**2)
    normals = ((along - np.sqrt(np.maximum(inside, 0.0))) / length2)[:, None] * rays - centre_m
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    cosine = -(normals @ centre_m) / np.linalg.norm(centre_m)
    on_ball = (inside > 0) & (cosine > SEEN_COSINE - 0.05)
    light = frame.image.ravel()
    shading = np.column_stack([np.ones(light.size), normals])
    bright = on_ball.copy()
    plain = light
    for _ in range(4):  # what is darker than the shading is ink and leaves the fit
        weights, *_ = np.linalg.lstsq(shading[bright], light[bright], rcond=None)
        plain = np.maximum(shading @ weights, 0.05)
        bright = on_ball & (light > 0.9 * plain)
        if bright.sum() < 10:
            bright = on_ball
    ink = np.clip(1 - light / plain, 0.0, 1.0)
    ink[~on_ball] = np.nan
    sharp = ink.reshape(side, side)
    sigma = COARSE_BLUR * radius_m * camera.focal_px / centre_m[2]
    mask = on_ball.reshape(side, side).astype(np.float64)
    spread = cv2.GaussianBlur(np.where(mask > 0, sharp, 0.0), (0, 0), sigma)
    soft = np.where(mask > 0, spread / np.maximum(cv2.GaussianBlur(mask, (0, 0), sigma), 1e-6), np.nan)
    rows = np.flatnonzero(on_ball & (cosine > SEEN_COSINE))
    return Ink(frame.t_s, centre_m, normals[rows], ink[rows], sharp, soft, frame.x0_px, frame.y0_px)
