"""Session of one client: its recording, its runs, its jobs and its messages."""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable
from typing import Any

from spinscope.app.viewer.drawing_cache import DrawingCache

from .jobs import Job, JobMessageType
from .message_queue import MessageQueue, RequestQueue
from .open_recording import OpenRecording
from .publisher import Publisher
from .runner import Runner


class ClientSession:
    """The server's side of one open page.

    Attributes
    ----------
    id : str
        Unguessable name of the session.
    requests, messages : RequestQueue, MessageQueue
        What the client wants, and what it is still to be told.
    listeners : int
        Connections that read the messages.
    """

    def __init__(self, recording: OpenRecording, drawings: DrawingCache) -> None:
        self.id = secrets.token_urlsafe(12)
        self.requests, self.messages = RequestQueue(), MessageQueue()
        self.publisher = Publisher(self.id, self.messages, drawings)
        self.runner = Runner(recording, self.requests, self.publisher)
        self.last_sign_of_life_s = time.monotonic()
        self.listeners = 0
        self._jobs: dict[str, Job] = {}

    def start(self, message: JobMessageType, work: Callable[[Job], Any]) -> None:
        """Start a job in place of the one of its kind."""
        kind = message.model_fields["kind"].default
        self.cancel(kind)
        self._jobs[kind] = Job(message, self.messages, work)

    def cancel(self, kind: str) -> None:
        """Cancel the job of a kind, if there is one."""
        if kind in self._jobs:
            self._jobs[kind].cancel()

    def close(self) -> None:
        """End the session's threads and its connection."""
        for job in self._jobs.values():
            job.cancel()
        self.requests.close()
        self.messages.close()

    def join(self, seconds: float) -> None:
        """Wait for the threads to end."""
        self.runner.join(seconds)
        for job in self._jobs.values():
            job.cancel(seconds)
