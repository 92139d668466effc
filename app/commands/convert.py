"""`spinscope convert`: a recording in another format."""

from __future__ import annotations

from pathlib import Path

import click

from spinscope.pipeline.recordings import ReadingOptions, writable_suffixes

from ..terminal import ProgressBar, note
from .options import RECORDING, reading_options, window_option


@click.command(
    help=f"Write a recording in another format, chosen by the suffix of TARGET ({', '.join(writable_suffixes())})."
)
@click.argument("source", type=RECORDING)
@click.argument("target", type=RECORDING)
@window_option
@click.option(
    "--roi",
    type=(int, int, click.IntRange(1), click.IntRange(1)),
    metavar="X Y W H",
    help="Write only the events in this rectangle, px; size of the sensor and coordinates stay.",
)
@click.option("--encoding", metavar="EVT2|EVT3", help="Encoding of a RAW file; EVT3 by default.")
@reading_options
def convert(
    source: Path,
    target: Path,
    reading: ReadingOptions,
    window: tuple[int, int] | None,
    roi: tuple[int, int, int, int] | None,
    encoding: str | None,
) -> None:
    """Convert a recording."""
    from spinscope.pipeline.recordings import convert as converted

    with ProgressBar() as bar:
        losses = converted(
            source,
            target,
            options=reading,
            window_us=window,
            roi_px=roi,
            encoding=encoding,
            on_progress=lambda share: bar(share, "converting"),
        )
    for loss in losses:
        note(f"warning: {loss}")
