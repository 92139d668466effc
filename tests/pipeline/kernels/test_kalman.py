"""The Kalman filter's kernels equal their slow twin, and filterpy's filter."""

from __future__ import annotations

import math
from types import ModuleType

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spinscope.pipeline.kernels import kalman
from tests.reference import kalman as reference

SEEDS = st.integers(0, 2**32 - 1)


@pytest.fixture(scope="module")
def filterpy() -> ModuleType:
    """Loaded here, for it brings scipy.stats: a tenth of what all tests load."""
    from filterpy import kalman

    return kalman


def state(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """A ball's state with a covariance in which everything depends on everything."""
    size = np.array([1.0, 1.0, 300.0, 300.0, 0.5])
    root = rng.normal(size=(5, 5)) * size[:, None]
    return rng.uniform(-1, 1, 5) * [1000, 700, 5000, 5000, 40], root @ root.T + np.diag(size**2)


@given(seed=SEEDS, dt_s=st.floats(1e-4, 0.05))
def test_a_prediction_equals_the_twins_and_filterpys(filterpy: ModuleType, seed: int, dt_s: float) -> None:
    rng = np.random.default_rng(seed)
    mean, covariance = state(rng)
    acceleration, growth = rng.uniform(1e3, 1e5), rng.uniform(1, 500)
    matrices = reference.matrices(dt_s, acceleration, growth)
    later, spread = kalman.predict(mean, covariance, dt_s, acceleration, growth)
    for expected in (reference.predict(mean, covariance, *matrices), filterpy.predict(mean, covariance, *matrices)):
        np.testing.assert_allclose(later, expected[0], rtol=1e-12, atol=1e-9)
        np.testing.assert_allclose(spread, expected[1], rtol=1e-9, atol=1e-9)


@given(seed=SEEDS)
def test_an_update_equals_the_twins_and_filterpys(filterpy: ModuleType, seed: int) -> None:
    rng = np.random.default_rng(seed)
    mean, covariance = state(rng)
    root = rng.normal(size=(3, 3)) * 0.2
    noise = root @ root.T + 0.01 * np.eye(3)
    observed = mean[kalman.OBSERVED] + rng.normal(size=3)
    matches, later, spread = kalman.update(mean, covariance, observed, noise, math.inf)
    assert matches
    for expected in (
        reference.update(mean, covariance, observed, noise)[1:],
        filterpy.update(mean, covariance, observed, noise, reference.OBSERVATION),
    ):
        np.testing.assert_allclose(later, expected[0], rtol=1e-7, atol=1e-6)
        np.testing.assert_allclose(spread, expected[1], rtol=1e-7, atol=1e-5)
    assert np.all(np.linalg.eigvalsh(spread) > 0)


@pytest.mark.parametrize(("share", "expected"), [(0.999, False), (1.001, True)])
def test_an_observation_farther_off_than_allowed_changes_nothing(share: float, expected: bool) -> None:
    mean, covariance = state(np.random.default_rng(1))
    noise, observed = 0.1 * np.eye(3), mean[kalman.OBSERVED] + [1.0, -2.0, 0.5]
    surprise = reference.update(mean, covariance, observed, noise)[0]
    matches, later, spread = kalman.update(mean, covariance, observed, noise, share * surprise)
    assert matches is expected
    assert np.array_equal(later, mean) is not expected and np.array_equal(spread, covariance) is not expected
    assert not np.shares_memory(later, mean) and not np.shares_memory(spread, covariance)


@given(seed=SEEDS, times=st.floats(1.0, 5.0))
def test_an_observations_noise_is_the_states_and_its_own(seed: int, times: float) -> None:
    _, covariance = state(np.random.default_rng(seed))
    noise = kalman.observation_noise(covariance, 0.04, times)
    np.testing.assert_allclose(noise, (covariance[np.ix_([0, 1, 4], [0, 1, 4])] + 0.04 * np.eye(3)) * times, rtol=1e-12)
