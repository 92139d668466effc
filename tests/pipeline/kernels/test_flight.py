"""The kernels of flight and lift equal their slow twins."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from spinscope.pipeline.kernels import flight, lift
from spinscope.pipeline.kernels.rotation import orthonormal_axes
from tests.reference import flight as reference

Floats = NDArray[np.float64]
CAMERA = (1646.0, 0.02)
AIR = (0.0726, 0.4, 0.02)
SEEDS = st.integers(0, 2**32 - 1)


def a_motion(random: np.random.Generator) -> Floats:
    """A ball about 2 m away at up to 20 m/s, bent by up to about 30 m/s^2, its radius up to a pixel wrong."""
    position = [*random.uniform(-0.3, 0.3, 2), random.uniform(1.5, 2.5)]
    bend = random.normal(0, 8, 3) + random.normal(0, 2, (3, 3))
    return np.array([*position, *random.uniform(-12, 12, 3) * [1, 1, 0.1], *bend.ravel(), random.uniform(-1, 1)])


def an_information(random: np.random.Generator, scale: float = 1.0) -> Floats:
    root = random.normal(0, scale, (9, 12))
    return root @ root.T


@given(SEEDS, st.floats(0.01, 0.2))
def test_places_are_the_double_integral_of_the_acceleration(seed: int, half_s: float) -> None:
    random = np.random.default_rng(seed)
    motion, tau_s = a_motion(random), half_s * random.uniform(-1, 1, 7)
    places = np.empty((7, 3))
    flight.predict_places(places, motion, tau_s, half_s, *CAMERA)
    np.testing.assert_allclose(places, reference.naive_places(motion, tau_s, half_s, *CAMERA), rtol=1e-9, atol=1e-9)


@given(SEEDS)
def test_a_guess_follows_gravity_and_drag_exactly(seed: int) -> None:
    """The drag is taken as constant, so the test's is: of a ball thrown straight against nothing else."""
    random = np.random.default_rng(seed)
    tau_s = np.sort(random.uniform(-0.05, 0.05, 9))
    place, velocity, gravity = random.normal(0, 1, 3), random.normal(0, 5, 3), random.normal(0, 6, 3)
    motion = np.empty(16)
    flight.guess_motion(
        motion, place + tau_s[:, None] * velocity + 0.5 * tau_s[:, None] ** 2 * gravity, tau_s, gravity, 0.0
    )
    np.testing.assert_allclose(motion[:6], [*place, *velocity], atol=1e-9)
    np.testing.assert_allclose(motion[6:15].reshape(3, 3), [gravity] * 3, atol=1e-9)
    assert motion[15] == 0.0


@given(SEEDS)
def test_a_fit_finds_the_motion_and_states_what_it_knows(seed: int) -> None:
    random = np.random.default_rng(seed)
    half_s, count = 0.06, 24
    true, tau_s = a_motion(random), np.linspace(-half_s, half_s, count)
    true[15] = 0.0
    exact = reference.naive_places(true, tau_s, half_s, *CAMERA)
    places = exact + random.normal(0, 0.04, exact.shape)
    motion = true + np.array([0.02] * 3 + [0.2] * 3 + [1.0] * 9 + [0.0])
    prior = np.eye(9) / 100.0
    expected = motion.copy()
    information, gradient, off_px, noise_px = flight.fit_motion(
        motion, places, tau_s, half_s, CAMERA, prior, (0.04, 0.04, 5.0), 0.3
    )
    np.testing.assert_allclose(places - off_px, reference.naive_places(motion, tau_s, half_s, *CAMERA), atol=1e-8)
    assert np.abs(off_px).max() < 0.25
    assert 0.02 < noise_px[0] < 0.07 and 0.02 < noise_px[1] < 0.07
    # The normal equations by differences, with the weights of Student's t.
    precision = np.tile([noise_px[0] ** -2] * 2 + [noise_px[1] ** -2], count)
    squares = np.sum((off_px.ravel() ** 2 * precision).reshape(-1, 3), axis=1)
    weights = np.repeat(7.0 / (4.0 + squares), 3) * precision
    slopes = reference.naive_slopes(motion, tau_s, half_s, *CAMERA)
    own = [0, 1, 2, 3, 4, 5, 15]
    whole = (slopes * weights[:, None]).T @ slopes
    whole[15, 15] += 1 / 0.3**2
    pull = slopes.T @ (weights * off_px.ravel())
    pull[15] -= motion[15] / 0.3**2
    gain = np.linalg.solve(whole[np.ix_(own, own)], whole[6:15][:, own].T).T
    left = whole[6:15, 6:15] - gain @ whole[own, 6:15]
    # The weights of the last round belong to the motion before it, which is nearly the last.
    np.testing.assert_allclose(information, left, rtol=0.02, atol=0.02 * np.abs(left).max())
    # At the fit the pull of the circles balances that of the prior.
    balance = prior @ (motion[6:15] - expected[6:15])
    assert gradient == pytest.approx(balance, abs=0.02 * max(np.abs(balance).max(), 1.0) + 0.05)


