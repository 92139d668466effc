"""Child processes: values that go to and fro, and their end with the parent's."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from spinscope.pipeline.child_process import ChildProcess, IdleProcesses
from spinscope.pipeline.events import EventBatch

ECHO = """
from spinscope.pipeline.child_process import pipes_to_parent, receive_value, send_value
requests, answers = pipes_to_parent()
print("to the answers, if it could")
while (value := receive_value(requests)) != "end":
    send_value(answers, value)
"""


def test_values_come_back_and_read_only_arrays_stay_so() -> None:
    process = ChildProcess(ECHO)
    pixels, on = np.ones(200_000, np.uint16), np.ones(200_000, np.bool_)
    events = EventBatch(np.arange(200_000), pixels, pixels, on)
    process.send({"events": events[1000:], "text": "x", "array": np.zeros(3)})
    back = process.receive()
    assert all((a == b).all() for a, b in zip(back["events"].columns, events[1000:].columns, strict=True))
    assert not back["events"].t_us.flags.writeable and back["array"].flags.writeable and back["text"] == "x"
    process.send("end")
    with pytest.raises(EOFError):
        process.receive()
    assert process.exit_status() == 0
    process.end()
    process.send("too late")


def test_idle_processes_that_have_ended_are_not_given_out() -> None:
    idle, processes = IdleProcesses[ChildProcess](1), [ChildProcess(ECHO) for _ in range(2)]
    for process in processes:
        idle.keep(process)
    assert [process.is_running() for process in processes] == [True, False]
    processes[0].kill()
    processes[0].exit_status()
    assert idle.take() is None


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_a_killed_parent_leaves_no_child() -> None:
    program = f"from spinscope.pipeline.child_process import ChildProcess; child = ChildProcess({ECHO!r}); "
    program += "child.send(1); child.receive(); print(child._process.pid, flush=True); input()"
    parent = subprocess.Popen([sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert parent.stdout is not None and parent.stdin is not None
    child = int(parent.stdout.readline())
    os.kill(parent.pid, signal.SIGKILL)
    parent.wait()
    state = Path(f"/proc/{child}/stat")
    while state.exists() and state.read_text().rpartition(")")[2].split()[0] != "Z":  # not reaped yet
        time.sleep(0.01)
    parent.stdin.close()
    parent.stdout.close()
