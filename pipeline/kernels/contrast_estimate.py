"""From logo events to a spin: search, comb and axis scan, refinement with the ball's place, uncertainty, refusal."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from .contrast_refine import NO_OFFSETS, Hill, bend_and_noise, climb, spread_of_estimate
from .contrast_search import TURN, bursts, distinct, narrowed, scored, search, spread_directions
from .contrast_window import segmented, whole

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# The comb: magnitudes from 0.45 to 2.2 of a candidate's hold every confusion of n turns with n + 1, down to half and
# double; finer than a tenth there is nothing to lose.
COMB_LOW, COMB_HIGH, COMB_STEP = 0.45, 2.2, 0.1
SCAN_DIRECTIONS = 150  # 17 degrees apart: visits of the logo one turn apart fix the axis only within each visit
FOLLOW_TURNS, FOLLOW_RATIO = 1.6, 2.5
# Peaks nearer than this (relative) are one answer with a wide error, farther ones are two answers.
NEAR = 0.3
TRACK_MEMORY_S = 0.02  # four steps of the Kalman filter
# Stretches longer than this may hold steady shading for the search to be rid of, and bursts to tell it by.
BURSTS_FROM_S = 0.015


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """Numbers of `estimate_spin`.

    fastest_rps : highest spin looked for
    sigma : radians, kernel of the last refinement; twice that for scans. A pixel of a 17 px ball is 0.06 rad, pixels
        report within about 0.1 ms, 0.03 rad at 50 rps
    floor : density in coinciding events, see `score`
    fewest : logo events needed
    most, search_most, scan_most : events looked at by the refinement, the search, the scans
    trust : weight of the score against the assumed place of the ball; events of one edge repeat each other
    repeats : how many events tell the same, in the noise of the score
    """

    fastest_rps: float = 150.0
    sigma: float = 0.04
    floor: float = 1.5
    fewest: int = 40
    most: int = 3000
    search_most: int = 800
    scan_most: int = 600
    trust: float = 0.3
    repeats: float = 2.0


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


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """1 sigma of what is assumed of the ball: centre (one axis) and radius, px, drift of the centre, px/s."""

    centre_std_px: float
    radius_std_px: float
    drift_std_px_s: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Answer:
    """What the events say.

    spin_rps, covariance_rps2 : (3,) and (3, 3) float64, the best spin and its 1-sigma covariance; None if there is
        none at all
    doubts : (margin, reason) of every test, smallest margin first; a margin below 1 is a refusal
    events : number of events given
    reference_s, span_s : middle of the stretch and its length
    rivals_rps : (k, 3) float64, other peaks of the score
    offsets_px : (3,) float64, refined centre x, y and radius less the assumed ones
    contrast : score per event, less that with exchanged times
    """

    spin_rps: Floats | None
    covariance_rps2: Floats | None
    doubts: tuple[tuple[float, str], ...]
    events: int
    reference_s: float = 0.0
    span_s: float = 0.0
    rivals_rps: Floats = field(default_factory=lambda: np.empty((0, 3)))
    offsets_px: Floats = field(default_factory=lambda: np.zeros(3))
    contrast: float = 0.0

    @property
    def reason(self) -> str | None:
        """Why the answer is refused, None if it is trusted."""
        return self.doubts[0][1] if self.doubts and self.doubts[0][0] < 1.0 else None


def estimate_spin(
    events: LogoEvents, place: Place, settings: Settings, *, starts_rps: Floats | None = None, searching: bool = True
) -> Answer:
    """The spin that explains the events best.

    starts_rps : (k, 3) spins to try first
    searching : look everywhere, not only around the starts; always so without starts
    """
    n = len(events)
    if n < settings.fewest:
        return Answer(None, None, ((n / settings.fewest, f"{n} logo events, {settings.fewest} are needed"),), n)
    reference_s = 0.5 * float(events.t_s[0] + events.t_s[-1])
    span_s = float(events.t_s[-1] - events.t_s[0])
    events = replace(events, t_s=events.t_s - reference_s)
    lively = events
    if span_s > BURSTS_FROM_S:
        rows = np.flatnonzero(bursts(events.t_s, events.normals, events.layers))
        lively = events.at(rows) if rows.size >= settings.fewest else events
    spins = np.empty((0, 3)) if starts_rps is None else np.asarray(starts_rps, np.float64) * TURN
    if searching or not len(spins):
        grid, _ = search(
            lively.t_s, lively.normals, lively.layers, settings.fastest_rps, settings.floor, settings.search_most
        )
        found = narrowed(
            lively.t_s, lively.normals, lively.layers, grid, settings.floor, settings.search_most, 4
        )
        spins = _followed(lively, np.concatenate([spins, found]), settings)
    spins = _scanned(lively, spins, settings)
    return _refined(events, spins, place, settings, reference_s, span_s)


def _hill(events: LogoEvents, settings: Settings, sigma: float) -> Hill:
    """The score of all these events together; B from at least 600 exchanged ones."""
    n = len(events)
    part, others = whole(events.t_s, events.normals, events.layers, max(1, round(600 / n)))
    return Hill(
        part, others, events.facing, events.radius_px, sigma, settings.floor, NO_OFFSETS, 1.0, np.empty(n)
    )


def _followed(events: LogoEvents, spins: Floats, settings: Settings) -> Floats:
    """At most 3 spins (k, 3), best first, climbed over segments that grow until they hold everything."""
    events = events.thinned(settings.most // 2)
    span_s = float(events.t_s[-1] - events.t_s[0])
    hill = _hill(events, settings, 1.5 * settings.sigma)
    everything, turns = hill.part, FOLLOW_TURNS
    while True:
        last = turns * TURN > span_s * float(np.linalg.norm(spins[0]))
        tops = []
        for spin in spins:
            segment_s = turns * TURN / float(np.linalg.norm(spin))
            hill.part = everything if last else _in_segments(events, segment_s)
            tops.append(climb(hill, spin, NO_OFFSETS, 4 if last else 2))
        spins = np.array([top[0] for top in tops])[np.argsort([-top[2] for top in tops], kind="stable")]
        spins = spins[distinct(spins, 0.05, 3)]
        if last:
            return spins
        turns *= FOLLOW_RATIO


def _in_segments(events: LogoEvents, segment_s: float):  # type: ignore[no-untyped-def]
    n = len(events)
    return segmented(events.t_s, events.normals, events.layers, segment_s=segment_s, most=n, most_each=n)


def _scanned(events: LogoEvents, spins: Floats, settings: Settings) -> Floats:
    """At most 4 spins (k, 3), best first: tops of the score over everything, also far from the given ones.

    A logo that shows in short visits fixes the spin within a visit only roughly, and between visits only up to whole
    turns. So magnitudes are looked for along each given axis, and all axes at each of these magnitudes.
    """
    sigma = 2.0 * settings.sigma
    part = _hill(events.thinned(settings.scan_most), settings, sigma).part
    magnitudes: list[float] = []
    for spin in spins[:2]:
        magnitude = float(np.linalg.norm(spin))
        factors, values = comb(part, spin, sigma, settings.floor)
        for one in magnitude * np.concatenate([[1.0, 0.5, 2.0], factors[peaks_of(values)[:2]]]):
            if all(abs(math.log(one / other)) > math.log(factors[1] / factors[0]) for other in magnitudes):
                magnitudes.append(float(one))
    directions = spread_directions(SCAN_DIRECTIONS)
    fastest = settings.fastest_rps * TURN
    candidates = np.concatenate([*(directions * one for one in magnitudes if one <= fastest), spins])
    order = np.argsort(-scored(candidates, part, sigma, settings.floor), kind="stable")
    candidates = candidates[order][distinct(candidates[order], 0.1, 5)]
    hill = _hill(events.thinned(1000), settings, 1.5 * settings.sigma)
    tops = [climb(hill, spin, NO_OFFSETS, 3) for spin in candidates]
    tops += [(spin, NO_OFFSETS, hill.value(spin, NO_OFFSETS)) for spin in spins]
    spins = np.array([top[0] for top in tops])[np.argsort([-top[2] for top in tops], kind="stable")]
    return spins[distinct(spins, 0.03, 4)]


def comb(part, spin_rad_s: Floats, sigma: float, floor: float) -> tuple[Floats, Floats]:  # type: ignore[no-untyped-def]
    """Factors (m,) on the magnitude from COMB_LOW to COMB_HIGH, no wider than a kernel apart, and their scores (m,)."""
    spread_s = float(np.std(part.t_s))
    step = min(0.8 * sigma / (spread_s * float(np.linalg.norm(spin_rad_s)) + 1e-12), COMB_STEP)
    factors = np.exp(np.arange(math.log(COMB_LOW), math.log(COMB_HIGH), step))
    return factors, scored(spin_rad_s * factors[:, None], part, sigma, floor)


def peaks_of(values: Floats) -> Integers:
    """Rows of the local maxima of a curve, highest first."""
    padded = np.concatenate([[-np.inf], values, [-np.inf]])
    peaks = np.flatnonzero((values >= padded[:-2]) & (values >= padded[2:]))
    return peaks[np.argsort(-values[peaks], kind="stable")]


def _refined(
    events: LogoEvents, spins: Floats, place: Place, settings: Settings, reference_s: float, span_s: float
) -> Answer:
    spins, margins = _ranked(events, spins, settings)
    hill = _hill(events.thinned(settings.most), settings, settings.sigma)
    spin, _, _ = climb(hill, spins[0], NO_OFFSETS, 2)
    hill.prior_px = np.array([place.centre_std_px, place.centre_std_px, place.radius_std_px])
    hill.trust = settings.trust
    spin, offsets, _ = climb(hill, spin, np.zeros(3), 3)
    bend, noise = bend_and_noise(hill, spin, offsets, settings.repeats)
    covariance = spread_of_estimate(hill, spin, bend, noise) + _drift(events, place, span_s)
    own = hill.score(spin, offsets)
    hill.part = hill.part._replace(t_s=np.random.default_rng(0).permutation(hill.part.t_s))
    contrast = (own - hill.score(spin, offsets)) / hill.ratios.size
    covariance /= TURN**2
    spins, spin = spins / TURN, spin / TURN
    margin, rival = math.inf, None
    for other, t in zip(spins[1:], margins[1:], strict=True):
        near = np.linalg.norm(other - spins[0]) < NEAR * np.linalg.norm(spins[0])
        if near and t < 6:
            gap = other - spins[0]
            covariance += np.outer(gap, gap) / (1.0 + math.exp(min(t, 50.0)))
        elif not near and t < margin:
            margin, rival = t, other
    stats = (margin, rival, contrast, own)
    return Answer(spin, covariance, stats, len(events), reference_s, span_s, spins[1:], offsets, contrast)


def _ranked(events: LogoEvents, spins: Floats, settings: Settings) -> tuple[Floats, Floats]:
    """Distinct spins (k, 3) climbed with the final kernel, best first, and by how much the best beats each.

    The margin is in standard deviations of the difference of the two scores, over the events that tell them apart.
    """
    hill = _hill(events.thinned(1000), settings, settings.sigma)
    tops, shares = [], []
    for spin in spins:
        top, _, _ = climb(hill, spin, NO_OFFSETS, 3)
        hill.score(top, NO_OFFSETS)
        tops.append(top)
        shares.append(hill.ratios.copy())
    order = np.argsort([-float(share.sum()) for share in shares], kind="stable")
    order = order[distinct(np.array(tops)[order], 0.05, 4)]
    gaps = np.array([shares[order[0]] - shares[row] for row in order])
    margins = gaps.sum(axis=1) / np.sqrt(settings.repeats * np.sum(gaps**2, axis=1) + 1e-12)
    return np.array(tops)[order], margins


def _drift(events: LogoEvents, place: Place, span_s: float) -> Floats:
    """(3, 3) covariance, rad^2/s^2: a centre that drifts across the ball looks like a turn about an axis in the image."""
    facing = events.facing.mean(axis=1)
    facing /= np.linalg.norm(facing)
    # A track that is off by the centre's sigma, anew every TRACK_MEMORY_S, cannot drift faster than this on average.
    longest_s = max(span_s, 1e-6)
    drift_px_s = math.sqrt(12.0) * place.centre_std_px / longest_s / math.sqrt(max(longest_s / TRACK_MEMORY_S, 1.0))
    drift_px_s = min(place.drift_std_px_s, drift_px_s)
    rate = drift_px_s / float(np.mean(events.radius_px))
    spread: Floats = rate**2 * (np.eye(3) - np.outer(facing, facing))
    return spread


