"""What the contrast estimate is made from, and what it says."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """Numbers of `estimate_spin`.

    fastest_rps : highest spin looked for
    sigma : radians, kernel of the refinement; 1.5 and 2 times that for what leads up to it. A pixel of a 17 px ball is
        0.06 rad; pixels report within about 0.1 ms, 0.03 rad at 50 rps
    floor : density in coinciding events, see `score`
    fewest : logo events needed
    most, search_most, scan_most, quick_most : events looked at by the refinement, the search, the scans, `follow_spin`
    trust : weight of the score against the assumed place of the ball
    repeats : how many events tell the same (the events of one edge at one pixel and its neighbours)
    """

    fastest_rps: float = 150.0
    sigma: float = 0.04
    floor: float = 1.5
    fewest: int = 40
    most: int = 3000
    search_most: int = 800
    scan_most: int = 250
    quick_most: int = 1000
    trust: float = 0.1
    repeats: float = 8.0


@dataclass(frozen=True, slots=True, eq=False)
class LogoEvents:
    """The logo's events of one stretch of time, one column an event.

    t_s : (n,) float64, rising, any origin
    normals : (3, n) float64, outward unit normals where the events are on the ball
    layers : (n,) int64, polarity 0 or 1
    facing : (3, n) float64, unit vectors from the camera to the ball's centre
    radius_px : (n,) float64, radius of the ball
    """

    t_s: Floats
    normals: Floats
    layers: Integers
    facing: Floats
    radius_px: Floats

    def __len__(self) -> int:
        return self.t_s.size

    def at(self, rows: Integers | NDArray[np.bool_]) -> LogoEvents:
        """The events of a mask or of indices."""
        return LogoEvents(
            self.t_s[rows],
            np.ascontiguousarray(self.normals[:, rows]),
            self.layers[rows],
            np.ascontiguousarray(self.facing[:, rows]),
            self.radius_px[rows],
        )

    def thinned(self, most: int) -> LogoEvents:
        """Every k-th event, so that about `most` are left."""
        stride = max(1, round(len(self) / most))
        return self if stride == 1 else self.at(np.arange(0, len(self), stride))

    @property
    def patch_rad(self) -> float:
        """How far the events spread over the ball as it is seen: radians, root mean square from their middle."""
        middle = self.normals.mean(axis=1)
        return float(np.sqrt(max(0.0, 1.0 - middle @ middle)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """1 sigma of what is assumed of the ball.

    centre_std_px, radius_std_px : of centre (one axis) and radius, as constant errors over the stretch
    track_std_px, drift_std_px_s : what of the centre's changes within the stretch, and the most it can drift
    """

    centre_std_px: float
    radius_std_px: float
    track_std_px: float = 0.0
    drift_std_px_s: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Answer:
    """What the events say.

    spin_rps, covariance_rps2 : (3,) and (3, 3) float64, the best spin and its 1-sigma covariance; None without one
    events : number of events given
    reference_s, span_s : the middle of the stretch, to whose time the events are turned back, and its length
    rivals_rps, margins : (k, 3) and (k,) float64, other tops of the score and by how many sigmas they are lower
    offsets_px : (3,) float64, refined centre x, y and radius less the assumed ones
    contrast : score per event less that of exchanged times; 0 = no pattern turns with the spin
    patch_rad : see LogoEvents
    """

    spin_rps: Floats | None
    covariance_rps2: Floats | None
    events: int
    reference_s: float = 0.0
    span_s: float = 0.0
    rivals_rps: Floats = field(default_factory=lambda: np.empty((0, 3)))
    margins: Floats = field(default_factory=lambda: np.empty(0))
    offsets_px: Floats = field(default_factory=lambda: np.zeros(3))
    contrast: float = 0.0
    patch_rad: float = 0.0
