"""Two runs A and B beside each other: A under a prefix of its own and paler, what differs, and the view of both."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from . import entities as at
from . import panes
from .ball_projections import sphere
from .derotated_logo import bounds as logo_bounds
from .image import ball_places
from .png import png
from .rerun_api import Chunk, columns_at, once, strips, styled
from .run import ViewedRun, shown_estimate, vector_of

Floats = NDArray[np.float64]

A = "/A"
# Series of A are drawn in the colour of the same series of B, mixed with this.
PALE, PALENESS = (235, 235, 235), 0.55
GRID_DEG, GRID_POINTS = 30, 49  # of the sphere on which the axes stand
# Length and thickness of the axes on the unit sphere: where they agree, each still looks out of the next.
AXES = {"A": (1.2, 0.06), "B": (1.35, 0.04), "truth": (1.5, 0.02)}
HOW_TO_PIN = "Pin as A first (key a)"
EQUAL = "no difference"
ARC_POINTS = 17  # of the arc between two axes


def compared(a: Sequence[Chunk]) -> list[Chunk]:
    """The chunks of run A beside those of run B: under the prefix /A, paler, and named "A: ..." in plots."""
    own = [chunk for chunk in a if not (chunk.entity_path.startswith(at.PLOT) and "truth" in chunk.entity_path)]
    moved = [chunk.with_entity_path(A + chunk.entity_path) for chunk in own]
    return [
        *moved,
        *(_pale(chunk) for chunk in moved if chunk.is_static and chunk.entity_path.startswith(f"{A}{at.PLOT}")),
    ]


def note_without_a(run: ViewedRun) -> list[Chunk]:
    """Text of the comparison while nothing is pinned, and a hint in each pane that has nothing to show without A."""
    text = "## Nothing to compare yet\n\nPress **Pin as A** above the viewer, then change parameters: that is B."
    look: dict[str, Any] = {"labels": HOW_TO_PIN, "colors": at.OTHERS_COLOUR, "radii": -0.1, "show_labels": True}
    ball = np.zeros(2)  # a close-up's origin
    flat = {A + at.SURFACE: ball, at.SURFACE_DIFFERENCE: ball, A + at.DEROTATED_LOGO: logo_bounds().mean(axis=1)}
    return [
        *_note(run, text),
        once(A + at.BALL_PLACE, rr.Transform3D(translation=[0.0, 0.0, 0.0])),  # the close-up's origin
        *(once(entity, rr.Points2D([middle], **look)) for entity, middle in flat.items()),
        once(f"{at.COMPARED_AXES}/angle", rr.Points3D([[0.0, 0.0, 0.0]], **look)),
    ]


def note_with_a(run: ViewedRun, text: str) -> list[Chunk]:
    """Text of the comparison about A and B, with the colours of the curves."""
    colours = {
        "truth": at.TRUTH_COLOUR,
        "Kalman filter": at.KALMAN_COLOUR,
        "refined circle": at.MEASURED_COLOUR,
        "Hough": at.HOUGH_COLOUR,
        **{method.label: method.colour for method in run.methods},
        "event rate's zero crossings": at.RATE_COLOUR,
    }
    legend = ", ".join(f"{label} {at.colour_name(colour)}" for label, colour in colours.items())
    told = f"Curves: {legend}. A is paler. Axes: B yellow, truth violet."
    return _note(run, f"{text}\n\n{told} Difference: red where B is brighter, blue where A is.")


def difference_chunks(a: ViewedRun, b: ViewedRun) -> list[Chunk]:
    """Differences between the runs: surfaces around B's ball, and the axes of the shown spins on a unit sphere."""
    return [*_surface_difference(a, b), *_axes(a, b)]


