"""The shots of a long recording, looked for while the page is already in use."""

from __future__ import annotations

import threading
import time

from spinscope.pipeline.registry import Parameters

from .bench import Bench
from .jobs import fault
from .outbox import Outbox

REPORT_S = 0.3


class ShotFinder:
    """Runs the tracker once over a whole long recording and tells every page on it what it finds."""

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        self.share = 0.0
        self._outboxes: list[Outbox] = []
        self._thread: threading.Thread | None = None
        self._closed = False
        self._lock = threading.Lock()

    def add(self, outbox: Outbox, parameters: Parameters) -> None:
        """Tell this page too; the search starts with the first one."""
        with self._lock:
            self._outboxes.append(outbox)
            if self._thread is None:
                self._thread = threading.Thread(target=self._find, args=(parameters,), name="shots", daemon=True)
                self._thread.start()
        self._tell()

    def remove(self, outbox: Outbox) -> None:
        """The page was closed."""
        with self._lock:
            if outbox in self._outboxes:
                self._outboxes.remove(outbox)

    def close(self) -> None:
        """Stop looking."""
        self._closed = True
        if self._thread is not None:
            self._thread.join(2.0)

    def _find(self, parameters: Parameters) -> None:
        told = 0.0
        try:
            for share in self.bench.find_shots(parameters):
                self.share = share
                self.bench.make_way()
                if self._closed:
                    return
                if time.monotonic() - told > REPORT_S:
                    told = time.monotonic()
                    self._tell()
        except Exception as error:  # noqa: BLE001  # whatever a stage raises, the pages are told
            self._tell(error=fault(error))
            return
        self._tell()

    def _tell(self, **more: str) -> None:
        with self._lock:
            for outbox in self._outboxes:
                outbox.put("shots", share=self.share, shots=self.bench.found, **more)
