"""Priority of threads that let others go first."""

from __future__ import annotations

import os
import sys


def lower_priority(niceness: int) -> None:
    """Lower this thread's priority, counted from the one it began with: that of the program may be low already.

    On Linux alone: elsewhere the whole process would have it.
    """
    if sys.platform == "linux":
        os.nice(niceness)
