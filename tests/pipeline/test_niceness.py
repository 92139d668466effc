"""Priority of threads, as the system has it."""

from __future__ import annotations

import os
import sys
import threading
from concurrent.futures import ThreadPoolExecutor

import pytest

from spinscope.pipeline.niceness import lower_priority


@pytest.mark.skipif(sys.platform != "linux", reason="threads have priorities of their own on Linux alone")
def test_a_thread_is_lowered_from_where_the_program_is_and_it_alone() -> None:
    """A program that was started with a low priority may not raise it."""

    def niceness() -> int:
        return os.getpriority(os.PRIO_PROCESS, threading.get_native_id())

    def lowered() -> tuple[int, int]:
        os.nice(4)
        before = niceness()
        lower_priority(3)
        return before, niceness()

    own = niceness()
    with ThreadPoolExecutor(1) as pool:
        assert pool.submit(lowered).result() == (min(own + 4, 19), min(own + 7, 19))
    assert niceness() == own
