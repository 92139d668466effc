"""Sightings of the logo: when it was seen, and when it was not."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ...camera import Camera
from ...kernels.arrays import Floats, Integers
from ...kernels.sightings import sighting_log_likelihoods
from ...kernels.sphere import spread_directions
from ...results import Packet
from ...stages.logo import LogoResult
from ...stages.track_result import BallTrack

# A ball of 150 rps turns by 54 degrees within this time.
BIN_US = 1000
# More of them than this are thinned evenly. A visit of the logo lasts some milliseconds, in which all tell the same.
MOST_BINS, VISIT_BINS = 50, 5
# Events in a millisecond from which on the logo is seen, and up to which it is not: shares of the most that there are
# in any, but at least so many. A logo well seen has 10 (1,000 in 100 ms), noise less than one.
SEEN_SHARE, SEEN_EVENTS, UNSEEN_SHARE, UNSEEN_EVENTS = 0.1, 4, 0.02, 1
# 26 degrees apart, about the logo's own size.
PLACES: Floats = spread_directions(60)


@dataclass(slots=True)
class Sightings:
    """Number of the logo's events in each millisecond of a shot, and the direction to the camera.

    Attributes
    ----------
    times_s : list of (n,) float64
        Middles of a tick's milliseconds, s.
    views : list of (n, 3) float64
        Unit vectors from the ball to the camera, camera frame.
    counts : list of (n,) int64
    """

    times_s: list[Floats] = field(default_factory=list)
    views: list[Floats] = field(default_factory=list)
    counts: list[Integers] = field(default_factory=list)

    def add(self, packet: Packet, ball: BallTrack, logo: LogoResult, camera: Camera, window_us: int) -> None:
        """Count the events of one more tick, and forget those from before the window that ends with it."""
        bins = max(1, round((packet.end_us - packet.start_us) / BIN_US))
        edges_us = np.linspace(packet.start_us, packet.end_us, bins + 1)
        middles_us = 0.5 * (edges_us[1:] + edges_us[:-1])
        rays = camera.rays(*ball.centre_px(middles_us))
        self.times_s.append(middles_us * 1e-6)
        self.views.append(-rays / np.linalg.norm(rays, axis=1)[:, None])
        self.counts.append(np.histogram(logo.turning.t_us, edges_us)[0])
        while self.times_s[0][-1] <= (packet.end_us - window_us) * 1e-6:
            del self.times_s[0], self.views[0], self.counts[0]

    def log_likelihood(self, spins_rps: Floats) -> Floats:
        """Logarithmic likelihoods (k,) of spins (k, 3); zeros without a tick.

        A spin under which the logo, wherever it is on the ball, would have come into view when nothing was seen, or
        been behind the ball when it was, is less likely. See `sighting_log_likelihoods`.
        """
        values = np.zeros(len(spins_rps))
        if not self.counts:
            return values
        counts, times_s, views = np.concatenate(self.counts), np.concatenate(self.times_s), np.concatenate(self.views)
        most = counts.max()
        seen = counts >= max(SEEN_SHARE * most, SEEN_EVENTS)
        rows = np.flatnonzero(seen | (counts <= max(UNSEEN_SHARE * most, UNSEEN_EVENTS)))
        rows = rows[:: -(-rows.size // MOST_BINS) or 1]
        weight = min(len(counts) / max(rows.size, 1) / VISIT_BINS, 1.0)
        origin_s = 0.5 * float(times_s[0] + times_s[-1])
        spins_rad_s = 2 * np.pi * np.ascontiguousarray(spins_rps)
        sighting_log_likelihoods(values, spins_rad_s, times_s[rows] - origin_s, views[rows], seen[rows], PLACES, weight)
        return values
