"""Periodicity of an event rate: moving average, low-pass, crossings, period (section 3.3)."""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import NDArray

from .arrays import Events, Flags, Floats, Integers


@numba.njit(cache=True, nogil=True)
def moving_average(signal: Floats, weight: float) -> Floats:
    """Exponential moving average (n,): each value moves it by `weight` of the difference; starts at the first."""
    average = signal.copy()
    for i in range(1, signal.size):
        average[i] = average[i - 1] + weight * (signal[i] - average[i - 1])
    return average


@numba.njit(cache=True, nogil=True)
def low_passed(signal: Floats, cutoff_cycles: float) -> Floats:
    """Butterworth low-pass of second order, forward and then backward: (n,), nothing is shifted in time.

    The cut-off is in cycles per sample, between 0 and 0.5. Each pass starts from the steady state of its first value,
    so an end that is not zero rings little.
    """
    k = np.tan(np.pi * cutoff_cycles)
    scale = 1.0 / (1.0 + np.sqrt(2.0) * k + k * k)  # bilinear transform of 1 / (s^2 + sqrt(2) s + 1)
    b0 = k * k * scale
    a1, a2 = 2.0 * (k * k - 1.0) * scale, (1.0 - np.sqrt(2.0) * k + k * k) * scale
    result = signal.copy()
    for backward in range(2):
        first = result[result.size - 1] if backward else result[0]
        x1, x2, y1, y2 = first, first, first, first
        for j in range(result.size):
            i = result.size - 1 - j if backward else j
            x0 = result[i]
            y0 = b0 * (x0 + 2.0 * x1 + x2) - a1 * y1 - a2 * y2
            x2, x1, y2, y1 = x1, x0, y1, y0
            result[i] = y0
    return result


@numba.njit(cache=True, nogil=True)
def falling_crossings(signal: Floats) -> Floats:
    """Places (m,), in samples, of the falls from above zero to zero or below; linear in between."""
    crossings = np.empty(signal.size)
    m = 0
    for i in range(signal.size - 1):
        if signal[i] > 0.0 and signal[i + 1] <= 0.0:
            crossings[m] = i + signal[i] / (signal[i] - signal[i + 1])
            m += 1
    return crossings[:m].copy()


@numba.njit(cache=True, nogil=True)
def autocorrelation(signal: Floats, lags: int) -> Floats:
    """Correlation (lags,) of the signal with itself, lag by lag, each lag normed by the parts that overlap.

    1 where the signal repeats exactly; 0 where a part is constant zero.
    """
    correlation = np.zeros(lags)
    n = signal.size
    for lag in range(min(lags, n)):
        product, early, late = 0.0, 0.0, 0.0
        for i in range(n - lag):
            product += signal[i] * signal[i + lag]
            early += signal[i] * signal[i]
            late += signal[i + lag] * signal[i + lag]
        if early > 0.0 and late > 0.0:
            correlation[lag] = product / np.sqrt(early * late)
    return correlation


@numba.njit(cache=True, nogil=True)
def shortest_period(correlation: Floats, shortest: int, share: float) -> int:
    """First lag from `shortest` on whose peak reaches `share` of the highest such peak; 0 if there is no peak.

    A rotation's multiples repeat as well as the rotation itself; its parts (the letters of the logo) repeat worse.
    """
    peaks = np.empty(correlation.size, np.int64)
    m, highest = 0, 0.0
    for lag in range(max(shortest, 1), correlation.size - 1):
        here = correlation[lag]
        if here > correlation[lag - 1] and here >= correlation[lag + 1] and here > 0.0:
            peaks[m], highest = lag, max(highest, here)
            m += 1
    for n in range(m):
        if correlation[peaks[n]] >= share * highest:
            return int(peaks[n])
    return 0


@numba.njit(cache=True, nogil=True)
def add_to_pattern(pattern: Floats, bins: Integers, normals: Floats, on: Flags) -> None:
    """Add events to `pattern` (2, n, c, c): bins of time, and linearly between c x c cells of the ball as it is seen.

    Parameters
    ----------
    bins : (m,) int64
        Bin of each event; those outside of 0 to n - 1 are left out.
    normals : (m, 3) float64
        Outward unit normals; x and y from -1 to 1 are spread over the cells.
    on : (m,) bool
        Polarity, the first index.
    """
    last = pattern.shape[2] - 1
    for i in range(bins.size):
        if bins[i] < 0 or bins[i] >= pattern.shape[1]:
            continue
        x, y = 0.5 * (normals[i, 0] + 1.0) * last, 0.5 * (normals[i, 1] + 1.0) * last
        _spread(pattern[1 if on[i] else 0, bins[i]], x, y)


@numba.njit(cache=True, nogil=True)
def add_to_disc(
    pattern: Floats,
    events: Events,
    start_us: float,
    bin_us: float,
    reference_us: float,
    centre_px: tuple[float, float],
    velocity_px_s: tuple[float, float],
    reach_px: float,
) -> None:
    """Add the events around a moving centre to `pattern` (2, n, c, c): bins of time, linearly between c x c cells.

    Parameters
    ----------
    start_us, bin_us : float
        Start of the first bin, and width of all.
    reference_us : float
        The time stamp that an event of the scene with the ball at `centre_px` carries.
    reach_px : float
        Distance from the centre within which events count; the cells span it to all sides.
    """
    t_us, x_px, y_px, on = events
    last = pattern.shape[2] - 1
    per_px = 0.5 * last / reach_px
    for i in range(t_us.size):
        at = math.floor((t_us[i] - start_us) / bin_us)
        if at < 0 or at >= pattern.shape[1]:
            continue
        dt_s = (t_us[i] - reference_us) * 1e-6
        dx = x_px[i] - (centre_px[0] + velocity_px_s[0] * dt_s)
        dy = y_px[i] - (centre_px[1] + velocity_px_s[1] * dt_s)
        if dx * dx + dy * dy < reach_px * reach_px:
            _spread(pattern[1 if on[i] else 0, at], 0.5 * last + dx * per_px, 0.5 * last + dy * per_px)


