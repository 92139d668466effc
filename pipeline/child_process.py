"""Child process of this program with which values are exchanged through pipes, arrays also through shared memory.

It is no child of `multiprocessing`, which would run an unguarded script of the user a second time. It ends with this
process, however that ends: its standard input is then at its end.
"""

from __future__ import annotations

import atexit
import os
import pickle
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from io import FileIO
from mmap import mmap
from typing import Any, BinaryIO, ClassVar, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

# What a terminal or system sends to all processes at once is the parent's, which then ends the others.
SIGNALS_OF_PARENT = {getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)}
PIPE_BYTES = 1 << 20  # the most that Linux gives to everybody: a whole tick of a busy scene
SHARED_BYTES = 4 << 20  # a part of a file takes 1.7 MB, and 3.3 MB where its pixels have 64 bits


class SharedMemory:
    """Memory shared with a child process, for the arrays of one value; it has no name and ends with the last process.

    Parameters
    ----------
    file : FileIO
        The memory as the system's open file, whose number the child process is told.
    """

    def __init__(self, file: FileIO) -> None:
        self.file = file
        self._bytes = np.frombuffer(mmap(file.fileno(), SHARED_BYTES), np.uint8)

    @classmethod
    def created(cls) -> SharedMemory | None:
        """Create memory; None where the system has none without a name (all but Linux) or gives no more."""
        if not hasattr(os, "memfd_create"):
            return None
        with suppress(OSError), ExitStack() as unused:
            file = unused.enter_context(FileIO(os.memfd_create("spinscope"), "r+"))
            os.posix_fallocate(file.fileno(), 0, SHARED_BYTES)  # memory found missing only when written to is fatal
            memory = cls(file)
            unused.pop_all()
            return memory
        return None

    def pieces(self, sizes: list[int]) -> list[NDArray[np.uint8]] | None:
        """Views of these sizes in bytes, one behind the other; None where they do not fit."""
        if sum(sizes) > SHARED_BYTES:
            return None
        return np.split(self._bytes, np.cumsum(sizes, dtype=np.int64))[:-1]


def send_value(file: BinaryIO, value: Any, memory: SharedMemory | None = None) -> None:
    """Write a value that can be pickled: a head with the sizes of its arrays, then these as they are in memory.

    Arrays that fit into the shared memory go through it, which takes half the time of a pipe; the receiver has to have
    a value before the next one is sent.
    """
    arrays: list[pickle.PickleBuffer] = []
    pickled = pickle.dumps(value, protocol=5, buffer_callback=arrays.append)
    parts = [array.raw() for array in arrays]
    sizes = [part.nbytes for part in parts]
    shared = None if memory is None else memory.pieces(sizes)
    if shared is not None:  # before the head, which says that they are there
        for piece, part in zip(shared, parts, strict=True):
            piece[:] = part
    pickle.dump((pickled, sizes), file)
    if shared is None:
        file.writelines(parts)
    file.flush()


def receive_value(file: BinaryIO, memory: SharedMemory | None = None) -> Any:
    """Read a value that `send_value` wrote, its arrays in memory of their own; raises EOFError at the file's end."""
    try:
        pickled, sizes = pickle.load(file)
    except pickle.UnpicklingError as error:  # cut off
        raise EOFError from error
    shared = None if memory is None else memory.pieces(sizes)
    if shared is not None:
        return pickle.loads(pickled, buffers=[piece.copy() for piece in shared])
    buffers = [np.empty(size, np.uint8) for size in sizes]
    for buffer in buffers:
        if file.readinto(buffer) < buffer.size:  # type: ignore[attr-defined]
            raise EOFError
    return pickle.loads(pickled, buffers=buffers)


