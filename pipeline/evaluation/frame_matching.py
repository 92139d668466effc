"""Spin from frames, after Tebbe 2020 in outline: take the logo off the ball, match its orientation, regress the spin.

Every frame gives the albedo of the ball's visible side, and so, with the known logo, the ball's orientation. Two frames
that follow each other suggest a spin; the one that explains the albedo in all frames best is the answer.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from ..camera import Camera
from ..compilation import njit
from ..kernels.rotation import axis_and_length, rotations
from ..simulator.logos import Logo, Texture, texture
from .frame_albedo import SurfaceAlbedo, surface_albedos
from .frame_camera import Frame

Floats = NDArray[np.float64]
Printing = tuple[NDArray[np.float32], float, float]  # texture, its half extent, cosine of its cap

LEAST_DARK = 0.01  # share of the disc that must be dark for a frame to give an orientation
POINTS = 300  # of a frame that are matched
BLUR_MM = 1.2  # of the logo: that of a sharp lens and pixels of 1 mm, and of some motion
GRID_DEG = 7.0  # of orientations; a letter's stroke is 4 degrees wide, the blur bridges the rest
ORIENTATIONS, APART_DEG = 3, 30.0  # kept of a frame, so far from each other at least
MAX_RPS = 160.0  # beyond 190 rps neighbours are more than half a turn apart
STARTS = 6  # spins that are followed up
WINDOWS = (2, 4, 8, 16, 32, 10_000)  # frames to both sides that a spin must explain, step by step
LEAST_MATCH = 0.4  # correlation of darkening seen and darkening expected, or there is no answer


def spin_from_frames(
    seen: Sequence[Frame], camera: Camera, radius_m: float, rate_hz: float, logo: Logo
) -> tuple[Floats | None, str]:
    """(3,) spin in rps, camera frame, or None, and what happened in words."""
    surfaces = surface_albedos(seen, camera, radius_m)
    dark = [k for k, one in enumerate(surfaces) if one.darkening.mean() >= LEAST_DARK]
    if len(dark) < 2:
        return None, f"the logo is seen in {len(dark)} frames"
    flight = _Flight(surfaces, texture(logo, BLUR_MM))
    starts = _starts(flight, dark, rate_hz)
    if not starts:
        return None, "the logo is not seen in two frames that follow each other"
    best, spin = max((flight.followed(*start) for start in starts), key=lambda found: found[0])
    if best < LEAST_MATCH:
        return None, f"the frames match the logo to {best:.2f} only"
    return spin, "ok"


def _starts(flight: _Flight, dark: Sequence[int], rate_hz: float) -> list[tuple[int, Floats, Floats]]:
    """(frame, camera -> ball at it, spin in rps): what pairs of frames suggest, the best first."""
    grid = _grid()
    poses = {k: flight.orientations(k, grid) for k in dark}
    found: list[tuple[float, int, Floats, Floats]] = []
    for i, j in itertools.combinations(dark, 2):
        step_s = flight.time_s[j] - flight.time_s[i]
        if step_s * rate_hz < 2.5:
            for one, other in itertools.product(poses[i], poses[j]):
                vector = _rotation_vector(other.T @ one)
                size = float(np.linalg.norm(vector))
                for turned in (vector, vector * (1 - 2 * math.pi / size)) if size > 0 else (vector,):
                    spin = turned / (2 * math.pi * step_s)
                    if np.linalg.norm(spin) <= MAX_RPS:
                        found.append((flight.match(i, one, spin, WINDOWS[0]), i, one, spin))
    found.sort(key=lambda start: -start[0])
    return [start[1:] for start in found[:STARTS]]


class _Flight:
    """The darkening of all frames, and how well a spin explains it."""

    def __init__(self, surfaces: Sequence[SurfaceAlbedo], printed: Texture) -> None:
        self.time_s = np.array([one.t_s for one in surfaces])
        self.normals, self.darkening = np.empty((len(surfaces), POINTS, 3)), np.empty((len(surfaces), POINTS))
        for k, one in enumerate(surfaces):
            rows = np.linspace(0, len(one.darkening) - 1, POINTS).round().astype(np.intp)
            self.normals[k], self.darkening[k] = one.normals[rows], one.darkening[rows]
        self.logo = (printed.values, printed.half_extent, math.cos(printed.cap_rad))

    def orientations(self, frame: int, grid: Floats) -> list[Floats]:
        """The (3, 3) rotations camera -> ball that explain one frame's darkening best."""
        values = np.empty(len(grid))
        some = slice(None, None, 3)  # enough to choose from a grid
        _match_orientations(values, grid, self.normals[frame, some], self.darkening[frame, some], self.logo)
        chosen: list[Floats] = []
        for turn in grid[np.argsort(-values)[:500]]:
            near = math.cos(math.radians(APART_DEG)) * 2 + 1  # trace of the rotation between two
            if all(np.trace(turn @ other.T) < near for other in chosen):
                chosen.append(turn)
            if len(chosen) == ORIENTATIONS:
                break
        return chosen

    def match(self, frame: int, turn: Floats, spin_rps: Floats, window: int) -> float:
        """Correlation of the darkening seen and expected in the frames around one, where the ball stands at `turn`."""
        near = slice(max(frame - window, 0), frame + window + 1)
        since_s = self.time_s[near] - self.time_s[frame]
        return float(_match_spin(turn, spin_rps, since_s, self.normals[near], self.darkening[near], self.logo))

    def followed(self, frame: int, turn: Floats, spin_rps: Floats) -> tuple[float, Floats]:
        """(correlation over all frames, spin) reached from a start, over more and more frames."""
        state = np.concatenate([spin_rps, np.zeros(3)])
        for window in WINDOWS:

            def missed(state: Floats, window: int = window) -> float:
                return -self.match(frame, turn @ rotations(state[3:])[0], state[:3], window)

            steps = np.diag([4.0 / window] * 3 + [0.05] * 3)  # rps and radians, for what frames so far apart tell
            simplex = np.vstack([state, state + steps])
            options = {"initial_simplex": simplex, "xatol": 1e-3, "fatol": 1e-4, "maxiter": 150}
            state = minimize(missed, state, method="Nelder-Mead", options=options).x
        return -missed(state), state[:3]