def comparison(run: ViewedRun) -> rrb.Container:
    """Pictures of A and B side by side and as a difference, their curves in the same plots."""
    surfaces = [panes.close_up(run, "A", prefix=A), panes.close_up(run, "B"), panes.difference(run, "B − A")]
    logos = [panes.derotated_logo("A: logo", prefix=A), panes.derotated_logo("B: logo")]
    curves = [_plot("x", "x [px], A pale"), _plot("radius", "Radius [px]"), _plot("spin", "Spin [rps]")]
    answers = [panes.compared_axes("Axes"), panes.text(at.COMPARISON, "Differences")]
    return rrb.Vertical(
        rrb.Horizontal(
            rrb.Horizontal(*surfaces, name="Surfaces"),
            rrb.Horizontal(*logos, name="Logo"),
            column_shares=[9, 8],
            name="Pictures",
        ),
        rrb.Horizontal(
            rrb.Horizontal(*curves, name="Curves"),
            rrb.Horizontal(*answers, name="Answers"),
            column_shares=[3, 2],
            name="Numbers",
        ),
    )


def _plot(quantity: str, name: str) -> rrb.View:
    path = f"{at.PLOT}/{quantity}"
    return rrb.TimeSeriesView(
        origin="/",
        contents=[f"{path}/**", f"{A}{path}/**"],
        name=name,
        axis_x=rrb.TimeAxis(link="LinkToGlobal"),
        plot_legend=rrb.PlotLegend(visible=False),  # of twice the usual curves it would hide the plot
    )


def _surface_difference(a: ViewedRun, b: ViewedRun) -> list[Chunk]:
    """Surface of B less that of A at every tick of B, around B's ball: red where B is brighter, blue where A is.

    The root of the difference is the brightness: small ones are seen, too. Where there is none, a label says so.
    """
    half_px = int(np.ceil(panes.CLOSE_UP_RADII * b.largest_radius_px))
    before = np.searchsorted(a.ends_us, b.ends_us, side="right") - 1
    pictures, is_equal = [png(np.zeros((2 * half_px + 1, 2 * half_px + 1, 3), np.uint8))], [False]
    for tick, row, (x, y) in zip(b.ticks, before, ball_places(b)[1:], strict=True):
        own = _around(tick.surface.values, x, y, half_px)
        other = _around(a.ticks[row].surface.values, x, y, half_px) if row >= 0 else np.zeros_like(own)
        more, less = (np.sqrt(np.clip(sign * (own - other) / 255, 0, 1))[..., None] for sign in (1, -1))
        pictures.append(png((more * np.array(at.ON) + less * np.array(at.OFF)).astype(np.uint8)))
        is_equal.append(bool(np.array_equal(own, other)))
    corner = rr.Transform3D(translation=[-half_px - 0.5, -half_px - 0.5, 0.0])
    return [
        once(at.SURFACE_DIFFERENCE, corner, rr.EncodedImage.from_fields(media_type="image/png")),
        columns_at(at.SURFACE_DIFFERENCE, b.times_us, rr.EncodedImage.columns(blob=pictures)),
        styled(at.NO_DIFFERENCE, rr.Points2D, colors=at.OTHERS_COLOUR, radii=-0.1, show_labels=True),
        columns_at(at.NO_DIFFERENCE, b.times_us, _labels(EQUAL, sum(is_equal)), np.array(is_equal, np.int64)),
    ]


def _labels(text: str, count: int) -> Any:
    """So many points at the origin of a close-up with this label."""
    return rr.Points2D.columns(positions=np.zeros((count, 2), np.float32), labels=[text] * count)


def _around(values: NDArray[np.uint8], x: float, y: float, half_px: int) -> Floats:
    """Part of a picture around a place, black beyond its edges."""
    side = 2 * half_px + 1
    place = np.array([[1, 0, half_px - x], [0, 1, half_px - y]])
    return np.asarray(cv2.warpAffine(values, place, (side, side)), np.float64)


def _axes(a: ViewedRun, b: ViewedRun) -> list[Chunk]:
    """Shown axes of both runs on a unit sphere with the truth, and the angle on the arc from A to B."""
    spins = [np.array([vector_of(shown_estimate(tick)[0]) for tick in run.ticks]) for run in (a, b)]
    pale = _paler(at.RING_COLOUR)
    chunks = [
        _sphere(),
        *_arrow(a, "A", spins[0], pale),
        *_arrow(b, "B", spins[1], at.RING_COLOUR),
        *_arc(a, b, *spins),
    ]
    if b.true_spins_rps is not None:
        chunks += _arrow(b, "truth", np.nan_to_num(b.true_spins_rps) * b.has_ball[:, None], at.TRUTH_COLOUR)
    return chunks


