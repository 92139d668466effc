"""Likelihood of spins by when the logo was seen: equal to the slow twin, and what it must tell."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spinscope.pipeline.kernels.rotation import rotations
from spinscope.pipeline.kernels.sightings import sighting_log_likelihoods
from spinscope.pipeline.kernels.sphere import spread_directions
from tests.reference.sightings import sighting_log_likelihood

PLACES = spread_directions(60)
TIMES_S = np.arange(-0.06, 0.06, 0.002)
VIEWS = np.tile([0.0, 0.0, -1.0], (TIMES_S.size, 1))


def log_likelihoods(spins_rps: np.ndarray, seen: np.ndarray) -> np.ndarray:
    values = np.empty(len(spins_rps))
    spins_rad_s = 2 * np.pi * np.asarray(spins_rps, np.float64)
    sighting_log_likelihoods(values, spins_rad_s, TIMES_S, VIEWS, seen, PLACES, 0.4)
    return values


def seen_of(spin_rps: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Whether a logo at this place stands nearer than 60 degrees to the line of sight."""
    turns = rotations(2 * np.pi * TIMES_S[:, None] * np.asarray(spin_rps, np.float64))
    return np.asarray((turns @ place) @ VIEWS[0] > 0.5)


@given(st.integers(0, 2**32 - 1))
def test_it_equals_its_slow_twin(seed: int) -> None:
    random = np.random.default_rng(seed)
    spins = random.normal(0.0, 200.0, (2, 3))
    times_s, seen = np.sort(random.uniform(-0.1, 0.1, 7)), random.random(7) < 0.5
    views = random.standard_normal((7, 3))
    views /= np.linalg.norm(views, axis=1)[:, None]
    places, weight = spread_directions(5), float(random.uniform(0.1, 1.0))
    values = np.empty(2)
    sighting_log_likelihoods(values, spins, times_s, views, seen, places, weight)
    slow = [sighting_log_likelihood(spin, times_s, views, seen, places, weight) for spin in spins]
    np.testing.assert_allclose(values, slow, rtol=1e-9)


@pytest.mark.parametrize("factor", [0.5, 2.0, 0.7, 1.5])
def test_a_logo_that_did_not_come_back_when_it_should_speaks_against_a_spin(factor: float) -> None:
    spin = np.array([40.0, 10.0, 0.0])
    values = log_likelihoods(np.array([spin, factor * spin]), seen_of(spin, np.array([0.0, 0.0, -1.0])))
    assert values[0] > values[1] + 2.0


def test_a_logo_never_seen_speaks_for_an_axis_along_the_line_of_sight() -> None:
    """There one half of the ball never shows; a ball that turns across it shows all but its poles."""
    along, across = np.array([0.0, 0.0, 40.0]), np.array([40.0, 0.0, 0.0])
    values = log_likelihoods(np.array([along, across, -along]), np.zeros(TIMES_S.size, bool))
    assert values[0] > values[1] + 0.3
    assert values[2] == pytest.approx(values[0], abs=0.05)


def test_a_logo_always_seen_tells_no_spin_about_the_line_of_sight_from_another() -> None:
    spins = np.array([[0.0, 0.0, 10.0], [0.0, 0.0, 90.0]])
    one, other = log_likelihoods(spins, np.ones(TIMES_S.size, bool))
    assert one == pytest.approx(other, abs=1e-9)


def test_turning_the_scene_turns_the_likelihood() -> None:
    spin = np.array([30.0, -20.0, 15.0])
    seen = seen_of(spin, np.array([0.6, 0.0, -0.8]))
    (plain,) = log_likelihoods(spin[None], seen)
    turn = rotations([0.3, -0.8, 0.5])[0]
    value = np.empty(1)
    spins_rad_s = 2 * np.pi * (turn @ spin)[None]
    sighting_log_likelihoods(value, spins_rad_s, TIMES_S, VIEWS @ turn.T, seen, PLACES @ turn.T, 0.4)
    assert value[0] == pytest.approx(plain, abs=1e-9)
