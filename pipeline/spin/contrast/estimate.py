"""Estimate of the spin from logo events: grid search, alias scan, refinement with the ball's place, and uncertainty."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ...kernels.arrays import Floats, Integers
from ...kernels.sphere import spread_directions
from .events import (
    LOG_ODDS_PER_SIGMA,
    BallUncertainty,
    ContrastEstimate,
    ContrastSettings,
    ScoreMap,
    SphereEvents,
    offset_slopes,
    segmented_window,
    whole_window,
)
from .score import TURN, Objective, burst_mask, scores, scores_near
from .search import (
    NEAR,
    NO_OFFSETS,
    RIM_COSINE,
    Stretch,
    distinct,
    even_span_s,
    grid_search,
    linked_share,
    local_model,
    maximise,
    maximise_each,
    spin_covariance,
    view_cosine,
    without_strays,
)

# Magnitudes from 0.45 to 2.2 of a candidate's hold every confusion of n turns with n + 1 (or n - 1), down to half and
# double; a step is never coarser than a tenth, and never finer than makes SCAN_MAGNITUDES of them.
SCAN_LOW, SCAN_HIGH, SCAN_STEP, SCAN_MAGNITUDES = 0.45, 2.2, 0.1, 300
# 20 degrees apart: visits of the logo one turn apart fix the axis only within each visit, that is roughly.
SCAN_DIRECTIONS = 100
ALIASES = 6  # magnitudes at which all axes are looked at
GROW_FROM_TURNS, GROW_RATIO = 1.6, 2.5
LEAST_PERMUTED = 300
STARTS_KEPT = 2
# A local maximum of the coarse scores below this part of the best one is no rival.
RIVAL = 0.5
# Newton's method ends within this of a maximum, relative to the spin; farther maxima are others.
SAME = 0.03
# The kernel blurs the logo's two sides differently as it comes and goes; the last refinement has a finer one. From
# 0.04 to 0.025 rad the axis gained a quarter, less than that brought nothing but noise.
FINE = 0.625
# The refinement does without events nearer to the rim than `RIM_COSINE` where so many of all are left.
OFF_RIM_SHARE = 0.5
# A flight's margins are of its track's changing error, too, which a ball in place has not. Likeliest log odds of one
# sigma between spins far apart, with their interval (1 sigma): 1.7 (1.55 to 1.9) of 378 estimates of 178 flights of all
# kinds, above 4 of 138 of mounted balls.
IN_PLACE = 1.5
# A near rival with smaller odds lies outside any interval of two sigma, and does not widen it.
NEGLIGIBLE = 0.01
# Longer stretches may hold steady shading for the search to be rid of, and bursts to tell it by.
BURSTS_FROM_S = 0.015
# Events of one edge at one moment come in disorder, by the pixels' latencies, and lie together the better the slower
# the spin, which is no reason to prefer it: spins are compared by events farther apart in time than that alone. See
# "Short visits" in docs/contrast.md.
APART_S = 0.5e-3
NO_RHYTHMS = np.empty(0)
# Below this part of a turn there are no other visits of the logo to be confused with; the grid search saw all of it.
SCAN_FROM_TURNS = 0.7
MAP_MAGNITUDES, MAP_DIRECTIONS = 41, 100
# The outer thirds of the stretch: a contact between them leaves each with events of one spin.
PARTS = 3
# Parts of one flight have similar contrast: in 116 of 122 flights of our simulator the lower is over half the higher.
LEFT = 0.5


def estimate_spin(
    events: SphereEvents,
    ball: BallUncertainty,
    settings: ContrastSettings,
    *,
    starts_rps: Floats | None = None,
    rhythms_rps: Floats = NO_RHYTHMS,
    searching: bool = True,
    scanning: bool = True,
) -> ContrastEstimate:
    """Estimate the spin that explains the events best.

    Parameters
    ----------
    events : SphereEvents
        The logo's events of one stretch of time.
    starts_rps : (k, 3) float64, optional
        Spins to try first.
    rhythms_rps : (k,) float64
        Magnitudes at which the scan looks at all axes too: those by which the logo's pattern comes back.
    searching : bool
        Search over all spins, not only around the starts and their aliases; always so without starts.
    scanning : bool
        Look at the starts' aliases; without it and without a search at the starts only.

    Returns
    -------
    ContrastEstimate
        Without a spin where there are too few events.
    """
    if len(events) < settings.min_events:
        return ContrastEstimate(None, None, len(events))
    events, stretch = _centred(events)
    moving = _without_static_events(events, stretch.span_s, settings)
    spins = np.empty((0, 3)) if starts_rps is None else np.asarray(starts_rps, np.float64).reshape(-1, 3) * TURN
    searching = searching or not len(spins)
    if searching:
        spins = _searched(events, moving, spins, settings)
    seen_again = stretch.span_s * float(np.linalg.norm(spins[0])) > SCAN_FROM_TURNS * TURN
    if scanning and (not searching or seen_again):
        # The scan's few events may rank what is known already below its aliases.
        spins = np.concatenate([alias_scan(moving, spins, settings, rhythms_rps), spins[:STARTS_KEPT]])
    spins, margins = _ranked(events, spins, settings, ball)
    some = _off_rim(events, settings).thinned(settings.refine_events)
    spins[0], _, _, _ = maximise(_objective(some, settings, settings.sigma_rad), spins[0], NO_OFFSETS, 1)
    answer = _refined(some, spins[0], ball, settings, stretch, np.zeros(3), 4)
    return _with_alternatives(answer, some, spins, margins, ball, settings, stretch)


def follow_spin(
    events: SphereEvents, ball: BallUncertainty, settings: ContrastSettings, before: ContrastEstimate
) -> ContrastEstimate:
    """Refine an estimate on an earlier, somewhat shorter stretch with a part of these events; its rivals stay."""
    assert before.spin_rps is not None
    events, stretch = _centred(events)
    some = _off_rim(events, settings).thinned(settings.follow_events)
    answer = _refined(some, before.spin_rps * TURN, ball, settings, stretch, before.offsets_px, 1)
    assert answer.covariance_rps2 is not None
    return replace(
        answer,
        covariance_rps2=answer.covariance_rps2 + before.kept_rps2,
        kept_rps2=before.kept_rps2,
        rivals_rps=before.rivals_rps,
        rival_covariances_rps2=before.rival_covariances_rps2,
        margins=before.margins,
    )


def refine_spin(
    events: SphereEvents, ball: BallUncertainty, settings: ContrastSettings, spin_rps: Floats
) -> ContrastEstimate:
    """Estimate from a part of these events around a spin that may be several kernels off; no rivals are looked for."""
    events, stretch = _centred(events)
    some = events.thinned(settings.follow_events)
    spins = maximise_over_growing_segments(some, spin_rps[None] * TURN, settings)
    return _refined(_off_rim(some, settings), spins[0], ball, settings, stretch, np.zeros(3), 2)


def estimates_of_ends(
    events: SphereEvents,
    balls: tuple[BallUncertainty, BallUncertainty],
    settings: ContrastSettings,
    whole: ContrastEstimate,
) -> tuple[ContrastEstimate, ContrastEstimate] | None:
    """Estimates from the first and from the last third of the stretch; None where either has too few events.

    Each is looked for near the spin of the whole, and among all spins where it has much less contrast than the other.
    `balls` is the uncertainty of the ball's place in either: right after a contact the track is at its worst.
    """
    assert whole.spin_rps is not None
    edges_s = np.linspace(events.t_s[0], events.t_s[-1], PARTS + 1)
    first, last = events.at(events.t_s <= edges_s[1]), events.at(events.t_s >= edges_s[-2])
    if min(len(first), len(last)) < settings.min_events:
        return None
    ends = tuple(zip((first, last), balls, strict=True))
    near = [refine_spin(part, ball, settings, whole.spin_rps) for part, ball in ends]
    least = LEFT * max(one.contrast for one in near)
    early, late = (
        one if one.contrast >= least else estimate_spin(part, ball, settings, starts_rps=whole.spin_rps[None])
        for one, (part, ball) in zip(near, ends, strict=True)
    )
    return early, late


def _centred(events: SphereEvents) -> tuple[SphereEvents, Stretch]:
    """The events with times from the middle of their stretch."""
    stretch = Stretch(len(events), 0.5 * float(events.t_s[0] + events.t_s[-1]), float(events.t_s[-1] - events.t_s[0]))
    return replace(events, t_s=events.t_s - stretch.reference_s), stretch


def _off_rim(events: SphereEvents, settings: ContrastSettings) -> SphereEvents:
    """The events away from the rim where these are enough; a pixel there is several on the ball."""
    rows = np.flatnonzero(view_cosine(events) > RIM_COSINE)
    return events.at(rows) if rows.size >= max(OFF_RIM_SHARE * len(events), settings.min_events) else events


def _without_static_events(events: SphereEvents, span_s: float, settings: ContrastSettings) -> SphereEvents:
    """The events without what stands still on the disc, where that can be told and leaves enough."""
    if span_s < BURSTS_FROM_S:
        return events
    rows = np.flatnonzero(burst_mask(events))
    return events.at(rows) if rows.size >= settings.min_events else events


def _objective(events: SphereEvents, settings: ContrastSettings, sigma_rad: float, apart_s: float = 0.0) -> Objective:
    """The score of all these events together; B from at least LEAST_PERMUTED permuted ones."""
    window = whole_window(events.columns, max(1, round(LEAST_PERMUTED / len(events))), apart_s)
    return Objective(window, np.empty((3, 3, 0)), sigma_rad, settings.floor, NO_OFFSETS, 1.0)


def _searched(events: SphereEvents, moving: SphereEvents, starts_rad_s: Floats, settings: ContrastSettings) -> Floats:
    """Spins (k, 3) found among all spins and from the starts, those best for all events first.

    Few events that coincide by chance look as if they stood still, so the search is made without those and with them.
    """
    found = []
    for part in (moving,) if moving is events else (moving, events):
        grid = grid_search(part.columns, settings.fastest_rps, settings.floor, settings.search_events, 6)
        found.append(maximise_over_growing_segments(part, np.concatenate([starts_rad_s, grid]), settings))
    if len(found) == 1:
        return found[0]
    spins = np.concatenate(found)
    whole = _objective(events.thinned(settings.refine_events // 2), settings, 1.5 * settings.sigma_rad)
    best_first: Floats = spins[np.argsort(-scores(spins, whole.window, whole.sigma_rad, whole.floor), kind="stable")]
    return best_first


def maximise_over_growing_segments(events: SphereEvents, spins_rad_s: Floats, settings: ContrastSettings) -> Floats:
    """At most 3 spins (k, 3), best first, maximised over segments that grow until they hold everything."""
    events = events.thinned(settings.refine_events // 2)
    span_s, n = float(events.t_s[-1] - events.t_s[0]), len(events)
    whole = _objective(events, settings, 1.5 * settings.sigma_rad)
    spins, turns = spins_rad_s, GROW_FROM_TURNS
    while True:
        last = turns * TURN > span_s * float(np.linalg.norm(spins[0]))
        maxima, values, objective = np.empty_like(spins), np.empty(len(spins)), whole
        for k, spin in enumerate(spins):
            if not last:
                segment_s = turns * TURN / float(np.linalg.norm(spin))
                objective = whole._replace(window=segmented_window(events.columns, segment_s, n, n))
            maxima[k], _, values[k], _ = maximise(objective, spin, NO_OFFSETS, 4 if last else 2)
        spins = maxima[np.argsort(-values, kind="stable")]
        spins = spins[distinct(spins, NEAR, 3, 0)]
        if last:
            return spins
        turns *= GROW_RATIO


def alias_scan(
    events: SphereEvents,
    spins_rad_s: Floats,
    settings: ContrastSettings,
    rhythms_rps: Floats = NO_RHYTHMS,
) -> Floats:
    """At most 6 spins (k, 3), best first: maxima of the score over everything, also far from the given ones.

    A logo that shows in short visits fixes the spin within a visit only roughly, and between visits only up to whole
    turns. So magnitudes are looked for along each given axis, and all axes at each of these magnitudes and of the
    rhythm's: a search may miss the axis that belongs to these.
    """
    sigma_rad, some = 2.0 * settings.sigma_rad, events.thinned(settings.scan_events)
    window, spread_s = _objective(some, settings, sigma_rad, APART_S).window, float(np.std(some.t_s))
    magnitudes: list[float] = []
    for spin in spins_rad_s[:2]:
        width = math.log(SCAN_HIGH / SCAN_LOW)
        step = 0.8 * sigma_rad / (spread_s * float(np.linalg.norm(spin)) + 1e-12)  # closer than a kernel
        step = min(max(step, width / SCAN_MAGNITUDES), SCAN_STEP)
        factors = SCAN_LOW * np.exp(step * np.arange(math.ceil(width / step)))
        along = scores(spin * factors[:, None], window, sigma_rad, settings.floor)
        near = math.log(factors[1] / factors[0])
        best = factors[local_maxima(along)[:2]]
        for one in np.linalg.norm(spin) * np.concatenate([[1.0, 0.5, 2.0], best]):
            if one <= settings.fastest_rps * TURN and all(abs(math.log(one / other)) > near for other in magnitudes):
                magnitudes.append(float(one))
    directions = spread_directions(SCAN_DIRECTIONS)
    looked_at = [*magnitudes[:ALIASES], *(rhythms_rps * TURN)]
    candidates = np.concatenate([*(directions * one for one in looked_at), spins_rad_s])
    order = np.argsort(-scores(candidates, window, sigma_rad, settings.floor), kind="stable")
    candidates = candidates[order][distinct(candidates[order], 0.1, 6, 2)]
    candidates = np.concatenate([spins_rad_s, candidates])
    candidates = candidates[distinct(candidates, SAME, len(candidates), 0)]
    objective = _objective(some, settings, 1.5 * settings.sigma_rad, APART_S)
    maxima, values, _ = maximise_each(objective, candidates, 3)
    order = np.argsort(-values, kind="stable")
    highest = float(values.max())  # negative where nothing turns with any of them: then the best alone stays
    spins = maxima[order[values[order] >= min(RIVAL * highest, highest)]]
    rivals: Floats = spins[distinct(spins, SAME, 6, 2)]
    return rivals


def local_maxima(values: Floats) -> Integers:
    """Indices of the local maxima of a curve, highest first."""
    padded = np.concatenate([[-np.inf], values, [-np.inf]])
    peaks = np.flatnonzero((values >= padded[:-2]) & (values >= padded[2:]))
    return peaks[np.argsort(-values[peaks], kind="stable")]


def _ranked(
    events: SphereEvents, spins_rad_s: Floats, settings: ContrastSettings, ball: BallUncertainty
) -> tuple[Floats, Floats]:
    """Distinct spins (k, 3) maximised with the final kernel, best first, and by how much the best beats each (k,).

    The margin is in standard deviations of the difference of the two scores, over the events that tell them apart; for
    a ball in place these count more (IN_PLACE).
    """
    objective = _objective(events.thinned(settings.follow_events), settings, settings.sigma_rad, APART_S)
    maxima, values, shares = maximise_each(objective, spins_rad_s, 3)
    order = np.argsort(-values, kind="stable")
    order = order[distinct(maxima[order], SAME, 6, 2)]
    gaps = shares[order[0]] - shares[order]
    margins = gaps.sum(axis=1) / np.sqrt(settings.repeats * np.sum(gaps**2, axis=1) + 1e-12)
    return maxima[order], margins if ball.is_flying else IN_PLACE * margins


def _with_place(events: SphereEvents, ball: BallUncertainty, settings: ContrastSettings) -> Objective:
    """The score as a function of the spin and the ball's offsets, with the finest kernel."""
    return _objective(events, settings, FINE * settings.sigma_rad)._replace(
        slopes=offset_slopes(events.normals, events.facing, events.radius_px),
        prior_px=np.array([ball.centre_std_px, ball.centre_std_px, ball.radius_std_px]),
        weight=settings.score_weight,
    )