@contextmanager
def _signals_held_back() -> Iterator[None]:
    """Hold `SIGNALS_OF_PARENT` back from this thread, and from a process that it starts until that ignores them."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS_OF_PARENT)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class ChildProcess:
    """The parent's side of a child process.

    Parameters
    ----------
    program : str
        Python statements that it runs, of which one takes `pipes_to_parent`.
    environment : Mapping of str to str
        Environment variables besides this process's own.
    memory : SharedMemory or None
        For its answers, where it sends each only after the one before was received.

    Raises
    ------
    OSError
        When it does not start.
    """

    # Referenced until their end: the garbage collector may take a process before the abandoned generator that ends it.
    _not_ended: ClassVar[set[ChildProcess]] = set()

    def __init__(
        self, program: str, environment: Mapping[str, str] | None = None, memory: SharedMemory | None = None
    ) -> None:
        path = os.pathsep.join(entry or os.getcwd() for entry in sys.path)
        with _signals_held_back():
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-c", program],  # -P: what lies in the working folder is not imported
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                pass_fds=() if memory is None else (memory.file.fileno(),),
                env={**os.environ, "PYTHONPATH": path, **(environment or {})},
            )
        self._memory = memory
        assert self._process.stdin is not None and self._process.stdout is not None
        self._requests: BinaryIO = self._process.stdin  # type: ignore[assignment]
        self._answers: BinaryIO = self._process.stdout  # type: ignore[assignment]
        if hasattr(fcntl, "F_SETPIPE_SZ"):
            for pipe in (self._requests, self._answers):
                with suppress(OSError):  # the user's pipes take too much already
                    fcntl.fcntl(pipe, fcntl.F_SETPIPE_SZ, PIPE_BYTES)
        self._not_ended.add(self)

    def send(self, value: Any) -> None:
        """Send a value; raises nothing where the process has ended, which `receive` then tells."""
        with suppress(BrokenPipeError, ValueError):  # a closed pipe is a ValueError
            send_value(self._requests, value)

    def receive(self) -> Any:
        """The next value from the process; raises EOFError when it has ended."""
        return receive_value(self._answers, self._memory)

    def is_running(self) -> bool:
        """Whether the process still runs and can be talked to."""
        return self._process.poll() is None and not self._requests.closed

    def exit_status(self) -> int:
        """Exit status of a process that has ended, or is about to; that of a signal is negative."""
        return self._process.wait()

    def kill(self) -> None:
        """Have the process end, from any thread."""
        self._process.kill()

    def end(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.wait()
        for pipe in (self._requests, self._answers):
            with suppress(OSError):
                pipe.close()
        if self._memory is not None:
            self._memory.file.close()
        self._not_ended.discard(self)


Kept = TypeVar("Kept", bound=ChildProcess)


class IdleProcesses(Generic[Kept]):
    """Processes that wait for the next call; they end with this one.

    Parameters
    ----------
    most : int
        How many are kept.
    """

    def __init__(self, most: int) -> None:
        self._most, self._idle, self._lock = most, list[Kept](), threading.Lock()
        atexit.register(self.end)
        if hasattr(os, "register_at_fork"):  # a copy of this process must not talk to the same ones
            os.register_at_fork(after_in_child=self._idle.clear)

    def take(self) -> Kept | None:
        """A process that waits; None where there is none."""
        with self._lock:
            while self._idle:
                process = self._idle.pop()
                if process.is_running():
                    return process
                process.end()
        return None

    def keep(self, process: Kept) -> None:
        """Keep a process that waits, or end it where it has ended or enough others wait."""
        with self._lock:
            if process.is_running() and len(self._idle) < self._most:
                self._idle.append(process)
                return
        process.end()

    def end(self) -> None:
        """End all that wait."""
        while (process := self.take()) is not None:
            process.end()


def pipes_to_parent() -> tuple[BinaryIO, BinaryIO]:
    """Pipe of the parent's requests and pipe of the answers, in a child process; prints then go nowhere.

    `SIGNALS_OF_PARENT` are ignored.
    """
    for one in SIGNALS_OF_PARENT:
        signal.signal(one, signal.SIG_IGN)
    requests, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    with open(os.devnull, "r+b") as nothing:  # a library that prints must not disturb the answers
        os.dup2(nothing.fileno(), 0)
        os.dup2(nothing.fileno(), 1)
    return requests, answers
