"""`spinscope label`: places of the ball as truth for the ball detector."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import click

from spinscope.pipeline.recordings import ReadingOptions

from ..terminal import note
from .options import RECORDING, reading_options


@click.command()
@click.argument("recording", type=RECORDING)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    metavar="TRUTH.csv",
    help="Labels to write; NAME.labels.csv beside the recording by default, where `evaluate detector --real` looks.",
)
@reading_options
def label(recording: Path, out: Path | None, reading: ReadingOptions) -> None:
    """Label the ball by blobs in frames of 10 ms, as the paper does: time, centre, radius and their error.

    The labels owe nothing to the ball detector, so that they can judge it. A ball must cross the image alone, before a
    background at rest.
    """
    from spinscope.pipeline.calibration.ball_labels import ball_labels
    from spinscope.pipeline.files import check_writable
    from spinscope.pipeline.recordings import open_recording

    out = out or recording.with_suffix(".labels.csv")
    check_writable(out, "labels")
    opened = open_recording(recording, **asdict(reading))
    labels = ball_labels(opened.read(), (opened.height_px, opened.width_px))
    labels.write(out)
    flights, std_px = int(labels.ball.max()), float(labels.std_px.mean())
    note(f"wrote {out}: {labels.t_us.size} labels of {flights} flights, +- {std_px:.2f} px on average")
