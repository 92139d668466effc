"""Thread of a live run whose results a page shows."""

from __future__ import annotations

import threading
from collections.abc import Callable

from ..terminal import ends_on_signals
from .headless import LiveObserver, OpenLive


class CameraObserver(LiveObserver):
    """Observer of a live run behind a page, which knows the run once it has begun.

    Attributes
    ----------
    has_begun : threading.Event
        Set when the camera runs, or could not be opened.
    """

    def __init__(self) -> None:
        self.has_begun = threading.Event()
        self._open: OpenLive | None = None

    @property
    def is_open(self) -> bool:
        """Whether the run has begun."""
        return self._open is not None

    @property
    def opened(self) -> OpenLive:
        """The run."""
        assert self._open is not None
        return self._open

    def begin(self, live: OpenLive) -> None:
        """Take the run before it starts."""
        self._open = live
        self.has_begun.set()

    def end(self, error: Exception | None) -> None:
        """Take note that the run has ended, by an error or as it should."""
        self.has_begun.set()


class CameraThread(threading.Thread):
    """A live run beside a page's server.

    Parameters
    ----------
    work : callable
        Runs until the camera ends or is told to.
    observer : CameraObserver
        Onlooker of the run, told of its end.
    """

    def __init__(self, work: Callable[[], None], observer: CameraObserver) -> None:
        super().__init__(name="live", daemon=True)
        self._work, self._observer = work, observer
        self._error: Exception | None = None

    def run(self) -> None:
        """Body of the thread."""
        try:
            self._work()
        except Exception as error:  # noqa: BLE001  raised by `end`
            self._error = error
        finally:
            self._observer.end(self._error)

    def end(self) -> None:
        """Stop the run and wait for it, at Ctrl-C not for its spins; raises what ended it."""
        if self._observer.is_open:
            run = self._observer.opened.run
            run.stop()
            with ends_on_signals(run.end):
                self.join()
        if self._error is not None:
            raise self._error
