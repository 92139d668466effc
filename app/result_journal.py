"""Journal of a batch beside its table: the rows of each recording, on disk as soon as they are known."""

from __future__ import annotations

import glob
import json
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.result_rows import ResultRow


@dataclass(frozen=True, slots=True)
class JournalEntry:
    """Place of one recording's rows in a journal, and what they depend on.

    Attributes
    ----------
    path, offset : Path, int
        File and byte at which the entry's line begins.
    recording_hash, sidecar_hash, settings_hash, version : str
        Content of the recording and its sidecar, settings, and version of the program.
    failed : bool
        Whether the recording could not be analyzed; it is tried again.
    has_ticks : bool
        Whether the entry holds the rows of ticks, too.
    """

    path: Path
    offset: int
    recording_hash: str
    sidecar_hash: str
    settings_hash: str
    version: str
    failed: bool
    has_ticks: bool

    def rows(self, kind: str) -> list[ResultRow]:
        """Rows of shots ("shots") or of their ticks ("ticks"), none where these were not asked for."""
        with open(self.path, "rb") as file:
            file.seek(self.offset)
            found: list[ResultRow] | None = json.loads(file.readline())[kind]
        return found or []


def journal_path(table: Path, part: tuple[int, int] | None = None) -> Path:
    """Name of a table's journal, or of a part's."""
    which = "" if part is None else f"-{part[0]}-of-{part[1]}"
    return table.with_name(f"{table.name}.rows{which}.jsonl")


def journals_of(table: Path) -> list[Path]:
    """The journals of a table and of its parts that are there, by name."""
    return sorted(Path(name) for name in glob.glob(f"{glob.escape(str(table))}.rows*.jsonl"))


class ResultJournal:
    """Append-only file with one line for each recording, and what older journals of the same table hold.

    Parameters
    ----------
    path : Path
        The journal to append to; a last line that was cut off is removed.
    others : sequence of Path
        Journals of the same table that are only read.
    """

    def __init__(self, path: Path, others: list[Path]) -> None:
        self.path = path
        self.entries: dict[str, JournalEntry] = {}
        for other in others:
            self._read(other)
        if path.exists():
            self._end = self._read(path)
            with open(path, "rb+") as file:
                file.truncate(self._end)
        else:
            self._end = 0

    def append(self, line: dict[str, Any]) -> None:
        """Add a recording's rows; they are on disk when this returns. Raises RecordingError."""
        content = json.dumps(line, allow_nan=False).encode() + b"\n"
        try:
            with open(self.path, "ab") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise RecordingError(f"rows cannot be written ({error.strerror}): check free space: {self.path}") from error
        self._take(line, self.path, self._end)
        self._end += len(content)

    def _read(self, path: Path) -> int:
        """Take the entries of a journal; byte at which its last whole line ends."""
        end = 0
        for content in _lines(path):
            try:
                line = json.loads(content)
                self._take(line, path, end)
            except (ValueError, LookupError, TypeError):
                raise RecordingError(f"journal is damaged at byte {end}: remove or rename it: {path}") from None
            end += len(content)
        return end

    def _take(self, line: dict[str, Any], path: Path, offset: int) -> None:
        self.entries[str(line["recording"])] = JournalEntry(
            path=path,
            offset=offset,
            recording_hash=str(line["recording_hash"]),
            sidecar_hash=str(line["sidecar_hash"]),
            settings_hash=str(line["settings_hash"]),
            version=str(line["version"]),
            failed=bool(line["failed"]),
            has_ticks=line["ticks"] is not None,
        )


def _lines(path: Path) -> Iterator[bytes]:
    """The whole lines of a file."""
    try:
        with open(path, "rb") as file:
            for content in file:
                if content.endswith(b"\n"):
                    yield content
    except OSError as error:
        raise RecordingError(f"the journal cannot be read ({error.strerror}): {path}") from error
