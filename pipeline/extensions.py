"""Registry of one kind of extension: stages, spin methods, recording formats, suites, views."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Generic, Protocol, TypeVar

from .errors import ParameterError


class Named(Protocol):
    """Anything that has a name to be registered by."""

    @property
    def name(self) -> str:
        """Unique name within its registry, as users type it."""


Entry = TypeVar("Entry", bound=Named)


class Registry(Generic[Entry]):
    """Entries of one kind, in the order in which they were registered, found by name.

    Parameters
    ----------
    kind : str
        What an entry is, as messages call it ("stage", "recording format").
    """

    def __init__(self, kind: str) -> None:
        self.kind = kind
        self._entries: dict[str, Entry] = {}

    def register(self, entry: Entry) -> Entry:
        """Add an entry at the end and return it; raises ValueError when its name is taken."""
        if entry.name in self._entries:
            raise ValueError(f"{self.kind} {entry.name!r} is registered already")
        self._entries[entry.name] = entry
        return entry

    def unregister(self, name: str) -> None:
        """Remove an entry."""
        del self._entries[name]

    @contextmanager
    def registered(self, entry: Entry) -> Iterator[Entry]:
        """Registration for the duration of a `with` block, for tests."""
        self.register(entry)
        try:
            yield entry
        finally:
            self.unregister(entry.name)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all entries, in order."""
        return tuple(self._entries)

    def __getitem__(self, name: str) -> Entry:
        """Entry by name; raises ParameterError that names the nearest one."""
        try:
            return self._entries[name]
        except KeyError:
            raise ParameterError(f"there is no {self.kind} {name!r}{did_you_mean(name, self._entries)}") from None

    def __contains__(self, name: object) -> bool:
        return name in self._entries

    def __iter__(self) -> Iterator[Entry]:
        return iter(tuple(self._entries.values()))

    def __len__(self) -> int:
        return len(self._entries)


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """End of a message about an unknown name: the nearest known one, or all of them."""
    names = list(known)
    close = difflib.get_close_matches(name, names, n=1)
    return f": did you mean {close[0]}?" if close else f"; there are {', '.join(names)}"