def _refined(
    events: SphereEvents,
    spin_rad_s: Floats,
    ball: BallUncertainty,
    settings: ContrastSettings,
    stretch: Stretch,
    offsets_px: Floats,
    iterations: int,
) -> ContrastEstimate:
    """The estimate around a spin, with the ball's offsets; `events` are thinned from those of the stretch."""
    objective = _with_place(events, ball, settings)
    spin, offsets, sharp, model = maximise(objective, spin_rad_s, offsets_px, iterations)
    steady = without_strays(events)
    return ContrastEstimate(
        spin / TURN,
        spin_covariance(objective, model, events, ball, settings, stretch, even_span_s(steady)) / TURN**2,
        *stretch,
        offsets_px=offsets,
        contrast=_contrast(objective, spin, offsets, sharp),
        patch_rad=events.patch_rad,
        linked_share=linked_share(steady, spin, settings),
    )


def _contrast(objective: Objective, spin_rad_s: Floats, offsets_px: Floats, score: float) -> float:
    """A spin's score per event less that of permuted times."""
    events = objective.window.events
    shuffled = events._replace(t_s=np.random.default_rng(0).permutation(events.t_s))
    chance = objective._replace(window=objective.window._replace(events=shuffled))
    by_chance = scores_near(np.empty((1, events.t_s.size)), chance, spin_rad_s, offsets_px, np.zeros((1, 6)))
    return (score - float(by_chance[0])) / events.t_s.size


