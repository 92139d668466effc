"""The paper's experiments on simulated and real recordings, as suites; `spinscope evaluate` runs them."""

from . import suites  # registers them
from .lab_recordings import LabFolder, LabRecording
from .suite import SUITES, Report, Suite, evaluate, evaluate_real
from .tables import ResultTable, Row, Summary
from .tasks import SceneChoices, Task, TaskContext, executor

__all__ = [
    "SUITES",
    "LabFolder",
    "LabRecording",
    "Report",
    "ResultTable",
    "Row",
    "SceneChoices",
    "Suite",
    "Summary",
    "Task",
    "TaskContext",
    "evaluate",
    "evaluate_real",
    "executor",
    "suites",
]