@given(SEEDS)
def test_lift_equals_its_twin(seed: int) -> None:
    random = np.random.default_rng(seed)
    spin, velocity = random.normal(0, 60, 3), random.normal(0, 8, (3, 3))
    found = np.empty(9)
    lift.lift_at(found, spin, velocity, AIR)
    np.testing.assert_allclose(found, reference.naive_lift(spin, velocity, AIR), rtol=1e-9, atol=1e-12)
    assert np.abs(found.reshape(3, 3) @ spin).max() < 1e-9 * np.linalg.norm(spin) * np.abs(found).max() + 1e-9
    lift.lift_at(found, np.zeros(3), velocity, AIR)
    assert not found.any()


@given(SEEDS, st.floats(0.01, 0.3))
@example(2553694, 0.015625)  # a lift that the circles exclude
def test_likelihoods_equal_their_twin(seed: int, lift_std: float) -> None:
    random = np.random.default_rng(seed)
    spins, velocity = random.normal(0, 40, (4, 3)), random.normal(0, 8, 3) + random.normal(0, 0.3, (3, 3))
    information, pull, values = an_information(random, 0.2), random.normal(0, 1, 9), np.empty(4)
    lift.spin_log_likelihoods(values, spins, velocity, information, pull, AIR, lift_std)
    for spin, value in zip(spins, values, strict=True):
        expected = reference.naive_log_likelihood(spin, velocity, information, pull, AIR, lift_std)
        assert value == pytest.approx(expected, rel=1e-5, abs=1e-5)


@given(SEEDS)
def test_other_causes_widen_the_covariance(seed: int) -> None:
    """A Gaussian cause adds its covariance to that of the accelerations."""
    random = np.random.default_rng(seed)
    information, gradient = an_information(random) + np.eye(9), random.normal(0, 3, 9)
    terms, known = random.normal(0, 1, (9, 3)), random.normal(0, 2, 9)
    pull = np.empty(9)
    left, most = lift.lift_likelihood(pull, information, gradient, terms, known)
    covariance = np.linalg.inv(information) + terms @ terms.T
    seen = np.linalg.solve(information, gradient) - known  # the lift that the circles show
    np.testing.assert_allclose(left, np.linalg.inv(covariance), atol=1e-8 * np.abs(left).max())
    np.testing.assert_allclose(pull, np.linalg.solve(covariance, seen), atol=1e-7 * np.abs(pull).max())
    wide = covariance + lift.ANY_LIFT_M_S2**2 * np.eye(9)
    # Marginal and conditional forms of the same Gaussian with a prior of ANY_LIFT_M_S2.
    expected = 0.5 * (seen @ np.linalg.solve(covariance, seen) - seen @ np.linalg.solve(wide, seen))
    assert most == pytest.approx(expected, rel=1e-6)


@given(SEEDS)
def test_a_grid_holds_the_best_spin_and_relative_likelihoods(seed: int) -> None:
    random = np.random.default_rng(seed)
    velocity = np.array([random.normal(0, 6, 3)] * 3)
    _, first, second = (np.array(a) for a in orthonormal_axes(*(velocity[1] / np.linalg.norm(velocity[1]))))
    angle, magnitude = random.uniform(0, 2 * math.pi), random.uniform(5, 100)
    true = magnitude * (math.cos(angle) * first + math.sin(angle) * second)
    information = an_information(random, random.uniform(0.3, 5))
    shown = reference.naive_lift(true, velocity, AIR)
    pull = information @ (shown + random.normal(0, 0.1, 9))
    most = 0.5 * pull @ np.linalg.solve(information, pull)
    weights = np.empty((20, 16))
    likelihood = (velocity, information, pull, most, AIR, 0.12)
    low, step, begin, turn, misfit = lift.spin_grid(weights, (tuple(first), tuple(second)), likelihood, 150.0, 7.0)
    angles, magnitudes = begin + turn * (np.arange(20) + 0.5), np.exp(low + step * (np.arange(16) + 0.5))
    spins = (np.cos(angles)[:, None] * first + np.sin(angles)[:, None] * second)[:, None] * magnitudes[:, None]
    values = np.empty(320)
    lift.spin_log_likelihoods(values, spins.reshape(-1, 3), velocity, information, pull, AIR, 0.12)
    assert weights.max() == 1.0
    assert misfit == pytest.approx(max(2 * (most - values.max()) / 7, 0), abs=1e-9)
    relative = np.exp((values - values.max()) / max(misfit, 1.0)).reshape(20, 16)
    np.testing.assert_allclose(weights, relative, rtol=1e-6, atol=1e-12)
    # No spin of a plain, finer grid is much better than the best of the narrowed one.
    a, m = np.meshgrid(np.linspace(0, 2 * math.pi, 240), np.geomspace(1.5, 150, 120), indexing="ij")
    plain = m[..., None] * (np.cos(a)[..., None] * first + np.sin(a)[..., None] * second)
    every = np.empty(plain.size // 3)
    lift.spin_log_likelihoods(every, np.ascontiguousarray(plain.reshape(-1, 3)), velocity, information, pull, AIR, 0.12)
    assert every.max() <= values.max() + 1.0
