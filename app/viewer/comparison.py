"""Two runs A and B beside each other: A under a prefix of its own and paler, and the view of both."""

from __future__ import annotations

from collections.abc import Sequence

import rerun as rr
import rerun.blueprint as rrb

from . import entities as at
from . import panes
from .rerun_api import Chunk, columns_at, once, styled
from .run import ViewedRun

A = "/A"
# Series of A are drawn in the colour of the same series of B, mixed with this.
PALE, PALENESS = (235, 235, 235), 0.55


def compared(a: Sequence[Chunk]) -> list[Chunk]:
    """The chunks of run A beside those of run B: under the prefix /A, paler, and named "A: ..." in plots."""
    own = [chunk for chunk in a if not (chunk.entity_path.startswith(at.PLOT) and "truth" in chunk.entity_path)]
    moved = [chunk.with_entity_path(A + chunk.entity_path) for chunk in own]
    return [
        *moved,
        *(_pale(chunk) for chunk in moved if chunk.is_static and chunk.entity_path.startswith(f"{A}{at.PLOT}")),
    ]


def note_without_a(run: ViewedRun) -> list[Chunk]:
    """Text of the comparison while nothing is pinned."""
    text = "## Nothing to compare yet\n\nPress **Pin as A** above the viewer, then change parameters: that is B."
    return _note(run, text)


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
    return _note(run, f"{text}\n\nCurves: {legend}. A is paler.")


def comparison(run: ViewedRun) -> rrb.Container:
    """Pictures of A and B side by side, their curves in the same plots."""
    return rrb.Vertical(
        rrb.Horizontal(
            panes.close_up(run, "A: surface and circles", prefix=A),
            panes.close_up(run, "B: surface and circles"),
            panes.derotated_logo("A: derotated logo", prefix=A),
            panes.derotated_logo("B: derotated logo"),
            column_shares=[3, 3, 2, 2],
        ),
        rrb.Horizontal(
            _plot("x", "x [px], A pale"),
            _plot("radius", "Radius [px], A pale"),
            _plot("spin", "Spin [rps], A pale"),
            panes.text(at.COMPARISON, "Differences"),
            column_shares=[3, 3, 3, 2],
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


def _pale(style: Chunk) -> Chunk:
    """The style of a series, laid over its own: what is written later holds."""
    batch = style.to_record_batch()
    names = {field.name.split(":")[-1]: field.name for field in batch.schema}
    archetype = next(name.split(":")[0] for name in batch.schema.names if ":" in name)
    name = batch.column(names["names"])[0].as_py()[0]
    colour = batch.column(names["colors"])[0].as_py()[0] >> 8
    parts = [(colour >> shift) & 255 for shift in (16, 8, 0)]
    pale = [round(part + PALENESS * (light - part)) for part, light in zip(parts, PALE, strict=True)]
    made = getattr(rr, archetype).from_fields(names=f"A: {name}", colors=[(*pale, 255)])
    return once(style.entity_path, made)


def _note(run: ViewedRun, text: str) -> list[Chunk]:
    return [
        columns_at(at.COMPARISON, run.times_us[:1], rr.TextDocument.columns(text=[text])),
        styled(at.COMPARISON, rr.TextDocument, media_type="text/markdown"),
    ]
