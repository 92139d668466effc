"""Calls in a process of their own, for foreign libraries that a damaged or hostile file can hang, crash or blow up.

The process has limits on memory and on computing and waiting without progress; when one is reached it ends, and the
call raises `IsolationError` while everything else goes on. It is started once and kept for the next call.
"""

from __future__ import annotations

import faulthandler
import os
import signal
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from io import FileIO
from typing import Any, BinaryIO, TypeVar

from .child_process import ChildProcess, IdleProcesses, SharedMemory, pipes_to_parent, receive_value, send_value
from .errors import SpinscopeError

try:
    import resource
except ImportError:  # Windows
    resource = None  # type: ignore[assignment]

Value = TypeVar("Value")

# Sound files give their next part within some hundredths of a second of computing. What a library that loops needs is
# counted in CPU time: a busy machine or a slow disk refuses no sound file. An error within 5 s is what a user is
# promised, start of the process included.
MAX_CPU_S = 2.0
# Where a library waits without computing, for a network that is gone; and on Windows, which cannot limit CPU time.
MAX_SILENCE_S = 20.0 if hasattr(signal, "setitimer") else 3.0
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
    process = _idle.take() or _Process()
    try:
        process.call(function, arguments)
        while True:
            kind, value = process.answer()
            if kind != VALUE:
                break
            wish = STOP
            try:
                yield value
                wish = NEXT
            finally:
                process.ask(wish)
    finally:
        if process.is_idle:
            _idle.keep(process)
        else:
            process.end()
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


class _Process(ChildProcess):
    """Process with limits, which answers calls."""

    def __init__(self) -> None:
        self._silence_s = MAX_SILENCE_S
        memory = SharedMemory.created()
        number = None if memory is None else memory.file.fileno()
        try:
            super().__init__(
                f"from {__name__} import serve; serve({MAX_CPU_S}, {MAX_SILENCE_S}, {number})",
                {"OPENBLAS_NUM_THREADS": "1"},  # threads take memory
                memory,
            )
        except OSError as error:
            if memory is not None:
                memory.file.close()
            raise IsolationError(f"the process to read it in does not start ({error.strerror})") from error
        self.is_idle = True  # whether it waits for a call

    def call(self, function: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
        """Call a function, whose values `answer` gives."""
        self.is_idle = False
        folder = None  # of relative paths
        with suppress(OSError):  # it has been removed: only absolute paths are of use
            folder = os.getcwd()
        self.send((function, arguments, folder))

    def ask(self, wish: bytes) -> None:
        """Ask for the next value, or for none."""
        self.send(wish)
        self.is_idle = wish == STOP

    def answer(self) -> tuple[int, Any]:
        """Kind and value of the answer; raises IsolationError when the process has ended."""
        try:
            kind, value = self.receive()
        except EOFError as error:
            raise IsolationError(self._end_in_words()) from error
        self.is_idle = kind != VALUE
        return kind, value

    def _end_in_words(self) -> str:
        status = self.exit_status()
        if status == SILENT_EXIT:
            return f"reading it makes no progress for {self._silence_s:g} s"
        if hasattr(signal, "SIGPROF") and status == -signal.SIGPROF:
            return f"reading it makes no progress in {MAX_CPU_S:g} s of computing"
        return f"reading it crashes the library (exit status {status})"


_idle = IdleProcesses[_Process](MAX_IDLE)


_limits: tuple[float, float] | None = None  # CPU time and time in seconds; None where this process has no limits


def serve(cpu_s: float, silence_s: float, memory_number: int | None) -> None:
    """Answer calls on standard input until it ends; the main program of the process.

    Parameters
    ----------
    cpu_s, silence_s : float
        CPU time and time in seconds without progress after which the process ends.
    memory_number : int or None
        File descriptor of the shared memory for the answers.
    """
    global _limits
    _limits = (cpu_s, silence_s)
    requests, answers = pipes_to_parent()
    memory = None if memory_number is None else SharedMemory(FileIO(memory_number, "r+"))
    _limit_memory()
    try:
        while True:
            function, arguments, folder = receive_value(requests)
            if folder is not None:
                with suppress(OSError):
                    os.chdir(folder)
            _answer(function(*arguments), requests, lambda value: send_value(answers, value, memory))
    except (EOFError, BrokenPipeError):  # the caller has gone
        os._exit(BROKEN_PIPE_EXIT)


def _answer(values: Iterator[Any], requests: BinaryIO, send: Callable[[tuple[int, Any]], None]) -> None:
    """Send the values, each when the caller asks for it, then the end or an error."""
    kind, value = _next(values)
    while True:
        send((kind, value))
        if kind != VALUE:
            return
        kind, value = _next(values)  # while the caller works on the one before
        if receive_value(requests) != NEXT:
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
    _set_cpu_timer(cpu_s)


def _lift_time_limit() -> None:
    if _limits is None:
        return
    faulthandler.cancel_dump_traceback_later()
    _set_cpu_timer(0)


def _set_cpu_timer(cpu_s: float) -> None:
    """Have the system end this process by SIGPROF after so much CPU time; never by 0."""
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_PROF, cpu_s)


def _limit_memory() -> None:
    """Limit the memory of this process and the picture of it that a crash leaves, on systems that can."""
    if resource is not None:  # on Windows sizes are checked before memory is taken, and that is all
        resource.setrlimit(resource.RLIMIT_DATA, (MAX_MEMORY_BYTES, MAX_MEMORY_BYTES))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
