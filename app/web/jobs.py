"""Longer work for a page beside its run: a tuning curve, a search, a new simulation; each can be cancelled."""

from __future__ import annotations

import threading
import traceback
from collections.abc import Callable
from typing import Any

from spinscope.pipeline.errors import SpinscopeError

from .outbox import Outbox


class Cancelled(Exception):  # no error: somebody changed their mind
    """The work is not wanted any more."""


class Job:
    """One piece of work in a thread of its own, which tells the page of it in messages of its kind.

    Every message has a state: running, done, cancelled or failed (with the error).
    """

    def __init__(self, kind: str, outbox: Outbox, work: Callable[[Job], dict[str, Any]]) -> None:
        self._kind, self._outbox, self._work = kind, outbox, work
        self._cancelled = threading.Event()
        self._thread = threading.Thread(target=self._run, name=kind, daemon=True)
        self._thread.start()

    def tell(self, **content: Any) -> None:
        """Report how far it is."""
        self._outbox.put(self._kind, state="running", **content)

    def check(self) -> None:
        """Called between two pieces of work: raises Cancelled when nobody wants the rest."""
        if self._cancelled.is_set():
            raise Cancelled

    def cancel(self, wait_s: float = 0.0) -> None:
        """Stop the work soon, and wait for that at most so long."""
        self._cancelled.set()
        if wait_s:
            self._thread.join(wait_s)

    def _run(self) -> None:
        content: dict[str, Any] = {}
        try:
            content = self._work(self)
            state = "done"
        except Cancelled:
            state = "cancelled"
        except Exception as error:  # noqa: BLE001  # whatever happens, the page is told
            state, content = "failed", {"error": fault(error)}
        self._outbox.put(self._kind, state=state, **content)


def fault(error: Exception) -> str:
    """One line for people: our own message, or which stage failed and how."""
    if isinstance(error, SpinscopeError):
        return str(error)
    places = [str(frame.f_globals.get("__name__")) for frame, _ in traceback.walk_tb(error.__traceback__)]
    stage = next(
        (place.rsplit(".", 1)[1] for place in places if place.startswith("spinscope.pipeline.stages.")), "the tuner"
    )
    return f"{stage} failed: {type(error).__name__}: {' '.join(str(error).split())[:300]}"
