"""Spin from the logo's place on the ball in successive event frames, as methods of frame cameras regress it.

Each frame gives one direction, from the ball's centre to the logo. Turning about a fixed axis they lie on a circle: the
axis is the normal of the plane that fits them best, and the angle in it grows with time.

Deviates: frames are those of events, so the logo's place is the mean of its events; the publication finds the printed
logo in grey frames by its contour. The sense of the axis and the number of turns follow from the smallest angles that
successive frames allow, as there.

References
----------
J. Tebbe, L. Klamt, Y. Gao, A. Zell, "Spin detection in robotic table tennis", ICRA 2020.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ...results import Packet, SpinEstimate
from ...stage import Context
from ...stages.logo import LogoResult
from ..parameters import SpinParameters
from .rival import rival

Floats = NDArray[np.float64]

# Frames of 2 ms: at the paper's expected 50 rps a tenth of a rotation. A frame needs events for a mean to be known to
# a tenth of the logo's width.
FRAME_US, FEWEST_EVENTS = 2000, 20
FEWEST_FRAMES = 3  # a plane
# Frames further apart than this may have another turn between them: a visit of the logo ends.
GAP_US = 3 * FRAME_US


class LogoOrientationSpin:
    """Spin of one shot from the logo's mean direction, frame by frame."""

    def __init__(self, name: str, parameters: SpinParameters, context: Context) -> None:
        self.name, self.parameters = name, parameters
        self.t_us = np.empty(0, np.int64)
        self.normals = np.empty((0, 3))

    def estimate(self, packet: Packet, logo: LogoResult) -> SpinEstimate:
        """The estimate at the end of a tick; no uncertainty is stated."""
        own = ~logo.of_outline
        self.t_us = np.concatenate([self.t_us, logo.events.t_us[own]])
        self.normals = np.concatenate([self.normals, logo.normals[own]])
        keep = self.t_us >= packet.end_us - self.parameters.window_us
        self.t_us, self.normals = self.t_us[keep], self.normals[keep]
        times_s, places = self._frames()
        if len(times_s) < FEWEST_FRAMES:
            reason = f"{len(times_s)} frames show the logo, {FEWEST_FRAMES} are needed"
            return SpinEstimate.refused(self.name, reason, self.t_us.size)
        spin_rps = turning(times_s, places, GAP_US * 1e-6)
        if spin_rps is None:
            return SpinEstimate.refused(self.name, "no two frames in a row show the logo", self.t_us.size)
        return SpinEstimate(self.name, spin_rps, None, None, self.t_us.size).up_to(self.parameters.max_spin_rps)

    def _frames(self) -> tuple[Floats, Floats]:
        """Mean time (m,), s, and direction (m, 3) to the logo of each frame with enough events."""
        _, first, counts = np.unique(self.t_us // FRAME_US, return_index=True, return_counts=True)
        full = counts >= FEWEST_EVENTS
        if not full.any():
            return np.empty(0), np.empty((0, 3))
        sums = np.add.reduceat(self.normals, first, axis=0)[full]
        times_s = np.add.reduceat((self.t_us - self.t_us[0]) * 1e-6, first)[full] / counts[full]
        return times_s, sums / np.linalg.norm(sums, axis=1, keepdims=True)


def turning(times_s: Floats, places: Floats, gap_s: float) -> Floats | None:
    """Spin (3,), rps, of directions (m, 3) that turn about a fixed axis; None where no two are within gap_s.

    The plane through all of them by least squares; the speed from the angles between neighbours in time.
    """
    middle = places.mean(axis=0)
    axis = np.linalg.svd(places - middle)[2][2]
    across = places - np.outer(places @ axis, axis)
    before, after = across[:-1], across[1:]
    angles = np.arctan2(np.cross(before, after) @ axis, np.sum(before * after, axis=1))
    steps_s = np.diff(times_s)
    near = steps_s <= gap_s
    if not near.any():
        return None
    spin_rps: Floats = axis * float(np.sum(angles[near]) / np.sum(steps_s[near])) / (2 * math.pi)
    return spin_rps


LOGO_ORIENTATION = rival(
    "logo_orientation",
    "Logo orientation",
    "the logo's place in event frames of 2 ms and the circle through them (Tebbe 2020).",
    (77, 182, 172),
    inputs=("packet", "logo"),
    state=LogoOrientationSpin,
)
