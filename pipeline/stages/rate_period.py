"""Period of the logo's pattern: after how long the same events are seen at the same places of the ball again."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..kernels.rate import add_to_pattern, deviations, highest_near, highest_peaks, lag_sums, over_multiples
from .logo import TurningEvents

Floats = NDArray[np.float64]

# Cells across the ball: a third of its radius, which the surface of a ball of 50 rps crosses in a millisecond.
CELLS = 6
SLOWEST_RPS, FEWEST_TURNS = 3.0, 1.2
# A magnitude is found where it exceeds chance by 5 sigma: 2,000 magnitudes are looked at.
FEWEST_SIGMAS = 5.0
# Fewer events that happen to lie together are many sigma: 14 have come back by five, with two thirds of the true spin.
FEWEST_EVENTS = 40
# Patterns look different when they come back: of 160 simulated shots the true period is first in all but one of those
# that pass, where its double leads by 0.12 of the sigmas; usual doubles and halves stay behind by 0.3 to 0.35. So an
# alternative counts as a deviation of 0.1 of the leader's sigmas.
SPREAD = 0.1
# An alternative of this log likelihood or more is not excluded (2 sigma).
EXCLUDED = -2.0
# Error of the last return: 0.5 ms (rms) in 117 simulated flights of more than 1.2 turns, 0.2 ms on 18 spinners.
RETURN_STD_S = 0.5e-3
ALTERNATIVES, APART = 4, 0.05
# With so many events more in a place, one that has only a few does not outweigh the others.
SPARSE_EVENTS = 3.0


@dataclass(frozen=True, slots=True, eq=False)
class PatternPeriod:
    """Magnitudes that the pattern's period allows.

    Attributes
    ----------
    spins_rps, log_likelihoods : (k,) float64
        Best first, its log likelihood 0; also when refused. Empty where nothing was to be seen.
    std_rps : float
        1 sigma of the first; NaN without one.
    reason : str, optional
        Why the first is not to be trusted; None if it is.
    sigmas : float
        By how many standard deviations of chance the first comes back.
    """

    spins_rps: Floats
    log_likelihoods: Floats
    std_rps: float
    reason: str | None
    sigmas: float = 0.0

    @classmethod
    def nothing(cls, reason: str) -> PatternPeriod:
        """No period."""
        return cls(np.empty(0), np.empty(0), math.nan, reason)


@dataclass(slots=True)
class LogoPattern:
    """Events of the logo by bin of time, polarity and place on the ball: (2, n, CELLS, CELLS)."""

    cells: Floats = field(default_factory=lambda: np.zeros((2, 0, CELLS, CELLS)))

    def add(self, events: TurningEvents, first_bin: int, length: int, bin_us: int) -> None:
        """Take a tick's events into bins [first_bin, first_bin + length), as far as they are kept."""
        grown = np.zeros((2, length, CELLS, CELLS))
        grown[:, : self.cells.shape[1]] = self.cells
        add_to_pattern(grown, events.t_us // bin_us - first_bin, np.ascontiguousarray(events.normals), events.on)
        self.cells = grown

    def forget(self, bins: int) -> None:
        """Drop the first bins."""
        self.cells = self.cells[:, bins:]

    def period(self, bins: int, bin_s: float, max_spin_rps: float) -> PatternPeriod:
        """Magnitudes behind the first `bins` bins.

        Each bin's pattern, less the mean pattern with as many events, is multiplied with that of every other bin; sums
        over bins a lag apart tell how much of the pattern has come back. That is the matching of EEPPR (Kolar et al.,
        arXiv 2408.06899, 2024), of all bins with all instead of one template, on the ball instead of in the image: the
        rate's slow trends drop out, and so does the line of sight's turning in flight. A period's multiples count
        together. Half of the true one meets nothing at every other multiple, twice the true one leaves half of the
        evidence out. Each polarity is judged by its own chance level, and their squares are added: one that shows
        nothing adds nothing.
        """
        events = round(float(self.cells[:, :bins].sum()))
        if events < FEWEST_EVENTS:
            return PatternPeriod.nothing(f"{events} logo events, {FEWEST_EVENTS} are needed")
        return period_of(self.cells[:, :bins], bin_s, max_spin_rps, FEWEST_TURNS, FEWEST_SIGMAS, None)


def period_of(
    cells: Floats,
    bin_s: float,
    max_spin_rps: float,
    fewest_turns: float,
    fewest_sigmas: float,
    nuisance: Floats | None,
) -> PatternPeriod:
    """Period of counts (2, n, c, c) by polarity, bin of time and place; see `LogoPattern.period`.

    Parameters
    ----------
    fewest_turns, fewest_sigmas : float
        Turns that the bins must hold of the slowest magnitude looked for, and the lead over chance that is asked for.
    nuisance : (n, k) float64, optional
        Orthonormal curves over time of what changes without the spin, taken out of each place's counts; the rest is
        weighed by the counts' own standard deviation (Pearson's residuals), for places of many events drown the others.
    """
    kept = cells.reshape(2, cells.shape[1], -1)
    span_s = kept.shape[1] * bin_s
    slowest_rps = max(fewest_turns / max(span_s, 1e-9), SLOWEST_RPS)
    if slowest_rps >= max_spin_rps:
        return PatternPeriod.nothing("the shot is too short for a period")
    # Neighbours differ by a quarter of a bin at the last return; they are the same ones whatever the fastest is.
    step = 0.25 * bin_s / span_s
    count = math.ceil(math.log(max_spin_rps / slowest_rps) / step)
    spins_rps = slowest_rps * np.exp(step * np.arange(count + 1))
    squares, sums, bounds = np.zeros((3, count + 1))
    for pattern in kept:
        varying = deviations(pattern)
        if nuisance is not None:
            varying = varying - nuisance @ (nuisance.T @ varying)
            varying /= np.sqrt((pattern.sum(axis=0) + SPARSE_EVENTS) / pattern.shape[0])
        by_lag, bound_by_lag, mean_square = lag_sums(varying)
        own, most, products = over_multiples(by_lag, bound_by_lag, 1.0 / (spins_rps * bin_s))
        squares += np.maximum(own, 0.0) ** 2 / np.maximum(mean_square * products, 1e-9)
        sums, bounds = sums + own, bounds + most
    relative_std = RETURN_STD_S / span_s
    return _judged(spins_rps, np.sqrt(squares), sums / np.maximum(bounds, 1e-9), relative_std, fewest_sigmas)


def _judged(
    spins_rps: Floats, sigmas: Floats, correlations: Floats, relative_std: float, fewest_sigmas: float
) -> PatternPeriod:
    """The highest peaks of a curve of sigmas (m,) over magnitudes (m,), and whether the first is to be trusted.

    The sigmas grow with what overlaps, and so lean to short lags; the correlations (m,) say where a peak really is.
    """
    chosen = highest_peaks(spins_rps, sigmas, ALTERNATIVES, APART)
    if not chosen.size:
        return PatternPeriod.nothing("the logo's pattern does not come back")
    best, found = float(sigmas[chosen[0]]), spins_rps[highest_near(spins_rps, correlations, chosen, APART)]
    likelihoods = -0.5 * ((1.0 - sigmas[chosen] / best) / SPREAD) ** 2
    reason = None
    if best < fewest_sigmas:
        reason = f"the logo's pattern comes back by {best:.1f} sigma, {fewest_sigmas:g} are needed"
    elif found.size > 1 and likelihoods[1] > EXCLUDED:
        reason = f"the logo's pattern comes back with {found[0]:.1f} and with {found[1]:.1f} rps"
    return PatternPeriod(found, likelihoods, float(found[0]) * relative_std, reason, best)
