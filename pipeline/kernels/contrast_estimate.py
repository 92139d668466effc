"""From logo events to a spin: search, comb and axis scan, refinement with the ball's place, and uncertainty."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .contrast_events import Answer, LogoEvents, Place, Settings
from .contrast_place import place_slopes
from .contrast_refine import NO_OFFSETS, climb, scores_near, spread_of_estimate
from .contrast_scan import followed, hill_of, ranked, scanned
from .contrast_search import NEAR, TURN, bursts, narrowed, search

Floats = NDArray[np.float64]

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
RIM, DEEP_SHARE, MOST_OBLIQUE = 0.5, 0.5, 5.0
TRACK_MEMORY_S = 0.01  # over which a track's errors hang together: two steps of the Kalman filter
# Longer stretches may hold steady shading for the search to be rid of, and bursts to tell it by.
BURSTS_FROM_S = 0.015
# Below this part of a turn there are no other visits of the logo to be confused with; `search` has seen all of it.
SCAN_FROM_TURNS = 0.7


def estimate_spin(
    events: LogoEvents,
    place: Place,
    settings: Settings,
    *,
    starts_rps: Floats | None = None,
    searching: bool = True,
    scanning: bool = True,
) -> Answer:
    """The spin that explains the events best.

    starts_rps : (k, 3) spins to try first
    searching : look everywhere, not only around the starts and their aliases; always so without starts
    scanning : look at the starts' aliases; without it and without a search at the starts only
    """
    if len(events) < settings.fewest:
        return Answer(None, None, len(events))
    events, reference_s, span_s = _centred(events)
    lively = _lively(events, span_s, settings)
    spins = np.empty((0, 3)) if starts_rps is None else np.asarray(starts_rps, np.float64).reshape(-1, 3) * TURN
    searching = searching or not len(spins)
    if searching:
        parts, floor, most = (lively.t_s, lively.normals, lively.layers), settings.floor, settings.search_most
        grid, _ = search(*parts, settings.fastest_rps, floor, most)
        spins = np.concatenate([spins, narrowed(*parts, grid, floor, most, 6)])
        spins = followed(lively, spins, settings)
    seen_again = span_s * float(np.linalg.norm(spins[0])) > SCAN_FROM_TURNS * TURN
    if scanning and (not searching or seen_again):
        spins = scanned(lively, spins, settings)
    spins, margins = ranked(events, spins, settings)
    some = _deep(events, settings).thinned(settings.most)
    spins[0], _, _, _ = climb(hill_of(some, settings, settings.sigma), spins[0], NO_OFFSETS, 1)
    stretch = (len(events), reference_s, span_s)
    return _refined(some, spins, margins, place, settings, stretch, np.zeros(3), 4)


def follow_spin(events: LogoEvents, place: Place, settings: Settings, before: Answer) -> Answer:
    """The same from an answer on an earlier, somewhat shorter stretch: climbed from it on a part of the events.

    Rivals are taken over as they were.
    """
    assert before.spin_rps is not None
    events, reference_s, span_s = _centred(events)
    some = _deep(events, settings).thinned(settings.quick_most)
    spins = np.concatenate([before.spin_rps[None], before.rivals_rps]) * TURN
    margins = np.concatenate([[0.0], before.margins])
    stretch = (len(events), reference_s, span_s)
    return _refined(some, spins, margins, place, settings, stretch, before.offsets_px, 1)


def _centred(events: LogoEvents) -> tuple[LogoEvents, float, float]:
    """The events with times from the middle of the stretch; that middle, and the stretch's length."""
    reference_s = 0.5 * float(events.t_s[0] + events.t_s[-1])
    return replace(events, t_s=events.t_s - reference_s), reference_s, float(events.t_s[-1] - events.t_s[0])


