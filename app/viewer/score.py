"""Drawing of contrast's score: over magnitudes along the best axis, and over directions of the axis.

A single sharp maximum is a safe answer; another nearly as high is a rival, marked where the search found it. Both
pictures are of the last full estimate.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, lru_cache

import cv2
import numpy as np
import rerun as rr
from numpy.typing import NDArray

from spinscope.pipeline.spin import contrast
from spinscope.pipeline.spin.contrast import ContrastResult

from . import entities as at
from .png import png
from .rerun_api import Chunk, bars, columns_at, once, styled
from .run import ViewedRun, vector_of

Floats = NDArray[np.float64]

# The scores are averaged in so many cells a side, 3.6 degrees in the middle, far below their reach.
COARSE, COARSE_GAP, CELL_PX = 32, 3, 6
COARSE_WIDTH = 2 * COARSE + COARSE_GAP
DISC_RADIUS_PX, GAP_PX = COARSE * CELL_PX // 2, COARSE_GAP * CELL_PX
# Reach of a scored direction: half the distance of the hundred scored directions from each other.
REACH_RAD = 0.18
BRIGHTEST = 150  # grey value of the highest score: the marks on it must stand out
MARK_WIDTH = 0.008  # of the curve's span
_NONE: tuple[Floats, Floats] = (np.empty(0), np.empty(0))


@dataclass(frozen=True)
class _Marks:
    """Spins marked on both pictures.

    Attributes
    ----------
    name : str
        Last part of the entity path, as the legend shows it.
    colour : (int, int, int)
        Red, green and blue, 0..255.
    height : float
        On the curve, of the highest score; below zero unless it is the curve's own maximum: the axis may be another.
    radius_ui : float
        On the map, in points of the screen.
    spins_rps : list of (k, 3) float64
        Spins at every tick.
    """

    name: str
    colour: at.Colour
    height: float
    radius_ui: float
    spins_rps: list[Floats]


def score_chunks(run: ViewedRun) -> list[Chunk]:
    """Both pictures at every tick, with the answers of all methods; empty where contrast has no best spin."""
    results = [result if result.magnitudes_rps.size else None for result in run.results("contrast")]
    if not results:
        return []
    none = np.empty((0, 3))
    best = [none if result is None else result.best_rps[None] for result in results]
    rivals = [none if result is None else result.rivals_rps for result in results]
    marks = [
        _Marks("best", contrast.STAGE.colour, 1.0, 6.0, best),
        _Marks("rivals", at.HOUGH_COLOUR, -0.16, 4.0, rivals),
    ]
    for method in run.methods:
        if method is not contrast.STAGE:
            answers = [vector_of(tick.estimates[method.name]) for tick in run.ticks]
            marks.append(_Marks(method.name, method.colour, -0.12, 3.5, _known(answers, results)))
    if run.true_spins_rps is not None:
        truths = _known(list(run.true_spins_rps), results)
        marks.append(_Marks("truth", at.TRUTH_COLOUR, -0.08, 3.0, truths))
    return [*_over_magnitude(run, results, marks), *_over_axes(run, results, marks)]


def _known(spins_rps: list[Floats], results: list[ContrastResult | None]) -> list[Floats]:
    """Rows (0 or 1, 3) of the spins that have an axis, where there is a score."""
    rows = zip(spins_rps, results, strict=True)
    return [spin[None][: int(result is not None and np.isfinite(spin).all() and spin.any())] for spin, result in rows]


def _over_magnitude(run: ViewedRun, results: list[ContrastResult | None], marks: list[_Marks]) -> list[Chunk]:
    """Bars over magnitude in rps, of the score and of the marks."""
    curves = [_NONE if r is None else (r.magnitudes_rps, r.magnitude_scores) for r in results]
    widths = [float(x[1] - x[0]) if x.size > 1 else 1.0 for x, _ in curves]
    chunks = bars(f"{at.SCORE_MAGNITUDE}/score", run.times_us, [_NONE, *curves], [1.0, *widths], at.MASK_COLOUR)
    mark_widths = [1.0, *(MARK_WIDTH * float(x.max(initial=1.0)) for x, _ in curves)]
    for mark in marks:
        rows = [_NONE]
        for (_, y), spins in zip(curves, mark.spins_rps, strict=True):
            magnitudes = np.linalg.norm(spins, axis=1)
            rows.append((magnitudes, np.full(magnitudes.size, mark.height * y.max(initial=0.0))))
        chunks += bars(f"{at.SCORE_MAGNITUDE}/{mark.name}", run.times_us, rows, mark_widths, mark.colour)
    return chunks


def _over_axes(run: ViewedRun, results: list[ContrastResult | None], marks: list[_Marks]) -> list[Chunk]:
    """Two discs of axis directions: those towards the camera and those away from it, x right and y down in both."""
    times, pictures = [run.start_us], [np.full((COARSE, COARSE_WIDTH, 3), at.BACKGROUND, np.uint8)]
    last: Floats | None = None
    for end_us, result in zip(run.ends_us, results, strict=True):
        scores = None if result is None else result.direction_scores
        if scores is last or (scores is not None and last is not None and np.array_equal(scores, last)):
            continue  # the tick followed the last full estimate
        last = scores
        times.append(end_us)
        pictures.append(pictures[0] if result is None else _heat(result.directions, result.direction_scores))
    form = rr.components.ImageFormat(width=COARSE_WIDTH, height=COARSE, color_model="RGB", channel_datatype="U8")
    columns = rr.Image.columns(buffer=np.array(pictures).reshape(len(pictures), -1), format=[form] * len(pictures))
    heat = f"{at.SCORE_AXES}/score"
    chunks = [
        columns_at(heat, np.array(times), columns),
        styled(heat, rr.Image, magnification_filter="linear", draw_order=-20.0),
        *_frame(heat),
    ]
    for mark in marks:
        columns = rr.Points2D.columns(positions=_on_map(np.concatenate(mark.spins_rps)))
        entity, order = f"{at.SCORE_AXES}/{mark.name}", 40.0 - mark.radius_ui
        chunks.append(styled(entity, rr.Points2D, colors=mark.colour, radii=-mark.radius_ui, draw_order=order))
        chunks.append(columns_at(entity, run.times_us, columns, [0, *map(len, mark.spins_rps)]))
    return chunks


def _on_map(spins_rps: Floats) -> NDArray[np.float32]:
    """Places (n, 2) of the axes of spins (n, 3) on the map, px."""
    axes = spins_rps / np.linalg.norm(spins_rps, axis=1)[:, None]
    right = np.where(axes[:, 2] < 0, 0, 2 * DISC_RADIUS_PX + GAP_PX)
    x, y = DISC_RADIUS_PX * (1 + axes[:, 0]) + right, DISC_RADIUS_PX * (1 + axes[:, 1])
    return np.stack([x, y], axis=1).astype(np.float32)


def _heat(directions: Floats, scores: Floats) -> NDArray[np.uint8]:
    """Picture (COARSE, COARSE_WIDTH, 3) of the mean score around every axis, dark = none, light = the highest."""
    best, others = _weights(directions[:1].tobytes()), _weights(directions[1:].tobytes())
    weighted = best @ scores[:1].astype(np.float32) + others @ scores[1:].astype(np.float32)
    mean = weighted / (best.sum(axis=-1) + others.sum(axis=-1))
    values = np.zeros((COARSE, COARSE_WIDTH), np.uint8)
    grey = np.clip(BRIGHTEST * mean / max(float(scores.max()), 1e-9), 0, BRIGHTEST)
    values[:, :COARSE], values[:, -COARSE:] = grey
    return np.asarray(cv2.applyColorMap(values, cv2.COLORMAP_BONE)[..., ::-1], np.uint8)


@cache
def _frame(heat: str) -> list[Chunk]:
    """Surroundings of the two discs, laid over the coarse picture, and the scale of that."""
    shape = 2 * DISC_RADIUS_PX, 4 * DISC_RADIUS_PX + GAP_PX
    hidden = np.full(shape, 255, np.uint8)
    for x in (DISC_RADIUS_PX, shape[1] - DISC_RADIUS_PX):
        cv2.circle(hidden, (x, DISC_RADIUS_PX), DISC_RADIUS_PX, 0, cv2.FILLED, cv2.LINE_AA)
    picture = np.dstack([np.full((*shape, 3), at.BACKGROUND, np.uint8), hidden])
    # Only what is not quite opaque lets through what is below its holes.
    around = rr.EncodedImage(contents=png(picture), media_type="image/png", draw_order=-10.0, opacity=0.999)
    return [once(heat, rr.Transform3D(scale=CELL_PX)), once(at.SCORE_AXES, around)]


@lru_cache(16)
def _weights(directions: bytes) -> NDArray[np.float32]:
    """Weights (2, COARSE, COARSE, n) of directions (n, 3) float64; all but an estimate's own are always the same."""
    rows = np.frombuffer(directions).reshape(-1, 3).astype(np.float32)
    weights: NDArray[np.float32] = np.exp((_axes() @ rows.T - 1) / np.float32(REACH_RAD**2))
    return weights


@cache
def _axes() -> NDArray[np.float32]:
    """Axes (2, COARSE, COARSE, 3) behind the pixels of the coarse picture's discs; beyond the rim those of the rim."""
    side = (np.arange(COARSE) + 0.5) / COARSE * 2 - 1
    x, y = np.meshgrid(side, side)
    z = np.sqrt(np.clip(1 - x**2 - y**2, 0, None))
    axes = np.stack([np.stack([x, y, -z], axis=-1), np.stack([x, y, z], axis=-1)])
    whole: NDArray[np.float32] = (axes / np.linalg.norm(axes, axis=-1, keepdims=True)).astype(np.float32)
    return whole
