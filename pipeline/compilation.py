"""Numba's cache of compiled kernels, which need not be writable: kernels are then compiled in memory, with a warning.

Of several processes that need a kernel, one compiles it and the others wait for it.

Modules with kernels outside of `kernels` take `njit` from here, so that this is loaded before any of them.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

from numba import njit as njit
from numba import types
from numba.core.caching import FunctionCache, NullCache
from numba.core.compiler_lock import global_compiler_lock
from numba.core.dispatcher import Dispatcher

try:
    import fcntl
except ImportError:  # Windows: several processes then compile the same
    fcntl = None  # type: ignore[assignment]

PACKAGE = __name__.partition(".")[0]

_enable_caching, _compile = Dispatcher.enable_caching, Dispatcher.compile
_warned = False


class KernelCache(FunctionCache):
    """Cache of one kernel, on a disk that may be full."""

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Keep other processes from compiling the kernel, where its folder can be written to and locks are known."""
        with ExitStack() as stack:
            if fcntl is not None:
                with suppress(OSError):
                    path = Path(self.cache_path) / f"{self._impl.filename_base}.lock"
                    file = stack.enter_context(path.open("w"))
                    fcntl.flock(file, fcntl.LOCK_EX)
                    stack.callback(fcntl.flock, file, fcntl.LOCK_UN)  # a forked process may hold the file open
            yield

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep the machine code if that can be written."""
        try:
            super().save_overload(sig, data)  # type: ignore[no-untyped-call]
        except OSError as error:
            _warn(error.strerror or str(error))


class MemoryCache(NullCache):
    """Cache of one kernel where there is no folder to keep it."""

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep nothing."""
        _warn("neither the program's folder nor the user's cache can be written to")


def _enable_kernel_caching(dispatcher: Any) -> None:
    """Give a dispatcher its cache; in place of numba's method, which raises where no folder can be written.

    No kernel is handed to a function as an argument: numba need not compile the code for that.
    """
    if dispatcher.py_func.__module__.partition(".")[0] != PACKAGE:
        _enable_caching(dispatcher)
        return
    dispatcher.targetoptions["no_cfunc_wrapper"] = True
    try:
        dispatcher._cache = KernelCache(dispatcher.py_func)  # type: ignore[no-untyped-call]
    except (RuntimeError, OSError):
        dispatcher._cache = MemoryCache()


def _compile_once(dispatcher: Any, signature: Any) -> Any:
    """Compile a kernel, or load what another process has compiled meanwhile; in place of numba's method.

    A constant among the arguments has the type of its value: nothing is compiled for the constant alone.
    """
    cache = dispatcher._cache
    if not isinstance(cache, KernelCache):
        return _compile(dispatcher, signature)
    if isinstance(signature, tuple):
        signature = tuple(types.unliteral(argument) for argument in signature)  # type: ignore[no-untyped-call]
    # numba's own lock first: a thread that waits for it must not hold what the thread inside it needs.
    with global_compiler_lock, cache.locked():
        return _compile(dispatcher, signature)


def _warn(why: str) -> None:
    """Say so for the first kernel; the others fare alike."""
    global _warned
    if not _warned:
        _warned = True
        warnings.warn(
            f"compiled kernels cannot be kept ({why}): they are compiled anew in every run, half a minute or so; "
            "NUMBA_CACHE_DIR=FOLDER names another place for them",
            stacklevel=3,
        )


# mypy lets no method be assigned to.
setattr(Dispatcher, "enable_caching", _enable_kernel_caching)  # noqa: B010
setattr(Dispatcher, "compile", _compile_once)  # noqa: B010
