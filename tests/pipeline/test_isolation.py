"""Calls in a process with limits: what they give, and what ends them."""

from __future__ import annotations

import gc
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from spinscope.pipeline import isolation
from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.isolation import IsolationError, call, iterate, without_time_limit

SHORT_S = 2.0  # of waiting, where a test would have to wait for the usual limit
SHORT_CPU_S = 1.5  # of computing, in every test: those that hang compute for as long


def blocks(count: int, size: int) -> Iterator[dict[str, np.ndarray]]:
    for k in range(count):
        yield {"values": np.full(size, k), "process": np.array(os.getpid())}


def hang() -> None:
    while True:
        pass


def hang_after(count: int) -> Iterator[int]:
    yield from range(count)
    hang()


def crash() -> None:
    os.kill(os.getpid(), signal.SIGSEGV)


def take(size: int) -> int:
    return np.ones(size, np.uint8).size


def refuse() -> None:
    raise RecordingError("x = -1 at event 7 is negative")


def fail() -> None:
    raise LookupError("a bug of ours")


def test_readers_in_a_process_of_their_own_start_without_a_compiler() -> None:
    """It takes as long to load as the library may then loop, until a hostile file is refused."""
    code = "import sys, spinscope.pipeline.recordings.isolated_reader; sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0


@pytest.fixture(autouse=True, scope="module")
def impatient() -> Iterator[None]:
    """The processes of these tests may compute less than usual."""
    isolation._idle.end()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(isolation, "MAX_CPU_S", SHORT_CPU_S)
        yield
    isolation._idle.end()


@pytest.fixture
def strict(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The processes of the test may wait less than usual."""
    isolation._idle.end()
    monkeypatch.setattr(isolation, "MAX_SILENCE_S", SHORT_S)
    yield
    isolation._idle.end()


def wait_for(duration_s: float) -> int:
    time.sleep(duration_s)
    return 7


def print_and_work_long() -> int:
    print("to the answers, if it could")  # noqa: T201
    with without_time_limit():
        time.sleep(SHORT_S + 0.5)
        compute_for(isolation.MAX_CPU_S + 0.1)
    return 7


def compute_for(duration_s: float) -> int:
    end = time.process_time() + duration_s
    while time.process_time() < end:
        pass
    return 7


def process_id() -> int:
    return os.getpid()


def test_values_arrive_as_they_were_sent() -> None:
    parts = list(iterate(blocks, 3, 100_000))
    assert [int(part["values"].sum()) for part in parts] == [0, 100_000, 200_000]
    parts[0]["values"][:] = 5  # memory of one's own, as from any other call


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_shared_memory_is_given_back_however_the_process_ends() -> None:
    def mapped() -> int:
        return Path("/proc/self/maps").read_text().count("memfd:spinscope")

    isolation._idle.end()
    gc.collect()
    before = mapped(), len(os.listdir("/proc/self/fd"))
    parts = iterate(blocks, 2, 100_000)
    assert next(parts)["values"].size == 100_000 and mapped() == before[0] + 1
    parts.close()
    with pytest.raises(IsolationError):
        call(crash)
    isolation._idle.end()
    gc.collect()
    assert (mapped(), len(os.listdir("/proc/self/fd"))) == before


def test_the_process_is_kept_and_is_not_this_one() -> None:
    first = call(process_id)
    assert first not in (os.getpid(), os.getppid()) and call(process_id) == first
    assert next(iterate(blocks, 10**9, 10))["process"] == first, "also when its generator is left half read"
    assert call(process_id) == first


def test_each_of_several_calls_at_a_time_has_a_process() -> None:
    one, other = iterate(blocks, 3, 10), iterate(blocks, 3, 10)
    assert next(one)["process"] != next(other)["process"]
    assert [len(list(rest)) for rest in (one, other)] == [2, 2]


@pytest.mark.parametrize(
    ("function", "arguments", "message"),
    [
        (hang, (), f"no progress in {SHORT_CPU_S:g} s of computing"),
        (crash, (), "crashes the library"),
        (take, (2 << 30,), "over 512 MB of memory"),
    ],
)
def test_hanging_crashing_and_greedy_calls_end(function: object, arguments: tuple[int, ...], message: str) -> None:
    with pytest.raises(IsolationError, match=message):
        call(function, *arguments)  # type: ignore[arg-type]
    assert call(take, 10) == 10


def test_the_limit_of_computing_counts_from_each_call_anew() -> None:
    first = call(process_id)
    for _ in range(3):
        assert call(compute_for, isolation.MAX_CPU_S / 2 - 0.2) == 7
    assert call(process_id) == first


@pytest.mark.usefixtures("strict")
def test_a_call_that_waits_forever_ends() -> None:
    with pytest.raises(IsolationError, match=f"no progress for {SHORT_S:g} s"):
        call(wait_for, 1e6)


@pytest.mark.parametrize("read", [1, 2, 3])
def test_what_is_left_of_a_call_disturbs_no_later_one(read: int) -> None:
    """Left with values to come, with the last one to come, and behind it."""
    first = call(process_id)
    parts = iterate(blocks, 3, 100_000)
    for _ in range(read):
        next(parts)
    parts.close()
    assert [int(part["values"][0]) for part in iterate(blocks, 2, 5)] == [0, 1]
    assert call(process_id) == first


def test_values_before_a_hang_are_kept() -> None:
    parts = iterate(hang_after, 2)
    assert next(parts) == 0
    with pytest.raises(IsolationError, match="no progress"):
        list(parts)


@pytest.mark.usefixtures("strict")
def test_a_slow_caller_is_waited_for() -> None:
    parts = iterate(blocks, 2, 10)
    process = next(parts)["process"]
    time.sleep(SHORT_S + 0.5)
    assert [part["process"] for part in parts] == [process]


def test_errors_arrive_and_bugs_with_their_traceback() -> None:
    with pytest.raises(RecordingError, match=r"^x = -1 at event 7 is negative$"):
        call(refuse)
    with pytest.raises(RuntimeError, match=r"in fail\n.*\nLookupError: a bug of ours"):
        call(fail)


def test_relative_paths_are_of_the_callers_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("a", "b"):  # the process is kept from one call to the next
        (tmp_path / name).mkdir()
        monkeypatch.chdir(tmp_path / name)
        assert call(os.getcwd) == os.getcwd()


@pytest.mark.usefixtures("strict")
def test_what_takes_long_in_sound_files_too_is_waited_for() -> None:
    assert call(print_and_work_long) == 7


def test_other_threads_go_on_while_a_call_hangs() -> None:
    """The tuner's server is such a thread: a library that hangs with Python's lock would stop it."""
    failed: list[IsolationError] = []

    def hang_there() -> None:
        try:
            call(hang)
        except IsolationError as error:
            failed.append(error)

    thread = threading.Thread(target=hang_there)
    thread.start()
    turns = 0
    while thread.is_alive():
        time.sleep(0.01)
        turns += 1
    assert failed and turns > 20


def test_the_garbage_collector_ends_the_process_of_an_abandoned_generator_without_a_warning() -> None:
    values = iterate(blocks, 5, 10)
    process = int(next(values)["process"])
    cycle: list[object] = [values]
    cycle.append(cycle)
    del values, cycle
    gc.collect()
    assert call(os.getpid) == process  # it waits for the next call
