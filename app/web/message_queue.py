"""Coalescing queues between the threads of a client session and its connection: only the newest entries stay."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import AsyncIterator

from .message_schemas import ServerMessage
from .schemas import RunRequest


class Superseded(Exception):  # no error: the client wants something newer
    """A newer request came in, or the client left."""


class RequestQueue:
    """Newest run request of a client; each one supersedes those before it."""

    def __init__(self) -> None:
        self._waiting: RunRequest | None = None
        self._newest = -1
        self._closed = False
        self._changed = threading.Condition()

    def put(self, request: RunRequest) -> bool:
        """Add a request; False when a newer one has come in already."""
        with self._changed:
            if request.serial <= self._newest:
                return False
            self._newest, self._waiting = request.serial, request
            self._changed.notify()
            return True

    def get(self, timeout_s: float | None = None) -> RunRequest | None:
        """Take the newest request, waiting for one; None after the timeout. Raises Superseded once closed."""
        with self._changed:
            self._changed.wait_for(lambda: self._closed or self._waiting is not None, timeout_s)
            if self._closed:
                raise Superseded
            request, self._waiting = self._waiting, None
            return request

    def check(self, request: RunRequest) -> None:
        """Raise Superseded where the request is not the newest one any more."""
        if self._closed or request.serial != self._newest:
            raise Superseded

    def rest(self, request: RunRequest, seconds: float) -> None:
        """Wait for so long whether a newer request comes in; raises Superseded where one does."""
        with self._changed:
            self._changed.wait_for(lambda: self._closed or request.serial != self._newest, seconds)
        self.check(request)

    def close(self) -> None:
        """Supersede everything: the client left."""
        with self._changed:
            self._closed = True
            self._changed.notify()


class MessageQueue:
    """Messages from any thread to the one reader that holds the client's connection."""

    def __init__(self) -> None:
        self._waiting: dict[tuple[str, bool], ServerMessage] = {}
        self._lock = threading.Lock()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._ready: asyncio.Event | None = None
        self._closed = False

    def put(self, message: ServerMessage) -> None:
        """Add a message in place of an unread one of its kind; progress does not take the place of a picture."""
        slot = message.kind, getattr(message, "picture", None) is not None
        with self._lock:
            self._waiting.pop(slot, None)
            self._waiting[slot] = message
        self._wake()

    def close(self) -> None:
        """End the reading."""
        self._closed = True
        self._wake()

    async def messages(self) -> AsyncIterator[ServerMessage]:
        """Yield messages as they come, until closed; a second reader takes the first one's place."""
        self._loop, mine = asyncio.get_running_loop(), asyncio.Event()
        if self._ready is not None:
            self._ready.set()
        self._ready = mine
        mine.set()
        while True:
            await mine.wait()
            mine.clear()
            if self._closed or self._ready is not mine:
                return
            with self._lock:
                waiting, self._waiting = self._waiting, {}
            for message in waiting.values():
                yield message

    def _wake(self) -> None:
        loop, ready = self._loop, self._ready
        if loop is not None and ready is not None and not loop.is_closed():
            loop.call_soon_threadsafe(ready.set)
