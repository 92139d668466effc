"""Child processes: values that go to and fro, and their end with the parent's."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import time
from io import BytesIO, FileIO
from pathlib import Path

import numpy as np
import pytest

from spinscope.pipeline.child_process import (
    SHARED_BYTES,
    SIGNALS_OF_PARENT,
    ChildProcess,
    IdleProcesses,
    SharedMemory,
    receive_value,
    send_value,
)
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


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="signals cannot be held back")
def test_signals_of_the_parent_end_no_child_that_has_just_been_started() -> None:
    process = ChildProcess(f"import time; time.sleep(0.2)\n{ECHO}")
    for one in SIGNALS_OF_PARENT:
        os.kill(process._process.pid, one)
    process.send("still there")
    assert process.receive() == "still there"
    process.end()


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


@pytest.mark.skipif(not hasattr(os, "memfd_create"), reason="no memory without a name")
@pytest.mark.parametrize("sizes", [(), (0, 10, 0), (7, SHARED_BYTES - 7), (SHARED_BYTES, 1)])
def test_arrays_go_through_shared_memory_where_they_fit(sizes: tuple[int, ...]) -> None:
    sender = SharedMemory.created()
    assert sender is not None
    receiver = SharedMemory(FileIO(os.dup(sender.file.fileno()), "r+"))
    rng = np.random.default_rng(4)
    arrays = [rng.integers(0, 256, size, np.uint8) for size in sizes]
    received = []
    for value in (arrays, [array[::-1].copy() for array in arrays]):  # the second one into the same memory
        pipe = BytesIO()
        send_value(pipe, value, sender)
        assert (pipe.tell() > SHARED_BYTES) == (sum(sizes) > SHARED_BYTES)
        pipe.seek(0)
        received.append(receive_value(pipe, receiver))
    for first, second, array in zip(*received, arrays, strict=True):
        np.testing.assert_array_equal(first, array)
        np.testing.assert_array_equal(second, array[::-1])
    for memory in (sender, receiver):
        memory.file.close()


@pytest.mark.skipif(not hasattr(os, "memfd_create"), reason="no memory without a name")
@pytest.mark.parametrize("call", ["memfd_create", "posix_fallocate"])
def test_where_the_system_gives_no_shared_memory_there_is_none(monkeypatch: pytest.MonkeyPatch, call: str) -> None:
    def refuse(*_: object) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, call, refuse)
    assert SharedMemory.created() is None
