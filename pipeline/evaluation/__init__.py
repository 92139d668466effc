"""The paper's experiments on simulated recordings, as suites; `spinscope evaluate` runs them."""

from . import suites  # registers them
from .suite import SUITES, Report, Suite, evaluate
from .tables import ResultTable, Row, Summary
from .tasks import Task, TaskContext, executor

__all__ = [
    "SUITES",
    "Report",
    "ResultTable",
    "Row",
    "Suite",
    "Summary",
    "Task",
    "TaskContext",
    "evaluate",
    "executor",
    "suites",
]
