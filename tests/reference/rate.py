"""Slow, obvious versions of the kernels that match the logo's pattern with itself."""

from __future__ import annotations

import numpy as np

from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.kernels.arrays import Flags, Floats, Integers


def naive_pattern(bins: Integers, normals: Floats, on: Flags, length: int, cells: int) -> Floats:
    """(2, length, cells, cells): each event's weight falls linearly from its place to nothing one cell away."""
    pattern = np.zeros((2, length, cells, cells))
    for i, number in enumerate(bins):
        if 0 <= number < length:
            x, y = 0.5 * (normals[i, :2] + 1.0) * (cells - 1)
            for row in range(cells):
                for column in range(cells):
                    weight = max(1.0 - abs(x - column), 0.0) * max(1.0 - abs(y - row), 0.0)
                    pattern[int(on[i]), number, row, column] += weight
    return pattern


def naive_disc(
    events: EventBatch, at_px: Floats, start_us: float, bin_us: float, length: int, cells: int, reach_px: float
) -> Floats:
    """(2, length, cells, cells) of the events within reach of the centres (n, 2), as `naive_pattern` spreads them."""
    off = (np.stack([events.x_px, events.y_px], axis=1) - at_px) / reach_px
    rows = np.flatnonzero(np.hypot(off[:, 0], off[:, 1]) < 1.0)
    bins = np.floor((events.t_us[rows] - start_us) / bin_us).astype(np.int64)
    return naive_pattern(bins, off[rows], events.on[rows], length, cells)


def naive_lag_sums(rows: Floats) -> tuple[Floats, Floats, float]:
    """Sums of the products of all pairs of rows by lag, their bounds, and the mean square from the second lag on."""
    n = len(rows)
    sums, bounds = np.zeros(n), np.zeros(n)
    squares = []
    for lag in range(n):
        early, late = rows[: n - lag], rows[lag:]
        products = [float(one @ other) for one, other in zip(early, late, strict=True)]
        sums[lag], bounds[lag] = sum(products), np.linalg.norm(early) * np.linalg.norm(late)
        squares += [product**2 for product in products if lag >= 2]
    return sums, bounds, float(np.mean(squares)) if squares else 0.0


def naive_over_multiples(sums: Floats, bounds: Floats, period: float) -> Floats:
    """(3,) the sums and bounds at the multiples of a period, and the number of products there."""
    n = len(sums)
    lags = [k * period for k in range(1, n) if k * period < n - 2]
    return np.array(
        [
            *(sum(float(np.interp(lag, np.arange(n), curve)) for lag in lags) for curve in (sums, bounds)),
            sum(n - lag for lag in lags),
        ]
    )


def naive_deviations(pattern: Floats) -> Floats:
    """Counts (n, c) less the mean pattern with as many events in each bin."""
    mean = pattern.sum(axis=0) / max(pattern.sum(), 1.0)
    return np.array([row - row.sum() * mean for row in pattern])


def naive_highest_peaks(places: Floats, heights: Floats, most: int, apart: float) -> list[int]:
    """Peaks by height, each with every higher one chosen before it at least so far away."""
    peaks = [k for k in range(1, len(heights) - 1) if heights[k - 1] <= heights[k] > heights[k + 1]]
    chosen: list[int] = []
    for peak in sorted(peaks, key=lambda k: -heights[k]):
        if all(abs(np.log(places[peak] / places[other])) > apart for other in chosen):
            chosen.append(peak)
    return chosen[:most]
