"""Cache of a pure function's results by the content of its arguments."""

from __future__ import annotations

import dataclasses
import threading
from collections.abc import Callable
from hashlib import blake2b
from typing import Any, ParamSpec, TypeVar

import numpy as np

MAX_CALLS = 1000  # some 40 settings of a flight's contrast, 3 kB a call

Given = ParamSpec("Given")
Returned = TypeVar("Returned")


class CallCache:
    """Results of slow pure functions whose arguments often are the same after a change of parameters.

    Arguments are compared bit by bit, so that a result is that of a fresh call to the last bit. For several threads;
    those that were not used for longest are dropped first.

    Parameters
    ----------
    max_calls : int
        The most results that are kept.
    """

    def __init__(self, max_calls: int = MAX_CALLS) -> None:
        self._max_calls = max_calls
        self._results: dict[bytes, Any] = {}
        self._lock = threading.Lock()

    def __deepcopy__(self, _: object) -> CallCache:
        """The same one: copies of a stage's state know the same calls."""
        return self

    def result(self, function: Callable[Given, Returned], *arguments: Given.args, **options: Given.kwargs) -> Returned:
        """The function's result, frozen, for it is given out again.

        Arguments are numbers, strings, None, arrays, and tuples and dataclasses of these; others raise TypeError.
        """
        hashing = blake2b(digest_size=16)
        for part in (function.__module__, function.__qualname__, arguments, tuple(options.items())):
            _feed(hashing, part)
        key = hashing.digest()
        with self._lock:
            known = key in self._results
            if known:
                self._results[key] = self._results.pop(key)  # the last ones are at the end
                found: Returned = self._results[key]
        if known:
            return found
        result = function(*arguments, **options)
        with self._lock:
            self._results[key] = result
            if len(self._results) > self._max_calls:
                del self._results[next(iter(self._results))]
        return result


def _feed(hashing: Any, value: Any) -> None:
    if isinstance(value, np.ndarray):
        hashing.update(f"{value.dtype.str}{value.shape}".encode())
        hashing.update(value.tobytes())
    elif isinstance(value, (tuple, list)):
        hashing.update(f"({len(value)}".encode())
        for one in value:
            _feed(hashing, one)
    elif dataclasses.is_dataclass(value):
        hashing.update(type(value).__qualname__.encode())
        for field in dataclasses.fields(value):
            _feed(hashing, getattr(value, field.name))
    elif value is None or isinstance(value, (bool, int, float, str)):
        hashing.update(f"{value!r};".encode())
    else:
        raise TypeError(f"{type(value).__name__}: a call is known by numbers, strings, arrays and dataclasses of these")
