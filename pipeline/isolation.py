"""Calls in a process of their own, for foreign libraries that a damaged or hostile file can hang, crash or blow up.

The process has limits on memory and on computing and waiting without progress; when one is reached it ends, and the
call raises `IsolationError` while everything else goes on. It is started once and kept for the next call. It is no
child of `multiprocessing`, which would run an unguarded script of the user a second time.
"""

from __future__ import annotations

import atexit
import faulthandler
import math
import os
import pickle
import signal
import subprocess
import sys
import threading
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, BinaryIO, TypeVar

from .errors import SpinscopeError

try:
    import resource
except ImportError:  # Windows
    resource = None  # type: ignore[assignment]

Value = TypeVar("Value")

# Sound files give their next part within some hundredths of a second of computing. What a library that loops needs is
# counted in CPU time: a busy machine or a slow disk refuses no sound file. An error within 5 s is what a user is
# promised, start of the process included.
MAX_CPU_S = 3
# Where a library waits without computing, for a network that is gone; and on Windows, which cannot limit CPU time.
MAX_SILENCE_S = 20.0 if hasattr(signal, "SIGXCPU") else 3.0
# What a process may take besides the libraries it loads (a part of a million events takes 13 MB, and some copies).
MAX_MEMORY_BYTES = 512 << 20
MAX_IDLE = 2  # processes kept for the next call: one for a reading thread and one beside it

VALUE, END, OUR_ERROR, FOREIGN_ERROR, OUT_OF_MEMORY = range(5)  # kinds of answers
NEXT, STOP = b"n", b"s"  # the caller's wish after each part
SILENT_EXIT = 1  # exit status of a process ended by faulthandler
BROKEN_PIPE_EXIT = 3


class IsolationError(SpinscopeError):
    """A call in a process of its own crashed, hung or needed too much memory."""


def call(function: Callable[..., Value], *arguments: Any) -> Value:
    """Result of `function(*arguments)`, called in a process with limits.

    Parameters
    ----------
    function : callable
        Function of a module, found in the process by its name.
    *arguments
        Values that can be pickled, as the result has to be.

    Raises
    ------
    IsolationError
        The call crashed, made no progress in `MAX_CPU_S` of computing or within `MAX_SILENCE_S`, or needed over
        `MAX_MEMORY_BYTES`.
    SpinscopeError
        As raised by the function. Other exceptions arrive as RuntimeError with their traceback.
    """
    (result,) = iterate(_single, function, *arguments)
    return result  # type: ignore[no-any-return]


def iterate(function: Callable[..., Iterator[Value]], *arguments: Any) -> Iterator[Value]:
    """Yield what the generator `function(*arguments)` yields in a process with limits; see `call`.

    The process works one value ahead. The limit of time holds for each value.
    """
    process = _idle_process() or _Process()
    try:
        process.send(function, arguments)
        while True:
            kind, value = process.receive()
            if kind != VALUE:
                break
            wish = STOP
            try:
                yield value
                wish = NEXT
            finally:
                process.ask(wish)
    finally:
        _keep(process)
    if kind == OUR_ERROR:
        raise value
    if kind == OUT_OF_MEMORY:
        raise IsolationError(f"it needs over {MAX_MEMORY_BYTES >> 20} MB of memory at once")
    if kind == FOREIGN_ERROR:
        raise RuntimeError(value)


@contextmanager
def without_time_limit() -> Iterator[None]:
    """Suspend the limit of time, for what takes long whatever the file: loading a library, compiling a kernel.

    In a process without limits it does nothing.
    """
    _lift_time_limit()
    yield
    _limit_time()


def _single(function: Callable[..., Value], *arguments: Any) -> Iterator[Value]:
    yield function(*arguments)


