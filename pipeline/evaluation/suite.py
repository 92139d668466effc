"""The registry of evaluation suites, and the run of one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from joblib import Parallel

from ..extensions import Registry
from .plots import Figures
from .tables import ResultTable, Row
from .tasks import Progress, Task, TaskContext, run


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
    """

    name: str
    label: str
    help: str
    tasks: Callable[[bool], list[Task]]
    tables: Callable[[Sequence[Row]], list[ResultTable]]
    figures: Callable[[Sequence[Row]], Figures]
    timed: bool = False


SUITES: Registry[Suite] = Registry("suite")


@dataclass(frozen=True)
class Report:
    """Results of a suite, thinned or not: one measurement a row, and tables that summarise them."""

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
        For an unknown suite, or a cache that cannot be written.
    """
    suite = SUITES[name]
    rows = run(suite.tasks(quick), context, None if suite.timed else parallel, on_progress)
    return Report(suite, quick, rows, suite.tables(rows))
