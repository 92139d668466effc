"""Period of all events on the ball's disc and around it: a logo that only its own outline shows."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..kernels.rate import add_to_disc
from ..results import Packet
from .rate_period import FEWEST_EVENTS, FEWEST_TURNS, PatternPeriod, period_of
from .track_result import BallTrack

Floats = NDArray[np.float64]

# A weak sensor reports a millisecond late, a third of the radius behind the ball. Cells as wide as those of the logo's
# pattern: 0.37 of the radius.
REACH, CELLS = 1.3, 8
# The outline changes with the ball's way through the image; a cubic of time leaves nothing of that beyond chance in
# what comes back three times. Slower magnitudes are looked for as well: half of what is found is one.
TREND_ORDER, RETURNS_TURNS = 3, 2.5
# On balls without a logo (80 simulated flights, half of them of weak sensors) the highest is 8 sigma, the median 3.6.
FEWEST_SIGMAS = 10.0
# Lamps at the mains make the whole outline flicker at these rates, known as well as three periods tell.
LAMPS_HZ, LAMP_WIDTH_HZ = (100.0, 120.0), 3.0


@dataclass(slots=True)
class DiscPattern:
    """Events by bin of time, polarity and place relative to the disc: (2, n, CELLS, CELLS); its edges (n, 4) in px."""

    cells: Floats = field(default_factory=lambda: np.zeros((2, 0, CELLS, CELLS)))
    edges_px: Floats = field(default_factory=lambda: np.zeros((0, 4)))

    def add(self, packet: Packet, ball: BallTrack, first_bin: int, length: int, bin_us: int) -> None:
        """Take a tick's events into bins [first_bin, first_bin + length), as far as they are kept."""
        kept = self.cells.shape[1]
        grown = np.zeros((2, length, CELLS, CELLS))
        grown[:, :kept] = self.cells
        x_px, y_px, vx_px_s, vy_px_s, radius_px = ball.mean.tolist()
        add_to_disc(
            grown,
            packet.events.columns,
            first_bin * bin_us,
            bin_us,
            ball.t_us + ball.latency_us,
            (x_px, y_px),
            (vx_px_s, vy_px_s),
            REACH * radius_px,
        )
        x_px, y_px = ball.centre_px((first_bin + 0.5 + np.arange(kept, length, dtype=np.float64)) * bin_us)
        edges_px = np.stack([x_px - radius_px, x_px + radius_px, y_px - radius_px, y_px + radius_px], axis=1)
        self.cells, self.edges_px = grown, np.concatenate([self.edges_px, edges_px])

    def forget(self, bins: int) -> None:
        """Drop the first bins."""
        self.cells, self.edges_px = self.cells[:, bins:], self.edges_px[bins:]

    def period(self, bins: int, bin_s: float, max_spin_rps: float) -> PatternPeriod:
        """Magnitudes behind the first `bins` bins.

        As `LogoPattern.period`, but without a mask: on a weak sensor, whose pixels report the outline over several
        pixels, no event of a logo near the rim can be told from the outline's; together they still come and go with
        the logo. What the outline does without it is taken out of every place's counts first: slow changes, and the
        burst whenever one of the disc's four edges comes to the next row or column of pixels.
        """
        events = round(float(self.cells[:, :bins].sum()))
        if events < FEWEST_EVENTS:
            return PatternPeriod.nothing(f"{events} events on the ball, {FEWEST_EVENTS} are needed")
        found = period_of(
            self.cells[:, :bins], bin_s, max_spin_rps, FEWEST_TURNS, FEWEST_SIGMAS, _nuisance(self.edges_px[:bins])
        )
        if found.reason is None and found.spins_rps[0] * bins * bin_s < RETURNS_TURNS:
            return replace(found, reason=f"{RETURNS_TURNS:g} turns are needed where only the outline tells the period")
        if found.reason is None and any(abs(found.spins_rps[0] - lamp_hz) < LAMP_WIDTH_HZ for lamp_hz in LAMPS_HZ):
            return replace(found, reason=f"the outline comes back with {found.spins_rps[0]:.0f} Hz, as lamps flicker")
        return found


def _nuisance(edges_px: Floats) -> Floats:
    """Orthonormal curves (n, k) over time: its powers, and sine and cosine of the edges' (n, 4) phase in a pixel."""
    time = np.linspace(-1.0, 1.0, edges_px.shape[0])
    curves = np.concatenate(
        [
            time[:, None] ** np.arange(TREND_ORDER + 1),
            np.cos(2.0 * np.pi * edges_px),
            np.sin(2.0 * np.pi * edges_px),
        ],
        axis=1,
    )
    basis, sizes, _ = np.linalg.svd(curves, full_matrices=False)
    # A ball that stays has one phase throughout.
    kept: Floats = basis[:, sizes > 1e-6 * sizes[0]]
    return kept
