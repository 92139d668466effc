"""Contrast's score as it searched: over magnitudes along the best axis, and over directions of the axis.

A single sharp top is a safe answer; another top nearly as high is a rival, marked where the search found it. Both
pictures are of the last full estimate.
"""

from __future__ import annotations

from functools import cache, lru_cache

import cv2
import numpy as np
import rerun as rr
from numpy.typing import NDArray

from pipeline.stages.contrast import ContrastResult

from . import entities as at
from .rerun_api import Chunk, bars, columns_at, once
from .run import Run
from .stages import PNG_QUICK

Floats = NDArray[np.float64]

DISC_RADIUS_PX, GAP_PX = 100, 16
AXES_WIDTH_PX = 4 * DISC_RADIUS_PX + GAP_PX
COARSE = 48  # the scores are averaged in so many pixels a side: 2.4 degrees in the middle, far below their reach
# How far a scored direction shines: half the distance of the hundred scored directions from each other.
REACH_RAD = 0.18
BRIGHTEST = 150  # grey value of the highest score: the marks on it must stand out
# Of every mark: its colour, its length on the curve (of the highest score, below zero unless it is the curve's own
# top) and its radius on the map, in pixels of the screen.
MARKS: dict[str, tuple[at.Colour, float, float]] = {
    "best": (at.METHOD_COLOURS["contrast"], 1.0, 6.0),
    "rivals": (at.HOUGH_COLOUR, -0.16, 4.0),
    "truth": (at.TRUTH_COLOUR, -0.08, 3.0),
}
MARK_WIDTH = 0.008  # of the curve's span


def score_chunks(run: Run) -> list[Chunk]:
    """Both pictures at every tick; empty where contrast has no best spin."""
    results = [t.contrast if t.contrast is not None and t.contrast.magnitudes_rps.size else None for t in run.ticks]
    spins = {
        "best": [np.empty((0, 3)) if result is None else result.best_rps[None] for result in results],
        "rivals": [np.empty((0, 3)) if result is None else result.rivals_rps for result in results],
    }
    if run.truth is not None:
        t_us = np.array([tick.track.t_us for tick in run.ticks])
        true_rps = run.true_values(t_us, run.truth.spin_rps)
        known = [result is not None and np.isfinite(spin).all() for result, spin in zip(results, true_rps, strict=True)]
        spins["truth"] = [spin[None][: int(shown)] for spin, shown in zip(true_rps, known, strict=True)]
    return [*_over_magnitude(run, results, spins), *_over_axes(run, results, spins)]


def _over_magnitude(run: Run, results: list[ContrastResult | None], spins: dict[str, list[Floats]]) -> list[Chunk]:
    """Bars over rps: the score and the marks; those below zero may have other axes."""
    curves = [(np.empty(0), np.empty(0)) if r is None else (r.magnitudes_rps, r.magnitude_scores) for r in results]
    widths = [float(x[1] - x[0]) if x.size > 1 else 1.0 for x, _ in curves]
    chunks = bars(f"{at.SCORE_MAGNITUDE}/score", run.times_us, [_NONE, *curves], [1.0, *widths], at.MASK_COLOUR)
    for name, column in spins.items():
        colour, length, _ = MARKS[name]
        marks, mark_widths = [_NONE], [1.0]
        for (x, y), rows in zip(curves, column, strict=True):
            magnitudes = np.linalg.norm(rows, axis=1)
            marks.append((magnitudes, np.full(magnitudes.size, length * y.max(initial=0.0))))
            mark_widths.append(MARK_WIDTH * float(x.max(initial=1.0)))
        chunks += bars(f"{at.SCORE_MAGNITUDE}/{name}", run.times_us, marks, mark_widths, colour)
    return chunks


_NONE: tuple[Floats, Floats] = (np.empty(0), np.empty(0))


