"""Rotation of vectors about an axis (Rodrigues' formula), the only one of the project."""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import ArrayLike

from .arrays import Floats

Vector = tuple[float, float, float]


@numba.njit(cache=True, nogil=True)
def axis_and_length(vector: Floats) -> tuple[float, float, float, float]:
    """Split a vector (3,) into its direction x, y, z (unit; the z axis for a zero vector) and its length."""
    length = math.sqrt(vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2])
    if length > 0.0:
        return vector[0] / length, vector[1] / length, vector[2] / length, length
    return 0.0, 0.0, 1.0, 0.0


@numba.njit(cache=True, nogil=True, inline="always")
def rotate(vector: Vector, axis: Vector, sine: float, cosine: float, versine: float) -> Vector:
    """Turn a vector about a unit axis by the angle of this sine, cosine and versine (1 - cosine), right-handed."""
    x, y, z = vector
    ax, ay, az = axis
    along = (ax * x + ay * y + az * z) * versine
    return (
        x * cosine + (ay * z - az * y) * sine + ax * along,
        y * cosine + (az * x - ax * z) * sine + ay * along,
        z * cosine + (ax * y - ay * x) * sine + az * along,
    )


@numba.njit(cache=True, nogil=True)
def orthonormal_axes(x: float, y: float, z: float) -> tuple[Vector, Vector, Vector]:
    """Complete a unit vector to a right-handed orthonormal basis, the vector itself first."""
    # Across the axis of the frame that is not near the vector.
    u, v, w = 0.0, -z, y
    if abs(x) >= 0.6:
        u, v, w = z, 0.0, -x
    length = math.sqrt(u * u + v * v + w * w)
    u, v, w = u / length, v / length, w / length
    return (x, y, z), (u, v, w), (y * w - z * v, z * u - x * w, x * v - y * u)


@numba.njit(cache=True, nogil=True)
def cross_product(left: Floats, right: Floats) -> Floats:
    """Cross product of two vectors (3,): NumPy's is made for many and takes ten times as long."""
    return np.array(
        [
            left[1] * right[2] - left[2] * right[1],
            left[2] * right[0] - left[0] * right[2],
            left[0] * right[1] - left[1] * right[0],
        ]
    )


def rotations(vectors_rad: ArrayLike) -> Floats:
    """Rotation matrices (n, 3, 3) about vectors (n, 3), or one vector (3,), by their lengths in radians."""
    vector = np.atleast_2d(np.asarray(vectors_rad, np.float64))
    angle = np.linalg.norm(vector, axis=1)
    axis = np.divide(vector, angle[:, None], out=np.zeros_like(vector), where=angle[:, None] > 0)
    cross = np.zeros((vector.shape[0], 3, 3))
    cross[:, 0, 1], cross[:, 0, 2], cross[:, 1, 2] = -axis[:, 2], axis[:, 1], -axis[:, 0]
    cross[:, 1, 0], cross[:, 2, 0], cross[:, 2, 1] = axis[:, 2], -axis[:, 1], axis[:, 0]
    sine, cosine = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    matrix: Floats = np.eye(3) + sine * cross + (1 - cosine) * (cross @ cross)
    return matrix
