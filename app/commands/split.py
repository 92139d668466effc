"""`spinscope split`: the trials of a recording, cut by its triggers."""

from __future__ import annotations

from pathlib import Path

import click

from spinscope.pipeline.recordings import ReadingOptions

from ..terminal import note
from .options import RECORDING, reading_options


@click.command()
@click.argument("recording", type=RECORDING)
@click.option("--out", type=click.Path(path_type=Path), required=True, metavar="FOLDER", help="Folder of the trials.")
@click.option("--before-ms", type=click.FloatRange(0), default=0.0, help="Begin so long before each rising edge.")
@click.option(
    "--length-ms", type=click.FloatRange(0, min_open=True), help="End so long after it; at the next by default."
)
@click.option("--channel", type=click.IntRange(0, 255), help="Trigger input, where there are several.")
@reading_options
def split(
    recording: Path,
    out: Path,
    before_ms: float,
    length_ms: float | None,
    channel: int | None,
    reading: ReadingOptions,
) -> None:
    """Cut a recording into trials at the rising edges of its trigger input, each with the recording's sidecar."""
    from spinscope.pipeline.recordings.trials import split_by_triggers

    length_us = None if length_ms is None else round(length_ms * 1000)
    written = split_by_triggers(
        recording, out, before_us=round(before_ms * 1000), length_us=length_us, channel=channel, options=reading
    )
    note(f"wrote {len(written)} trials, {written[0]} to {written[-1].name}")
