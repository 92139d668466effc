"""`spinscope view`: every stage of a recording in the viewer."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from spinscope.pipeline.errors import ParameterError
from spinscope.pipeline.files import check_writable
from spinscope.pipeline.flight_calibration import with_measured_up
from spinscope.pipeline.session import Choices, Session

from ..terminal import ProgressBar, note
from .options import RECORDING, ListingCommand, RegisteredName, page_options, rival_option, session_options


def _layouts() -> dict[str, str]:
    """Names of the tabs and what they show."""
    from ..viewer.views import views

    return {view.name: view.help for view in views()}


@click.command(cls=ListingCommand, title="Layouts", entries=_layouts)
@click.argument("recording", type=RECORDING)
@click.option(
    "--save",
    type=click.Path(path_type=Path),
    metavar="FILE.rrd",
    help="Write an .rrd file instead of opening the viewer.",
)
@click.option("--native", is_flag=True, help="Open Rerun's own window instead of the browser.")
@click.option(
    "--layout",
    type=RegisteredName(lambda: tuple(_layouts())),
    default="all",
    show_default=True,
    help="Which tab is in front.",
)
@click.option(
    "--shot",
    "followed",
    type=click.IntRange(min=1),
    metavar="N",
    help="Follow the ball of shot N, as `analyze` numbers them; the first ball by default.",
)
@page_options
@session_options
@rival_option
def view(
    recording: Path,
    save: Path | None,
    native: bool,
    layout: str,
    followed: int | None,
    page: dict[str, Any],
    choices: Choices,
) -> None:
    """Show every stage of a recording in the viewer."""
    if not (save or native):
        from ..web import serve

        serve(recording, choices, **page, tools=False, layout=layout, followed=followed)
        return
    from .. import viewer

    if save:
        check_writable(save, ".rrd file")
    else:
        viewer.require_display()
    with ProgressBar() as bar:
        session = Session.open(recording, choices, bar)
        session = session.clip_for_viewing(bar)
        result = with_measured_up(session, lambda: session.estimate_keeping_ticks(bar))
        if followed is not None and followed > len(result.shots):
            raise ParameterError(f"--shot {followed}: there are {len(result.shots)} shots, numbered from 1")
        for warning in session.warnings:
            note(f"warning: {warning}")
        if save:
            viewer.save(result, save, layout, followed)
    if save:
        note(f"saved {save} ({save.stat().st_size / 1e6:.1f} MB): `uv run rerun {save}` opens it")
    else:
        viewer.show_window(result, layout, followed)
