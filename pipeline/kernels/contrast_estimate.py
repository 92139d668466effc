"""From logo events to a spin: search, comb and axis scan, refinement with the ball's place, uncertainty, refusal."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .contrast_refine import NO_OFFSETS, Hill, bend_and_noise, climb, spread_of_estimate
from .contrast_search import TURN, bursts, distinct, narrowed, scored, search, spread_directions
from .contrast_window import segmented, whole

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """Knobs of `estimate_spin`; see the stage's parameters for those that people turn."""

    fastest_rps: float = 150.0
    sigma: float = 0.04
    floor: float = 3.0
    fewest: int = 40
    most: int = 3000
    search_most: int = 800
    scan_most: int = 600
    trust: float = 0.3
    repeats: float = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class LogoEvents:
    """The logo's events of one stretch of time.

    t_s : (n,) float64 rising, any origin; normals : (3, n) float64, outward unit normals; layers : (n,) int64,
    polarity 0 or 1; facing : (3, n) float64, unit vectors camera to ball; radius_px : (n,) float64
    """

    t_s: Floats
    normals: Floats
    layers: Integers
    facing: Floats
    radius_px: Floats

    def at(self, rows: Integers | NDArray[np.bool_]) -> LogoEvents:
        return LogoEvents(
            self.t_s[rows],
            np.ascontiguousarray(self.normals[:, rows]),
            self.layers[rows],
            np.ascontiguousarray(self.facing[:, rows]),
            self.radius_px[rows],
        )

    def thinned(self, most: int) -> LogoEvents:
        return self.at(np.arange(0, self.t_s.size, max(1, math.ceil(self.t_s.size / most - 0.5))))


@dataclass(frozen=True, slots=True, eq=False)
class Answer:
    """What `estimate_spin` found; times are relative to reference_s, spins in rps."""

    spin_rps: Floats | None
    covariance_rps2: Floats | None
    reason: str | None
    events: int
    reference_s: float
    span_s: float
    best_rps: Floats | None = None
    offsets_px: Floats = field(default_factory=lambda: np.zeros(3))
    rivals_rps: Floats = field(default_factory=lambda: np.empty((0, 3)))
    score_per_event: float = 0.0
    stats: dict[str, float] = field(default_factory=dict)


def estimate_spin(
    events: LogoEvents,
    settings: Settings,
    *,
    centre_std_px: float,
    radius_std_px: float,
    starts_rps: Floats | None = None,
    searching: bool = True,
) -> Answer:
    n = events.t_s.size
    if n < settings.fewest:
        return Answer(None, None, f"only {n} logo events, {settings.fewest} are needed", n, 0.0, 0.0)
    reference_s = 0.5 * float(events.t_s[0] + events.t_s[-1])
    span_s = float(events.t_s[-1] - events.t_s[0])
    events = LogoEvents(events.t_s - reference_s, events.normals, events.layers, events.facing, events.radius_px)
    some = events
    if span_s > 0.015:
        mask = bursts(events.t_s, events.normals, events.layers)
        if mask.sum() >= settings.fewest:
            some = events.at(mask)
    spins = np.empty((0, 3)) if starts_rps is None else starts_rps * TURN
    if searching or not len(spins):
        t, normals, layers = some.t_s, some.normals, some.layers
        grid, _ = search(t, normals, layers, settings.fastest_rps, settings.floor, settings.search_most)
        found = narrowed(t, normals, layers, grid, settings.floor, settings.search_most, 4)
        spins = np.concatenate([spins, found])
        spins = _followed(some, spins, settings)
    spins, values = _scanned(some, spins, settings)
    hill = _hill(events.thinned(settings.most), settings, settings.sigma)
    spin, _, _ = climb(hill, spins[0], NO_OFFSETS, 3)
    hill.prior_px = np.array([centre_std_px, centre_std_px, radius_std_px])
    bend, noise = bend_and_noise(hill, spin, np.zeros(3), settings.repeats)
    lam = np.linalg.eigvals(np.linalg.solve(noise, bend)).real
    hill.trust = settings.trust if settings.trust else float(np.clip(np.median(lam), 0.01, 1.0))
    spin, offsets, _ = climb(hill, spin, np.zeros(3), 3)
    bend, noise = bend_and_noise(hill, spin, offsets, settings.repeats)
    covariance = spread_of_estimate(hill, spin, bend, noise)
    stats = _stats(hill, spin, offsets, spins, settings)
    stats["lam"] = hill.trust
    return Answer(
        spin / TURN,
        covariance / TURN**2,
        None,
        n,
        reference_s,
        span_s,
        spin / TURN,
        offsets,
        spins / TURN,
        stats["score"] / stats["used"],
        stats,
    )


