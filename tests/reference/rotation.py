"""Slow, obvious twin of the rotations."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def turned(vectors: Floats, spin_rps: Floats, t_s: Floats) -> Floats:
    """Vectors (n, 3), each turned by the spin (3,) for its own time (n,): the part across the axis goes round."""
    magnitude = float(np.linalg.norm(spin_rps))
    if magnitude == 0:
        return vectors
    axis = spin_rps / magnitude
    angle = (2 * np.pi * magnitude) * t_s[:, None]
    along = (vectors @ axis)[:, None] * axis
    turned_vectors: Floats = along + np.cos(angle) * (vectors - along) + np.sin(angle) * np.cross(axis, vectors)
    return turned_vectors