def _grid() -> Floats:
    """(n, 3, 3) rotations camera -> ball on a grid, the logo's middle at most 100 degrees from the view."""
    step = math.radians(GRID_DEG)
    turns: list[Floats] = []
    for polar in np.arange(step / 2, math.radians(100), step):
        count = max(1, round(2 * math.pi * math.sin(polar) / step))
        for azimuth in 2 * math.pi * np.arange(count) / count:
            x, y = math.sin(polar) * math.cos(azimuth), math.sin(polar) * math.sin(azimuth)
            middle = np.array([x, y, -math.cos(polar)])
            side = np.cross(middle, [0.0, 0.0, 1.0])
            side /= np.linalg.norm(side)
            for in_plane in np.arange(0, 2 * math.pi, step):
                along = math.cos(in_plane) * side + math.sin(in_plane) * np.cross(middle, side)
                turns.append(np.stack([along, np.cross(middle, along), middle]))
    return np.array(turns)


def _rotation_vector(turn: Floats) -> Floats:
    """(3,) axis times angle (0 to pi) of a rotation matrix."""
    angle = math.acos(min(max((float(np.trace(turn)) - 1) / 2, -1.0), 1.0))
    odd = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    length = float(np.linalg.norm(odd))
    if length < 1e-9:  # no turn, or half a turn about an axis that the even part gives
        axis = np.linalg.eigh(turn + turn.T)[1][:, -1]
        return np.zeros(3) if angle < 1.0 else np.asarray(axis * angle)
    return np.asarray(odd / length * angle)


@njit(cache=True, nogil=True)
def _expected(turn: Floats, x: float, y: float, z: float, logo: Printing) -> float:
    """The logo's darkening where the surface has this normal in the camera frame."""
    printed, half_extent, cap_cosine = logo
    bz = turn[2, 0] * x + turn[2, 1] * y + turn[2, 2] * z
    if bz <= cap_cosine:
        return 0.0
    scale = math.sqrt(2.0 / (1.0 + bz)) / half_extent
    last = printed.shape[0] - 1
    u = ((turn[0, 0] * x + turn[0, 1] * y + turn[0, 2] * z) * scale + 1.0) * 0.5 * last
    w = ((turn[1, 0] * x + turn[1, 1] * y + turn[1, 2] * z) * scale + 1.0) * 0.5 * last
    if not (0.0 <= u <= last and 0.0 <= w <= last):
        return 0.0
    return float(printed[int(w + 0.5), int(u + 0.5)])


@njit(cache=True, nogil=True)
def _correlation(sums: Floats) -> float:
    """Of sums over n, a, b, a a, b b, a b."""
    n, a, b, aa, bb, ab = sums
    spread = (aa - a * a / n) * (bb - b * b / n)
    return (ab - a * b / n) / math.sqrt(spread) if spread > 1e-12 else 0.0


@njit(cache=True, nogil=True)
def _add(sums: Floats, turn: Floats, normals: Floats, darkening: Floats, logo: Printing) -> None:
    """Add one frame's points to `sums`, the ball standing at `turn`."""
    for p in range(darkening.size):
        a = darkening[p]
        b = _expected(turn, normals[p, 0], normals[p, 1], normals[p, 2], logo)
        sums[0] += 1.0
        sums[1] += a
        sums[2] += b
        sums[3] += a * a
        sums[4] += b * b
        sums[5] += a * b


@njit(cache=True, nogil=True)
def _match_orientations(values: Floats, turns: Floats, normals: Floats, darkening: Floats, logo: Printing) -> None:
    """Write into values the correlation of one frame's darkening with the logo at each of the turns."""
    for k in range(turns.shape[0]):
        sums = np.zeros(6)
        _add(sums, turns[k], normals, darkening, logo)
        values[k] = _correlation(sums)


@njit(cache=True, nogil=True)
def _match_spin(
    turn: Floats, spin_rps: Floats, since_s: Floats, normals: Floats, darkening: Floats, logo: Printing
) -> float:
    """Correlation over frames of a ball that stands at `turn` (camera -> ball) at time 0 and spins."""
    x, y, z, size = axis_and_length(spin_rps)
    sums, back = np.zeros(6), np.empty((3, 3))
    for k in range(since_s.size):
        # Camera frame now -> camera frame at time 0: turned back.
        angle = -2.0 * math.pi * size * since_s[k]
        c, s = math.cos(angle), math.sin(angle)
        v = 1.0 - c
        back[0, 0], back[0, 1], back[0, 2] = c + x * x * v, x * y * v - z * s, x * z * v + y * s
        back[1, 0], back[1, 1], back[1, 2] = y * x * v + z * s, c + y * y * v, y * z * v - x * s
        back[2, 0], back[2, 1], back[2, 2] = z * x * v - y * s, z * y * v + x * s, c + z * z * v
        _add(sums, turn @ back, normals[k], darkening[k], logo)
    return _correlation(sums)
