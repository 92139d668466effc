"""The tuner's page over the shots of a running camera: each one is there as soon as it has ended."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from spinscope.pipeline.session import Choices

from ..terminal import note
from ..web import serve
from .headless import Outputs, run_headless
from .opening import CameraChoice
from .shot_table import events_folder

LOOK_S = 0.1


def run_with_page(
    chosen: CameraChoice, choices: Choices, method: str, to: Outputs, *, port: int | None, open_browser: bool
) -> None:
    """Run a camera in a thread, and serve the page of its shots from the first one on until Ctrl-C.

    The shots' events are in a folder that goes with the program, unless there is a table. Raises SpinscopeError.
    """
    with TemporaryDirectory(prefix="spinscope-live-") as scratch:
        table = to.table or Path(scratch) / "live.csv"
        work = _CameraThread(lambda on_start: run_headless(chosen, choices, method, replace(to, table=table), on_start))
        work.start()
        try:
            first = work.first_of(events_folder(table))
            if first is not None:
                note("the page lists the shots so far when it is loaded")
                serve(first, choices, port, open_browser=open_browser)
        except KeyboardInterrupt:
            pass
        finally:
            work.end()


class _CameraThread(threading.Thread):
    """A live run beside the page's server."""

    def __init__(self, work: Callable[[Callable[[Callable[[], None]], None]], None]) -> None:
        super().__init__(name="live", daemon=True)
        self._work = work
        self._stop_run: Callable[[], None] | None = None
        self._error: Exception | None = None

    def run(self) -> None:
        """Body of the thread."""
        try:
            self._work(self._begun)
        except Exception as error:  # noqa: BLE001  raised by `end`
            self._error = error

    def _begun(self, stop: Callable[[], None]) -> None:
        self._stop_run = stop

    def first_of(self, folder: Path) -> Path | None:
        """Wait for the first shot's recording; None when the camera has ended without one."""
        note("the page opens with the first shot")
        while True:
            is_over = not self.is_alive()
            found = sorted(folder.glob("*.h5"))
            if found or is_over:
                return found[0] if found else None
            time.sleep(LOOK_S)

    def end(self) -> None:
        """Stop the run and wait for it; raises what ended it."""
        if self._stop_run is not None:
            self._stop_run()
            self.join()
        if self._error is not None:
            raise self._error
