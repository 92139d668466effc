"""`spinscope label`: places of the ball as truth for the ball detector."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from spinscope.pipeline.errors import ParameterError
from spinscope.pipeline.recordings import ReadingOptions
from spinscope.pipeline.session import Choices

from ..terminal import note
from .options import RECORDING, page_options, reading_options


@click.command()
@click.argument("recording", type=RECORDING)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    metavar="TRUTH.csv",
    help="Labels to write; NAME.labels.csv beside the recording by default, where `evaluate detector --real` looks.",
)
@click.option("--view", is_flag=True, help="Go through the labels on the page: accept, move, delete.")
@page_options
@reading_options
def label(recording: Path, out: Path | None, view: bool, page: dict[str, Any], reading: ReadingOptions) -> None:
    """Label the ball by blobs in frames of 10 ms, as the paper does: time, centre, radius and their error.

    The labels owe nothing to the ball detector, so that they can judge it. A ball must cross the image alone, before a
    background at rest. With --view the page shows each label in its frame; labels that are there already are gone on
    with.
    """
    from spinscope.pipeline.calibration.ball_labels import DETECTED, BallLabels, ball_labels, labels_beside
    from spinscope.pipeline.files import check_writable
    from spinscope.pipeline.recordings import open_recording

    out = out or labels_beside(recording)
    check_writable(out, "labels")
    there = BallLabels.read(out) if out.is_file() else None
    if there is None or not view:
        if there is not None and (there.state != DETECTED).any():
            raise ParameterError(
                f"labels that somebody has gone through are there: go on with --view, or give another --out: {out}"
            )
        opened = open_recording(recording, **asdict(reading))
        labels = ball_labels(opened.read(), (opened.height_px, opened.width_px))
        labels.write(out)
        flights, std_px = int(labels.ball.max()), float(labels.std_px.mean())
        note(f"wrote {out}: {labels.t_us.size} labels of {flights} flights, +- {std_px:.2f} px on average")
    if view:
        from ..web import serve

        serve(recording, Choices(reading=reading), labels=out, **page)
