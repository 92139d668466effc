"""Reading of files of packets through packages of others, whatever these raise."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

from ..errors import SpinscopeError
from .reader import ReadPass, UncheckedEvents, file_errors

Packet = TypeVar("Packet")


@contextmanager
def foreign_errors(path: Path, kind: str) -> Iterator[None]:
    """Turn whatever a package raises on a damaged file into a RecordingError of one line."""
    with file_errors(path, kind):
        try:
            yield
        except SpinscopeError:
            raise
        except Exception as error:  # of any class: a package knows its own
            raise RuntimeError(str(error)) from error


def undamaged(packets: Iterable[Packet], reading: ReadPass) -> Iterator[Packet]:
    """Yield the packets before the first damaged one, which is counted; damage in the very first is raised."""
    count, iterator = 0, iter(packets)
    while True:
        try:
            packet = next(iterator)
        except StopIteration:
            return
        except Exception:
            if not count:
                raise
            reading.damage.broken_ends += 1
            return
        count += 1
        yield packet


def joined(parts: Iterable[UncheckedEvents], most: int) -> Iterator[UncheckedEvents]:
    """Yield the events of small parts in parts of up to `most`, none of them empty."""
    held: list[UncheckedEvents] = []
    count = 0
    for part in parts:
        held.append(part)
        count += len(part)
        if count >= most:
            yield from _pieces(held, most)
            held, count = [], 0
    yield from _pieces(held, most)


def _pieces(held: list[UncheckedEvents], most: int) -> Iterator[UncheckedEvents]:
    together = UncheckedEvents.concatenate(held) if held else UncheckedEvents.empty()
    for first in range(0, len(together), most):
        yield together[first : first + most]
