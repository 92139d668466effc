"""Contrast maximisation on the sphere (s-CMax), offline and online.

The events' points on the ball are turned back by a spin to one time; the spin at which the image of them has the
largest variance is the answer. Offline the whole range of spins is searched on all events of the shot, online the
neighbourhood of the last answer on the latest events.

What deviates from the publication, which has three zoomed views of the ball and a graphics processor:

- One view without zoom, of a ball some 33 px wide whose circle is the tracker's.
- Points on the ball come from the exact intersection of the camera's ray, since the camera is not kept on the ball.
- Points that have turned to the far side have an image of their own, so that none is lost.
- The first guess of the online method comes from a search of its first window; there it is a network's.
- No uncertainty is stated; there it is the network's.

References
----------
Event-based Gaze Control System for Accurate Real-time Spin Estimation in Professional Ball Games, arXiv 2606.26780.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ...kernels.orthographic_contrast import orthographic_variances
from ...kernels.rotation import orthonormal_axes
from ...results import Packet, SpinEstimate
from ...stages.logo import LogoResult
from ..parameters import SpinParameters
from .rival import rival

Floats = NDArray[np.float64]

TAU = 2 * math.pi

FEWEST_EVENTS = 30  # OFF events, as many as the other methods ask of a visible logo
# Thinned to so many: the image's variance is that of many events a cell long before.
SEARCHED_EVENTS, REFINED_EVENTS = 300, 1500
# The first search is over 10 ms, in which a ball of 100 rps turns once: longer, and the peak is narrower than any
# grid of axes; shorter, and spins of a few rps cannot be told apart.
FIRST_US, ONLINE_US = 10_000, 10_000
DIRECTIONS, STEP_RPS = 500, 4.0  # axes 9 degrees apart, magnitudes a quarter of a radian in 10 ms
KEPT, APART_RPS = 8, 6.0  # peaks that are refined, and what makes them two
# Cells across the disc: a fifth of a radian for the search, a tenth to end with, about the width of a logo's stroke.
COARSE_CELLS, FINE_CELLS = 12, 24
# Once the window is doubled, another number of turns may fit as well: so many steps of a turn a window are tried.
OTHER_TURNS = np.arange(-2, 3) / 2.0
# A shot is searched anew when it has half as many events again; in between the last answer is refined.
GROWTH = 1.5
# Online: spins around the last one, each of its axes within 15 degrees and a tenth of the magnitude.
NEIGHBOURS, NEAR_SHARE, NEAR_RAD = 200, 0.1, 0.26
SEED = 1


class SphereContrastSpin:
    """Contrast maximisation's spin of one shot.

    Parameters
    ----------
    name : str
        Of the method.
    online : bool
        Whether to look at the last ONLINE_US alone, near the last answer.
    """

    def __init__(self, name: str, parameters: SpinParameters, online: bool) -> None:
        self.name, self.parameters, self.online = name, parameters, online
        self.t_us = np.empty(0, np.int64)
        self.normals = np.empty((0, 3))
        self.sight = np.zeros(3)  # sum of the directions to the logo's events
        self.last: Floats | None = None  # rad/s
        self.searched_with = 0

    def estimate(self, packet: Packet, logo: LogoResult) -> SpinEstimate:
        """The estimate at the end of a tick."""
        own = ~logo.of_outline & ~logo.events.on
        self.t_us = np.concatenate([self.t_us, logo.events.t_us[own]])
        self.normals = np.concatenate([self.normals, logo.normals[own]])
        self.sight = self.sight + logo.points_m[own].sum(axis=0)
        keep = self.t_us >= packet.end_us - (ONLINE_US if self.online else self.parameters.window_us)
        self.t_us, self.normals = self.t_us[keep], self.normals[keep]
        count = self.t_us.size
        if count < FEWEST_EVENTS:
            reason = f"{count} OFF events of the logo, {FEWEST_EVENTS} are needed"
            return SpinEstimate.refused(self.name, reason, count)
        if self.last is None or (not self.online and count >= GROWTH * self.searched_with):
            self.searched_with = count
            found = self._searched()
        elif self.online:
            found = self._near(self.last)
        else:
            found = self._refined(self.last, self.t_us[0], self.t_us[-1])
        self.last = found
        return SpinEstimate(self.name, found / TAU, None, None, count).up_to(self.parameters.max_spin_rps)

    def _variances(self, spins_rad_s: Floats, first_us: int, last_us: int, cells: int, most: int) -> Floats:
        """Variances (m,) of spins (m, 3) over the events of [first_us, last_us], thinned to about so many."""
        first, last = np.searchsorted(self.t_us, [first_us, last_us + 1])
        rows = np.arange(first, last, max(1, int(last - first) // most))
        t_s = ((self.t_us[rows] - (first_us + last_us) / 2) * 1e-6).astype(np.float64)
        away, across, up = orthonormal_axes(*(self.sight / np.linalg.norm(self.sight)).tolist())
        view = np.array([across, up, away])
        variances: Floats = orthographic_variances(spins_rad_s, t_s, self.normals[rows], view, cells)
        return variances

    def _searched(self) -> Floats:
        """The best of all spins: by the densest FIRST_US, then over ever longer windows around these."""
        start_us, end_us = int(self.t_us[0]), int(self.t_us[-1])
        counts = np.searchsorted(self.t_us, self.t_us + FIRST_US) - np.arange(self.t_us.size)
        first_us = max(min(int(self.t_us[int(np.argmax(counts))]), end_us - FIRST_US), start_us)
        last_us = min(first_us + FIRST_US, end_us)
        spins = _grid(self.parameters.max_spin_rps)
        scores = self._variances(spins, first_us, last_us, COARSE_CELLS, SEARCHED_EVENTS)
        found = [self._refined(spin, first_us, last_us) for spin in _peaks(spins, scores)]
        while first_us > start_us or last_us < end_us:
            length_us = last_us - first_us
            first_us, last_us = max(first_us - length_us // 2, start_us), min(last_us + length_us // 2 + 1, end_us)
            window_s = (last_us - first_us) * 1e-6
            found = [self._best_turns(spin, window_s, first_us, last_us) for spin in found]
        scores = self._variances(np.array(found), first_us, last_us, FINE_CELLS, REFINED_EVENTS)
        return found[int(np.argmax(scores))]

    def _best_turns(self, spin: Floats, window_s: float, first_us: int, last_us: int) -> Floats:
        """The best spin over a window, refined from this one and from those that turn a little more or less in it."""
        speed = float(np.linalg.norm(spin))
        speeds = np.clip(speed + OTHER_TURNS * TAU / window_s, 1.0, TAU * self.parameters.max_spin_rps)
        starts = speeds[:, None] * spin / max(speed, 1e-9)
        scores = self._variances(starts, first_us, last_us, COARSE_CELLS, REFINED_EVENTS)
        return self._refined(starts[int(np.argmax(scores))], first_us, last_us)

    def _near(self, spin: Floats) -> Floats:
        """The best spin in the neighbourhood of one, a batch of them at a time."""
        speed = max(float(np.linalg.norm(spin)), 1.0)
        random = np.random.default_rng(SEED).standard_normal((NEIGHBOURS, 3))
        along = np.outer(random @ spin / speed, spin / speed)
        around = speed * (NEAR_SHARE * along + NEAR_RAD * (random - along))
        spins = spin + np.concatenate([np.zeros((1, 3)), around])
        first_us, last_us = int(self.t_us[0]), int(self.t_us[-1])
        scores = self._variances(spins, first_us, last_us, COARSE_CELLS, SEARCHED_EVENTS)
        return self._refined(spins[int(np.argmax(scores))], first_us, last_us)

    def _refined(self, spin: Floats, first_us: int, last_us: int) -> Floats:
        """The top of the peak on which a spin lies, by the simplex method."""
        from scipy.optimize import minimize  # only needed here; a quarter of a second to load

        def blur(one: Floats) -> float:
            return -float(self._variances(one[None], first_us, last_us, FINE_CELLS, REFINED_EVENTS)[0])

        # A step moves the events at the window's ends by about a cell.
        step = 0.2 / max((last_us - first_us) * 0.5e-6, 1e-3)
        simplex = spin + step * np.concatenate([np.zeros((1, 3)), np.eye(3)])
        options = {"initial_simplex": simplex, "maxfev": 80, "xatol": 0.02 * step, "fatol": 0.0}
        found: Floats = minimize(blur, spin, method="Nelder-Mead", options=options).x
        return found


def _grid(max_spin_rps: float) -> Floats:
    """Spins (m, 3), rad/s: DIRECTIONS evenly over the sphere (Fibonacci's lattice), magnitudes STEP_RPS apart."""
    number = np.arange(DIRECTIONS) + 0.5
    z, turn = 1.0 - 2.0 * number / DIRECTIONS, math.pi * (1.0 + math.sqrt(5.0)) * number
    across = np.sqrt(1.0 - z * z)
    axes = np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=1)
    speeds = TAU * np.arange(STEP_RPS, max_spin_rps + STEP_RPS, STEP_RPS)
    spins: Floats = (speeds[:, None, None] * axes).reshape(-1, 3)
    return spins


def _peaks(spins: Floats, scores: Floats) -> list[Floats]:
    """The best KEPT spins, rad/s, that are APART_RPS from better ones."""
    kept: list[Floats] = []
    for row in np.argsort(scores)[::-1]:
        if all(np.linalg.norm(spins[row] - one) > TAU * APART_RPS for one in kept):
            kept.append(spins[row])
        if len(kept) == KEPT:
            break
    return kept


OFFLINE = rival(
    "s_cmax",
    "s-CMax offline",
    "contrast maximisation on the sphere over all of the shot's OFF events (arXiv 2606.26780).",
    (171, 71, 188),
    inputs=("packet", "logo"),
    state=lambda name, parameters, context: SphereContrastSpin(name, parameters, online=False),
)
ONLINE = rival(
    "s_cmax_online",
    "s-CMax online",
    "contrast maximisation on the sphere near the last answer, over the last 10 ms (arXiv 2606.26780).",
    (206, 147, 216),
    inputs=("packet", "logo"),
    state=lambda name, parameters, context: SphereContrastSpin(name, parameters, online=True),
)
