"""The paper's experiments on simulated and real recordings, as suites; `spinscope evaluate` runs them.

`pipeline.evaluation.suites` loads and registers them: batches of recordings need the tasks alone.
"""

from .lab_recordings import LabFolder, LabRecording
from .suite import Report, Suite, evaluate, evaluate_real
from .tables import ResultTable, Row, Summary
from .tasks import SceneChoices, Task, TaskContext, executor

__all__ = [
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
]