def _over_axes(run: Run, results: list[ContrastResult | None], spins: dict[str, list[Floats]]) -> list[Chunk]:
    """Two discs of axis directions: those towards the camera and those away from it, x right and y down in both."""
    pictures = [_blank()]
    last: ContrastResult | None = None
    for result in results:
        if result is None:
            pictures.append(_blank())
        elif last is not None and np.array_equal(result.direction_scores, last.direction_scores):
            pictures.append(pictures[-1])  # the tick followed the last full estimate
        else:
            pictures.append(_heat(result.directions, result.direction_scores))
        last = result
    chunks = [
        columns_at(at.SCORE_AXES, run.times_us, rr.EncodedImage.columns(blob=pictures)),
        once(at.SCORE_AXES, rr.EncodedImage.from_fields(media_type="image/png", draw_order=-10.0)),
    ]
    for name, column in spins.items():
        columns = rr.Points2D.columns(positions=np.concatenate([_on_map(rows) for rows in column]))
        colour, _, radius = MARKS[name]
        style = rr.Points2D.from_fields(colors=[colour], radii=[-radius], draw_order=40.0 - radius)
        entity = f"{at.SCORE_AXES}/{name}"
        chunks += [once(entity, style), columns_at(entity, run.times_us, columns, [0, *map(len, column)])]
    return chunks


def _on_map(spins_rps: Floats) -> NDArray[np.float32]:
    """(n, 2) where the axes of spins (n, 3) lie on the map."""
    axes = spins_rps / np.linalg.norm(spins_rps, axis=1)[:, None]
    right = np.where(axes[:, 2] < 0, 0, 2 * DISC_RADIUS_PX + GAP_PX)
    x, y = DISC_RADIUS_PX * (1 + axes[:, 0]) + right, DISC_RADIUS_PX * (1 + axes[:, 1])
    return np.stack([x, y], axis=1).astype(np.float32)


def _heat(directions: Floats, scores: Floats) -> bytes:
    """PNG: at every axis the mean of the scores around it, dark = none, light = the highest."""
    mean = _weights(directions.astype(np.float32).tobytes()) @ scores.astype(np.float32)
    grey = np.clip(BRIGHTEST * mean / max(float(scores.max()), 1e-9), 0, BRIGHTEST).astype(np.uint8)
    side = 2 * DISC_RADIUS_PX
    values = np.zeros((side, AXES_WIDTH_PX), np.uint8)
    values[:, :side], values[:, -side:] = (cv2.resize(half, (side, side)) for half in grey)
    picture = np.full((side, AXES_WIDTH_PX, 3), at.BACKGROUND[0], np.uint8)
    cv2.copyTo(cv2.applyColorMap(values, cv2.COLORMAP_BONE), _discs(), picture)
    return bytes(cv2.imencode(".png", picture, PNG_QUICK)[1])


@cache
def _discs() -> NDArray[np.uint8]:
    """Where the two discs are in the picture: 1, else 0."""
    mask = np.zeros((2 * DISC_RADIUS_PX, AXES_WIDTH_PX), np.uint8)
    for x in (DISC_RADIUS_PX, AXES_WIDTH_PX - DISC_RADIUS_PX):
        cv2.circle(mask, (x, DISC_RADIUS_PX), DISC_RADIUS_PX, 1, cv2.FILLED)
    return mask


@lru_cache(4)  # contrast scores the same directions again and again
def _weights(directions: bytes) -> NDArray[np.float32]:
    """(2, COARSE, COARSE, n) how much each of the directions (n, 3) float32 shines on the axes; the sum is 1."""
    weights = np.exp((_axes() @ np.frombuffer(directions, np.float32).reshape(-1, 3).T - 1) / np.float32(REACH_RAD**2))
    whole: NDArray[np.float32] = weights / weights.sum(axis=-1, keepdims=True)
    return whole


@cache
def _axes() -> NDArray[np.float32]:
    """(2, COARSE, COARSE, 3) the axes behind the pixels of a coarse picture of each disc; the rim's beyond it."""
    side = (np.arange(COARSE) + 0.5) / COARSE * 2 - 1
    x, y = np.meshgrid(side, side)
    z = np.sqrt(np.clip(1 - x**2 - y**2, 0, None))
    axes = np.stack([np.stack([x, y, -z], axis=-1), np.stack([x, y, z], axis=-1)])
    whole: NDArray[np.float32] = (axes / np.linalg.norm(axes, axis=-1, keepdims=True)).astype(np.float32)
    return whole


@cache
def _blank() -> bytes:
    return _heat(np.array([[0.0, 0.0, 1.0]]), np.zeros(1))
