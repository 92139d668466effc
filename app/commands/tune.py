"""`spinscope tune`: the page with a slider for every parameter beside the viewer."""

from __future__ import annotations

from pathlib import Path

import click

from spinscope.pipeline.session import DEFAULT_SAMPLE, Choices

from .options import RECORDING, session_options


@click.command()
@click.argument("recording", type=RECORDING, default=DEFAULT_SAMPLE)
@click.option(
    "--port",
    type=click.IntRange(0, 65535),
    help="Port of the page; another free one is taken when it is busy.",
)
@click.option("--no-browser", is_flag=True, help="Only print the address.")
@session_options
def tune(recording: Path, port: int | None, no_browser: bool, choices: Choices) -> None:
    """Open a page with a slider for every parameter beside the viewer."""
    from ..web import serve

    serve(recording, choices, port, open_browser=not no_browser)
