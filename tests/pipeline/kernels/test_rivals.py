"""The rivals' kernels against their slow twins, and on pictures and spins that are known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from spinscope.pipeline.kernels.orthographic_contrast import orthographic_variances
from spinscope.pipeline.kernels.patch_matching import patch_displacements
from tests.reference.rivals import naive_displacement, naive_variance


def points(random: np.random.Generator, count: int) -> np.ndarray:
    normals = random.standard_normal((count, 3))
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


@settings(max_examples=40)
@given(seed=st.integers(0, 100_000), count=st.integers(1, 60))
def test_variance_equals_its_twin(seed: int, count: int) -> None:
    random = np.random.default_rng(seed)
    spins, t_s, normals = (
        300 * random.standard_normal((3, 3)),
        random.uniform(-0.01, 0.01, count),
        points(random, count),
    )
    view = Rotation.random(random_state=seed).as_matrix()
    slow = [naive_variance(spin, t_s, normals, view, 12) for spin in spins]
    np.testing.assert_allclose(orthographic_variances(spins, t_s, normals, view, 12), slow, rtol=1e-6, atol=1e-9)


def test_variance_is_largest_at_the_true_spin() -> None:
    """Events of a pattern of few points that turns: at their spin all of a point's events fall into one place."""
    random = np.random.default_rng(5)
    spin, t_s = np.array([200.0, -100.0, 50.0]), np.linspace(-0.01, 0.01, 400)
    pattern = points(random, 8)[random.integers(0, 8, 400)]
    normals = Rotation.from_rotvec(np.outer(t_s, spin)).apply(pattern)
    spins = np.concatenate([[spin], spin + 30 * points(random, 50)])
    variances = orthographic_variances(spins, t_s, normals, np.eye(3), 24)
    assert np.argmax(variances) == 0


@settings(max_examples=30)
@given(seed=st.integers(0, 100_000))
def test_displacement_equals_its_twin(seed: int) -> None:
    random = np.random.default_rng(seed)
    first, second = random.random((2, 2, 25, 25))
    columns, rows = random.integers(6, 19, 3), random.integers(6, 19, 3)
    found, match = patch_displacements(first, second, columns, rows, 2, 4)
    for place, share, column, row in zip(found, match, columns, rows, strict=True):
        slow = naive_displacement(first, second, int(column), int(row), 2, 4)
        if max(map(abs, slow)) == 4:
            assert np.isnan(place).all() and np.isnan(share)
        else:
            assert np.abs(place - slow).max() <= 0.5


@pytest.mark.parametrize("moved", [(2.0, -1.0), (0.4, 2.3), (-1.7, 0.0)])
def test_displacement_of_a_blob_is_found_to_a_fraction_of_a_pixel(moved: tuple[float, float]) -> None:
    y, x = np.mgrid[0:31, 0:31].astype(float)

    def blob(at_x: float, at_y: float) -> np.ndarray:
        return np.exp(-((x - at_x) ** 2 + (y - at_y) ** 2) / 18)[None]

    second = blob(15 + moved[0], 15 + moved[1])
    found, match = patch_displacements(blob(15, 15), second, np.array([15]), np.array([15]), 4, 5)
    np.testing.assert_allclose(found[0], moved, atol=0.15)
    assert match[0] < 0.1
