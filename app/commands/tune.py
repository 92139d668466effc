"""`spinscope tune`: the page with a slider for every parameter beside the viewer."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.session import DEFAULT_SAMPLE, Choices

from .options import RECORDING, page_options, rival_option, session_options


@click.command()
@click.argument("recordings", type=RECORDING, nargs=-1, metavar="[RECORDING|FOLDER]...")
@page_options
@session_options
@rival_option
def tune(recordings: tuple[Path, ...], page: dict[str, Any], choices: Choices) -> None:
    """Open a page with a slider for every parameter beside the viewer.

    It shows the first of the recordings, or the first of a folder; all others of the folders and below are opened from
    the page.
    """
    from ..web import serve
    from ..web.recording_folder import first_recording

    given = recordings or (DEFAULT_SAMPLE,)
    for path in given:
        if not path.exists():
            raise RecordingError(f"there is no such recording or folder: check the name: {path}")
    folders = [path if path.is_dir() else path.parent for path in given]
    first = first_recording(given[0], choices.reading) if given[0].is_dir() else given[0]
    serve(first, choices, folders=folders, **page)
