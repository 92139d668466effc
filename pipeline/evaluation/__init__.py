"""The paper's experiments on simulated and real recordings, as suites; `spinscope evaluate` runs them.

`pipeline.evaluation.suites` loads and registers them, and `real_recordings` runs them on recordings of a laboratory:
batches of recordings need the tasks alone.
"""

from .lab_recordings import LabFolder, LabRecording
from .suite import Report, Suite, evaluate
from .tables import ResultTable, Row, Summary
from .tasks import SceneChoices, Task, TaskContext
from .workers import TaskWorkers, processor_count, task_workers

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
    "TaskWorkers",
    "evaluate",
    "processor_count",
    "task_workers",
]