def _deep(events: LogoEvents, settings: Settings) -> LogoEvents:
    """The events away from the rim where these are enough; a pixel there is several on the ball."""
    rows = np.flatnonzero(_faced(events) > RIM)
    return events.at(rows) if rows.size >= max(DEEP_SHARE * len(events), settings.fewest) else events


def _faced(events: LogoEvents) -> Floats:
    """(n,) cosine of the angle at which the camera looks at the surface: 1 in the middle of the disc, 0 at its rim."""
    faced: Floats = -np.sum(events.normals * events.facing, axis=0)
    return faced


def _lively(events: LogoEvents, span_s: float, settings: Settings) -> LogoEvents:
    """The events without what stands still on the disc, where that can be told and leaves enough."""
    if span_s < BURSTS_FROM_S:
        return events
    rows = np.flatnonzero(bursts(events.t_s, events.normals, events.layers))
    return events.at(rows) if rows.size >= settings.fewest else events


def _refined(
    events: LogoEvents,
    spins: Floats,
    margins: Floats,
    place: Place,
    settings: Settings,
    stretch: tuple[int, float, float],
    offsets_px: Floats,
    iterations: int,
) -> Answer:
    """The answer around spins[0], with the ball's offsets; `events` of the hill are thinned from stretch[0]."""
    given, reference_s, span_s = stretch
    hill = hill_of(events, settings, FINE * settings.sigma)._replace(
        slopes_px=place_slopes(events.normals, events.facing, events.radius_px),
        prior_px=np.array([place.centre_std_px, place.centre_std_px, place.radius_std_px]),
        trust=settings.trust,
    )
    spin, offsets, sharp, seen = climb(hill, spins[0], offsets_px, iterations)
    covariance = spread_of_estimate(hill, seen, settings.repeats * len(events) / given)
    covariance += _drift(events, place, span_s)
    along = np.outer(spin, spin) / (spin @ spin)
    oblique = max(1.0, RIM / max(float(_faced(events).mean()), RIM / MOST_OBLIQUE))
    covariance += (AXIS_FLOOR * settings.sigma * oblique) ** 2 * (spin @ spin) * (np.eye(3) - along)
    covariance += (TURN_FLOOR * settings.sigma / max(float(np.std(events.t_s)), 1e-5)) ** 2 * along
    chance = hill._replace(part=hill.part._replace(t_s=np.random.default_rng(0).permutation(hill.part.t_s)))
    by_chance = scores_near(np.empty((1, len(events))), chance, spin, offsets, np.zeros((1, 6)))
    contrast = (sharp - float(by_chance[0])) / len(events)
    gaps = spins[1:] - spins[0]
    near = np.linalg.norm(gaps, axis=1) < NEAR * np.linalg.norm(spins[0])
    for gap, margin in zip(gaps[near], margins[1:][near], strict=True):
        covariance += np.outer(gap, gap) / (1.0 + math.exp(min(float(margin), 50.0)))
    return Answer(
        spin / TURN,
        covariance / TURN**2,
        given,
        reference_s,
        span_s,
        spins[1:][~near] / TURN,
        margins[1:][~near],
        offsets,
        contrast,
        events.patch_rad,
    )


def _drift(events: LogoEvents, place: Place, span_s: float) -> Floats:
    """(3, 3) covariance, rad^2/s^2: a centre that drifts over the ball looks like a turn about an axis in the image.

    A track that is off by its sigma, anew every TRACK_MEMORY_S, looks like a ramp of sqrt(12) sigma over the stretch,
    less so the more often its errors change.
    """
    facing = events.facing.mean(axis=1)
    facing /= np.linalg.norm(facing)
    changes = max(span_s / TRACK_MEMORY_S, 1.0)
    ramp_px_s = math.sqrt(12.0 / changes) * place.track_std_px / max(span_s, 1e-6)
    rate = min(place.drift_std_px_s, ramp_px_s) / float(np.mean(events.radius_px))
    spread: Floats = rate**2 * (np.eye(3) - np.outer(facing, facing))
    return spread
