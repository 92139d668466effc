"""Drawing of a spin's witnesses: each one's axis with its 2 sigma ellipse, its magnitudes, and its odds."""

from __future__ import annotations

from functools import cache

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from spinscope.pipeline.registry import STAGES
from spinscope.pipeline.spin.combined.result import CombinedResult, Witness
from spinscope.pipeline.spin.combined.stage import METHOD as COMBINED
from spinscope.pipeline.stage import SpinMethod

from . import entities as at
from .rerun_api import Chunk, columns_at, once, strips, styled
from .run import ViewedRun

Floats = NDArray[np.float64]

# Two discs of axes, those towards the camera and those away from it, and below them bars over magnitude.
DISC_RADIUS_PX, GAP_PX = 60.0, 20.0
WIDTH_PX = 4 * DISC_RADIUS_PX + GAP_PX
BARS_TOP_PX, ROW_PX = 2 * DISC_RADIUS_PX + 30.0, 40.0  # words are as large in a small pane: they need their rows
NAMES_X_PX, MARGIN_PX = -150.0, 300.0
ODDS_X_PX, ODDS_MARGIN_PX = WIDTH_PX + 130.0, 260.0
MAX_RPS, GRID_RPS = 150.0, 50.0
SIGMAS = 2.0
ELLIPSE_POINTS = 49
# Every witness that there may be, the combined answer last; the truth below all.
SIGHTINGS = "logo"
NAMES = ("rate", "normal_flow", "contrast", "trajectory", SIGHTINGS, COMBINED)
TRUTH = "truth"
Strips = list[Floats]


def witness_chunks(run: ViewedRun) -> list[Chunk]:
    """Ellipses, bars and odds at every tick; empty where a witness tells nothing."""
    results = run.results(COMBINED)
    if not results:
        return []
    chunks = [*_frame()]
    for row, name in enumerate(NAMES):
        said = [_said(result, name) for result in results]
        chunks += _drawn(run, name, _colour(name), _strips(said, row))
        chunks += _odds(run, name, row, said)
    if run.true_spins_rps is not None:
        truth = [
            Witness(TRUTH, spin, np.zeros((3, 3)), float(np.linalg.norm(spin)), 0.5)
            if np.isfinite(spin).all() and spin.any()
            else None
            for spin in run.true_spins_rps
        ]
        chunks += _drawn(run, TRUTH, at.TRUTH_COLOUR, _strips(truth, len(NAMES)))
    return chunks


def _said(result: CombinedResult, name: str) -> Witness | None:
    """Evidence of one witness by itself, or the combined answer; None where it says nothing."""
    estimate = result.estimate
    if name != COMBINED:
        return next((one for one in result.witnesses if one.name == name), None)
    if estimate.vector_rps is None:
        return None
    spin = estimate.vector_rps, estimate.covariance_rps2
    return Witness(name, *spin, estimate.magnitude_rps, estimate.magnitude_std_rps)


def _colour(name: str) -> at.Colour:
    stage = STAGES[name]
    if isinstance(stage, SpinMethod):
        return stage.colour
    return at.OTHERS_COLOUR if name == SIGHTINGS else at.RATE_COLOUR


def _drawn(run: ViewedRun, name: str, colour: at.Colour, ticks: list[Strips]) -> list[Chunk]:
    entity = f"{at.WITNESSES}/{name}"
    columns = rr.LineStrips2D.columns(strips=strips([line for lines in ticks for line in lines]))
    return [
        styled(entity, rr.LineStrips2D, colors=colour, radii=-1.8),
        columns_at(entity, run.times_us, columns, [0, *map(len, ticks)]),
    ]


def _odds(run: ViewedRun, name: str, row: int, said: list[Witness | None]) -> list[Chunk]:
    """Odds of the combined spin against the next best one by one witness, where it speaks for or against it."""
    entity = f"{at.WITNESSES}/{name}/odds"
    texts = ["" if witness is None else witness.odds for witness in said]
    shown = [text for text in texts if text]
    place = ODDS_X_PX, BARS_TOP_PX + ROW_PX * (row + 0.2)
    columns = rr.Points2D.columns(positions=np.full((len(shown), 2), place), labels=shown)
    return [
        styled(entity, rr.Points2D, colors=_colour(name), radii=-0.1, show_labels=True),
        columns_at(entity, run.times_us, columns, [0, *(int(bool(text)) for text in texts)]),
    ]


def _strips(witnesses: list[Witness | None], row: int) -> list[Strips]:
    """Lines of one witness at every tick: its ellipse, a cross at its axis, its bar, and a mark at its magnitude.

    All ticks at once: one by one, with lines that Rerun converts, a flight of 20 ticks takes 3.6 times as long.
    """
    drawn: list[Strips] = [[] for _ in witnesses]
    known = [
        (lines, witness.spin_rps, witness.covariance_rps2)
        for lines, witness in zip(drawn, witnesses, strict=True)
        if witness is not None and witness.spin_rps is not None and witness.covariance_rps2 is not None
    ]
    with_axis = [one for one in known if one[1].any()]
    if with_axis:
        into, spins, covariances = zip(*with_axis, strict=True)
        for lines, ellipse in zip(into, _ellipses(np.array(spins), np.array(covariances)), strict=True):
            lines += ellipse
    for lines, witness in zip(drawn, witnesses, strict=True):
        if witness is not None and witness.magnitude_rps is not None and witness.magnitude_std_rps is not None:
            y, middle = BARS_TOP_PX + ROW_PX * (row + 0.5), witness.magnitude_rps
            reach = SIGMAS * witness.magnitude_std_rps
            low, at_magnitude, high = _bar_x(np.array([middle - reach, middle, middle + reach]))
            lines.append(np.array([[low, y], [high, y]]))
            lines.append(np.array([[at_magnitude, y - 4], [at_magnitude, y + 4]]))
    return drawn