def _hill(events: LogoEvents, settings: Settings, sigma: float) -> Hill:
    n = events.t_s.size
    part, others = whole(events.t_s, events.normals, events.layers, max(1, round(600 / n)))
    return Hill(
        part, others, events.facing, events.radius_px, sigma, settings.floor, NO_OFFSETS, 1.0, np.empty(n)
    )


def _followed(events: LogoEvents, spins: Floats, settings: Settings) -> Floats:
    """Spins climbed over segments that grow until they hold everything."""
    events = events.thinned(1500)
    span_s = float(events.t_s[-1] - events.t_s[0])
    turns = 1.6
    while True:
        climbed, values = [], []
        last = turns * TURN > span_s * np.linalg.norm(spins[0])
        for spin in spins:
            hill = _hill(events, settings, 1.5 * settings.sigma)
            if not last:
                hill.part = segmented(events.t_s, events.normals, events.layers, segment_s=turns * TURN / float(np.linalg.norm(spin)), most=10**9, most_each=10**9)
            spin, _, value = climb(hill, spin, NO_OFFSETS, 4 if last else 2)
            climbed.append(spin)
            values.append(value)
        spins = np.array(climbed)[np.argsort(-np.array(values), kind="stable")]
        spins = spins[distinct(spins, 0.05, 3)]
        if last:
            return spins
        turns *= 2.5


def _scanned(events: LogoEvents, spins: Floats, settings: Settings) -> tuple[Floats, Floats]:
    sigma = 2.0 * settings.sigma
    part = _hill(events.thinned(settings.scan_most), settings, sigma).part
    spread_s = float(np.std(part.t_s))
    magnitudes: list[float] = []
    for spin in spins[:3]:
        magnitude = float(np.linalg.norm(spin))
        step = min(0.8 * sigma / spread_s / magnitude, 0.1)
        factors = np.exp(np.arange(math.log(0.45), math.log(2.2), step))
        values = scored(spin * factors[:, None], part, sigma, settings.floor)
        padded = np.concatenate([[-np.inf], values, [-np.inf]])
        peaks = np.flatnonzero((values >= padded[:-2]) & (values >= padded[2:]))
        peaks = peaks[np.argsort(-values[peaks], kind="stable")][:3]
        for one in (magnitude, *(magnitude * factors[peaks])):
            if all(abs(math.log(one / other)) > step for other in magnitudes):
                magnitudes.append(one)
    directions = spread_directions(150)
    candidates = np.concatenate([*(directions * one for one in magnitudes[:5]), spins])
    values = scored(candidates, part, sigma, settings.floor)
    order = np.argsort(-values, kind="stable")
    candidates = candidates[order][distinct(candidates[order], 0.1, 5)]
    hill = _hill(events.thinned(1000), settings, 1.5 * settings.sigma)
    tops = [climb(hill, spin, NO_OFFSETS, 3) for spin in candidates]
    tops += [(spin, NO_OFFSETS, hill.value(spin, NO_OFFSETS)) for spin in spins]
    values = np.array([top[2] for top in tops])
    order = np.argsort(-values, kind="stable")
    spins = np.array([top[0] for top in tops])[order]
    rows = distinct(spins, 0.03, 4)
    return spins[rows], values[order][rows]


def _stats(hill: Hill, spin: Floats, offsets: Floats, rivals: Floats, settings: Settings) -> dict[str, float]:
    own = hill.score(spin, offsets)
    shares = hill.ratios.copy()
    rng = np.random.default_rng(0)
    nulls = []
    for _ in range(4):
        part = hill.part
        shuffled = part._replace(t_s=rng.permutation(part.t_s))
        hill.part = shuffled
        nulls.append(hill.score(spin, offsets))
        hill.part = part
    result = {"score": own, "null": float(np.mean(nulls)), "null_std": float(np.std(nulls)), "used": float(shares.size)}
    result["rival_t"] = 99.0
    for rival in rivals[1:]:
        gap = np.linalg.norm(rival - spin)
        if gap < 0.1 * np.linalg.norm(spin):
            continue
        top, off, _ = climb(hill, rival, np.zeros(3), 1)
        other = hill.score(top, off)
        d = shares - hill.ratios
        t = (own - other) / math.sqrt(float(np.sum(d * d)) + 1e-9)
        if t < result["rival_t"]:
            result["rival_t"] = t
            result["rival_gap"] = float(np.linalg.norm(top - spin) / np.linalg.norm(spin))
    return result