class _Process:
    """The caller's side of one process."""

    def __init__(self) -> None:
        self._silence_s = MAX_SILENCE_S
        path = os.pathsep.join(entry or os.getcwd() for entry in sys.path)
        try:
            self._process = subprocess.Popen(
                # -P: what lies in the working folder is not imported.
                [sys.executable, "-P", "-c", f"from {__name__} import serve; serve({MAX_CPU_S}, {MAX_SILENCE_S})"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                env={**os.environ, "PYTHONPATH": path, "OPENBLAS_NUM_THREADS": "1"},  # threads take memory
            )
        except OSError as error:
            raise IsolationError(f"the process to read it in does not start ({error.strerror})") from error
        assert self._process.stdin is not None and self._process.stdout is not None
        self._requests: BinaryIO = self._process.stdin  # type: ignore[assignment]
        self._answers: BinaryIO = self._process.stdout  # type: ignore[assignment]
        self.is_idle = True  # whether it waits for a call

    def send(self, function: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
        """Call a function; raises nothing where the process has ended, which `receive` then tells."""
        self.is_idle = False
        folder = None  # of relative paths
        with suppress(OSError):  # it has been removed: only absolute paths are of use
            folder = os.getcwd()
        self._write(pickle.dumps((function, arguments, folder)))

    def ask(self, wish: bytes) -> None:
        """Ask for the next value, or for none."""
        self._write(wish)
        self.is_idle = wish == STOP

    def receive(self) -> tuple[int, Any]:
        """Kind and value of the answer; raises IsolationError when the process has ended."""
        try:
            kind, pickled, sizes = pickle.load(self._answers)
            buffers = [bytearray(size) for size in sizes]
            for buffer in buffers:
                if self._answers.readinto(buffer) < len(buffer):  # type: ignore[attr-defined]
                    raise EOFError
        except (EOFError, pickle.UnpicklingError) as error:
            raise IsolationError(self._end_in_words()) from error
        self.is_idle = kind != VALUE
        return kind, pickle.loads(pickled, buffers=buffers)

    def is_running(self) -> bool:
        """Whether the process still runs and can be talked to."""
        return self._process.poll() is None and not self._requests.closed

    def end(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.wait()
        for pipe in (self._requests, self._answers):
            with suppress(OSError):
                pipe.close()

    def _write(self, content: bytes) -> None:
        # A closed pipe is a ValueError: the garbage collector may close it before it ends an abandoned `iterate`.
        with suppress(BrokenPipeError, ValueError):
            self._requests.write(content)
            self._requests.flush()

    def _end_in_words(self) -> str:
        status = self._process.wait()
        if status == SILENT_EXIT:
            return f"reading it makes no progress for {self._silence_s:g} s"
        if hasattr(signal, "SIGXCPU") and status == -signal.SIGXCPU:
            return f"reading it makes no progress in {MAX_CPU_S} s of computing"
        return f"reading it crashes the library (exit status {status})"


_idle: list[_Process] = []
_idle_lock = threading.Lock()


def _idle_process() -> _Process | None:
    """A process that waits for a call; None where there is none."""
    with _idle_lock:
        while _idle:
            process = _idle.pop()
            if process.is_running():
                return process
            process.end()
    return None


def _keep(process: _Process) -> None:
    """Keep a process for the next call, or end it where it cannot take one or enough others wait."""
    with _idle_lock:
        if process.is_idle and process.is_running() and len(_idle) < MAX_IDLE:
            _idle.append(process)
            return
    process.end()


def _end_idle() -> None:
    while (process := _idle_process()) is not None:
        process.end()


atexit.register(_end_idle)
if hasattr(os, "register_at_fork"):  # a copy of this process must not talk to the same ones
    os.register_at_fork(after_in_child=_idle.clear)


_limits: tuple[int, float] | None = None  # CPU time and time in seconds; None where this process has no limits


def serve(cpu_s: int, silence_s: float) -> None:
    """Answer calls on standard input until it ends; the main program of the process.

    Parameters
    ----------
    cpu_s, silence_s : int, float
        CPU time and time in seconds without progress after which the process ends.
    """
    global _limits
    _limits = (cpu_s, silence_s)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the caller's, who then closes the pipe
    requests, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    with open(os.devnull, "r+b") as nothing:  # a library that prints must not disturb the answers
        os.dup2(nothing.fileno(), 0)
        os.dup2(nothing.fileno(), 1)
    _limit_memory()
    try:
        while True:
            function, arguments, folder = pickle.load(requests)
            if folder is not None:
                with suppress(OSError):
                    os.chdir(folder)
            _answer(function(*arguments), requests, answers)
    except (EOFError, BrokenPipeError):  # the caller has gone
        os._exit(BROKEN_PIPE_EXIT)


def _answer(values: Iterator[Any], requests: BinaryIO, answers: BinaryIO) -> None:
    """Send the values, each when the caller asks for it, then the end or an error."""
    kind, value = _next(values)
    while True:
        _send(answers, kind, value)
        if kind != VALUE:
            return
        kind, value = _next(values)  # while the caller works on the one before
        if requests.read(len(NEXT)) != NEXT:
            with _time_limit():
                values.close()  # type: ignore[attr-defined]
            return


def _next(values: Iterator[Any]) -> tuple[int, Any]:
    """Kind and value of the next answer."""
    try:
        with _time_limit():
            return VALUE, next(values)
    except StopIteration:
        return END, None
    except SpinscopeError as error:
        return OUR_ERROR, error
    except MemoryError:
        return OUT_OF_MEMORY, None
    except Exception:  # noqa: BLE001  raised again by the caller
        return FOREIGN_ERROR, traceback.format_exc()


def _send(answers: BinaryIO, kind: int, value: Any) -> None:
    """Send one answer: a pickled head with the sizes of the arrays, then the arrays as they are in memory."""
    arrays: list[pickle.PickleBuffer] = []
    pickled = pickle.dumps(value, protocol=5, buffer_callback=arrays.append)
    parts = [array.raw() for array in arrays]
    pickle.dump((kind, pickled, [part.nbytes for part in parts]), answers)
    for part in parts:
        answers.write(part)
    answers.flush()


@contextmanager
def _time_limit() -> Iterator[None]:
    """End the process when the block takes too long, also inside a library that keeps Python's lock."""
    _limit_time()
    try:
        yield
    finally:
        _lift_time_limit()


def _limit_time() -> None:
    """Limit the CPU time and the time from now on; both end the process without asking Python."""
    if _limits is None:
        return
    cpu_s, silence_s = _limits
    faulthandler.dump_traceback_later(silence_s, exit=True)
    if resource is not None:
        used = resource.getrusage(resource.RUSAGE_SELF)
        _set_soft_limit(resource.RLIMIT_CPU, math.ceil(used.ru_utime + used.ru_stime) + cpu_s - 1)


def _lift_time_limit() -> None:
    if _limits is None:
        return
    faulthandler.cancel_dump_traceback_later()
    if resource is not None:
        _set_soft_limit(resource.RLIMIT_CPU, resource.RLIM_INFINITY)


def _set_soft_limit(kind: int, value: int) -> None:
    """Set a limit of this process as far as the hard limit that it was started with allows."""
    hard = resource.getrlimit(kind)[1]
    allowed = value if hard == resource.RLIM_INFINITY else hard if value == resource.RLIM_INFINITY else min(value, hard)
    resource.setrlimit(kind, (allowed, hard))


def _limit_memory() -> None:
    """Limit the memory of this process and the picture of it that a crash leaves, on systems that can."""
    if resource is not None:  # on Windows sizes are checked before memory is taken, and that is all
        resource.setrlimit(resource.RLIMIT_DATA, (MAX_MEMORY_BYTES, MAX_MEMORY_BYTES))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
