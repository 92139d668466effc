"""Estimate of the spin from logo events: grid search, alias scan, refinement with the ball's place, and uncertainty."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...kernels.arrays import Floats, Integers
from .events import (
    BallUncertainty,
    ContrastEstimate,
    ContrastSettings,
    SphereEvents,
    offset_slopes,
    segmented_window,
    whole_window,
)
from .score import TURN, Objective, burst_mask, scores, scores_near, spin_axes
from .search import NEAR, NO_OFFSETS, LocalModel, distinct, grid_search, maximise, maximise_each, spread_directions

# Magnitudes from 0.45 to 2.2 of a candidate's hold every confusion of n turns with n + 1 (or n - 1), down to half and
# double; a step is never coarser than a tenth, and never finer than makes SCAN_MAGNITUDES of them.
SCAN_LOW, SCAN_HIGH, SCAN_STEP, SCAN_MAGNITUDES = 0.45, 2.2, 0.1, 300
# 20 degrees apart: visits of the logo one turn apart fix the axis only within each visit, that is roughly.
SCAN_DIRECTIONS = 100
ALIASES = 6  # magnitudes at which all axes are looked at
GROW_FROM_TURNS, GROW_RATIO = 1.6, 2.5
LEAST_PERMUTED = 300
# A local maximum of the coarse scores below this part of the best one is no rival.
RIVAL = 0.5
# Newton's method ends within this of a maximum, relative to the spin; farther maxima are others.
SAME = 0.03
# The kernel blurs the logo's two sides differently as it comes and goes; the last refinement has a finer one. From
# 0.04 to 0.025 rad the axis gained a quarter, less than that brought nothing but noise.
FINE = 0.625
# What the model lacks (the logo's blurred edges look different from each side) leaves errors that more events do not
# lessen, as parts of the kernel: of the axis, and of the turn over the stretch's spread in time. From the errors of
# two simulators' balls with exact tracks.
AXIS_FLOOR, TURN_FLOOR = 0.3, 0.036
# Where the camera looks at the surface at less than this cosine (60 degrees, 2.2 px inside a 16.5 px ball's outline) a
# blurred edge is that much farther off on the ball. The refinement does without such events where so many of all are
# left; else the axis is stated as less certain, at most by MOST_OBLIQUE.
RIM_COSINE, OFF_RIM_SHARE, MOST_OBLIQUE = 0.5, 0.5, 5.0
TRACK_MEMORY_S = 0.01  # over which a track's errors hang together: two steps of the Kalman filter
# Longer stretches may hold steady shading for the search to be rid of, and bursts to tell it by.
BURSTS_FROM_S = 0.015
# Below this part of a turn there are no other visits of the logo to be confused with; the grid search saw all of it.
SCAN_FROM_TURNS = 0.7
# Refining leaves so much of the offsets' error: 0.43, 0.37 and 0.52 of 0.5 px on 87 spinners, less where the spin
# depends on it.
REFINED = 0.65
MAP_MAGNITUDES, MAP_DIRECTIONS = 41, 100


class Stretch(NamedTuple):
    """Number of events in a stretch of time, its middle and its length."""

    events: int
    reference_s: float
    span_s: float


def estimate_spin(
    events: SphereEvents,
    ball: BallUncertainty,
    settings: ContrastSettings,
    *,
    starts_rps: Floats | None = None,
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
        found = grid_search(moving.columns, settings.fastest_rps, settings.floor, settings.search_events, 6)
        spins = maximise_over_growing_segments(moving, np.concatenate([spins, found]), settings)
    seen_again = stretch.span_s * float(np.linalg.norm(spins[0])) > SCAN_FROM_TURNS * TURN
    if scanning and (not searching or seen_again):
        spins = alias_scan(moving, spins, settings)
    spins, margins = _ranked(events, spins, settings)
    some = _off_rim(events, settings).thinned(settings.refine_events)
    spins[0], _, _, _ = maximise(_objective(some, settings, settings.sigma_rad), spins[0], NO_OFFSETS, 1)
    return _refined(some, spins, margins, ball, settings, stretch, np.zeros(3), 4)


def follow_spin(
    events: SphereEvents, ball: BallUncertainty, settings: ContrastSettings, before: ContrastEstimate
) -> ContrastEstimate:
    """Refine an estimate on an earlier, somewhat shorter stretch with a part of these events; its rivals stay."""
    assert before.spin_rps is not None
    events, stretch = _centred(events)
    some = _off_rim(events, settings).thinned(settings.follow_events)
    spins = np.concatenate([before.spin_rps[None], before.rivals_rps]) * TURN
    margins = np.concatenate([[0.0], before.margins])
    return _refined(some, spins, margins, ball, settings, stretch, before.offsets_px, 1)


def _centred(events: SphereEvents) -> tuple[SphereEvents, Stretch]:
    """The events with times from the middle of their stretch."""
    stretch = Stretch(len(events), 0.5 * float(events.t_s[0] + events.t_s[-1]), float(events.t_s[-1] - events.t_s[0]))
    return replace(events, t_s=events.t_s - stretch.reference_s), stretch


def _off_rim(events: SphereEvents, settings: ContrastSettings) -> SphereEvents:
    """The events away from the rim where these are enough; a pixel there is several on the ball."""
    rows = np.flatnonzero(_view_cosine(events) > RIM_COSINE)
    return events.at(rows) if rows.size >= max(OFF_RIM_SHARE * len(events), settings.min_events) else events


def _view_cosine(events: SphereEvents) -> Floats:
    """Cosine (n,) of the angle at which the camera looks at the surface: 1 in the middle of the disc, 0 at its rim."""
    cosine: Floats = -np.sum(events.normals * events.facing, axis=0)
    return cosine


def _without_static_events(events: SphereEvents, span_s: float, settings: ContrastSettings) -> SphereEvents:
    """The events without what stands still on the disc, where that can be told and leaves enough."""
    if span_s < BURSTS_FROM_S:
        return events
    rows = np.flatnonzero(burst_mask(events))
    return events.at(rows) if rows.size >= settings.min_events else events


def _objective(events: SphereEvents, settings: ContrastSettings, sigma_rad: float) -> Objective:
    """The score of all these events together; B from at least LEAST_PERMUTED permuted ones."""
    window = whole_window(events.columns, max(1, round(LEAST_PERMUTED / len(events))))
    return Objective(window, np.empty((3, 3, 0)), sigma_rad, settings.floor, NO_OFFSETS, 1.0)


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


def alias_scan(events: SphereEvents, spins_rad_s: Floats, settings: ContrastSettings) -> Floats:
    """At most 6 spins (k, 3), best first: maxima of the score over everything, also far from the given ones.

    A logo that shows in short visits fixes the spin within a visit only roughly, and between visits only up to whole
    turns. So magnitudes are looked for along each given axis, and all axes at each of these magnitudes.
    """
    sigma_rad, some = 2.0 * settings.sigma_rad, events.thinned(settings.scan_events)
    window, spread_s = _objective(some, settings, sigma_rad).window, float(np.std(some.t_s))
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
    candidates = np.concatenate([*(directions * one for one in magnitudes[:ALIASES]), spins_rad_s])
    order = np.argsort(-scores(candidates, window, sigma_rad, settings.floor), kind="stable")
    candidates = candidates[order][distinct(candidates[order], 0.1, 6, 2)]
    candidates = np.concatenate([spins_rad_s, candidates])
    candidates = candidates[distinct(candidates, SAME, len(candidates), 0)]
    maxima, values, _ = maximise_each(_objective(some, settings, 1.5 * settings.sigma_rad), candidates, 3)
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


def _ranked(events: SphereEvents, spins_rad_s: Floats, settings: ContrastSettings) -> tuple[Floats, Floats]:
    """Distinct spins (k, 3) maximised with the final kernel, best first, and by how much the best beats each (k,).

    The margin is in standard deviations of the difference of the two scores, over the events that tell them apart.
    """
    objective = _objective(events.thinned(settings.follow_events), settings, settings.sigma_rad)
    maxima, values, shares = maximise_each(objective, spins_rad_s, 3)
    order = np.argsort(-values, kind="stable")
    order = order[distinct(maxima[order], SAME, 6, 2)]
    gaps = shares[order[0]] - shares[order]
    margins = gaps.sum(axis=1) / np.sqrt(settings.repeats * np.sum(gaps**2, axis=1) + 1e-12)
    return maxima[order], margins


def _refined(
    events: SphereEvents,
    spins_rad_s: Floats,
    margins: Floats,
    ball: BallUncertainty,
    settings: ContrastSettings,
    stretch: Stretch,
    offsets_px: Floats,
    iterations: int,
) -> ContrastEstimate:
    """The estimate around spins_rad_s[0], with the ball's offsets; `events` are thinned from those of the stretch."""
    objective = _objective(events, settings, FINE * settings.sigma_rad)._replace(
        slopes=offset_slopes(events.normals, events.facing, events.radius_px),
        prior_px=np.array([ball.centre_std_px, ball.centre_std_px, ball.radius_std_px]),
        weight=settings.score_weight,
    )
    spin, offsets, sharp, model = maximise(objective, spins_rad_s[0], offsets_px, iterations)
    covariance = _spin_covariance(objective, model, settings.repeats * len(events) / stretch.events)
    covariance += _drift_covariance(events, ball, stretch.span_s)
    along = np.outer(spin, spin) / (spin @ spin)
    oblique = max(1.0, RIM_COSINE / max(float(_view_cosine(events).mean()), RIM_COSINE / MOST_OBLIQUE))
    covariance += (AXIS_FLOOR * settings.sigma_rad * oblique) ** 2 * (spin @ spin) * (np.eye(3) - along)
    covariance += (TURN_FLOOR * settings.sigma_rad / max(float(np.std(events.t_s)), 1e-5)) ** 2 * along
    window = objective.window
    shuffled = window.events._replace(t_s=np.random.default_rng(0).permutation(events.t_s))
    chance = objective._replace(window=window._replace(events=shuffled))
    by_chance = scores_near(np.empty((1, len(events))), chance, spin, offsets, np.zeros((1, 6)))
    contrast = (sharp - float(by_chance[0])) / len(events)
    rivals, margins = spins_rad_s[1:], margins[1:]
    gaps = rivals - spins_rad_s[0]
    near = np.linalg.norm(gaps, axis=1) < NEAR * np.linalg.norm(spins_rad_s[0])
    for gap, margin in zip(gaps[near], margins[near], strict=True):
        covariance += np.outer(gap, gap) / (1.0 + math.exp(min(float(margin), 50.0)))
    spin_rps, rivals_rps = spin / TURN, rivals[~near] / TURN
    return ContrastEstimate(
        spin_rps, covariance / TURN**2, *stretch, rivals_rps, margins[~near], offsets, contrast, events.patch_rad
    )