def _with_alternatives(
    answer: ContrastEstimate,
    events: SphereEvents,
    spins_rad_s: Floats,
    margins: Floats,
    ball: BallUncertainty,
    settings: ContrastSettings,
    stretch: Stretch,
) -> ContrastEstimate:
    """The estimate with its rivals and their covariances, its own with what near ones and the polarities add.

    A near rival adds its distance, by the odds that it is the right one, where these are not NEGLIGIBLE: along the
    answer the difference of the magnitudes, across it that of the axes.
    """
    assert answer.spin_rps is not None and answer.covariance_rps2 is not None
    kept = _polarity_covariance(answer, events, ball, settings)
    others_rps = spins_rad_s[1:] / TURN
    near = np.linalg.norm(others_rps - answer.spin_rps, axis=1) < NEAR * np.linalg.norm(answer.spin_rps)
    odds = np.exp(-LOG_ODDS_PER_SIGMA * margins[1:])
    for other_rps, one in zip(others_rps[near], odds[near], strict=True):
        if one > NEGLIGIBLE:
            gap_rps = _distance(answer.spin_rps, other_rps)
            kept += np.outer(gap_rps, gap_rps) * one / (1.0 + one)
    rivals, some = spins_rad_s[1:][~near], events.thinned(settings.rival_events)
    objective, covariances = _with_place(some, ball, settings), np.empty((len(rivals), 3, 3))
    even_s = even_span_s(without_strays(some))
    for k, rival in enumerate(rivals):
        model = local_model(objective, rival, np.zeros(3), 1.0)
        covariances[k] = spin_covariance(objective, model, some, ball, settings, stretch, even_s) / TURN**2
    return replace(
        answer,
        covariance_rps2=answer.covariance_rps2 + kept,
        kept_rps2=kept,
        rivals_rps=rivals / TURN,
        rival_covariances_rps2=covariances,
        margins=margins[1:][~near],
    )


