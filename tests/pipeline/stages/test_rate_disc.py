"""Period of all events around the ball's disc: its kernel against its twin, and what outlines alone do to it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.kernels.rate import add_to_disc
from spinscope.pipeline.results import Packet
from spinscope.pipeline.stages import rate_disc
from spinscope.pipeline.stages.rate_disc import CELLS, DiscPattern
from spinscope.pipeline.stages.rate_period import PatternPeriod
from spinscope.pipeline.stages.track_result import BallTrack
from tests.reference.rate import naive_disc

BIN_US, RADIUS_PX, DURATION_US = 500, 18.0, 100_000


@settings(max_examples=30)
@given(seed=st.integers(0, 10_000), count=st.integers(0, 60), length=st.integers(1, 12))
def test_the_disc_is_its_twins(seed: int, count: int, length: int) -> None:
    random = np.random.default_rng(seed)
    t_us = np.sort(random.integers(0, 7000, count))
    x_px, y_px = (random.integers(60, 140, count) for _ in range(2))
    events = EventBatch(t_us, x_px.astype(np.uint16), y_px.astype(np.uint16), random.random(count) < 0.5)
    velocity = random.normal(0.0, 2000.0, 2)
    at_px = 100.0 + (t_us[:, None] - 3000.0) * 1e-6 * velocity
    pattern = np.zeros((2, length, CELLS, CELLS))
    add_to_disc(pattern, events.columns, 700.0, 500.0, 3000.0, (100.0, 100.0), tuple(velocity), 25.0)
    np.testing.assert_allclose(pattern, naive_disc(events, at_px, 700.0, 500.0, length, CELLS, 25.0), atol=1e-9)


def outline(
    *, logo_rps: float = 0.0, flicker_hz: float = 0.0, across_px_s: float = 0.0, seed: int = 0
) -> tuple[EventBatch, tuple[float, float]]:
    """A ball's outline, ON ahead and OFF behind, and a logo's visits at its rim; the velocity in px/s.

    The sides of the disc give bursts as they come to another row of pixels.
    """
    random = np.random.default_rng(seed)
    t_us = np.sort(random.uniform(0.0, DURATION_US, 60_000))
    angle = random.uniform(-np.pi, np.pi, t_us.size)
    kept = np.ones(t_us.size, np.bool_)
    if flicker_hz:
        kept &= random.random(t_us.size) < 0.5 + 0.4 * np.cos(2 * np.pi * flicker_hz * t_us * 1e-6 + angle)
    if across_px_s:
        sides = np.abs(np.sin(angle)) > 0.8
        kept &= ~sides | (random.random(t_us.size) < 0.5 + 0.5 * np.cos(2 * np.pi * across_px_s * t_us * 1e-6))
    t_us, angle = t_us[kept], angle[kept]
    x_px, y_px, on = RADIUS_PX * np.cos(angle), RADIUS_PX * np.sin(angle), np.cos(angle) > 0.0
    if logo_rps:
        visits = np.repeat(np.arange(0.003, DURATION_US * 1e-6, 1.0 / logo_rps), 120) * 1e6
        t_us = np.concatenate([t_us, visits + random.normal(0.0, 500.0, visits.size)])
        x_px = np.concatenate([x_px, random.normal(-4.0, 3.0, visits.size)])
        y_px = np.concatenate([y_px, random.normal(RADIUS_PX, 1.0, visits.size)])
        on = np.concatenate([on, np.zeros(visits.size, np.bool_)])
    velocity = (6000.0, across_px_s)
    order = np.argsort(t_us)
    t_us = np.clip(t_us[order], 0, DURATION_US - 1).astype(np.int64)
    x_px = 100.0 + velocity[0] * t_us * 1e-6 + x_px[order]
    y_px = 100.0 + velocity[1] * t_us * 1e-6 + y_px[order]
    return EventBatch(t_us, np.rint(x_px).astype(np.uint16), np.rint(y_px).astype(np.uint16), on[order]), velocity


def period(events: EventBatch, velocity: tuple[float, float], max_spin_rps: float = 165.0) -> PatternPeriod:
    """The period of the events, taken in ticks of 5 ms."""
    pattern = DiscPattern()
    for start_us in range(0, DURATION_US, 5000):
        end_us = start_us + 5000
        mean = np.array([*(100.0 + np.array(velocity) * end_us * 1e-6), *velocity, RADIUS_PX])
        ball = BallTrack(0, end_us, 0.0, mean, np.eye(5), True, 0, "found")
        packet = Packet(0, start_us, end_us, events.between(start_us, end_us))
        pattern.add(packet, ball, 0, end_us // BIN_US, BIN_US)
    return pattern.period(DURATION_US // BIN_US, BIN_US * 1e-6, max_spin_rps)


@pytest.mark.parametrize("logo_rps", [40.0, 63.0, 131.0])
def test_a_logo_among_the_outline_gives_the_magnitude(logo_rps: float) -> None:
    found = period(*outline(logo_rps=logo_rps))
    assert found.reason is None
    assert found.spins_rps[0] == pytest.approx(logo_rps, abs=2.5 * found.std_rps)


@pytest.mark.parametrize("seed", range(4))
def test_an_outline_without_a_logo_has_no_period(seed: int) -> None:
    assert period(*outline(seed=seed)).reason is not None


@pytest.mark.parametrize("across_px_s", [47.0, 90.0])
def test_pixels_that_the_outline_comes_to_are_no_period(monkeypatch: pytest.MonkeyPatch, across_px_s: float) -> None:
    """A burst whenever the disc's sides come to the next row looks like a logo at the rim, but for its phase."""
    events = outline(across_px_s=across_px_s)
    assert period(*events).reason is not None
    phases = rate_disc._nuisance
    monkeypatch.setattr(rate_disc, "_nuisance", lambda edges_px: phases(np.zeros_like(edges_px)))
    assert period(*events).reason is None


def test_two_visits_are_not_enough() -> None:
    assert "2.5 turns are needed" in (period(*outline(logo_rps=21.0)).reason or "")


@pytest.mark.parametrize("flicker_hz", [100.0, 120.0])
def test_lamps_that_flicker_are_no_period(flicker_hz: float) -> None:
    assert "lamps" in (period(*outline(flicker_hz=flicker_hz)).reason or "")


def test_a_shot_that_begins_right_before_a_ticks_end_has_no_period_yet() -> None:
    period = DiscPattern().period(0, BIN_US * 1e-6, 165.0)
    assert period.reason == "0 events on the ball, 40 are needed" and not period.spins_rps.size
