"""Evidence of a flight in the track: what is doubted, and that flights are not."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spinscope.pipeline.results import Circle
from spinscope.pipeline.stages.track_result import BallTrack
from spinscope.pipeline.track_evidence import LARGEST_SCATTER, NO_EVIDENCE, TrackEvidence

RADIUS_PX = 16.0
# 40 px across the image in 5 ms: 10 m/s. Gravity, drag and lift together: 2 g.
FLIGHT = np.array([[300.0, 500.0], [8000.0, -1000.0], [-3000.0, 9000.0]])


def evidence_of(centres_px: Iterable[tuple[float, ...] | None], tick_us: float = 5000.0) -> TrackEvidence:
    """Evidence of circles (x, y, perhaps radius) measured, or not, tick by tick."""
    evidence, t_us = NO_EVIDENCE, 1e6
    for centre in centres_px:
        circle = None
        if centre is not None:
            x, y, radius = map(float, (*centre, RADIUS_PX)[:3])
            circle = Circle(x, y, radius, 1.0)
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


def test_what_the_tracker_doubts_now_is_doubted() -> None:
    *places, (x, y) = flight(21)
    circle = Circle(x, y, RADIUS_PX, 1.0)
    last = BallTrack(0, 1.1e6, 40.0, np.ones(5), np.eye(5), circle, 0, "found", doubt="it may roll")
    evidence = evidence_of(places).with_tick(last)
    assert evidence.doubt == "it may roll"
    assert evidence.with_tick(replace(last, measured=None)).doubt == "it may roll"
    assert evidence.with_tick(replace(last, doubt=None)).doubt is None


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
    walk = 300 + np.cumsum(np.random.default_rng(1).normal(scale=12.0, size=(20, 2)), axis=0)
    doubt = evidence_of([(x, y) for x, y in walk]).doubt
    assert doubt is not None
    assert "no flight" in doubt


@pytest.mark.parametrize("tick_us", [500, 1000, 2000, 5000])
def test_a_dot_on_a_turning_disc_is_no_flight(tick_us: int) -> None:
    """19.4 rps, 107 px from the middle: 13,000 px/s, as fast as a ball of this size that flies at 16 m/s."""
    angles = 2 * np.pi * 19.4 * np.arange(0.0, 0.08, tick_us * 1e-6)
    doubt = evidence_of([(500 + 107 * np.cos(a), 300 + 107 * np.sin(a)) for a in angles], tick_us).doubt
    assert doubt is not None and "no flight" in doubt


@given(
    st.floats(0.6, 4.0),
    st.tuples(*[st.floats(-25.0, 25.0)] * 3),
    st.tuples(*[st.floats(-30.0, 30.0)] * 3),
)
def test_no_flight_is_taken_for_an_erratic_track_whatever_the_camera_sees_of_it(
    distance_m: float, velocity_m_s: tuple[float, ...], acceleration_m_s2: tuple[float, ...]
) -> None:
    """Perspective bends the path of a ball that comes near the camera: it is no parabola in the image."""
    s = np.arange(-12, 13)[:, None] * 0.005
    places = [0.0, 0.0, distance_m] + np.array(velocity_m_s) * s + 0.5 * np.array(acceleration_m_s2) * s**2
    places = places[places[:, 2] > 0.3]
    circles = 1646.0 * np.column_stack([places[:, :2], np.full(len(places), 0.02)]) / places[:, 2:]
    assert evidence_of(circles[np.abs(circles).max(axis=1) < 640]).scatter < LARGEST_SCATTER


def test_a_stated_ball_needs_no_evidence() -> None:
    still = BallTrack(0, 5000.0, 40.0, np.array([320.0, 180.0, 0.0, 0.0, 16.0]), np.eye(5), None, 0, "start")
    assert NO_EVIDENCE.with_tick(still).doubt is None
    assert NO_EVIDENCE.doubt is not None


@given(st.floats(0.05, 5.0), st.integers(0, 1000))
def test_scatter_is_that_of_the_noise_on_the_circles(noise_px: float, seed: int) -> None:
    s = np.arange(400)[:, None] * 0.005
    noise = noise_px * np.random.default_rng(seed).normal(size=(400, 2))
    centres = FLIGHT[0] + FLIGHT[1] * s + 0.5 * FLIGHT[2] * s**2 + noise
    # 800 third differences, of which neighbours are alike: 15 % is five of their sigmas.
    assert evidence_of([(x, y) for x, y in centres]).scatter * RADIUS_PX == pytest.approx(noise_px, rel=0.15)


def test_a_gap_and_a_shorter_last_tick_are_no_scatter() -> None:
    places: list[tuple[float, float] | None] = [*flight(20, noise_px=0.0)]
    places[7:9] = [None, None]
    evidence = evidence_of(places)
    assert evidence.differences == 4 + 8
    assert evidence.scatter == pytest.approx(0.0, abs=1e-9)
    last = BallTrack(0, 1e6 + 97_000, 40.0, np.ones(5), np.eye(5), Circle(900.0, 0.0, 16.0, 1.0), 0, "found")
    assert evidence.with_tick(last).scatter == pytest.approx(0.0, abs=1e-9)
