"""Statistics of series of shots: centre, spread, best, and whether it got better."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Trend = Literal["rose", "fell", "unclear", "too_few"]

FEWEST = 3  # shots of a spread, and of each part of a series that are compared; with two it says nothing
ROBUST_STD = 1.4826  # standard deviations in the median absolute deviation of a normal distribution
WITHIN = 2 / 3  # of the shots lie in the ellipse
STEPS = 20  # towards the densest two thirds, which mostly are found in three
CLEAR_SIGMAS = 2.0  # of the difference's own error: chance does that once in twenty times


@dataclass(frozen=True, slots=True, kw_only=True)
class SeriesStatistics:
    """Statistics of the spin of a series of shots; None for what too few shots tell.

    Attributes
    ----------
    count, unseen : int
        Shots whose spin is known, and those whose spin is not seen.
    median_rps, best_rps : float, optional
        Middle value and largest one.
    median_std_rps : float, optional
        Standard error of the middle value, from the middle deviation, which a single other shot does not change.
    best_id : int, optional
        The shot with the largest spin.
    spread_rps : float, optional
        Standard deviation.
    median_speed_m_s : float, optional
        Middle value of the speeds.
    ellipse : list of (float, float), optional
        Outline of the ellipse that holds two of three shots, see `spread_ellipse`.
    trend : str
        Whether the spin rose or fell from the earlier part of the series to the later.
    change_rps, change_std_rps : float, optional
        Mean of the later part less that of the earlier, and its standard error.
    """

    count: int
    unseen: int
    median_rps: float | None
    median_std_rps: float | None
    best_rps: float | None
    best_id: int | None
    spread_rps: float | None
    median_speed_m_s: float | None
    ellipse: list[tuple[float, float]] | None
    trend: Trend
    change_rps: float | None
    change_std_rps: float | None


def series_statistics(shots: Sequence[Mapping[str, Any]], since_s: float | None = None) -> SeriesStatistics:
    """Statistics of shots (rows of a session) in order of time.

    Parameters
    ----------
    since_s : float, optional
        Begin of the later part, which is compared with the earlier, in seconds since 1970; by default halves are.
    """
    known = [shot for shot in shots if shot["spin_rps"] is not None]
    spins = np.array([shot["spin_rps"] for shot in known], np.float64)
    moving = [shot for shot in known if shot["speed_m_s"] is not None]
    speeds = np.array([shot["speed_m_s"] for shot in moving], np.float64)
    best = max(known, key=lambda shot: shot["spin_rps"], default=None)
    trend, change, change_std = _trend(*_parts(known, spins, since_s))
    return SeriesStatistics(
        count=len(known),
        unseen=len(shots) - len(known),
        median_rps=float(np.median(spins)) if len(spins) else None,
        median_std_rps=_median_std(spins) if len(spins) >= FEWEST else None,
        best_rps=best["spin_rps"] if best else None,
        best_id=best["id"] if best else None,
        spread_rps=float(spins.std(ddof=1)) if len(spins) >= FEWEST else None,
        median_speed_m_s=float(np.median(speeds)) if len(speeds) else None,
        ellipse=spread_ellipse(speeds, np.array([shot["spin_rps"] for shot in moving], np.float64)),
        trend=trend,
        change_rps=change,
        change_std_rps=change_std,
    )


def compared(series: Mapping[str, SeriesStatistics]) -> tuple[list[str], bool]:
    """Names of the series with enough shots, the largest middle first; whether it is larger by more than chance."""
    known = {
        name: (one.median_rps, one.median_std_rps)
        for name, one in series.items()
        if one.median_rps is not None and one.median_std_rps is not None
    }
    names = sorted(known, key=lambda name: known[name][0], reverse=True)
    if len(names) < 2:
        return names, False
    (first, first_std), (second, second_std) = (known[name] for name in names[:2])
    return names, first - second > CLEAR_SIGMAS * math.hypot(first_std, second_std)


def _median_std(spins_rps: Floats) -> float:
    """Standard error of the median: of a normal distribution 1.25 times that of the mean."""
    return float(1.25 * ROBUST_STD * np.median(np.abs(spins_rps - np.median(spins_rps))) / math.sqrt(len(spins_rps)))


def spread_ellipse(speeds_m_s: Floats, spins_rps: Floats, points: int = 48) -> list[tuple[float, float]] | None:
    """Outline (speed in m/s, spin in rps) of the ellipse that holds two of three shots; None for too few of them.

    Its shape is that of the two thirds of the shots that lie closest together, found by concentration steps: a single
    shot of another kind does not turn it.

    References
    ----------
    Rousseeuw and Van Driessen, A Fast Algorithm for the Minimum Covariance Determinant Estimator, Technometrics 1999.
    """
    if len(speeds_m_s) < FEWEST:
        return None
    shots = np.stack([speeds_m_s, spins_rps], axis=1)
    count = max(math.ceil(WITHIN * len(shots)), FEWEST)
    spread = ROBUST_STD * np.median(np.abs(shots - np.median(shots, axis=0)), axis=0)
    centre, covariance = np.median(shots, axis=0), np.diag(np.maximum(spread, 1e-6) ** 2)
    for _ in range(STEPS):
        nearest = np.argsort(_distances(shots, centre, covariance), kind="stable")[:count]
        centre, before = shots[nearest].mean(axis=0), covariance
        # A thousandth of the spread beside: shots on a line have an ellipse, too.
        covariance = np.cov(shots[nearest].T) + np.diag(1e-6 * np.maximum(spread, 1e-6) ** 2)
        if np.allclose(covariance, before):
            break
    reach = np.sort(_distances(shots, centre, covariance))[count - 1]
    angle = np.linspace(0, 2 * np.pi, points, endpoint=False)
    circle = np.stack([np.cos(angle), np.sin(angle)])
    outline = centre[:, None] + reach * np.linalg.cholesky(covariance) @ circle
    return [(float(speed), float(spin)) for speed, spin in outline.T]


def _distances(shots: Floats, centre: Floats, covariance: Floats) -> Floats:
    """Mahalanobis distances of shots (n, 2)."""
    apart: Floats = np.linalg.solve(np.linalg.cholesky(covariance), (shots - centre).T)
    lengths: Floats = np.hypot(*apart)
    return lengths


def _parts(shots: Sequence[Mapping[str, Any]], spins_rps: Floats, since_s: float | None) -> tuple[Floats, Floats]:
    """Spins of the earlier and the later part: before an instant and from it on, or halves, which share no shot."""
    if since_s is None:
        return spins_rps[: len(spins_rps) // 2], spins_rps[(len(spins_rps) + 1) // 2 :]
    later = np.array([shot["recorded_s"] >= since_s for shot in shots], np.bool_)
    return spins_rps[~later], spins_rps[later]


def _trend(earlier: Floats, later: Floats) -> tuple[Trend, float | None, float | None]:
    """Whether the later part differs from the earlier by more than chance, the difference and its standard error."""
    if min(len(earlier), len(later)) < FEWEST:
        return "too_few", None, None
    change = float(later.mean() - earlier.mean())
    std = math.sqrt(earlier.var(ddof=1) / len(earlier) + later.var(ddof=1) / len(later))
    if abs(change) <= CLEAR_SIGMAS * std:
        return "unclear", change, std
    return "rose" if change > 0 else "fell", change, std
