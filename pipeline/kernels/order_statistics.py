"""Order statistics of short arrays: NumPy's take ten times as long to compile."""

from __future__ import annotations

from numba import njit

from .arrays import Floats


@njit(cache=True, nogil=True)
def value_of_rank(values: Floats, rank: int) -> float:
    """Value that would stand at index `rank` were the values (n,) sorted; reorders them (Hoare's selection)."""
    low, high = 0, values.size - 1
    while low < high:
        pivot, i, j = values[(low + high) // 2], low, high
        while i <= j:
            while values[i] < pivot:
                i += 1
            while values[j] > pivot:
                j -= 1
            if i <= j:
                values[i], values[j] = values[j], values[i]
                i, j = i + 1, j - 1
        if rank <= j:
            high = j
        elif rank >= i:
            low = i
        else:
            break
    return float(values[rank])


@njit(cache=True, nogil=True)
def median(values: Floats) -> float:
    """Median of the values (n,), n > 0, which it reorders."""
    middle = values.size // 2
    upper = value_of_rank(values, middle)
    return upper if values.size % 2 else (value_of_rank(values, middle - 1) + upper) / 2.0
