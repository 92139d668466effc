"""A session: a folder with one SQLite table of shots, small recordings of their events, and pictures.

Names and marks belong to shots, not to analyses: when a recording is analyzed again, they pass to the shots that are at
the same time. Columns are only ever added, so that sessions of older and newer versions open.
"""

from __future__ import annotations

import json
import sqlite3
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from spinscope.pipeline.errors import ParameterError, RecordingError

from .shot_record import RecordingShots, ShotRecord

TABLE_FILE = "session.sqlite"
FORMAT = 1
BUSY_S = 10.0  # another program that writes to the same session is waited for
NAMES = ("player", "wing", "stroke", "drill")
NAME_MOST = 80  # characters
NOT_FOUND = "not found again with the present settings"

_SQL_TYPES = {"int": "INTEGER", "float": "REAL", "float | None": "REAL", "str": "TEXT", "str | None": "TEXT"}
_OF_RECORD = {name: _SQL_TYPES[str(kind)] for name, kind in ShotRecord.__annotations__.items()}
_OF_PEOPLE = {**dict.fromkeys(NAMES, "TEXT"), "marked": "INTEGER DEFAULT 0", "deleted": "INTEGER DEFAULT 0"}
SHOT_COLUMNS = {"id": "INTEGER PRIMARY KEY AUTOINCREMENT", "revision": "INTEGER", **_OF_RECORD, **_OF_PEOPLE}
RECORDING_COLUMNS = {
    "recording": "TEXT PRIMARY KEY",
    "revision": "INTEGER",
    **dict.fromkeys(("recording_hash", "settings_hash", "version", "error", "no_shot_reason", "warnings"), "TEXT"),
}

Row = dict[str, Any]


@dataclass(frozen=True, slots=True)
class KnownRecording:
    """Content, settings and program behind a session's results of a recording, and the error where there are none."""

    recording_hash: str
    settings_hash: str
    version: str
    error: str | None


