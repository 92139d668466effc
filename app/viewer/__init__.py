"""The viewer: every stage of a run on one timeline, in a file, in the browser or in Rerun's own window.

Nothing here loads Rerun before `save` or `show` is called: the other commands must not wait for it.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from spinscope.pipeline.chain import Tick
from spinscope.pipeline.errors import SpinscopeError
from spinscope.pipeline.shots import Shot

if TYPE_CHECKING:
    from ..session import Session

LAYOUTS = ("all", "tracker", "logo", "spin", "coach")


def save(
    session: Session,
    ticks: Sequence[Tick],
    shots: Sequence[Shot],
    path: Path,
    layout: str = "all",
    *,
    no_shot_reason: str | None = None,
) -> None:
    """Write the run as an .rrd file with its layouts in it; the file appears whole or not at all.

    layout : which tab is in front (LAYOUTS)
    no_shot_reason : why there is no shot, in words, when there is none
    Raises RecordingError when the file cannot be written.
    """
    from .recorded import write_rrd
    from .run import Run

    write_rrd(Run.of(session, ticks, shots, no_shot_reason), path, layout)


def require_display() -> None:
    """Raise SpinscopeError where Rerun's own window cannot open: to be asked before the work is done."""
    linux = sys.platform.startswith("linux")
    if linux and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise SpinscopeError(
            "there is no display for Rerun's window: leave out --native to get an address for the browser, "
            "or use --save FILE.rrd"
        )


def show(
    session: Session,
    ticks: Sequence[Tick],
    shots: Sequence[Shot],
    layout: str = "all",
    *,
    native: bool = False,
    no_shot_reason: str | None = None,
) -> None:
    """Show the run until Ctrl-C: in the browser, or in Rerun's own window until that is closed.

    Raises SpinscopeError when there is no display for the window, or no free port for the browser.
    """
    from .run import Run

    run = Run.of(session, ticks, shots, no_shot_reason)
    if native:
        from .native import show_native

        show_native(run, layout)
    else:
        from .web import show_web

        show_web(run, layout)
