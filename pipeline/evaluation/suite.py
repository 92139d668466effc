"""The registry of evaluation suites, and the run of one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import ParameterError
from ..extensions import Registry
from ..session import Choices
from .lab_recordings import LabRecording
from .plots import Figures
from .tables import ResultTable, Row
from .tasks import Progress, SceneChoices, Task, TaskContext, run
from .workers import TaskWorkers


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
    workers: TaskWorkers | None = None,
    on_progress: Progress | None = None,
) -> Report:
    """Run the registered suite of this name.

    Parameters
    ----------
    name : str
    context : TaskContext
    quick : bool
        Whether to thin the suite to about ten seconds.
    workers : TaskWorkers or None
        From `task_workers`; None, and every timed suite, runs in this process.
    on_progress : callable or None
        Called with the share done (0..1) and what is being done.

    Raises
    ------
    SpinscopeError
        As of `check_choices`, or for a cache that cannot be written.
    """
    suite = check_choices(name, context.choices, context.scene, is_real=False)
    rows = run(suite.tasks(quick), context, None if suite.timed else workers, on_progress)
    return Report(suite, quick, rows, suite.tables(rows))
