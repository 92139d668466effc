"""Search for the events in an HDF5 file: records, one dataset a column, or a table of four columns."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import h5py

from ....errors import RecordingError
from ...column_types import named_columns

# Prophesee's, DSEC's and ours; others (M3ED, MVSEC) are searched for.
KNOWN_PLACES = ("CD/events", "events", "/")
MAX_OBJECTS = 10_000  # looked at; groups may be linked in a ring
TABLE_COLUMNS = 4


class ColumnPlace(NamedTuple):
    """Place of a column: a dataset, and the field of its records or the column of its table (None: all of it)."""

    dataset: str
    part: str | int | None


@dataclass(frozen=True, slots=True)
class EventLayout:
    """Place of the events in a file.

    Attributes
    ----------
    format : str
        Name of the layout for people.
    path : str
        Path of the dataset, or of the group of the columns.
    columns : dict of str to ColumnPlace, or None
        Place of t, x, y and p; None for a table, whose columns only their values tell apart.
    """

    format: str
    path: str
    columns: dict[str, ColumnPlace] | None


def find_layout(file: h5py.File, asked: str | None, path: Path, warnings: list[str]) -> EventLayout:
    """Find the events, at or below `asked` if it is given; raises RecordingError where there are none."""
    found = {layout.path: layout for place in _places(file) if (layout := _layout_at(file, place)) is not None}
    wanted = found if asked is None else {p: found[p] for p in found if _is_below(p, asked)}
    if not found:
        if any(isinstance(file.get(name, getlink=True), h5py.ExternalLink) for name in file):
            raise RecordingError(f"events lie in another file, which is not read: copy them into one file: {path}")
        present = ", ".join(sorted(file)[:8]) or "nothing"
        raise RecordingError(
            f"HDF5 file holds no events (it has {present}): /CD/events or /events/x, y, t, p needed: {path}"
        )
    if not wanted:
        raise RecordingError(f"no events at --dataset {asked}: give one of {', '.join(found)}: {path}")
    chosen = next(iter(wanted.values()))
    if len(wanted) > 1:
        warnings.append(f"events are read from {chosen.path} of {', '.join(wanted)}: --dataset PATH chooses")
    return chosen


def _is_below(path: str, asked: str) -> bool:
    return f"{path.strip('/')}/".startswith(f"{asked.strip('/')}/")


def _places(file: h5py.File) -> Iterator[str]:
    """Yield the paths at which events may be, known ones first; those behind links to other files are left out."""
    yield from KNOWN_PLACES
    waiting, seen = [""], 0
    while waiting and seen < MAX_OBJECTS:
        group = waiting.pop(0)
        for name in file[group or "/"]:
            seen += 1
            place = f"{group}/{name}".lstrip("/")
            if place not in KNOWN_PLACES:
                yield place
            if isinstance(_item(file, place), h5py.Group):
                waiting.append(place)


def _item(file: h5py.File, place: str) -> h5py.Group | h5py.Dataset | None:
    """Object at a path; None where there is none, or only a link to another file."""
    link = None if place == "/" else file.get(place, getlink=True)
    return None if isinstance(link, h5py.ExternalLink) else file.get(place)


def _layout_at(file: h5py.File, place: str) -> EventLayout | None:
    item = _item(file, place)
    if isinstance(item, h5py.Dataset):
        fields = named_columns(item.dtype.names or ())
        if fields is not None:
            maker = "Prophesee HDF5" if place.startswith("CD") else "HDF5"
            return EventLayout(f"{maker} compound", place, {c: ColumnPlace(place, name) for c, name in fields.items()})
        if "events" in place.lower() and item.ndim == 2 and TABLE_COLUMNS in item.shape and item.dtype.kind in "iuf":
            return EventLayout("HDF5 table", place, None)
    elif isinstance(item, h5py.Group):
        prefix = "" if place == "/" else f"{place}/"
        names = named_columns(name for name in item if isinstance(_item(file, prefix + name), h5py.Dataset))
        if names is not None:
            columns = {c: ColumnPlace(prefix + name, None) for c, name in names.items()}
            return EventLayout("HDF5 columns", place, columns)
    return None
