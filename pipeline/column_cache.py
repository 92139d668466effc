"""Cache of columns: each stage's results so far, with the state to go on from."""

from __future__ import annotations

import threading
from collections.abc import Callable, Hashable, Iterable
from dataclasses import dataclass, field
from typing import Any

from .results import nbytes

CACHE_BYTES = 2 << 30
MAX_COLUMNS = 10_000


class StageKey:
    """Key of a stage's results: hashable parts, keys of its inputs among them, compared by value.

    It is hashed once: a tuple of tuples would be hashed anew, all its inputs' inputs with it, at every look into a
    cache.
    """

    __slots__ = ("_hash", "_parts")

    def __init__(self, *parts: Hashable) -> None:
        self._parts = parts
        self._hash = hash(parts)

    def __hash__(self) -> int:
        return self._hash

    def __eq__(self, other: object) -> bool:
        if self is other:
            return True
        return isinstance(other, StageKey) and self._hash == other._hash and self._parts == other._parts


@dataclass(slots=True, eq=False)
class Column:
    """One stage's results, of the whole recording or of one shot, from tick number `first` on.

    Attributes
    ----------
    results : list
        Results in order; lacks what a run was told to forget.
    making : Lock
        Held while the next result is made: another thread that wants it waits for it.
    is_kept : bool
        Whether all results so far are there.
    is_cached : bool
        Whether the cache still has it, and counts its bytes.
    fault : BaseException, optional
        Raised by a step; the state may be half way into its tick, so that no other run may go on from it.
    """

    key: Hashable
    state: Any
    first: int
    making: threading.Lock = field(default_factory=threading.Lock)
    results: list[Any] = field(default_factory=list)
    is_kept: bool = True
    is_cached: bool = True
    fault: BaseException | None = None
    bytes: int = 0
    last_use: int = 0


class ColumnCache:
    """Columns by their keys, for several threads; those that were not used for longest are dropped first.

    Parameters
    ----------
    budget_bytes, max_columns : int
        The most that they hold together, and the most of them.
    """

    def __init__(self, budget_bytes: int, max_columns: int) -> None:
        self._budget_bytes, self._max_columns = budget_bytes, max_columns
        self._columns: dict[Hashable, Column] = {}
        self._uses = self._bytes = 0
        self._lock = threading.Lock()

    def begun(self, key: Hashable, first: int, start: Callable[[], Any]) -> Column:
        """The column of a key, begun at tick number `first` with a fresh state where there is none to go on from."""
        with self._lock:
            column = self._columns.get(key)
            if column is None or not column.is_kept:
                begun = Column(key, start(), first)
                if column is not None:
                    self._take_out(column)
                column = self._columns[key] = begun
            self._uses += 1
            column.last_use = self._uses
        return column

    def result(self, column: Column, index: int, make: Callable[[], Any], *, is_kept: bool) -> Any:
        """The column's result of tick number `index`, made unless it is known; `is_kept`: beyond its tick."""
        with column.making:
            if index - column.first < len(column.results):
                return column.results[index - column.first]
            if column.fault is not None:
                raise column.fault
            try:
                result = make()
            except BaseException as error:
                column.fault = error
                self.drop(column)
                raise
            if is_kept:
                column.results.append(result)
                self._count(column, nbytes(result))
            else:
                column.is_kept = False
        return result

    def results(self, key: Hashable, count: int) -> list[Any] | None:
        """The first results of a column, None where it has fewer."""
        with self._lock:
            column = self._columns.get(key)
        return None if column is None or len(column.results) < count else column.results[:count]

    def reaches(self, key: Hashable, index: int) -> bool:
        """Whether the result of tick number `index` is kept."""
        with self._lock:
            column = self._columns.get(key)
        return column is not None and column.first + len(column.results) > index

    def drop(self, column: Column) -> None:
        """Forget a column, where it is still here."""
        with self._lock:
            if column.is_cached:
                self._take_out(column)

    def keep_budget(self, in_use: Iterable[Column]) -> None:
        """Drop columns, none of those in use, until the others are within the budget."""
        with self._lock:
            if self._is_within():
                return  # comparing the keys of all columns would take longer than a quick tick
            others = self._columns.keys() - {column.key for column in in_use}
            for key in sorted(others, key=lambda k: self._columns[k].last_use):
                if self._is_within():
                    break
                self._take_out(self._columns[key])

    def _is_within(self) -> bool:
        return self._bytes <= self._budget_bytes and len(self._columns) <= self._max_columns

    def _count(self, column: Column, more_bytes: int) -> None:
        """Count what a column has more; adding all up again each tick would take the longer the more there are."""
        with self._lock:
            column.bytes += more_bytes
            if column.is_cached:
                self._bytes += more_bytes

    def _take_out(self, column: Column) -> None:
        del self._columns[column.key]
        self._bytes -= column.bytes
        column.is_cached = False
