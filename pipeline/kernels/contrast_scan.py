"""Tops of the contrast score over a whole stretch, also far from the spins at hand: comb and axis scan."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .contrast_events import LogoEvents, Settings
from .contrast_refine import NO_OFFSETS, Hill, climb, climb_all
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
OTHERS = 300
# A top of the coarse scores below this part of the best one is no rival.
RIVAL = 0.5
# A climb ends within this of its top, relative to the spin; farther tops are others.
SAME = 0.03


def hill_of(events: LogoEvents, settings: Settings, sigma: float) -> Hill:
    """The score of all these events together; B from at least OTHERS exchanged ones."""
    part, others = whole(events.t_s, events.normals, events.layers, max(1, round(OTHERS / len(events))))
    return Hill(part, others, np.empty((3, 3, 0)), sigma, settings.floor, NO_OFFSETS, 1.0)


def followed(events: LogoEvents, spins_rad_s: Floats, settings: Settings) -> Floats:
    """At most 3 spins (k, 3), best first, climbed over segments that grow until they hold everything."""
    events = events.thinned(settings.most // 2)
    span_s, n = float(events.t_s[-1] - events.t_s[0]), len(events)
    hill = hill_of(events, settings, 1.5 * settings.sigma)
    everything, spins, turns = hill, spins_rad_s, FOLLOW_TURNS
    while True:
        last = turns * TURN > span_s * float(np.linalg.norm(spins[0]))
        tops = np.empty_like(spins)
        values = np.empty(len(spins))
        for k, spin in enumerate(spins):
            if not last:
                segment_s = turns * TURN / float(np.linalg.norm(spin))
                part, others = segmented(events.t_s, events.normals, events.layers, segment_s, n, n)
                hill = everything._replace(part=part, others=others)
            tops[k], _, values[k], _ = climb(hill, spin, NO_OFFSETS, 4 if last else 2)
        spins = tops[np.argsort(-values, kind="stable")]
        spins = spins[distinct(spins, NEAR, 3, 0)]
        if last:
            return spins
        turns *= FOLLOW_RATIO
        hill = everything


def scanned(events: LogoEvents, spins_rad_s: Floats, settings: Settings) -> Floats:
    """At most 6 spins (k, 3), best first: tops of the score over everything, also far from the given ones.

    A logo that shows in short visits fixes the spin within a visit only roughly, and between visits only up to whole
    turns. So magnitudes are looked for along each given axis, and all axes at each of these magnitudes.
    """
    sigma, some = 2.0 * settings.sigma, events.thinned(settings.scan_most)
    part = hill_of(some, settings, sigma).part
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
    candidates = candidates[distinct(candidates, SAME, len(candidates), 0)]
    hill = hill_of(some, settings, 1.5 * settings.sigma)
    tops, values, _ = climb_all(hill, candidates, 3)
    order = np.argsort(-values, kind="stable")
    best = float(values.max())  # negative where nothing turns with any of them: then the best alone stays
    spins = tops[order[values[order] >= min(RIVAL * best, best)]]
    rivals: Floats = spins[distinct(spins, SAME, 6, 2)]
    return rivals


def ranked(events: LogoEvents, spins_rad_s: Floats, settings: Settings) -> tuple[Floats, Floats]:
    """Distinct spins (k, 3) climbed with the final kernel, best first, and by how much the best beats each (k,).

    The margin is in standard deviations of the difference of the two scores, over the events that tell them apart.
    """
    hill = hill_of(events.thinned(settings.quick_most), settings, settings.sigma)
    tops, values, shares = climb_all(hill, spins_rad_s, 3)
    order = np.argsort(-values, kind="stable")
    order = order[distinct(tops[order], SAME, 6, 2)]
    gaps = shares[order[0]] - shares[order]
    margins = gaps.sum(axis=1) / np.sqrt(settings.repeats * np.sum(gaps**2, axis=1) + 1e-12)
    return tops[order], margins


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
