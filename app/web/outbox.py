"""What a page is still to be told: the newest message of each kind, so that a slow reader costs nothing."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import AsyncIterator
from typing import Any

Message = dict[str, Any]


class Outbox:
    """Messages from any thread to the one reader that holds the page's connection."""

    def __init__(self) -> None:
        self._waiting: dict[str, Message] = {}
        self._lock = threading.Lock()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._ready: asyncio.Event | None = None
        self._closed = False

    def put(self, kind: str, **content: Any) -> None:
        """Leave a message; an older one of the same kind that was not read yet is dropped.

        One that names a recording stays until another one does: word of progress must not take a picture's place.
        """
        slot = f"{kind} with recording" if "recording" in content else kind
        with self._lock:
            self._waiting.pop(slot, None)
            self._waiting[slot] = {"kind": kind, **content}
        self._wake()

    def close(self) -> None:
        """End the reading."""
        self._closed = True
        self._wake()

    async def messages(self) -> AsyncIterator[Message]:
        """The messages as they come, until closed; a second reader takes the first one's place."""
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
