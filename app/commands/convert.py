"""`spinscope convert`: a recording in another format."""

from __future__ import annotations

from pathlib import Path

import click

from spinscope.pipeline.recordings import writable_suffixes

from ..terminal import ProgressBar
from .options import RECORDING, sensor_option


@click.command(
    help=f"Write a recording in another format, chosen by the suffix of TARGET ({', '.join(writable_suffixes())})."
)
@click.argument("source", type=RECORDING)
@click.argument("target", type=RECORDING)
@sensor_option
def convert(source: Path, target: Path, sensor: tuple[int, int] | None) -> None:
    """Convert a recording."""
    from spinscope.pipeline.recordings import convert as converted

    with ProgressBar() as bar:
        converted(source, target, sensor=sensor, on_progress=lambda share: bar(share, "converting"))