def _bar_x(magnitudes_rps: Floats) -> Floats:
    """Columns of magnitudes, px; those beyond the scale stand at its end."""
    x: Floats = np.clip(magnitudes_rps, 0.0, MAX_RPS) * (WIDTH_PX / MAX_RPS)
    return x


def _ellipses(spins_rps: Floats, covariances_rps2: Floats) -> list[Strips]:
    """Ellipses of axes on the two discs, in pieces where they leave one of them, and a cross at each axis.

    Parameters
    ----------
    spins_rps : (n, 3) float64
        None of them zero.
    covariances_rps2 : (n, 3, 3) float64
        1-sigma covariances of the spins.
    """
    magnitudes = np.linalg.norm(spins_rps, axis=1)
    axes = spins_rps / magnitudes[:, None]
    across = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    values, vectors = np.linalg.eigh(across @ covariances_rps2 @ across)
    sigmas = SIGMAS * np.sqrt(np.maximum(values[:, 1:], 0.0)) / magnitudes[:, None]
    reaches = vectors[:, :, 1:] * sigmas[:, None, :]
    angle = np.linspace(0.0, 2 * np.pi, ELLIPSE_POINTS)
    circle = np.stack([np.cos(angle), np.sin(angle)])
    points = axes[:, None, :] + np.swapaxes(reaches @ circle, 1, 2)
    points /= np.linalg.norm(points, axis=2)[:, :, None]
    places, centres = _on_discs(points), _on_discs(axes)
    arms = 3.0 * np.array([[[-1.0, 0.0], [1.0, 0.0]], [[0.0, -1.0], [0.0, 1.0]]])
    crosses = centres[:, None, None, :] + arms
    is_near = points[:, :, 2] < 0
    drawn = []
    for line, near, cross in zip(places, is_near, crosses, strict=True):
        pieces = [line] if near.all() or not near.any() else np.split(line, np.flatnonzero(np.diff(near)) + 1)
        drawn.append([*(piece for piece in pieces if len(piece) > 1), *cross])
    return drawn


def _on_discs(axes: Floats) -> Floats:
    """Places (..., 2) of unit vectors (..., 3), px: towards the camera on the left, away from it on the right."""
    right = np.where(axes[..., 2] < 0, 0.0, 2 * DISC_RADIUS_PX + GAP_PX)
    return np.stack([DISC_RADIUS_PX * (1 + axes[..., 0]) + right, DISC_RADIUS_PX * (1 + axes[..., 1])], axis=-1)


@cache
def _frame() -> list[Chunk]:
    """Rims of the discs, the bars' scale, and the names."""
    angle = np.linspace(0.0, 2 * np.pi, 91)
    rim = DISC_RADIUS_PX * (1 + np.column_stack([np.cos(angle), np.sin(angle)]))
    bottom = BARS_TOP_PX + ROW_PX * (len(NAMES) + 1)
    marks = np.arange(0.0, MAX_RPS + 1.0, GRID_RPS)
    scale = [np.array([[x, BARS_TOP_PX], [x, bottom]]) for x in _bar_x(marks)]
    rims = [rim, rim + np.array([2 * DISC_RADIUS_PX + GAP_PX, 0.0])]
    numbers = [*(f"{mark:.0f}" for mark in marks[:-1]), f"{marks[-1]:.0f} rps"]
    labels = [(number, (x, bottom - 8)) for number, x in zip(numbers, _bar_x(marks), strict=True)]
    labels += [("towards", (DISC_RADIUS_PX, -16.0)), ("away", (3 * DISC_RADIUS_PX + GAP_PX, -16.0))]
    labels.append(("odds over the next", (ODDS_X_PX, BARS_TOP_PX - 18.0)))
    names = [*("Logo seen or not" if name == SIGHTINGS else STAGES[name].label for name in NAMES), "Truth"]
    colours = [*map(_colour, NAMES), at.TRUTH_COLOUR]
    places = [(NAMES_X_PX, BARS_TOP_PX + ROW_PX * (row + 0.2)) for row in range(len(names))]
    return [
        once(f"{at.WITNESSES}/frame", rr.LineStrips2D([*rims, *scale], colors=[at.MASK_COLOUR], radii=[-0.7])),
        once(
            f"{at.WITNESSES}/labels",
            rr.Points2D(
                [*(place for _, place in labels), *places],
                labels=[*(text for text, _ in labels), *names],
                colors=[*[at.MASK_COLOUR] * len(labels), *colours],
                radii=[-0.1] * len(labels) + [-3.0] * len(names),
                show_labels=True,
            ),
        ),
    ]


def bounds() -> Floats:
    """Visible part of the picture, (2, 2), px: x and y, from and to."""
    bottom = BARS_TOP_PX + ROW_PX * (len(NAMES) + 1) + 44.0
    return np.array([[-MARGIN_PX, WIDTH_PX + ODDS_MARGIN_PX], [-36.0, bottom]])