def _distance(spin_rps: Floats, other_rps: Floats) -> Floats:
    """Vector (3,) from a spin to another: along it the difference of the magnitudes, across it that of the axes.

    The straight line between two spins of one magnitude has a part along each of them, which is no error of it.
    """
    magnitude_rps = float(np.linalg.norm(spin_rps))
    axis = spin_rps / magnitude_rps
    along_rps = float(other_rps @ axis)
    across = other_rps - along_rps * axis
    across_rps = float(np.linalg.norm(across))
    arc_rps = magnitude_rps * math.atan2(across_rps, along_rps)
    distance: Floats = (np.linalg.norm(other_rps) - magnitude_rps) * axis + arc_rps * across / max(across_rps, 1e-12)
    return distance


def _polarity_covariance(
    answer: ContrastEstimate, events: SphereEvents, ball: BallUncertainty, settings: ContrastSettings
) -> Floats:
    """Covariance (3, 3), rps^2, that the polarities' own maxima show beyond the stated one; zero where one is missing.

    With shares a and b of the contrast and their distance d, a b d d' has the expectation of the covariance of their
    weighted mean, whatever they do not have in common: latencies, and the edges that each of them sees. What exceeds
    the expectation under the stated covariance C, a b d' C^-1 d = 3, is added (method of moments, as in DerSimonian
    and Laird, "Meta-analysis in clinical trials", 1986).
    """
    assert answer.spin_rps is not None and answer.covariance_rps2 is not None
    found: list[Floats] = []
    gains: list[float] = []
    for polarity in (0, 1):
        own = events.at(events.polarity == polarity)
        if len(own) < settings.min_events:
            return np.zeros((3, 3))
        objective = _with_place(own, ball, settings)
        spin, offsets, sharp, _ = maximise(objective, answer.spin_rps * TURN, answer.offsets_px, 2)
        found.append(spin / TURN)
        gains.append(max(_contrast(objective, spin, offsets, sharp), 0.0) * len(own))
    shares = gains[0] * gains[1] / max(gains[0] + gains[1], 1e-9) ** 2
    apart = found[0] - found[1]
    excess = shares * float(apart @ np.linalg.solve(answer.covariance_rps2, apart))
    return shares * max(1.0 - 3.0 / max(excess, 1e-9), 0.0) * np.outer(apart, apart)


def score_map(events: SphereEvents, estimate: ContrastEstimate | None, settings: ContrastSettings) -> ScoreMap:
    """Magnitudes up to twice the estimate's, the estimate's own among them; empty without an estimate."""
    if estimate is None or estimate.spin_rps is None or not np.any(estimate.spin_rps):
        return ScoreMap.empty()
    sigma_rad, some = 2.0 * settings.sigma_rad, events.thinned(settings.scan_events)
    window = _objective(replace(some, t_s=some.t_s - estimate.reference_s), settings, sigma_rad).window
    magnitude = float(np.linalg.norm(estimate.spin_rps))
    axis = estimate.spin_rps / magnitude
    magnitudes = magnitude * np.linspace(0.0, 2.0, MAP_MAGNITUDES)
    directions = np.concatenate([axis[None], spread_directions(MAP_DIRECTIONS)])
    along = scores(axis * magnitudes[:, None] * TURN, window, sigma_rad, settings.floor)
    around = scores(directions * magnitude * TURN, window, sigma_rad, settings.floor)
    return ScoreMap(magnitudes, along / len(some), directions, around / len(some))
