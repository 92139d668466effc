"""The registry of evaluation suites, and the run of one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from joblib import Parallel

from ..extensions import Registry
from .tables import ResultTable, Row
from .tasks import Progress, Task, TaskContext, run

if TYPE_CHECKING:
    from matplotlib.figure import Figure  # loaded when the first one is drawn


@dataclass(frozen=True, kw_only=True)
class Suite:
    """One experiment of the evaluation; a module of `suites` registers it.

    Attributes
    ----------
    name : str
        As users type it.
    label : str
        Heading of its results.
    help : str
        One line on what it measures.
    tasks : callable
        Tasks of the full or (argument True) the thinned suite.
    tables : callable
        Tables that summarise the rows of all tasks.
    figures : callable
        Matplotlib figures of the rows by name.
    timed : bool
        Whether the tasks measure run times, so that they run one by one in this process.
    """

    name: str
    label: str
    help: str
    tasks: Callable[[bool], list[Task]]
    tables: Callable[[Sequence[Row]], list[ResultTable]]
    figures: Callable[[Sequence[Row]], dict[str, Figure]]
    timed: bool = False


SUITES: Registry[Suite] = Registry("suite")


@dataclass(frozen=True)
class Report:
    """Results of a suite.

    Attributes
    ----------
    suite : Suite
    quick : bool
        Whether the suite was thinned.
    rows : list of dict
        One measurement each.
    tables : list of ResultTable
        Summaries of the rows.
    """

    suite: Suite
    quick: bool
    rows: list[Row]
    tables: list[ResultTable]

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "suite": self.suite.name,
            "title": self.suite.label,
            "quick": self.quick,
            "tables": [table.as_dict() for table in self.tables],
            "rows": self.rows,
        }


def evaluate(
    name: str,
    context: TaskContext,
    *,
    quick: bool = False,
    parallel: Parallel | None = None,
    on_progress: Progress | None = None,
) -> Report:
    """Run a suite.

    Parameters
    ----------
    name : str
        Of a registered suite.
    context : TaskContext
        Cache and parameters.
    quick : bool
        Whether to thin the suite to about ten seconds.
    parallel : joblib.Parallel or None
        From `tasks.executor`; None, and every timed suite, runs in this process.
    on_progress : callable or None
        Called with the share done (0..1) and what is being done.

    Raises
    ------
    ParameterError
        For an unknown suite.
    RecordingError
        When the cache cannot be written.
    """
    suite = SUITES[name]
    rows = run(suite.tasks(quick), context, None if suite.timed else parallel, on_progress)
    return Report(suite, quick, rows, suite.tables(rows))
