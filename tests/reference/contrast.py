"""Slow, obvious twin of the contrast score, and a logo of dots to try it on."""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from spinscope.pipeline.spin.contrast.events import SphereEvents
from tests.reference.rotation import turned

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


def naive_time_permuted(t_s: Floats, starts: Integers, times_each: int) -> list[list[tuple[float, int]]]:
    """For each segment the (time, row) of its time-permuted events."""
    golden, segments = (math.sqrt(5) - 1) / 2, []
    for first, last in itertools.pairwise(starts):
        own = []
        for i in range(last - first) if last - first > 1 else ():
            for j in range(times_each):
                rank = int((j + (i * golden) % 1.0) / times_each * (last - first))
                own.append((float(t_s[first + rank]), int(first + i)))
        segments.append(own)
    return segments


def _spline(offset: float) -> float:
    """The quadratic B-spline."""
    if abs(offset) < 0.5:
        return 0.75 - offset**2
    return 0.5 * (1.5 - abs(offset)) ** 2 if abs(offset) < 1.5 else 0.0


def _on_map(points: Floats, pole: Floats, cell: float) -> list[tuple[float, float]]:
    """Lambert's equal-area maps of both hemispheres, in cells, side by side; the pole is cell (middle, middle)."""
    across = np.array([0.0, -pole[2], pole[1]]) if abs(pole[0]) < 0.6 else np.array([pole[2], 0.0, -pole[0]])
    u = across / np.linalg.norm(across)
    v = np.cross(pole, u)
    size = int(2.0 * math.sqrt(2.0) / cell) + 5
    places = []
    for point in points:
        scale = math.sqrt(2.0 / (1.0 + abs(float(pole @ point)))) / cell
        middle, beyond = 0.5 * (size - 1), size if pole @ point < 0.0 else 0
        places.append((float(u @ point) * scale + middle + beyond, float(v @ point) * scale + middle))
    return places


def _density(at: tuple[float, float], paint: list[tuple[tuple[float, float], float]]) -> float:
    """What the splats (place, weight) add up to, read at a place with the same spline, by way of the cells."""
    column, row = int(at[0] + 0.5), int(at[1] + 0.5)
    total = 0.0
    for x in (column - 1, column, column + 1):
        for y in (row - 1, row, row + 1):
            inked = sum(weight * _spline(place[0] - x) * _spline(place[1] - y) for place, weight in paint)
            total += _spline(at[0] - x) * _spline(at[1] - y) * inked
    return total


def naive_score(
    spin_rad_s: Floats,
    t_s: Floats,
    normals: Floats,
    polarity: Integers,
    starts: Integers,
    times_each: int,
    cell: float,
    floor: float,
    apart_s: float = 0.0,
) -> tuple[float, Floats]:
    """The score and each event's share, straight from its definition; normals (3, n)."""
    spin_rps = spin_rad_s / (2 * np.pi)
    points = turned(normals.T, -spin_rps, t_s)
    some = points[:: max(1, len(points) // 64)]
    mean = some.sum(axis=0) + np.array([0.0, 0.0, 1e-9])
    pole = np.linalg.matrix_power(some.T @ some / len(some) + 1e-3 * np.eye(3), 8) @ mean
    pole /= np.linalg.norm(pole)
    places, shares, added = _on_map(points, pole, cell), np.empty(t_s.size), floor * 0.55**2
    permuted = naive_time_permuted(t_s, starts, times_each)
    for segment, (first, last) in enumerate(itertools.pairwise(starts)):
        others = permuted[segment]
        blurred = turned(normals.T[[row for _, row in others]], -spin_rps, np.array([time for time, _ in others]))
        for i in range(first, last):
            apart = [k for k in range(first, last) if k != i and (apart_s == 0.0 or abs(t_s[k] - t_s[i]) > apart_s)]
            weight = len(apart) / max(len(others), 1)
            sharp = [(places[k], 1.0) for k in apart if polarity[k] == polarity[i]]
            blur = [
                (place, weight)
                for place, (_, row) in zip(_on_map(blurred, pole, cell), others, strict=True)
                if polarity[row] == polarity[i]
            ]
            shares[i] = math.log((_density(places[i], sharp) + added) / (_density(places[i], blur) + added))
    return float(shares.sum()), shares


def dotted_ball(
    spin_rps: Floats, *, duration_s: float = 0.03, events: int = 600, toward: Floats | None = None, seed: int = 0
) -> SphereEvents:
    """Events of a logo of 40 dots on a turning ball, seen along `toward` (from the camera to the ball, +z if None).

    Each event is a dot at a random time, where it shows and is not near the rim; half of the dots are ON.
    """
    random = np.random.default_rng(seed)
    toward = np.array([0.0, 0.0, 1.0]) if toward is None else toward / np.linalg.norm(toward)
    dots = -toward + 0.35 * random.standard_normal((40, 3))
    dots /= np.linalg.norm(dots, axis=1)[:, None]
    pick = random.integers(0, 40, 20 * events)
    t_s = random.uniform(-0.5, 0.5, pick.size) * duration_s
    normals = turned(dots[pick], np.asarray(spin_rps, np.float64), t_s)
    rows = np.flatnonzero(normals @ toward < -0.5)[:events]
    rows = rows[np.argsort(t_s[rows])]
    facing = np.repeat(toward[:, None], rows.size, axis=1)
    return SphereEvents(
        t_s[rows], np.ascontiguousarray(normals[rows].T), pick[rows] % 2, facing, np.full(rows.size, 17.0)
    )
