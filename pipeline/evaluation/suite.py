"""The registry of evaluation suites, and the run of one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from joblib import Parallel

from ..errors import ParameterError, SpinscopeError
from ..extensions import Registry
from ..recordings import is_recording
from ..recordings.recording import file_identity
from ..session import Choices
from .lab_recordings import LabFolder, LabRecording, recordings_table
from .plots import Figures
from .tables import ResultTable, Row
from .tasks import Progress, SceneChoices, Task, TaskContext, digest, run


@dataclass(frozen=True, kw_only=True)
class Suite:
    """One experiment of the evaluation, from a module of `suites`.

    Attributes
    ----------
    name, label, help : str
        As users type it, heading of its results, and one line on what it measures.
    tasks : callable
        Tasks of the full or (argument True) the thinned suite.
    tables, figures : callable
        Tables that summarise the rows of all tasks, and matplotlib figures of them by name.
    timed : bool
        Whether the tasks measure run times, so that they run one by one in this process.
    takes_scene_choices : bool
        Whether another ball or lens can be chosen for the scenes.
    takes_rivals : bool
        Whether it compares spin methods, so that those of other publications can be added.
    real_kinds : tuple of str
        Kinds of real recordings that the suite runs on; empty where it runs on simulated ones only.
    real : callable or None
        `real(context, recording)`: rows of a LabRecording; raises SpinscopeError, with a remedy, where something is
        missing.
    """

    name: str
    label: str
    help: str
    tasks: Callable[[bool], list[Task]]
    tables: Callable[[Sequence[Row]], list[ResultTable]]
    figures: Callable[[Sequence[Row]], Figures]
    timed: bool = False
    takes_scene_choices: bool = False
    takes_rivals: bool = False
    real_kinds: tuple[str, ...] = ()
    real: Callable[[TaskContext, LabRecording], list[Row]] | None = None


SUITES: Registry[Suite] = Registry("suite")


@dataclass(frozen=True)
class Report:
    """Results of a suite, thinned or not: one measurement a row, and tables that summarise them.

    `folder` is that of the real recordings, None where they were simulated.
    """

    suite: Suite
    quick: bool
    rows: list[Row]
    tables: list[ResultTable]
    folder: Path | None = None

    @property
    def title(self) -> str:
        """Heading of the results."""
        return self.suite.label if self.folder is None else f"{self.suite.label}, real recordings"

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "suite": self.suite.name,
            "title": self.title,
            "quick": self.quick,
            "real": self.folder is not None,
            "tables": [table.as_dict() for table in self.tables],
            "rows": self.rows,
        }


def check_choices(name: str, choices: Choices, scene: SceneChoices, *, is_real: bool) -> Suite:
    """The registered suite of this name; raises ParameterError for an unknown one, and for what it does not take."""
    suite = SUITES[name]
    if is_real and suite.real is None:
        able = ", ".join(one.name for one in SUITES if one.real)
        raise ParameterError(f"the suite {name} runs on simulated recordings only: real ones are for {able}")
    if not is_real and scene != SceneChoices() and not suite.takes_scene_choices:
        raise ParameterError(f"the suite {name} has balls and lenses of its own: leave --ball and --lens-mm out")
    if choices.rivals and not suite.takes_rivals:
        able = ", ".join(one.name for one in SUITES if one.takes_rivals)
        raise ParameterError(f"the suite {name} compares no spin methods: leave --rival out, or run it with {able}")
    return suite


def evaluate(
    name: str,
    context: TaskContext,
    *,
    quick: bool = False,
    parallel: Parallel | None = None,
    on_progress: Progress | None = None,
) -> Report:
    """Run the registered suite of this name.

    Parameters
    ----------
    name : str
    context : TaskContext
    quick : bool
        Whether to thin the suite to about ten seconds.
    parallel : joblib.Parallel or None
        From `tasks.executor`; None, and every timed suite, runs in this process.
    on_progress : callable or None
        Called with the share done (0..1) and what is being done.

    Raises
    ------
    SpinscopeError
        As of `check_choices`, or for a cache that cannot be written.
    """
    suite = check_choices(name, context.choices, context.scene, is_real=False)
    rows = run(suite.tasks(quick), context, None if suite.timed else parallel, on_progress)
    return Report(suite, quick, rows, suite.tables(rows))


def evaluate_real(
    name: str,
    folder: Path,
    context: TaskContext,
    *,
    parallel: Parallel | None = None,
    on_progress: Progress | None = None,
) -> Report:
    """Run a suite on the real recordings of a folder, with truth from their sidecars.

    A recording that cannot be used is left out and named in the first table, with the reason.

    Parameters
    ----------
    name : str
    folder : Path
        With its recordings, those in folders below, and their sidecars.
    context, parallel, on_progress
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
    every = run(tasks, context, None if suite.timed else parallel, on_progress)
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
    from .suites import SUITES as REGISTERED  # a process of its own has loaded this module alone, and no suite

    measure = REGISTERED[suite].real
    assert measure is not None
    try:
        opened = LabRecording.of(Path(path), context.choices)
        rows = measure(context, opened)
        sensor = f"{opened.session.source.width_px}x{opened.session.source.height_px}"
    except SpinscopeError as error:
        return [{"recording": recording, "error": str(error)}]
    return [{"recording": recording, "sensor": sensor, **row} for row in rows]
