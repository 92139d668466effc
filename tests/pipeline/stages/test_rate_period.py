"""Period of the logo's pattern: its kernels against their twins, and what it finds on balls that turn."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spinscope.pipeline.kernels.rate import (
    add_to_pattern,
    deviations,
    highest_near,
    highest_peaks,
    lag_sums,
    over_multiples,
)
from spinscope.pipeline.stages.logo import TurningEvents
from spinscope.pipeline.stages.rate_period import CELLS, FEWEST_SIGMAS, LogoPattern, PatternPeriod, _judged
from tests.reference.contrast import dotted_ball
from tests.reference.rate import (
    naive_deviations,
    naive_highest_peaks,
    naive_lag_sums,
    naive_over_multiples,
    naive_pattern,
)

BIN_US = 500


@settings(max_examples=30)
@given(seed=st.integers(0, 10_000), count=st.integers(0, 40), length=st.integers(1, 12))
def test_the_pattern_is_its_twins(seed: int, count: int, length: int) -> None:
    random = np.random.default_rng(seed)
    bins, on = random.integers(-2, length + 2, count), random.random(count) < 0.5
    normals = random.standard_normal((count, 3))
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
    pattern = np.zeros((2, length, CELLS, CELLS))
    add_to_pattern(pattern, bins, normals, on)
    np.testing.assert_allclose(pattern, naive_pattern(bins, normals, on, length, CELLS), atol=1e-12)


@settings(max_examples=30)
@given(seed=st.integers(0, 10_000), n=st.integers(1, 40), cells=st.integers(1, 9), period=st.floats(1.0, 50.0))
def test_lag_sums_and_their_totals_are_their_twins(seed: int, n: int, cells: int, period: float) -> None:
    rows = np.random.default_rng(seed).standard_normal((n, cells))
    found, (sums, bounds, mean_square) = lag_sums(rows), naive_lag_sums(rows)
    np.testing.assert_allclose(found[0], sums, atol=1e-9)
    np.testing.assert_allclose(found[1], bounds, atol=1e-9)
    assert found[2] == pytest.approx(mean_square, abs=1e-9)
    totals = over_multiples(sums, bounds, np.array([period]))[:, 0]
    np.testing.assert_allclose(totals, naive_over_multiples(sums, bounds, period), atol=1e-9)


@settings(max_examples=30)
@given(seed=st.integers(0, 10_000), n=st.integers(1, 12), cells=st.integers(1, 9))
def test_the_deviations_are_their_twins(seed: int, n: int, cells: int) -> None:
    pattern = np.random.default_rng(seed).poisson(0.5, (n, cells)).astype(np.float64)
    np.testing.assert_allclose(deviations(pattern), naive_deviations(pattern), atol=1e-12)


@settings(max_examples=50)
@given(seed=st.integers(0, 10_000), n=st.integers(1, 80), most=st.integers(1, 5))
def test_the_highest_peaks_are_their_twins(seed: int, n: int, most: int) -> None:
    """Heights of few values, so that neighbours and peaks tie."""
    random = np.random.default_rng(seed)
    places, heights = 3.0 * 1.02 ** np.arange(n), random.integers(0, 6, n).astype(np.float64)
    peaks = highest_peaks(places, heights, most, 0.05)
    assert peaks.tolist() == naive_highest_peaks(places, heights, most, 0.05)
    others = random.integers(0, 6, n).astype(np.float64)
    for peak, found in zip(peaks, highest_near(places, others, peaks, 0.05), strict=True):
        near = np.abs(np.log(places / places[peak])) < 0.05
        assert found == np.argmax(np.where(near, others, -np.inf))


def turning(spin_rps: np.ndarray, *, duration_s: float = 0.1, stamps: int = 1, events: int = 1500) -> PatternPeriod:
    """The period of a ball with dots, seen where it faces the camera; two stamps are the same half a turn apart."""
    ball = dotted_ball(spin_rps, duration_s=duration_s, events=events)
    normals, on = ball.normals.T.copy(), ball.polarity == 1
    t_us = np.round(ball.t_s * 1e6).astype(np.int64)
    t_us -= t_us[0]
    if stamps == 2:
        again = t_us + round(0.5e6 / np.linalg.norm(spin_rps))
        order = np.argsort(np.concatenate([t_us, again]), kind="stable")
        t_us, normals, on = np.concatenate([t_us, again])[order], np.tile(normals, (2, 1))[order], np.tile(on, 2)[order]
    return period_of(t_us, normals, on, duration_s)


def period_of(t_us: np.ndarray, normals: np.ndarray, on: np.ndarray, duration_s: float) -> PatternPeriod:
    bins = round(duration_s * 1e6) // BIN_US
    pattern = LogoPattern()
    pattern.add(TurningEvents(t_us, on, normals, np.zeros(t_us.size), np.zeros(t_us.size)), 0, bins, BIN_US)
    return pattern.period(bins, BIN_US * 1e-6, 165.0)


@pytest.mark.parametrize("spin", [(40.0, -25.0, 20.0), (0.0, 0.0, 90.0), (-15.0, 8.0, 2.0), (140.0, 30.0, 0.0)])
def test_a_pattern_that_comes_back_gives_the_magnitude(spin: tuple[float, float, float]) -> None:
    found = turning(np.array(spin))
    magnitude = float(np.linalg.norm(spin))
    assert found.reason is None and found.log_likelihoods[0] == 0.0
    assert found.spins_rps[0] == pytest.approx(magnitude, rel=0.01)
    assert abs(found.spins_rps[0] - magnitude) < 2.5 * found.std_rps


def test_half_and_double_periods_are_seen_and_less_likely() -> None:
    found = turning(np.array([50.0, 0.0, 0.0]))
    for factor in (0.5, 2.0):
        at = np.flatnonzero(np.abs(found.spins_rps / (factor * 50.0) - 1.0) < 0.02)
        assert at.size == 1 and found.log_likelihoods[at[0]] < -2.0


def test_two_equal_stamps_on_opposite_sides_look_like_twice_the_spin() -> None:
    """Nothing in the pattern tells them apart: what comes back twice a turn is found to."""
    assert turning(np.array([40.0, 0.0, 0.0]), stamps=2).spins_rps[0] == pytest.approx(80.0, rel=0.01)


def test_what_does_not_come_back_is_refused() -> None:
    random = np.random.default_rng(3)
    ball = dotted_ball(np.array([50.0, 0.0, 0.0]), duration_s=0.1, events=1500)
    t_us = np.sort(random.integers(0, 100_000, 1500))
    normals = ball.normals.T[random.permutation(1500)].copy()
    noise = period_of(t_us, normals, ball.polarity == 1, 0.1)
    assert noise.reason is not None and ("sigma" in noise.reason or "comes back" in noise.reason)
    short = turning(np.array([50.0, 0.0, 0.0]), duration_s=0.006)
    assert short.reason is not None and not short.spins_rps.size
    assert np.isnan(short.std_rps)


def test_a_few_events_have_no_period() -> None:
    assert "39 logo events, 40 are needed" in str(turning(np.array([50.0, 0.0, 0.0]), events=39).reason)


@pytest.mark.parametrize(
    ("double", "height", "reason"),
    [
        (0.75, 20.0, None),
        (0.85, 20.0, "comes back with 40.0 and with 80.0 rps"),
        (0.5, 5.2, None),
        (0.5, 4.8, "comes back by 4.8 sigma"),
        (0.0, 0.0, "does not come back"),
    ],
)
def test_the_reason_for_refusal_names_what_remains(double: float, height: float, reason: str | None) -> None:
    magnitudes = 10.0 * 2.0 ** (np.arange(401) / 100)  # 40 and 80 are among them

    curve = sum(
        high * np.exp(-0.5 * (np.log(magnitudes / at) / 0.01) ** 2)
        for at, high in ((40.0, height), (80.0, double * height))
    )
    found = _judged(magnitudes, curve, curve, 0.01, FEWEST_SIGMAS).reason
    assert found is None if reason is None else reason in str(found)


def test_adding_tick_by_tick_is_adding_at_once() -> None:
    random = np.random.default_rng(0)
    t_us = np.sort(random.integers(0, 20_000, 300))
    normals = random.standard_normal((300, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    events = TurningEvents(t_us, random.random(300) < 0.5, normals, np.zeros(300), np.zeros(300))
    whole, parts = LogoPattern(), LogoPattern()
    whole.add(events, 0, 40, BIN_US)
    for end_us in (3300, 9000, 20_000):
        rows = np.flatnonzero((t_us >= {3300: 0, 9000: 3300, 20_000: 9000}[end_us]) & (t_us < end_us))
        parts.add(events[rows], 0, -(-end_us // BIN_US), BIN_US)
    np.testing.assert_array_equal(whole.cells, parts.cells)
    whole.forget(30)
    np.testing.assert_array_equal(whole.cells, parts.cells[:, 30:])