def _spin_covariance(objective: Objective, model: LocalModel, repeats: float) -> Floats:
    """Covariance (3, 3) of the spin, rad^2/s^2, at the maximum: sandwich estimator plus the ball's place.

    An event's part of the gradient is twice the slope of its own share (it also is the neighbour of its neighbours):
    M = 4 repeats sum d_i d_i', with `repeats` events of one edge that tell the same. With A the score's curvature the
    events' noise gives A_ww^-1 M_ww A_ww^-1 (w: the spin). A ball that is d off its assumed place moves the maximum
    by -A_ww^-1 A_wp d; d has nearly the prior's covariance (REFINED), although offsets were refined with the spin:
    refining improves the spin, but the refined offsets are themselves hardly nearer to the truth.
    """
    inverse = np.linalg.inv(model.curvature[:3, :3])
    by_place = inverse @ model.curvature[:3, 3:] * (REFINED * objective.prior_px / model.steps[3:])
    whole = 4.0 * repeats * inverse @ model.scatter[:3, :3] @ inverse + by_place @ by_place.T
    back = spin_axes(model.spin_rad_s).T * model.steps[:3]
    covariance: Floats = back @ whole @ back.T
    return covariance


def _drift_covariance(events: SphereEvents, ball: BallUncertainty, span_s: float) -> Floats:
    """Covariance (3, 3), rad^2/s^2: a centre that drifts over the ball looks like a turn about an axis in the image.

    A track that is off by its sigma, anew every TRACK_MEMORY_S, looks like a ramp of sqrt(12) sigma over the stretch,
    less so the more often its errors change.
    """
    facing = events.facing.mean(axis=1)
    facing /= np.linalg.norm(facing)
    changes = max(span_s / TRACK_MEMORY_S, 1.0)
    ramp_px_s = math.sqrt(12.0 / changes) * ball.track_std_px / max(span_s, 1e-6)
    rate = min(ball.drift_std_px_s, ramp_px_s) / float(np.mean(events.radius_px))
    spread: Floats = rate**2 * (np.eye(3) - np.outer(facing, facing))
    return spread


class ScoreMap(NamedTuple):
    """Score per event around an estimate, for people to look at.

    Attributes
    ----------
    magnitudes_rps, magnitude_scores : (m,) float64
        Along the estimate's axis.
    directions, direction_scores : (d, 3) and (d,) float64
        Over all axes at the estimate's magnitude.
    """

    magnitudes_rps: Floats
    magnitude_scores: Floats
    directions: Floats
    direction_scores: Floats

    @classmethod
    def empty(cls) -> ScoreMap:
        """Nothing to show."""
        return cls(np.empty(0), np.empty(0), np.empty((0, 3)), np.empty(0))


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
