"""The suites by name, and how one is run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Any

from ..errors import ParameterError
from . import biases, detector, filters, frames, runtime, spinner, thrower
from .tables import Row, Table
from .work import Bench, Progress, Task, run


@dataclass(frozen=True)
class Suite:
    """One of the paper's experiments.

    tasks : of the full or (True) the thinned suite
    alone : whether its tasks must not share the machine with each other, because they take times
    """

    name: str
    title: str
    tasks: Callable[[bool], list[Task]]
    tables: Callable[[Sequence[Row]], list[Table]]
    alone: bool = False


SUITES: dict[str, Suite] = {
    suite.name: suite
    for suite in (
        Suite("detector", "Ball detector: error against speed", detector.tasks, detector.tables),
        Suite("spinner", "Ball spinner: the paper's table 1", spinner.tasks, spinner.tables),
        Suite("thrower", "Ball thrower: the paper's table 2", thrower.tasks, thrower.tables),
        Suite("frames", "Frame camera against event camera: the paper's table 2", frames.tasks, frames.tables),
        Suite("biases", "Biases: event rates and pictures of the logo", biases.tasks, biases.tables),
        Suite("filters", "Filters: events kept, and the spin", filters.tasks, filters.tables),
        Suite("runtime", "Run times", runtime.tasks, runtime.tables, alone=True),
    )
}


@dataclass(frozen=True)
class Report:
    """What a suite found.

    rows : one measurement each; tables : summaries of them
    """

    suite: Suite
    quick: bool
    rows: list[Row]
    tables: list[Table]

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "suite": self.suite.name,
            "title": self.suite.title,
            "quick": self.quick,
            "tables": [table.as_dict() for table in self.tables],
            "rows": self.rows,
        }


def evaluate(
    name: str,
    bench: Bench,
    *,
    quick: bool = False,
    by: Executor | None = None,
    on_progress: Progress | None = None,
) -> Report:
    """Run a suite.

    by : who does the work, see `work.executor`; None = this process
    Raises ParameterError for an unknown suite, RecordingError when the cache cannot be written.
    """
    if name not in SUITES:
        raise ParameterError(f"there is no suite {name!r}: there are {', '.join(SUITES)}")
    suite = SUITES[name]
    rows = run(suite.tasks(quick), bench, None if suite.alone else by, on_progress)
    return Report(suite, quick, rows, suite.tables(rows))