def _sphere() -> Chunk:
    """Circles of longitude and latitude."""
    turn = np.linspace(-np.pi, np.pi, GRID_POINTS)
    steps = np.radians(np.arange(-180 + GRID_DEG, 180, GRID_DEG))
    circles = [sphere(step, turn / 2) for step in [*steps, np.pi]]
    circles += [sphere(turn, step) for step in steps if abs(step) < np.pi / 2]
    return once(f"{at.COMPARED_AXES}/sphere", rr.LineStrips3D(circles, colors=[(*at.MASK_COLOUR, 90)], radii=[-0.4]))


def _arrow(run: ViewedRun, name: str, spins_rps: Floats, colour: at.Colour) -> list[Chunk]:
    """Axis of a run at every tick at which it is known."""
    magnitudes = np.linalg.norm(spins_rps, axis=1)
    known = magnitudes > 0
    length, radius = AXES[name]
    axes = length * spins_rps[known] / magnitudes[known, None]
    entity, columns = f"{at.COMPARED_AXES}/{name}", rr.Arrows3D.columns(vectors=axes)
    style = styled(entity, rr.Arrows3D, colors=colour, radii=radius)
    return [style, columns_at(entity, run.times_us, columns, [0, *known.astype(int)])]


def _arc(a: ViewedRun, b: ViewedRun, spins_a: Floats, spins_b: Floats) -> list[Chunk]:
    """Arc from A's axis to B's at every tick of B at which both are known, labelled with its angle."""
    before = np.searchsorted(a.ends_us, b.ends_us, side="right") - 1
    first = spins_a[np.maximum(before, 0)] * (before >= 0)[:, None]
    lengths = [np.linalg.norm(spins, axis=1) for spins in (first, spins_b)]
    known = np.minimum(*lengths) > 0
    first, last = (spins[known] / length[known, None] for spins, length in zip((first, spins_b), lengths, strict=True))
    angles_deg = np.degrees(np.arccos(np.clip((first * last).sum(axis=1), -1, 1)))
    share = np.linspace(0, 1, ARC_POINTS)[:, None]
    chords = first[:, None] * (1 - share) + last[:, None] * share
    arcs = chords / np.maximum(np.linalg.norm(chords, axis=2, keepdims=True), 1e-9)
    columns = rr.LineStrips3D.columns(strips=strips(arcs, 3), labels=[f"{angle:.1f}°" for angle in angles_deg])
    entity = f"{at.COMPARED_AXES}/angle"
    style = styled(entity, rr.LineStrips3D, colors=at.OTHERS_COLOUR, radii=-1.5, show_labels=True)
    return [style, columns_at(entity, b.times_us, columns, [0, *known.astype(int)])]


def _paler(colour: at.Colour) -> at.Colour:
    """Colour of A for what B has in this one."""
    red, green, blue = (round(part + PALENESS * (light - part)) for part, light in zip(colour, PALE, strict=True))
    return red, green, blue


def _pale(style: Chunk) -> Chunk:
    """The style of a series, laid over its own: what is written later holds."""
    batch = style.to_record_batch()
    names = {field.name.split(":")[-1]: field.name for field in batch.schema}
    archetype = next(name.split(":")[0] for name in batch.schema.names if ":" in name)
    name = batch.column(names["names"])[0].as_py()[0]
    colour = batch.column(names["colors"])[0].as_py()[0] >> 8
    pale = _paler(((colour >> 16) & 255, (colour >> 8) & 255, colour & 255))
    made = getattr(rr, archetype).from_fields(names=f"A: {name}", colors=[(*pale, 255)])
    return once(style.entity_path, made)


def _note(run: ViewedRun, text: str) -> list[Chunk]:
    return [
        columns_at(at.COMPARISON, run.times_us[:1], rr.TextDocument.columns(text=[text])),
        styled(at.COMPARISON, rr.TextDocument, media_type="text/markdown"),
    ]
