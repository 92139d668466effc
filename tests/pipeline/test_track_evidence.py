"""Evidence of a flight in the track: what is doubted, and that flights are not."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spinscope.pipeline.results import Circle
from spinscope.pipeline.stages.track import BallTrack
from spinscope.pipeline.track_evidence import NO_EVIDENCE, TrackEvidence

RADIUS_PX = 16.0
# 40 px across the image in 5 ms: 10 m/s. Gravity, drag and lift together: 2 g.
FLIGHT = np.array([[300.0, 500.0], [8000.0, -1000.0], [-3000.0, 9000.0]])


def evidence_of(centres_px: Iterable[tuple[float, float] | None], tick_us: float = 5000.0) -> TrackEvidence:
    """Evidence of circles measured (or not) tick by tick."""
    evidence, t_us = NO_EVIDENCE, 1e6
    for centre in centres_px:
        circle = None if centre is None else Circle(float(centre[0]), float(centre[1]), RADIUS_PX, 1.0)
        mean = np.array([0.0, 0.0, 8000.0, 0.0, RADIUS_PX])
        evidence = evidence.with_tick(BallTrack(0, t_us, 40.0, mean, np.eye(5), circle, 0, "found"))
        t_us += tick_us
    return evidence


def flight(count: int, noise_px: float = 0.1, tick_s: float = 0.005) -> list[tuple[float, float]]:
    """Centres on a parabola."""
    s = np.arange(count)[:, None] * tick_s
    places = FLIGHT[0] + FLIGHT[1] * s + 0.5 * FLIGHT[2] * s**2
    return [(x, y) for x, y in places + noise_px * np.random.default_rng(0).normal(size=places.shape)]


@pytest.mark.parametrize(("count", "tick_us"), [(3, 5000), (20, 5000), (11, 1000), (100, 1000), (3, 10_000)])
def test_a_flight_is_not_doubted(count: int, tick_us: int) -> None:
    assert evidence_of(flight(count, tick_s=tick_us * 1e-6), tick_us).doubt is None


def test_a_flight_seen_through_vibration_and_from_behind_an_arm_is_not_doubted() -> None:
    centres: list[tuple[float, float] | None] = [*flight(20, noise_px=1.4)]
    centres[8:12] = [None] * 4
    assert evidence_of(centres).doubt is None


@pytest.mark.parametrize(
    ("pattern", "tick_us"), [("x", 5000), ("xx", 5000), ("x..........", 5000), ("xx.xx.xx.xx", 5000), ("xxxxxx", 1000)]
)
def test_few_measured_ticks_in_a_row_are_too_little(pattern: str, tick_us: int) -> None:
    places = flight(len(pattern), tick_s=tick_us * 1e-6)
    doubt = evidence_of([p if seen == "x" else None for p, seen in zip(places, pattern, strict=True)], tick_us).doubt
    assert doubt is not None
    assert "too little" in doubt and "--fixed-ball auto" in doubt


def test_rows_are_counted_from_their_first_tick_to_their_last() -> None:
    """Two in a row, a gap, and three in a row: the gap does not count, the second row does."""
    places = flight(6)
    assert evidence_of([*places[:2], None, *places[3:5]]).doubt is not None
    assert evidence_of([*places[:2], None, *places[3:6]]).doubt is None
    assert evidence_of([*places[:3], None, None, None]).doubt is None


def test_a_ball_that_stays_in_its_place_is_none_in_flight_and_the_remedy_is_named() -> None:
    wobbling = [(320.0 + np.sin(n), 180.0 + np.cos(n)) for n in range(20)]
    doubt = evidence_of(wobbling).doubt
    assert doubt is not None
    assert "--fixed-ball 320 181 16" in doubt


def test_an_erratic_track_is_no_flight() -> None:
    walk = np.cumsum(np.random.default_rng(1).normal(scale=12.0, size=(20, 2)), axis=0) + 300
    doubt = evidence_of([(x, y) for x, y in walk]).doubt
    assert doubt is not None
    assert "no flight" in doubt


def test_a_bounce_taken_for_one_flight_is_no_flight() -> None:
    """10 m/s across and 3 m/s down, then up, seen from the side."""
    s = np.arange(20) * 0.005
    assert "no flight" in str(evidence_of([(8000 * t + 50, 300 - 2400 * abs(t - 0.05)) for t in s]).doubt)


def test_a_stated_ball_needs_no_evidence() -> None:
    still = BallTrack(0, 5000.0, 40.0, np.array([320.0, 180.0, 0.0, 0.0, 16.0]), np.eye(5), None, 0, "start")
    assert NO_EVIDENCE.with_tick(still).doubt is None
    assert NO_EVIDENCE.doubt is not None


@given(st.lists(st.tuples(st.floats(0, 1280), st.floats(0, 720)), min_size=5, max_size=30))
def test_scatter_is_that_of_numpys_parabola(centres: list[tuple[float, float]]) -> None:
    s = np.arange(len(centres)) * 0.005
    places = np.array(centres)
    rest = places - np.polynomial.polynomial.polyval(s, np.polynomial.polynomial.polyfit(s, places, 2)).T
    assert evidence_of(centres).scatter_px == pytest.approx(np.sqrt((rest**2).sum() / len(s)), abs=1e-3)
