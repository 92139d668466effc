"""Analysis of many recordings into one table: processes or a cluster do the work, and every row is kept at once."""

from __future__ import annotations

import dataclasses
import json
import traceback
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor
from dataclasses import astuple, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from spinscope.pipeline.errors import ParameterError, RecordingError, SpinscopeError
from spinscope.pipeline.evaluation.tables import Row
from spinscope.pipeline.evaluation.tasks import Task, TaskContext, digest, performed, text_digest
from spinscope.pipeline.evaluation.workers import local_workers, processor_count, task_workers
from spinscope.pipeline.files import check_writable
from spinscope.pipeline.recordings.recording import file_identity
from spinscope.pipeline.result_rows import ResultRow, shot_columns, shot_rows, tick_columns, tick_rows
from spinscope.pipeline.session import Choices, Progress
from spinscope.pipeline.sidecar import Sidecar

from .analysis import analyzed
from .result_journal import JournalEntry, ResultJournal, journal_path, journals_of
from .table_files import check_table_name, write_table

REMEDY = "give another name, or --overwrite to begin anew"


@dataclass(frozen=True, slots=True, kw_only=True)
class BatchWork:
    """Work of a batch on each of its recordings, and the places of the results.

    Attributes
    ----------
    table : Path
        Table of the shots.
    series : Path, optional
        Table of the shots' ticks.
    part : (int, int), optional
        (I, N): only every N-th recording from the I-th on; the table is left to a run without parts.
    jobs : int, optional
        Processes on this machine; None = one a core.
    cluster : str, optional
        Address of a Dask scheduler, whose workers do the work instead.
    overwrite : bool
        Whether earlier results of these names are thrown away.
    """

    choices: Choices
    method: str
    table: Path
    series: Path | None = None
    part: tuple[int, int] | None = None
    jobs: int | None = None
    cluster: str | None = None
    overwrite: bool = False

    @property
    def methods(self) -> tuple[str, ...]:
        """Names of the methods asked for, "all" among them."""
        return (self.method, *self.choices.rivals)

    @property
    def settings_hash(self) -> str:
        """Hash of all options that the results depend on."""
        choices = self.choices
        settings = [choices.parameters().as_dict(), choices.window_us, choices.fixed_ball, astuple(choices.reading)]
        settings += choices.rivals  # none leaves the settings of older tables as they were
        return digest([*settings, self.method])


@dataclass(frozen=True, slots=True)
class BatchSummary:
    """Counts over the recordings of a batch, those known from earlier runs among them.

    Attributes
    ----------
    recordings, known : int
        All, and those of earlier runs.
    failed : tuple of str
        Name and error of each recording that could not be analyzed.
    """

    recordings: int
    known: int
    failed: tuple[str, ...]


def analyze_to_table(recordings: Sequence[Path], work: BatchWork, on_progress: Progress | None = None) -> BatchSummary:
    """Analyze recordings, keeping each one's rows in a journal beside the table at once, then write the table.

    Rows of an earlier run with the same settings are taken over where neither recording nor sidecar nor program has
    changed; the table is ordered by the recordings' names.

    Raises
    ------
    ParameterError, RecordingError
        A file of the table's name is there that this is not, the cluster does not answer, or nothing can be written.
        Whatever is wrong with a recording becomes a row.
    """
    settings, program = work.settings_hash, program_version()
    journal = _journal(work, settings)
    mine = sorted(recordings)[work.part[0] - 1 :: work.part[1]] if work.part else list(recordings)
    pending: dict[int, Task] = {}
    for number, path in enumerate(mine):
        if not _is_known(journal.entries.get(path.as_posix()), path, work, program):
            arguments = {"path": path.absolute(), "line": _line(path, settings, program), "work": work}
            pending[number] = Task(recording_rows, arguments, keep=False)
    done = known = len(mine) - len(pending)
    for line in _lines(pending, work):
        journal.append(line)
        done += 1
        if on_progress:
            on_progress(done / len(mine), f"{done} of {len(mine)} recordings")
    if work.part is None:
        write_tables(journal, work)
    failed = [
        f"{path}: {entry.rows('shots')[0]['error']}"
        for path in mine
        if (entry := journal.entries[path.as_posix()]).failed
    ]
    return BatchSummary(len(mine), known, tuple(failed))


def write_tables(journal: ResultJournal, work: BatchWork) -> None:
    """Write the tables of all recordings of the journals, in the order of their names; raises RecordingError."""
    names = sorted(journal.entries)

    def rows(kind: str) -> Iterator[ResultRow]:
        for name in names:
            entry = journal.entries[name]
            about: ResultRow = {
                "recording": name,
                "recording_hash": entry.recording_hash or None,
                "sidecar_hash": entry.sidecar_hash or None,
                "settings_hash": entry.settings_hash,
                "version": entry.version,
            }
            yield from (about | row for row in entry.rows(kind))

    write_table(work.table, shot_columns(work.methods), rows("shots"))
    if work.series is not None:
        write_table(work.series, tick_columns(work.methods), rows("ticks"))


