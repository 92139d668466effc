"""Search for the shots of a long recording while the page is already in use."""

from __future__ import annotations

import threading
import time

from spinscope.pipeline.registry import Parameters

from .jobs import error_text
from .message_queue import MessageQueue
from .message_schemas import ShotsMessage
from .open_recording import OpenRecording

REPORT_S = 0.3


class ShotDetectionJob:
    """Run of the tracker over a whole long recording, which reports the shots found to every client on it."""

    def __init__(self, recording: OpenRecording, parameters: Parameters) -> None:
        self._recording, self._parameters = recording, parameters
        self._share = 0.0
        self._queues: list[MessageQueue] = []
        self._closed = False
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._run, name="shots", daemon=True)
        self._thread.start()

    def add(self, queue: MessageQueue) -> None:
        """Report to this client too."""
        with self._lock:
            self._queues.append(queue)
        self._report()

    def remove(self, queue: MessageQueue) -> None:
        """Report to this client no longer."""
        with self._lock:
            if queue in self._queues:
                self._queues.remove(queue)

    def close(self) -> None:
        """Stop the search."""
        self._closed = True
        self._thread.join(2.0)

    def _run(self) -> None:
        reported_s = 0.0
        try:
            for share in self._recording.find_shots(self._parameters):
                self._share = share
                self._recording.make_way()
                if self._closed:
                    return
                if time.monotonic() - reported_s > REPORT_S:
                    reported_s = time.monotonic()
                    self._report()
        except Exception as error:  # noqa: BLE001  # whatever a stage raises, the clients are told
            self._report(error_text(error))
            return
        self._report()

    def _report(self, error: str | None = None) -> None:
        with self._lock:
            message = ShotsMessage(share=self._share, shots=self._recording.found_us, error=error)
            for queue in self._queues:
                queue.put(message)