@numba.njit(cache=True, nogil=True)
def _spread(cells: Floats, x: float, y: float) -> None:
    """Add one event at a place, in cells, to those around it."""
    last = cells.shape[1] - 1
    column, row = min(max(int(x), 0), last - 1), min(max(int(y), 0), last - 1)
    right, down = x - column, y - row
    cells[row, column] += (1.0 - right) * (1.0 - down)
    cells[row, column + 1] += right * (1.0 - down)
    cells[row + 1, column] += (1.0 - right) * down
    cells[row + 1, column + 1] += right * down


@numba.njit(cache=True, nogil=True)
def deviations(pattern: Floats) -> Floats:
    """Counts (n, c) of n bins less the mean pattern with as many events in each."""
    n, places = pattern.shape
    totals, whole = np.zeros(places), 0.0
    for i in range(n):
        for c in range(places):
            totals[c] += pattern[i, c]
    for c in range(places):
        whole += totals[c]
    varying = np.empty((n, places))
    for i in range(n):
        events = 0.0
        for c in range(places):
            events += pattern[i, c]
        share = events / max(whole, 1.0)
        for c in range(places):
            varying[i, c] = pattern[i, c] - share * totals[c]
    return varying


def lag_sums(rows: Floats) -> tuple[Floats, Floats, float]:
    """Sums of the products of rows (n, c) by their lag, the most they can be, and the mean square of a product.

    Sums (n,) and bounds (n,) by Schwarz's inequality, from the rows that a lag leaves at either end; the mean is over
    products of rows two or more apart. The sums come by Fourier transform: no n x n products are made.
    """
    n = rows.shape[0]
    spectrum = np.fft.rfft(np.ascontiguousarray(rows.T), 2 * n)
    sums = np.fft.irfft(_powers(spectrum), 2 * n)[:n]
    return sums, *_lag_bounds(rows)


@numba.njit(cache=True, nogil=True)
def _powers(spectrum: NDArray[np.complex128]) -> Floats:
    """Sums (m,) of the squares of spectra (c, m)."""
    powers = np.zeros(spectrum.shape[1])
    for c in range(spectrum.shape[0]):
        for k in range(powers.size):
            powers[k] += spectrum[c, k].real ** 2 + spectrum[c, k].imag ** 2
    return powers


@numba.njit(cache=True, nogil=True)
def _lag_bounds(rows: Floats) -> tuple[Floats, float]:
    """Bounds (n,) and mean square of `lag_sums`, from sum_ij (r_i . r_j)^2 = |R^T R|^2."""
    n, places = rows.shape
    energies, products = np.zeros(n), np.zeros((places, places))
    near = 0.0
    for i in range(n):
        after = 0.0
        for c in range(places):
            value = rows[i, c]
            energies[i] += value * value
            after += value * rows[i + 1, c] if i + 1 < n else 0.0
            for other in range(places):
                products[c, other] += value * rows[i, other]
        near += energies[i] ** 2 + 2.0 * after**2
    squares = 0.0
    for c in range(places):
        for other in range(places):
            squares += products[c, other] ** 2
    bounds, early, late = np.empty(n), 0.0, 0.0
    for i in range(n):
        early += energies[i]
        bounds[n - 1 - i] = early
    for i in range(n):
        late += energies[n - 1 - i]
        bounds[n - 1 - i] = np.sqrt(bounds[n - 1 - i] * late)
    return bounds, max(squares - near, 0.0) / max((n - 1) * (n - 2), 1)


@numba.njit(cache=True, nogil=True)
def over_multiples(sums: Floats, bounds: Floats, periods: Floats) -> Floats:
    """Totals (3, m) of lag sums (n,), of their bounds and of n - lag, over all multiples of periods (m,) in samples."""
    n = sums.size
    totals = np.zeros((3, periods.size))
    for k in range(periods.size):
        lag = periods[k]
        while lag < n - 2:
            at = int(lag)
            part = lag - at
            totals[0, k] += (1.0 - part) * sums[at] + part * sums[at + 1]
            totals[1, k] += (1.0 - part) * bounds[at] + part * bounds[at + 1]
            totals[2, k] += n - lag
            lag += periods[k]
    return totals


@numba.njit(cache=True, nogil=True)
def highest_peaks(places: Floats, heights: Floats, most: int, apart: float) -> Integers:
    """Indices of at most so many peaks of a curve (n,), highest first, whose logarithms of place differ by `apart`."""
    peaks, count = np.empty(most, np.int64), 0
    while count < most:
        best = -1
        for k in range(1, heights.size - 1):
            if not (heights[k] >= heights[k - 1] and heights[k] > heights[k + 1]):
                continue
            if best >= 0 and heights[k] <= heights[best]:
                continue
            alone = True
            for j in range(count):
                alone = alone and abs(np.log(places[k] / places[peaks[j]])) > apart
            if alone:
                best = k
        if best < 0:
            break
        peaks[count] = best
        count += 1
    return peaks[:count].copy()


@numba.njit(cache=True, nogil=True)
def highest_near(places: Floats, heights: Floats, centres: Integers, apart: float) -> Integers:
    """Index (m,) of the highest value (n,) less than `apart` from each centre (m,), in logarithms of place (n,)."""
    highest = centres.copy()
    for j in range(centres.size):
        found = False
        for k in range(places.size):
            if abs(np.log(places[k] / places[centres[j]])) < apart and (not found or heights[k] > heights[highest[j]]):
                highest[j], found = k, True
    return highest
