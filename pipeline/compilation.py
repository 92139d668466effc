"""Numba's cache of compiled kernels, which need not be writable: kernels are then compiled in memory, with a warning.

Modules with kernels outside of `kernels` take `njit` from here, so that this is loaded before any of them.
"""

from __future__ import annotations

import warnings
from typing import Any

from numba import njit as njit
from numba.core.caching import FunctionCache, NullCache
from numba.core.dispatcher import Dispatcher

PACKAGE = __name__.partition(".")[0]

_enable_caching = Dispatcher.enable_caching
_warned = False


class KernelCache(FunctionCache):
    """Cache of one kernel, on a disk that may be full."""

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
    """Give a dispatcher its cache; in place of numba's method, which raises where no folder can be written."""
    if dispatcher.py_func.__module__.partition(".")[0] != PACKAGE:
        _enable_caching(dispatcher)
        return
    try:
        dispatcher._cache = KernelCache(dispatcher.py_func)  # type: ignore[no-untyped-call]
    except (RuntimeError, OSError):
        dispatcher._cache = MemoryCache()


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


setattr(Dispatcher, "enable_caching", _enable_kernel_caching)  # noqa: B010  mypy: no method may be assigned to
