"""The paper's experiments on simulated recordings, as suites; `spinscope evaluate` runs them."""

from .suites import SUITES, Report, Suite, evaluate
from .tables import Row, Summary, Table
from .work import Bench, executor

__all__ = ["SUITES", "Bench", "Report", "Row", "Suite", "Summary", "Table", "evaluate", "executor"]
