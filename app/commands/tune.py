"""`spinscope tune`: the page with a slider for every parameter beside the viewer."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from spinscope.pipeline.session import DEFAULT_SAMPLE, Choices

from .options import RECORDING, page_options, rival_option, session_options


@click.command()
@click.argument("recording", type=RECORDING, default=DEFAULT_SAMPLE)
@page_options
@session_options
@rival_option
def tune(recording: Path, page: dict[str, Any], choices: Choices) -> None:
    """Open a page with a slider for every parameter beside the viewer."""
    from ..web import serve

    serve(recording, choices, **page)
