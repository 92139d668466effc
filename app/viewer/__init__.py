"""The viewer: every stage of a run on one timeline, in a file, in the browser or in Rerun's own window.

Nothing here loads Rerun before `save` or `show` is called: the other commands must not wait for it.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from spinscope.pipeline.errors import SpinscopeError

if TYPE_CHECKING:
    from spinscope.pipeline.session import Result


def save(result: Result, path: Path, layout: str = "all") -> None:
    """Write a result as an .rrd file with all views in it; the file appears whole or not at all.

    Parameters
    ----------
    result : Result
        The result.
    path : Path
        File to write.
    layout : str
        Name of the view in front.

    Raises
    ------
    RecordingError
        When the file cannot be written.
    """
    from .rrd import write_rrd
    from .run import ViewedRun

    write_rrd(ViewedRun.of(result), path, layout)


def require_display() -> None:
    """Raise SpinscopeError where Rerun's own window cannot open; called before the work is done."""
    linux = sys.platform.startswith("linux")
    if linux and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise SpinscopeError(
            "there is no display for Rerun's window: leave out --native to get an address for the browser, "
            "or use --save FILE.rrd"
        )


def show(
    result: Result,
    layout: str = "all",
    *,
    native: bool = False,
) -> None:
    """Show the run until Ctrl-C: in the browser, or in Rerun's own window until that is closed.

    Raises SpinscopeError when there is no display for the window, or no free port for the browser.
    """
    from .run import ViewedRun

    run = ViewedRun.of(result)
    if native:
        from .native import show_native

        show_native(run, layout)
    else:
        from .web import show_web

        show_web(run, layout)
