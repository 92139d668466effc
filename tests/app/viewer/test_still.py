"""Turning back by the spin: a right spin holds the logo still, a wrong one smears it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.viewer.still import Sampler, density, disc_directions, texture_directions, tone, turned

vectors = st.tuples(*[st.floats(-80, 80)] * 3).map(np.array)


def unit_vectors(count: int, seed: int = 0) -> np.ndarray:
    found = np.random.default_rng(seed).normal(size=(count, 3))
    return found / np.linalg.norm(found, axis=1, keepdims=True)


@given(spin_rps=vectors)
def test_turning_back_undoes_turning(spin_rps: np.ndarray) -> None:
    points, seconds = unit_vectors(20), np.linspace(-0.1, 0.1, 20)
    there = turned(points, spin_rps, seconds)
    np.testing.assert_allclose(np.linalg.norm(there, axis=1), 1)
    np.testing.assert_allclose(turned(there, spin_rps, -seconds), points, atol=1e-9)


def test_turning_is_by_the_right_hand_rule() -> None:
    """A quarter of a turn about z carries x to y; for a short time the way is omega x e."""
    quarter = turned(np.array([[1.0, 0.0, 0.0]]), np.array([0.0, 0.0, 10.0]), np.array([0.025]))
    np.testing.assert_allclose(quarter, [[0, 1, 0]], atol=1e-12)
    points, spin_rps, step_s = unit_vectors(50), np.array([3.0, -2.0, 5.0]), 1e-6
    moved = (turned(points, spin_rps, np.full(50, step_s)) - points) / step_s
    np.testing.assert_allclose(moved, np.cross(2 * np.pi * spin_rps, points), atol=1e-2)


def test_a_right_spin_gives_the_sharpest_picture() -> None:
    spin_rps, seconds = np.array([40.0, -20.0, 10.0]), np.random.default_rng(1).uniform(0, 0.1, 3000)
    logo = np.tile([[0.0, 0.3, -1.0], [0.2, -0.2, -1.0]], (1500, 1))
    logo /= np.linalg.norm(logo, axis=1, keepdims=True)
    seen = turned(logo, spin_rps, seconds)

    def sharpness(guess: np.ndarray) -> float:
        return float(np.square(density(turned(seen, guess, -seconds))).sum())

    right = sharpness(spin_rps)
    for wrong in (0.9 * spin_rps, -spin_rps, np.zeros(3), spin_rps[::-1]):
        assert sharpness(wrong) < 0.5 * right


@pytest.mark.parametrize("direction", [*np.eye(3), *-np.eye(3), [0.6, 0.0, -0.8]])
def test_density_peaks_where_the_events_are_and_nowhere_else(direction: np.ndarray) -> None:
    texels = texture_directions()
    counts = Sampler(texels)(density(np.tile(np.array(direction, float), (100, 1))))
    peak = texels[np.unravel_index(np.argmax(counts), counts.shape)]
    assert peak @ direction > np.cos(np.radians(3))
    assert np.all((texels @ direction)[counts > 0] > np.cos(np.radians(10)))


def test_the_textures_middle_faces_the_camera_with_the_images_right_and_down() -> None:
    texels = texture_directions()
    height, width, _ = texels.shape
    middle = texels[height // 2, width // 2]
    assert middle @ [0, 0, -1] > 0.99
    assert texels[height // 2, width // 2 + 20][0] > 0.3
    assert texels[height // 2 + 15, width // 2][1] > 0.3


def test_the_left_disc_looks_at_the_middle_and_the_right_one_at_the_back() -> None:
    """Seen by the camera: x to the right and y down on the left disc; mirrored left to right on the right one."""
    directions, mask = disc_directions(np.array([0.0, 0.0, -1.0]))
    size = mask.shape[0]
    np.testing.assert_allclose(directions[size // 2, size // 2], [0, 0, -1], atol=0.02)
    assert directions[size // 2, size // 2 + 40][0] > 0.4
    assert directions[size // 2 + 40, size // 2][1] > 0.4
    back = mask.shape[1] - size // 2
    np.testing.assert_allclose(directions[size // 2, back], [0, 0, 1], atol=0.02)
    assert directions[size // 2, back + 40][0] < -0.4
    np.testing.assert_allclose(np.linalg.norm(directions[mask], axis=1), 1, atol=1e-9)


def test_tone_of_nothing_is_nothing() -> None:
    assert not tone(np.zeros(5), 0.0).any()
    np.testing.assert_allclose(tone(np.array([0.0, 10.0, 20.0]), 10.0), [0, 1, 1])
