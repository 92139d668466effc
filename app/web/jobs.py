"""Jobs of a client session beside its runs: sweeps, optimization, re-simulation; each can be cancelled."""

from __future__ import annotations

import threading
import traceback
from collections.abc import Callable
from typing import Any, Literal

from spinscope.pipeline.errors import SpinscopeError

from .message_queue import MessageQueue
from .message_schemas import BiasesMessage, BiasSweepMessage, OptimizationMessage, SweepMessage

STAGE_PACKAGES = ("spinscope.pipeline.stages.", "spinscope.pipeline.spin.")
JobMessageType = type[SweepMessage] | type[OptimizationMessage] | type[BiasesMessage] | type[BiasSweepMessage]


class Cancelled(Exception):  # no error: somebody changed their mind
    """The job is not wanted any more."""


class Job:
    """One job in a thread of its own, which reports its progress in messages of one type.

    Parameters
    ----------
    message : type
        Type of the messages.
    work : callable
        Does the work with the job's `report` and `check` and returns the final content.
    """

    def __init__(self, message: JobMessageType, queue: MessageQueue, work: Callable[[Job], Any]) -> None:
        self._message, self._queue, self._work = message, queue, work
        self._cancelled = threading.Event()
        self._thread = threading.Thread(target=self._run, name=message.__name__, daemon=True)
        self._thread.start()

    def report(self, content: Any) -> None:
        """Report progress."""
        self._put("running", content)

    def check(self) -> None:
        """Raise Cancelled when the rest is not wanted; called between two pieces of work."""
        if self._cancelled.is_set():
            raise Cancelled

    def cancel(self, wait_s: float = 0.0) -> None:
        """Cancel the job, and wait at most so long for its end."""
        self._cancelled.set()
        if wait_s:
            self._thread.join(wait_s)

    def _run(self) -> None:
        try:
            self._put("done", self._work(self))
        except Cancelled:
            self._put("cancelled")
        except Exception as error:  # noqa: BLE001  # whatever happens, the page is told
            self._put("failed", error=error_text(error))

    def _put(
        self, state: Literal["running", "done", "cancelled", "failed"], content: Any = None, error: str | None = None
    ) -> None:
        self._queue.put(self._message(state=state, content=content, error=error))


def error_text(error: Exception) -> str:
    """One line for people: our own message, or which stage failed and how."""
    if isinstance(error, SpinscopeError):
        return str(error)
    modules = [str(frame.f_globals.get("__name__")) for frame, _ in traceback.walk_tb(error.__traceback__)]
    stages = [name.split(".")[3] for name in modules if name.startswith(STAGE_PACKAGES)]
    return f"{next(iter(stages), 'the server')} failed: {type(error).__name__}: {' '.join(str(error).split())[:300]}"
