"""Cache of calls: what counts as the same arguments, and what is kept."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from spinscope.pipeline.call_cache import CallCache


@dataclass(frozen=True)
class One:
    value: Any


@dataclass(frozen=True)
class Other:
    value: Any


VALUES: list[Any] = [
    None,
    0,
    0.0,
    -0.0,
    1e-300,
    False,
    "0",
    "",
    (),
    ((),),
    ("ab", "c"),
    ("a", "bc"),
    np.zeros(6),
    np.zeros(6, np.int64),
    np.zeros(6, np.float32),
    np.zeros((2, 3)),
    np.zeros((3, 2)),
    np.zeros(0),
    np.array([0.0, 0.0, 0.0, 0.0, 0.0, -0.0]),
    One(0),
    Other(0),
    One(np.zeros(6)),
]


def test_arguments_are_compared_bit_by_bit() -> None:
    calls, made = CallCache(), []

    def function(value: Any, more: Any = None) -> int:
        made.append(value)
        return len(made)

    def another(value: Any, more: Any = None) -> int:
        return function(value)

    first = [calls.result(function, value) for value in VALUES]
    first += [calls.result(function, 1, value) for value in VALUES]
    first += [calls.result(function, 1, more=value) for value in VALUES]
    first += [calls.result(another, value) for value in VALUES]
    assert first == list(range(1, 4 * len(VALUES) + 1))
    again = [calls.result(function, np.copy(value) if isinstance(value, np.ndarray) else value) for value in VALUES]
    assert again == first[: len(VALUES)] and len(made) == len(first)
    table = np.arange(12.0).reshape(3, 4)
    assert calls.result(function, table.T) == calls.result(function, np.ascontiguousarray(table.T)) == len(made)


def test_those_used_last_are_kept_and_a_call_that_fails_is_not() -> None:
    calls, made = CallCache(max_calls=2), []

    def function(value: int) -> None:
        made.append(value)
        if value < 0:
            raise ValueError

    for value in (1, 2, 1, 3, 1, 2):  # 3 takes the place of 2
        assert calls.result(function, value) is None
    assert made == [1, 2, 3, 2]
    for _ in range(2):
        with pytest.raises(ValueError):
            calls.result(function, -1)
    assert made[4:] == [-1, -1]


def test_what_cannot_be_compared_is_refused() -> None:
    with pytest.raises(TypeError, match="set: a call is known by"):
        CallCache().result(len, {1})
