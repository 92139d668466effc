"""Rotations against their twin, and as matrices."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from spinscope.pipeline.kernels.derotated_normal_flow import derotated_normals
from spinscope.pipeline.kernels.rotation import axis_and_length, orthonormal_axes, rotations
from spinscope.pipeline.spin.contrast.score import derotate
from tests.reference.rotation import turned

vectors = st.tuples(*[st.floats(-900, 900)] * 3).map(np.array)


@given(seed=st.integers(0, 10_000), spin_rad_s=vectors)
def test_every_rotation_turns_alike(seed: int, spin_rad_s: np.ndarray) -> None:
    random = np.random.default_rng(seed)
    normals, t_us = random.normal(size=(10, 3)), random.integers(-100_000, 100_000, 10)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    expected = turned(normals, spin_rad_s / (2 * np.pi), -t_us * 1e-6)
    np.testing.assert_allclose(derotated_normals(normals, t_us, 0, spin_rad_s), expected, atol=1e-9)
    matrices = rotations(-spin_rad_s * (t_us * 1e-6)[:, None])
    np.testing.assert_allclose(np.einsum("nij,nj->ni", matrices, normals), expected, atol=1e-9)
    derotated = np.empty((3, 10))
    derotate(derotated, spin_rad_s, t_us * 1e-6, np.ascontiguousarray(normals.T))
    np.testing.assert_allclose(derotated.T, expected, atol=2e-6)


@given(vector=vectors)
def test_axes_are_orthonormal_and_right_handed(vector: np.ndarray) -> None:
    x, y, z, length = axis_and_length(vector)
    np.testing.assert_allclose(np.array([x, y, z]) * length, vector, atol=1e-9)
    axes = np.array(orthonormal_axes(x, y, z))
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(axes), 1.0)