class ShotSession:
    """One session's folder. Every method may be called from any thread, and by several programs at once.

    Parameters
    ----------
    folder : Path
        Of the session; made where it is not there.

    Raises
    ------
    RecordingError
        The folder cannot be written, or its table is no session's.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._lock = threading.Lock()
        try:
            for one in (folder, folder / "events", folder / "pictures"):
                one.mkdir(parents=True, exist_ok=True)
            with self._table() as table:
                _add_tables(table)
        except OSError as error:
            raise RecordingError(f"the session cannot be opened ({error.strerror}): {folder}") from error

    @staticmethod
    def is_session(folder: Path) -> bool:
        """Whether a folder holds a session."""
        return (folder / TABLE_FILE).is_file()

    @property
    def name(self) -> str:
        """Name for people."""
        return self.folder.name

    @property
    def revision(self) -> int:
        """Number of the last change; a session that has not changed has the same one."""
        with self._table() as table:
            return int(table.execute("SELECT value FROM about WHERE key = 'revision'").fetchone()[0])

    def setting(self, key: str) -> Any:
        """A value that was kept with the session by `keep_setting`; None where none was."""
        with self._table() as table:
            found = table.execute("SELECT value FROM about WHERE key = ?", (f"setting.{key}",)).fetchone()
        return None if found is None else json.loads(found[0])

    def keep_setting(self, key: str, value: Any) -> None:
        """Keep a value of JSON's kinds with the session."""
        with self._table() as table:
            _next_revision(table)
            table.execute("REPLACE INTO about VALUES (?, ?)", (f"setting.{key}", json.dumps(value)))

    def shots(self, since: int = -1) -> list[Row]:
        """All columns but `detail` of the shots that have changed since a revision, deleted ones among them."""
        columns = ", ".join(name for name in SHOT_COLUMNS if name != "detail")
        with self._table() as table:
            found = table.execute(f"SELECT {columns} FROM shots WHERE revision > ? ORDER BY recorded_s, id", (since,))
            return [dict(row) for row in found]

    def shot(self, shot_id: int) -> Row:
        """All columns of one shot, `detail` unpacked; raises ParameterError where there is none."""
        with self._table() as table:
            row = table.execute(f"SELECT {', '.join(SHOT_COLUMNS)} FROM shots WHERE id = ?", (shot_id,)).fetchone()
        if row is None:
            raise ParameterError(f"there is no shot {shot_id} in this session: choose one of the list")
        return _unpacked(row)

    def bounced(self) -> list[Row]:
        """All columns of the shots that ended with a bounce, as `shot` gives them."""
        with self._table() as table:
            found = table.execute(f"SELECT {', '.join(SHOT_COLUMNS)} FROM shots WHERE ended_by = 'bounce'")
            return [_unpacked(row) for row in found]

    def picture(self, shot_id: int) -> Path | None:
        """File of a shot's picture; None where there is none."""
        with self._table() as table:
            row = table.execute("SELECT picture_file FROM shots WHERE id = ?", (shot_id,)).fetchone()
        path = None if row is None or row[0] is None else self.folder / row[0]
        return path if path is not None and path.is_file() else None

    def recordings(self) -> dict[str, Row]:
        """All columns of the recordings, by path."""
        with self._table() as table:
            found = table.execute(f"SELECT {', '.join(RECORDING_COLUMNS)} FROM recordings ORDER BY recording")
            return {row["recording"]: dict(row) for row in found}

    def known(self) -> dict[str, KnownRecording]:
        """The recordings with results or errors, by path."""
        names = KnownRecording.__slots__
        return {
            path: KnownRecording(*(row[name] or "" if name != "error" else row[name] for name in names))
            for path, row in self.recordings().items()
        }

    def name_shots(self, shot_ids: Sequence[int], values: Mapping[str, str | bool | None]) -> None:
        """Set names (text, None to clear them), `marked` or `deleted` of shots; raises ParameterError."""
        checked: Row = {}
        for name, value in values.items():
            if name in NAMES and (value is None or isinstance(value, str)):
                text = " ".join((value or "").split())
                if len(text) > NAME_MOST:
                    raise ParameterError(f"{name} has {len(text)} characters: {NAME_MOST} at most")
                checked[name] = text or None
            elif name in ("marked", "deleted") and isinstance(value, bool):
                checked[name] = int(value)
            else:
                raise ParameterError(f"{name} = {value!r} is nothing that a shot has: {', '.join(_OF_PEOPLE)}")
        if not checked:
            return
        places = ", ".join(f"{name} = ?" for name in checked)
        with self._table() as table:
            revision = _next_revision(table)
            table.executemany(
                f"UPDATE shots SET {places}, revision = ? WHERE id = ?",
                [(*checked.values(), revision, shot_id) for shot_id in shot_ids],
            )

    def add(self, path: str, known: KnownRecording, found: RecordingShots | None) -> list[int]:
        """Put the analysis of a recording in the place of an earlier one, in one transaction; ids of its shots.

        Each shot takes over id, names and marks of the earlier shot with which it shares most of its time. Earlier
        shots that are not found again stay where somebody has named or marked them. Without `found`, as after an error,
        the earlier shots stay as they are. New shots get the names of the session's setting "now".
        """
        now = {name: value for name, value in (self.setting("now") or {}).items() if name in NAMES}
        with self._table() as table:
            revision = _next_revision(table)
            about = {
                "recording": path,
                "revision": revision,
                **{name: getattr(known, name) for name in known.__slots__},
                "no_shot_reason": found.no_shot_reason if found else None,
                "warnings": "; ".join(found.warnings) if found else None,
            }
            _write(table, "REPLACE", "recordings", about)
            if found is None:
                return []
            rows = table.execute("SELECT * FROM shots WHERE recording = ?", (path,))
            earlier: dict[int, Row] = {row["id"]: dict(row) for row in rows}
            ids = []
            for shot in found.shots:
                row: Row = {**shot.values(), "recording": path, "revision": revision}
                same = max(earlier.values(), key=lambda one: _shared_us(one, shot), default=None)
                if same is not None and _shared_us(same, shot) > 0:
                    del earlier[same["id"]]
                    row |= {"id": same["id"]} | {name: same[name] for name in _OF_PEOPLE}
                else:
                    row |= now
                ids.append(_write(table, "REPLACE", "shots", row))
            for row in earlier.values():
                self._forget(table, row, revision)
        return ids

    @staticmethod
    def _forget(table: sqlite3.Connection, row: Mapping[str, Any], revision: int) -> None:
        """Delete a shot that is not found again, or only its spin where somebody has named or marked it."""
        unknown = [name for name, kind in _OF_RECORD.items() if kind == "REAL" and name != "recorded_s"]
        empty = ", ".join(f"{name} = NULL" for name in (*unknown, "method", "told_by"))
        is_named = any(row[name] for name in (*NAMES, "marked"))
        table.execute(
            f"UPDATE shots SET revision = ?, {empty}, reason = ?, deleted = ? WHERE id = ?",
            (revision, NOT_FOUND, row["deleted"] if is_named else 1, row["id"]),
        )

    @contextmanager
    def _table(self) -> Iterator[sqlite3.Connection]:
        """The table in a transaction of its own."""
        with self._lock:
            table = sqlite3.connect(self.folder / TABLE_FILE, timeout=BUSY_S)
            table.row_factory = sqlite3.Row
            try:
                with table:
                    yield table
            except sqlite3.Error as error:
                raise RecordingError(f"the session's table fails ({error}): {self.folder / TABLE_FILE}") from error
            finally:
                table.close()


def _add_tables(table: sqlite3.Connection) -> None:
    """Add the tables, and the columns that a session of an older version lacks."""
    table.execute("CREATE TABLE IF NOT EXISTS about (key TEXT PRIMARY KEY, value TEXT)")
    for name, columns in (("shots", SHOT_COLUMNS), ("recordings", RECORDING_COLUMNS)):
        there = {row["name"] for row in table.execute(f"PRAGMA table_info({name})")}
        if not there:
            table.execute(f"CREATE TABLE {name} ({', '.join(f'{one} {kind}' for one, kind in columns.items())})")
            continue
        for one in columns.keys() - there:
            table.execute(f"ALTER TABLE {name} ADD COLUMN {one} {columns[one]}")
    table.execute("CREATE INDEX IF NOT EXISTS shots_recording ON shots (recording)")
    table.execute("INSERT OR IGNORE INTO about VALUES ('format', ?), ('revision', '0')", (str(FORMAT),))


def _unpacked(row: sqlite3.Row) -> Row:
    return {**dict(row), "detail": json.loads(row["detail"])}


def _next_revision(table: sqlite3.Connection) -> int:
    table.execute("UPDATE about SET value = CAST(value AS INTEGER) + 1 WHERE key = 'revision'")
    return int(table.execute("SELECT value FROM about WHERE key = 'revision'").fetchone()[0])


def _write(table: sqlite3.Connection, verb: str, name: str, row: Row) -> int:
    places = ", ".join("?" for _ in row)
    written = table.execute(f"{verb} INTO {name} ({', '.join(row)}) VALUES ({places})", tuple(row.values()))
    return int(written.lastrowid or 0)


def _shared_us(row: Mapping[str, Any], shot: ShotRecord) -> int:
    """Time that two shots share, us; not positive where they share none."""
    return int(min(row["end_us"], shot.end_us) - max(row["start_us"], shot.start_us))
