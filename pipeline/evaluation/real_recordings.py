"""Suites run on real recordings, also by processes of their own, which load this module and with it all suites."""

from __future__ import annotations

from pathlib import Path

from ..errors import SpinscopeError
from ..recordings import is_recording
from ..recordings.recording import file_identity
from .lab_recordings import LabFolder, LabRecording, recordings_table
from .suite import Report, check_choices
from .suites import SUITES
from .tables import Row
from .tasks import Progress, Task, TaskContext, digest, run
from .workers import TaskWorkers


def evaluate_real(
    name: str,
    folder: Path,
    context: TaskContext,
    *,
    workers: TaskWorkers | None = None,
    on_progress: Progress | None = None,
) -> Report:
    """Run a suite on the real recordings of a folder, with truth from their sidecars.

    A recording that cannot be used is left out and named in the first table, with the reason.

    Parameters
    ----------
    name : str
    folder : Path
        With its recordings, those in folders below, and their sidecars.
    context, workers, on_progress
        As of `evaluate`.

    Raises
    ------
    SpinscopeError
        As of `check_choices`, or for a folder without recordings.
    """
    suite = check_choices(name, context.choices, context.scene, is_real=True)
    found = LabFolder.of(folder, context.choices, context.scene.ball)
    beside = {one: digest(_beside(one)) for one in {recording.path.parent for recording in found.recordings}}
    tasks = [
        Task(
            real_rows,
            {
                "suite": name,
                "recording": recording.path.relative_to(folder).as_posix(),
                "path": str(recording.path.absolute()),
                "content": [file_identity(recording.path), recording.sidecar.digest, beside[recording.path.parent]],
            },
            keep=not suite.timed,
        )
        for recording in found.recordings
        if recording.kind in suite.real_kinds
    ]
    every = run(tasks, context, None if suite.timed else workers, on_progress)
    rows = [row for row in every if "error" not in row]
    tables = [table for table in suite.tables(rows) if table.rows] if rows else []
    return Report(suite, False, rows, [recordings_table(found, suite.real_kinds, every), *tables], folder)


def _beside(folder: Path) -> list[str]:
    """Names and times of change of what is no recording in a folder: labels, pictures, calibrations."""
    others = (path for path in sorted(folder.iterdir()) if not is_recording(path))
    return [f"{path.name} {path.stat().st_mtime_ns}" for path in others]


def real_rows(context: TaskContext, suite: str, recording: str, path: str, content: list[str]) -> list[Row]:
    """Rows of a suite of one real recording; a single one with the `error` where it cannot be used.

    `content` tells versions of the recording and what stands beside it apart when rows are kept.
    """
    measure = SUITES[suite].real
    assert measure is not None
    try:
        opened = LabRecording.of(Path(path), context.choices)
        rows = measure(context, opened)
        sensor = f"{opened.session.source.width_px}x{opened.session.source.height_px}"
    except SpinscopeError as error:
        return [{"recording": recording, "error": str(error)}]
    return [{"recording": recording, "sensor": sensor, **row} for row in rows]
