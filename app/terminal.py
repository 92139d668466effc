"""Output of the command line to people: one-line notes, progress, the notice of compilation."""

from __future__ import annotations

import math
import os
import queue
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from errno import EDQUOT, EFBIG, EIO, ENOSPC
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

UNFOLDED_COLUMNS = 1000  # wider than any table
PATIENCE_S = 1.0  # work that ends sooner shows no bar
LOGGED_S = 30.0  # from line to line of a log: 120 lines an hour
_ENDING = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
# Signals nearer to each other are one request: a shell, or `uv run`, hands on what the terminal has sent already.
SAME_REQUEST_S = 0.5
REPEAT_S = 0.05  # until a request that Python has dropped is made again
_requested_s = -math.inf  # when the last request came
FULL_DISK = (ENOSPC, EDQUOT, EFBIG, EIO)  # errors of writing that are the disk's


def note(text: str) -> None:
    """Print one line on standard error."""
    print(text, file=sys.stderr, flush=True)


def prepare_streams() -> None:
    """Let letters that the output's code page lacks appear as escapes, and warnings as one line."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")
    warnings.showwarning = lambda message, *_: note(f"warning: {message}")


def exit_on_signals() -> None:
    """End as on an error when the user or the system asks the program to: half-written files are removed.

    A signal that comes while it ends, as from a shell that sends it to the whole group, would disturb that: it is
    ignored. A program started to outlive its terminal (`nohup`) does. Where Python drops the error, as in a finalizer,
    the request is made again.
    """

    def end(number: int, _: object) -> None:
        _is_another_request()
        _ignore_signals()
        if number == signal.SIGINT:
            raise KeyboardInterrupt
        sys.exit(128 + number)

    chosen = [one for one in _ENDING if one == signal.SIGINT or signal.getsignal(one) is not signal.SIG_IGN]
    report = sys.unraisablehook

    def repeat(dropped: sys.UnraisableHookArgs) -> None:
        number = (requested_status(dropped.exc_value) or 0) - 128
        if number not in chosen:
            report(dropped)
            return
        for one in chosen:
            signal.signal(one, end)
        threading.Timer(REPEAT_S, os.kill, (os.getpid(), number)).start()

    sys.unraisablehook = repeat
    for one in chosen:
        signal.signal(one, end)


def requested_status(error: BaseException | None) -> int | None:
    """Exit status that a request for the end asks for, where an error is that request; None for any other error.

    Python raises another error from it where it comes while a module is loaded (`__set_name__` of an attribute).
    """
    while error is not None:
        if isinstance(error, KeyboardInterrupt):
            return 128 + signal.SIGINT
        if isinstance(error, SystemExit) and isinstance(error.code, int):
            return error.code
        error = error.__cause__
    return None


@contextmanager
def until_interrupted() -> Iterator[None]:
    """End a block, rather than the program, when the user interrupts it (Ctrl-C)."""
    try:
        yield
    except (KeyboardInterrupt, Exception) as error:
        if requested_status(error) != 128 + signal.SIGINT:
            raise


@contextmanager
def ends_on_signals(end: Callable[[], None]) -> Iterator[None]:
    """Have each request of the user or the system for the end call `end`, in a thread of its own.

    A signal comes between any two steps of the main thread, also while that holds a lock that `end` needs. After the
    first request, further ones are ignored from the end of this block on, where the rest of the program ends. In
    another thread nothing is done.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    requests: queue.SimpleQueue[bool] = queue.SimpleQueue()  # may be filled by a handler at any moment
    is_asked = False

    def take(number: int, _: object) -> None:
        nonlocal is_asked
        if _is_another_request():
            is_asked = True
            requests.put(True)

    def call() -> None:
        while requests.get():
            end()

    thread = threading.Thread(target=call, name="requests for the end", daemon=True)
    thread.start()
    before = {one: signal.signal(one, take) for one in _ENDING if signal.getsignal(one) is not signal.SIG_IGN}
    try:
        yield
    finally:
        if is_asked:
            _ignore_signals()
        else:
            for one, handler in before.items():
                signal.signal(one, handler)
        requests.put(False)
        thread.join()


def _is_another_request() -> bool:
    """Take a signal that comes now; whether it does not belong to the last request."""
    global _requested_s
    now_s = time.monotonic()
    if now_s - _requested_s <= SAME_REQUEST_S:
        return False
    _requested_s = now_s
    return True


def _ignore_signals() -> None:
    # By a handler: Python complains of a signal that came together with the first one and is ignored without.
    for one in _ENDING:
        signal.signal(one, lambda *_: None)


def ignore_signals_at_exit() -> None:
    """Ignore signals from here on, also when Python has taken its handlers away at its end."""
    for one in _ENDING:
        signal.signal(one, signal.SIG_IGN)


def drop_output() -> None:
    """Send what is still to be printed nowhere, as Python complains at its end about what it cannot write."""
    with open(os.devnull, "wb") as nowhere:
        os.dup2(nowhere.fileno(), sys.stdout.fileno())


def console() -> Console:
    """Console for tables on standard output: as wide as the terminal, or unfolded where it is piped or a file."""
    return Console(width=None if sys.stdout.isatty() else UNFOLDED_COLUMNS)


class ProgressBar:
    """Progress on standard error; calls take (share 0..1, what).

    On a terminal a bar for work that takes longer than a second, in a log a line every LOGGED_S.
    """

    def __init__(self) -> None:
        self._begin = self._logged = time.perf_counter()
        self._bar: Progress | None = None

    def __enter__(self) -> ProgressBar:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar:
            self._bar.stop()

    def __call__(self, share: float, what: str) -> None:
        """Show the share done (0..1) and what is being done."""
        if self._bar is None:
            now = time.perf_counter()
            if not sys.stderr.isatty():
                if now - self._logged >= LOGGED_S:
                    self._logged = now
                    note(f"{what}: {share:.0%}")
                return
            if now - self._begin < PATIENCE_S:
                return
            self._bar = Progress(
                TextColumn("{task.description}"),
                BarColumn(),
                TextColumn("{task.percentage:>3.0f} %"),
                TimeRemainingColumn(),
                console=Console(stderr=True),
                transient=True,
            )
            self._bar.add_task(what, total=1.0)
            self._bar.start()
        self._bar.update(self._bar.task_ids[0], completed=share, description=what)


def announce_compilation() -> None:
    """Print one line, once, when kernels are compiled rather than loaded from the cache."""
    from numba.core import event

    class Announce(event.Listener):
        said = False

        def on_start(self, _: object) -> None:
            if not Announce.said:
                Announce.said = True
                note("compiling the kernels, once on this machine: half a minute or so, cached afterwards ...")

        def on_end(self, _: object) -> None:
            pass

    event.register("numba:compile", Announce())  # type: ignore[no-untyped-call]
