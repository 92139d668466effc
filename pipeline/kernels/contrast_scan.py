"""Tops of the contrast score over a whole stretch, also far from the spins at hand: comb and axis scan."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .contrast_events import LogoEvents, Settings
from .contrast_refine import NO_OFFSETS, Hill, climb
from .contrast_search import NEAR, TURN, distinct, scored, spread_directions
from .contrast_window import Window, segmented, whole

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# Magnitudes from 0.45 to 2.2 of a candidate's hold every confusion of n turns with n + 1 (or n - 1), down to half and
# double; a step is never coarser than a tenth, and never finer than makes COMB_MOST of them.
COMB_LOW, COMB_HIGH, COMB_STEP, COMB_MOST = 0.45, 2.2, 0.1, 300
# 20 degrees apart: visits of the logo one turn apart fix the axis only within each visit, that is roughly.
SCAN_DIRECTIONS = 100
MAGNITUDES = 6  # at which all axes are looked at
FOLLOW_TURNS, FOLLOW_RATIO = 1.6, 2.5
# A climb ends within this of its top, relative to the spin; farther tops are others.
SAME = 0.03


def hill_of(events: LogoEvents, settings: Settings, sigma: float) -> Hill:
    """The score of all these events together; B from at least 600 exchanged ones."""
    n = len(events)
    part, others = whole(events.t_s, events.normals, events.layers, max(1, round(600 / n)))
    return Hill(part, others, events.facing, events.radius_px, sigma, settings.floor, NO_OFFSETS, 1.0, np.empty(n))


def followed(events: LogoEvents, spins_rad_s: Floats, settings: Settings) -> Floats:
    """At most 3 spins (k, 3), best first, climbed over segments that grow until they hold everything."""
    events = events.thinned(settings.most // 2)
    span_s, n = float(events.t_s[-1] - events.t_s[0]), len(events)
    hill = hill_of(events, settings, 1.5 * settings.sigma)
    everything, spins, turns = hill.part, spins_rad_s, FOLLOW_TURNS
    while True:
        last = turns * TURN > span_s * float(np.linalg.norm(spins[0]))
        tops = []
        for spin in spins:
            if not last:
                segment_s = turns * TURN / float(np.linalg.norm(spin))
                hill.part = segmented(
                    events.t_s, events.normals, events.layers, segment_s=segment_s, most=n, most_each=n
                )
            tops.append(climb(hill, spin, NO_OFFSETS, 4 if last else 2))
        spins = np.array([top[0] for top in tops])[np.argsort([-top[2] for top in tops], kind="stable")]
        spins = spins[distinct(spins, NEAR, 3)]
        if last:
            return spins
        turns *= FOLLOW_RATIO
        hill.part = everything


def scanned(events: LogoEvents, spins_rad_s: Floats, settings: Settings) -> Floats:
    """At most 6 spins (k, 3), best first: tops of the score over everything, also far from the given ones.

    A logo that shows in short visits fixes the spin within a visit only roughly, and between visits only up to whole
    turns. So magnitudes are looked for along each given axis, and all axes at each of these magnitudes.
    """
    sigma = 2.0 * settings.sigma
    part = hill_of(events.thinned(settings.scan_most), settings, sigma).part
    magnitudes: list[float] = []
    for spin in spins_rad_s[:2]:
        factors, values = comb(part, spin, sigma, settings.floor)
        near = math.log(factors[1] / factors[0])
        for one in np.linalg.norm(spin) * np.concatenate([[1.0, 0.5, 2.0], factors[peaks_of(values)[:2]]]):
            if one <= settings.fastest_rps * TURN and all(abs(math.log(one / other)) > near for other in magnitudes):
                magnitudes.append(float(one))
    directions = spread_directions(SCAN_DIRECTIONS)
    candidates = np.concatenate([*(directions * one for one in magnitudes[:MAGNITUDES]), spins_rad_s])
    order = np.argsort(-scored(candidates, part, sigma, settings.floor), kind="stable")
    candidates = candidates[order][distinct(candidates[order], 0.1, 6, 2)]
    candidates = np.concatenate([spins_rad_s, candidates])
    candidates = candidates[distinct(candidates, SAME, len(candidates))]
    hill = hill_of(events.thinned(settings.scan_most), settings, 1.5 * settings.sigma)
    tops = [climb(hill, spin, NO_OFFSETS, 3) for spin in candidates]
    spins = np.array([top[0] for top in tops])[np.argsort([-top[2] for top in tops], kind="stable")]
    return spins[distinct(spins, SAME, 6, 2)]


def ranked(events: LogoEvents, spins_rad_s: Floats, settings: Settings) -> tuple[Floats, Floats]:
    """Distinct spins (k, 3) climbed with the final kernel, best first, and by how much the best beats each (k,).

    The margin is in standard deviations of the difference of the two scores, over the events that tell them apart.
    """
    hill = hill_of(events.thinned(settings.search_most), settings, settings.sigma)
    tops, shares = [], []
    for spin in spins_rad_s:
        top, _, _ = climb(hill, spin, NO_OFFSETS, 3)
        hill.score(top, NO_OFFSETS)
        tops.append(top)
        shares.append(hill.ratios.copy())
    order = np.argsort([-float(share.sum()) for share in shares], kind="stable")
    order = order[distinct(np.array(tops)[order], SAME, 6, 2)]
    gaps = np.array([shares[order[0]] - shares[row] for row in order])
    margins = gaps.sum(axis=1) / np.sqrt(settings.repeats * np.sum(gaps**2, axis=1) + 1e-12)
    return np.array(tops)[order], margins


def comb(part: Window, spin_rad_s: Floats, sigma: float, floor: float) -> tuple[Floats, Floats]:
    """Factors (m,) on the magnitude, closer than a kernel, and the scores (m,) along the spin's axis."""
    spread_s, width = float(np.std(part.t_s)), math.log(COMB_HIGH / COMB_LOW)
    step = 0.8 * sigma / (spread_s * float(np.linalg.norm(spin_rad_s)) + 1e-12)
    step = min(max(step, width / COMB_MOST), COMB_STEP)
    factors = COMB_LOW * np.exp(step * np.arange(math.ceil(width / step)))
    return factors, scored(spin_rad_s * factors[:, None], part, sigma, floor)


def peaks_of(values: Floats) -> Integers:
    """Rows of the local maxima of a curve, highest first."""
    padded = np.concatenate([[-np.inf], values, [-np.inf]])
    peaks = np.flatnonzero((values >= padded[:-2]) & (values >= padded[2:]))
    return peaks[np.argsort(-values[peaks], kind="stable")]