def recording_rows(context: TaskContext, path: Path, line: dict[str, Any], work: BatchWork) -> list[Row]:
    """Analyze one recording, in whatever process; one row with the journal's `line` filled in, as JSON."""
    try:
        hashes = {"recording_hash": file_identity(path) if path.is_file() else ""}
        line |= hashes | {"sidecar_hash": Sidecar.beside(path).digest}
        result = analyzed(path, work.choices, work.method)
        ticks = None if work.series is None else tick_rows(result)
        line |= {"failed": False, "shots": shot_rows(result), "ticks": ticks}
    except SpinscopeError as error:
        line["shots"] = [{"error": str(error).removesuffix(f": {path}")}]
    except Exception as error:  # noqa: BLE001  # whatever one recording meets, the others go on
        place = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{Path(place.filename).name}, line {place.lineno}"
        line["shots"] = [
            {"error": f"fault of the program ({type(error).__name__}: {error}; {where}): please report it"}
        ]
    return [{"line": json.dumps(line, allow_nan=False)}]


def program_version() -> str:
    """Version of the program with a digest of the pipeline's text, for results of a changed checkout are others."""
    return f"{version('spinscope')}+{text_digest('')[:8]}"


def _line(path: Path, settings_hash: str, program: str) -> dict[str, Any]:
    """A journal's line for a recording whose analysis has not succeeded."""
    hashes = {"recording_hash": "", "sidecar_hash": "", "settings_hash": settings_hash, "version": program}
    return {"recording": path.as_posix(), **hashes, "failed": True, "shots": [], "ticks": None}


def _lines(tasks: Mapping[int, Task], work: BatchWork) -> Iterator[dict[str, Any]]:
    """The journal's lines, as they come.

    A recording on which a library ends the whole process is found by giving each that may have been at work a process
    of its own, and costs its own row only.
    """
    left = dict(tasks)
    jobs = min(processor_count() if work.jobs is None else work.jobs, len(left))
    while left:
        try:
            with task_workers(jobs, work.cluster) as workers:
                for number, rows in performed(dict(left), TaskContext(), workers):
                    del left[number]
                    yield json.loads(str(rows[0]["line"]))
        except BrokenExecutor:
            for number in list(left)[: 2 * jobs]:  # under way, or done and not handed on
                task = left.pop(number)
                try:
                    with local_workers(1) as workers:
                        ((_, rows),) = performed({number: task}, TaskContext(), workers)
                    yield json.loads(str(rows[0]["line"]))
                except BrokenExecutor:
                    error = "the process that read it was ended, by lack of memory or a fault of a library"
                    yield {**task.arguments["line"], "shots": [{"error": error}]}


def _is_known(entry: JournalEntry | None, path: Path, work: BatchWork, program: str) -> bool:
    """Whether a journal's entry is what an analysis would give again."""
    if entry is None or entry.failed or entry.version != program or (work.series is not None and not entry.has_ticks):
        return False
    try:
        return (file_identity(path), Sidecar.beside(path).digest) == (entry.recording_hash, entry.sidecar_hash)
    except SpinscopeError:
        return False


def _journal(work: BatchWork, settings_hash: str) -> ResultJournal:
    """The journal to append to, with what earlier runs and other parts found; see `analyze_to_table` for errors."""
    tables = [path for path in (work.table, work.series) if path is not None]
    for path in tables:
        check_table_name(path)
        check_writable(path, "table")
    earlier = journals_of(work.table)
    if work.overwrite:
        for path in earlier:
            path.unlink(missing_ok=True)
        earlier = []
    elif not earlier and (there := [path for path in tables if path.exists()]):
        raise RecordingError(f"there is a file of this name without the journal of its rows: {REMEDY}: {there[0]}")
    own = journal_path(work.table, work.part)
    journal = ResultJournal(own, [path for path in earlier if path != own])
    if any(entry.settings_hash != settings_hash for entry in journal.entries.values()):
        raise ParameterError(f"the table holds results of other settings: {REMEDY}: {work.table}")
    is_ours = work.overwrite or any(entry.has_ticks for entry in journal.entries.values())
    if work.series is not None and work.series.exists() and not is_ours:
        raise RecordingError(f"there is a file of this name that is not of these results: {REMEDY}: {work.series}")
    return journal


def absolute_choices(choices: Choices) -> Choices:
    """The choices with the paths of their files absolute, for processes that may run elsewhere."""
    return dataclasses.replace(
        choices, preset=_absolute(choices.preset), flight_calibration=_absolute(choices.flight_calibration)
    )


def _absolute(name: str | Path | None) -> str | Path | None:
    """The path of a TOML file made absolute; the name of a preset as it is."""
    return Path(name).absolute() if name and str(name).endswith(".toml") else name
