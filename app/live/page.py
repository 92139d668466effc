"""The tuner's page on a running camera: its picture and state, and its last seconds and shots as recordings."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from spinscope.pipeline.niceness import lower_priority
from spinscope.pipeline.session import Choices

from ..terminal import note, until_interrupted
from ..web import serve
from .camera_thread import CameraThread
from .camera_view import CameraView
from .headless import Outputs, run_headless
from .opening import CameraChoice
from .shot_table import events_folder

KEPT_S = 30.0
PAGE_NICENESS = 5  # a third of the tracker's share where both want one core


def run_with_page(
    chosen: CameraChoice,
    choices: Choices,
    method: str,
    to: Outputs,
    *,
    port: int | None,
    open_browser: bool,
    hosts: Collection[str] = (),
    kept_s: float = KEPT_S,
) -> None:
    """Run a camera in a thread, and serve the page on it (see `serve`) from its first half second on until Ctrl-C.

    The last `kept_s` seconds can be looked at. The recordings go with the program. Raises SpinscopeError.
    """
    with TemporaryDirectory(prefix="spinscope-live-") as scratch:
        table = Path(scratch) / "live.csv"
        folder = events_folder(table)
        folder.mkdir()
        view = CameraView(folder, kept_s)
        work = CameraThread(lambda: run_headless(chosen, choices, method, replace(to, table=table), view), view)
        work.start()
        try:
            with until_interrupted():
                view.has_begun.wait()
                if view.is_open:
                    note("the page opens as soon as events have come")
                view.has_events.wait()
                if view.is_open and view.opened.recent.span_us is not None:
                    lower_priority(PAGE_NICENESS)
                    first = view.save_window(kept_s)
                    serve(first, choices.for_others, port, open_browser=open_browser, hosts=hosts, live=view)
        finally:
            work.end()
