"""`spinscope label`: places of the ball as truth for the ball detector."""

from __future__ import annotations

from pathlib import Path

import click

from ..terminal import note
from .options import RECORDING, sensor_option


@click.command()
@click.argument("recording", type=RECORDING)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    metavar="TRUTH.csv",
    help="Labels to write; NAME.labels.csv beside the recording by default, where `evaluate detector --real` looks.",
)
@sensor_option
def label(recording: Path, out: Path | None, sensor: tuple[int, int] | None) -> None:
    """Label the ball by blobs in frames of 10 ms, as the paper does: time, centre, radius and their error.

    The labels owe nothing to the ball detector, so that they can judge it. A ball must cross the image alone, before a
    background at rest.
    """
    from spinscope.pipeline.calibration.ball_labels import ball_labels
    from spinscope.pipeline.files import check_writable
    from spinscope.pipeline.recordings import open_recording

    out = out or recording.with_suffix(".labels.csv")
    check_writable(out, "labels")
    opened = open_recording(recording, sensor=sensor)
    labels = ball_labels(opened.read(), (opened.height_px, opened.width_px))
    labels.write(out)
    flights, std_px = int(labels.ball.max()), float(labels.std_px.mean())
    note(f"wrote {out}: {labels.t_us.size} labels of {flights} flights, +- {std_px:.2f} px on average")
