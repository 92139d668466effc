"""Viewer: every stage of a run on one timeline, in a file, in Rerun's own window, or in the web application.

Nothing here loads Rerun before `save` or `show_window` is called: the other commands must not wait for it.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from spinscope.pipeline.errors import SpinscopeError

if TYPE_CHECKING:
    from spinscope.pipeline.session import Result


def save(result: Result, path: Path, layout: str = "all", followed: int | None = None) -> None:
    """Write a result as an .rrd file with all views in it; the file appears whole or not at all.

    Parameters
    ----------
    result : Result
        The result.
    path : Path
        File to write.
    layout : str
        Name of the view in front.
    followed : int, optional
        Number of the shot, from 1, whose ball the detail views follow while it flies.

    Raises
    ------
    RecordingError
        When the file cannot be written.
    """
    from .rrd import write_rrd
    from .run import ViewedRun

    write_rrd(ViewedRun.of(result, followed), path, layout)


def require_display() -> None:
    """Raise SpinscopeError where Rerun's own window cannot open; called before the work is done."""
    linux = sys.platform.startswith("linux")
    if linux and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise SpinscopeError(
            "there is no display for Rerun's window: leave out --native to get an address for the browser, "
            "or use --save FILE.rrd"
        )


def show_window(result: Result, layout: str = "all", followed: int | None = None) -> None:
    """Show the run in Rerun's own window until that is closed; raises SpinscopeError where no window can open."""
    from .native import show_native
    from .run import ViewedRun

    show_native(ViewedRun.of(result, followed), layout)
