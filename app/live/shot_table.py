"""Table to which shots are appended as they end, with each shot's events as a small recording of its own."""

from __future__ import annotations

import csv
import io
import json
import os
from collections.abc import Iterator
from datetime import UTC, datetime
from itertools import chain as joined
from itertools import count
from pathlib import Path

from spinscope.pipeline.cameras import RecentEvents
from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.live_outputs import LiveShot
from spinscope.pipeline.recordings import write_recording
from spinscope.pipeline.result_rows import ResultRow, shot_columns, shot_rows
from spinscope.pipeline.session import Result, Session

from ..coach.shot_record import SHOT_END, SHOT_START
from ..table_files import check_table_name, write_table
from ..terminal import note

MARGIN_US = 20_000  # of events before and after a shot: analysed anew it begins and ends as it did
LIVE_COLUMNS: dict[str, type] = {"number": int, "date": str, "events_file": str, "latency_ms": float}


def events_folder(table: Path) -> Path:
    """Folder of the events of a table's shots."""
    return table.with_name(f"{table.stem}_shots")


class ShotTable:
    """CSV, JSON lines or Parquet with one row a shot; the same name goes on with the rows that are there.

    Rows are on disk when `append` returns: in the table itself, or for Parquet, which nothing can be appended to, in
    NAME.parquet.rows.jsonl, from which `close` makes it.

    Parameters
    ----------
    path : Path
        The table. Events are saved in the folder NAME_shots beside it, where those of another table of this name stay.
    method : str
        Name of the spin method that is run, or "all".

    Raises
    ------
    ParameterError
        For a name that is no table's.
    RecordingError
        For a table that cannot be written or was not written by this program.
    """

    def __init__(self, path: Path, method: str = "all") -> None:
        check_table_name(path)
        self.path, self.columns = path, {**LIVE_COLUMNS, **shot_columns([method])}
        self.folder = events_folder(path)
        is_parquet = path.suffix.lower() == ".parquet"
        self._rows = path.with_name(f"{path.name}.rows.jsonl") if is_parquet else path
        self._is_csv = path.suffix.lower() == ".csv"
        if is_parquet and path.exists() and not self._rows.exists():
            raise RecordingError(f"the table is there without its rows ({self._rows.name}): give another name: {path}")
        try:
            self.folder.mkdir(exist_ok=True)
            self.count = self._known_rows()
        except OSError as error:
            raise self._error(error) from error

    def append(self, shot: LiveShot, session: Session, recent: RecentEvents) -> ResultRow:
        """Add a shot and save its events, or say why they are not; returns the row. Raises RecordingError."""
        (row,) = shot_rows(Result(session, (shot.shot,), None))
        number = self.count + 1
        try:
            saved = self._save_events(number, shot, session, recent)
        except RecordingError as error:
            note(f"the events of shot {number} are not saved: {error}")
            saved = None
        row |= {"number": number, "date": datetime.now(UTC).isoformat(), "latency_ms": shot.latency_ms}
        row["events_file"] = None if saved is None else str(saved.relative_to(self.path.parent))
        self._append({name: row.get(name) for name in self.columns})
        self.count = number
        return row

    def _save_events(self, number: int, shot: LiveShot, session: Session, recent: RecentEvents) -> Path:
        """Save a shot's events, as far as they are kept; raises RecordingError."""
        start_us, end_us = max(shot.shot.start_us - MARGIN_US, 0), shot.shot.end_us + MARGIN_US
        events = recent.between(shot.clock, start_us, end_us)
        if not len(events):
            raise RecordingError("they are no longer in memory: the spins are too far behind")
        names = (f"shot_{number:05d}{again}.h5" for again in joined([""], (f"-{n}" for n in count(2))))
        saved = next(path for path in map(self.folder.joinpath, names) if not path.exists())
        camera = {f"camera.{name}": value for name, value in session.parameters.camera.as_dict().items()}
        attributes = {name: value for name, value in camera.items() if isinstance(value, str | float)}
        attributes |= {SHOT_START: float(shot.shot.start_us), SHOT_END: float(shot.shot.end_us)}
        width_px, height_px = session.source.width_px, session.source.height_px
        write_recording(saved, events, width_px=width_px, height_px=height_px, attributes=attributes)
        return saved

    @property
    def disk_bytes(self) -> int:
        """Disk use of the table and the saved events."""
        files = [self._rows, *self.folder.iterdir()]
        return sum(file.stat().st_size for file in files if file.exists())

    def close(self) -> None:
        """Write the Parquet table; raises RecordingError."""
        if self._rows != self.path:
            write_table(self.path, self.columns, map(json.loads, self._lines()))

    def _known_rows(self) -> int:
        """Number of rows that are there; a last one that was cut off is removed."""
        if not self._rows.exists():
            self._write(self._csv_line(dict(zip(self.columns, self.columns, strict=True))) if self._is_csv else b"")
            return 0
        lines = list(self._lines())
        if self._is_csv and (not lines or next(csv.reader([lines[0].decode()])) != list(self.columns)):
            raise RecordingError(
                f"the table has other columns than this version writes: give another name: {self.path}"
            )
        os.truncate(self._rows, sum(map(len, lines)))
        return len(lines) - self._is_csv

    def _lines(self) -> Iterator[bytes]:
        """The whole lines; texts of rows hold no line ends."""
        with open(self._rows, "rb") as file:
            yield from (line for line in file if line.endswith(b"\n"))

    def _append(self, row: ResultRow) -> None:
        try:
            self._write(self._csv_line(row) if self._is_csv else json.dumps(row, allow_nan=False).encode() + b"\n")
        except OSError as error:
            raise self._error(error) from error

    def _csv_line(self, row: ResultRow) -> bytes:
        text = io.StringIO()
        csv.DictWriter(text, self.columns, lineterminator="\n").writerow(row)
        return text.getvalue().encode()

    def _write(self, content: bytes) -> None:
        with open(self._rows, "ab") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())

    def _error(self, error: OSError) -> RecordingError:
        return RecordingError(f"table cannot be written ({error.strerror}): check free space and rights: {self.path}")
