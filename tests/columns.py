"""Columns as stages hand them to kernels."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray


def read_only(*columns: NDArray[Any]) -> tuple[NDArray[Any], ...]:
    """The same arrays, not to be written to, like those of an EventBatch; else numba compiles each kernel twice."""
    for column in columns:
        column.flags.writeable = False
    return columns
