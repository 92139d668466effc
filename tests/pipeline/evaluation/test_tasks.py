"""Tasks: kept results, interruption, who does the work."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
import threading
import time
import types
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor, CancelledError, Future, ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import pytest

from spinscope.pipeline.errors import ParameterError, RecordingError
from spinscope.pipeline.evaluation.tables import Row
from spinscope.pipeline.evaluation.tasks import Task, TaskContext, _limit_cache, performed, run, write_whole
from spinscope.pipeline.evaluation.workers import TaskWorkers, local_workers, task_workers
from spinscope.pipeline.registry import Parameters

CALLS: list[int] = []


def square(context: TaskContext, number: int) -> list[Row]:
    CALLS.append(number)
    return [{"number": number, "square": number * number}]


def sleeping(context: TaskContext, number: int) -> list[Row]:
    time.sleep(600.0)
    return []


def failing(context: TaskContext) -> list[Row]:
    raise ParameterError("no")


@pytest.fixture(autouse=True)
def no_calls() -> Iterator[None]:
    CALLS.clear()
    yield
    CALLS.clear()


def squares(count: int, keep: bool = True) -> list[Task]:
    return [Task(square, {"number": number}, keep) for number in range(count)]


@contextmanager
def threads(count: int) -> Iterator[TaskWorkers]:
    with ThreadPoolExecutor(count) as executor:
        yield TaskWorkers(executor, count)


def test_rows_come_in_the_order_of_tasks(tmp_path: Path) -> None:
    shares: list[float] = []
    with threads(3) as workers:
        rows = run(squares(20), TaskContext(tmp_path), workers, lambda share, what: shares.append(share))
    assert [row["square"] for row in rows] == [n * n for n in range(20)]
    assert shares == sorted(shares) and shares[-1] == 1.0


def test_interrupted_run_goes_on_where_it_stopped(tmp_path: Path) -> None:
    def stop(share: float, what: str) -> None:
        if share == 0.75:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(squares(4), TaskContext(tmp_path), on_progress=stop)
    assert CALLS == [0, 1, 2]
    rows = run(squares(4), TaskContext(tmp_path))
    assert CALLS == [0, 1, 2, 3]
    assert [row["square"] for row in rows] == [0, 1, 4, 9]


def test_error_of_a_task_stops_the_run_and_keeps_what_is_done(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="no"), threads(1) as workers:
        run([*squares(1), Task(failing), *squares(3)[1:]], TaskContext(tmp_path), workers)
    assert len(list((tmp_path / "results").iterdir())) >= 1
    assert not list(tmp_path.rglob("*.part"))


def test_other_parameters_are_other_results(tmp_path: Path) -> None:
    run(squares(1), TaskContext(tmp_path))
    run(squares(1), TaskContext(tmp_path, Parameters().with_assignments(["logo.pad_px=3"])))
    assert CALLS == [0, 0]


def test_damaged_result_is_made_anew(tmp_path: Path) -> None:
    run(squares(1), TaskContext(tmp_path))
    (kept,) = (tmp_path / "results").iterdir()
    kept.write_text("[{")
    assert run(squares(1), TaskContext(tmp_path)) == [{"number": 0, "square": 0}]
    assert CALLS == [0, 0]


def test_times_and_runs_without_a_cache_are_not_kept(tmp_path: Path) -> None:
    for _ in range(2):
        run(squares(1, keep=False), TaskContext(tmp_path))
        run(squares(1), TaskContext(None))
    assert CALLS == [0] * 4
    assert not list(tmp_path.iterdir())


@pytest.mark.filterwarnings("ignore:This process:DeprecationWarning")  # NumPy's threads end before a copy is made
@pytest.mark.parametrize("has_threads", [False, True])
def test_local_processes_do_the_work(tmp_path: Path, has_threads: bool) -> None:
    """As copies of this process, or started anew beside threads."""
    is_done = threading.Event()
    if has_threads:
        threading.Thread(target=is_done.wait).start()
    with task_workers(2) as workers:
        rows = run(squares(2), TaskContext(tmp_path), workers)
    is_done.set()
    assert [row["square"] for row in rows] == [0, 1]
    assert not CALLS  # not in this process


def test_an_error_ends_the_processes_at_once() -> None:
    """Else the block would end with their work."""
    with pytest.raises(KeyboardInterrupt), local_workers(1) as workers:
        working = workers.executor.submit(time.sleep, 600)
        raise KeyboardInterrupt
    with pytest.raises(BrokenExecutor):
        working.result()


def test_an_error_leaves_the_processes_of_others() -> None:
    with local_workers(1) as others:
        with pytest.raises(KeyboardInterrupt), local_workers(1):
            other = others.executor.submit(os.getpid).result()
            raise KeyboardInterrupt
        assert others.executor.submit(os.getpid).result() == other


@pytest.mark.parametrize("process_count", [1, 2])
def test_another_thread_stops_the_work(process_count: int) -> None:
    """At once, with processes at work; after the task under way, without."""
    stop: Future[None] = Future()
    tasks = {0: Task(square, {"number": 0}), 1: Task(sleeping if process_count > 1 else square, {"number": 1})}
    with pytest.raises(CancelledError), task_workers(process_count) as workers:
        for number, _ in performed(tasks, TaskContext(), workers, stop):
            assert number == 0
            stop.set_result(None)


@pytest.mark.slow  # tests/app/test_batch.py kills a command with its workers
def test_workers_end_with_the_process_that_started_them(tmp_path: Path) -> None:
    """Also when it is killed and cannot stop them."""
    script = (
        "import os, signal\n"
        "from spinscope.pipeline.evaluation.workers import local_workers\n"
        "if __name__ == '__main__':\n"
        "    with local_workers(2) as workers:\n"
        "        print(workers.executor.submit(os.getpid).result(), flush=True)\n"
        "        os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    (tmp_path / "run.py").write_text(script)
    here = str(Path(__file__).parents[3])
    # The worker holds the other end of the pipe: reading to its end waits for the worker, too.
    ended = subprocess.run(
        [sys.executable, str(tmp_path / "run.py")],
        stdout=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": here},
        timeout=120,
        check=False,
    )
    assert ended.returncode == -signal.SIGKILL
    assert int(ended.stdout) > 0


def test_cluster_without_dask_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ParameterError, match="needs Dask"), task_workers(cluster="tcp://nowhere:1"):
        pass


def test_cluster_that_does_not_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    def client(address: str, timeout: float) -> None:
        raise OSError("timed out")

    monkeypatch.setitem(sys.modules, "distributed", types.SimpleNamespace(Client=client))
    with (
        pytest.raises(ParameterError, match="no Dask cluster answers at tcp://nowhere:1"),
        task_workers(cluster="tcp://nowhere:1"),
    ):
        pass


def test_place_that_cannot_be_written_gets_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(RecordingError, match="cannot be written") as caught:
        write_whole(tmp_path / "file" / "below.json", "text")
    assert "\n" not in str(caught.value)


def test_a_full_disk_leaves_no_half_result(tmp_path: Path) -> None:
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, before[1]))
    try:
        with pytest.raises(RecordingError, match=r"cannot be written.*free space"):
            write_whole(tmp_path / "result.json", "text" * 1000)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert not list(tmp_path.iterdir())


def test_results_that_need_only_a_part_do_not_care_for_parameters(tmp_path: Path) -> None:
    task = Task(square, {"number": 3}, needs=("simulator", "biases.py"))
    run([task], TaskContext(tmp_path))
    run([task], TaskContext(tmp_path, Parameters().with_assignments(["logo.pad_px=3"])))
    run([Task(square, {"number": 3}, needs=("simulator",))], TaskContext(tmp_path))
    assert CALLS == [3, 3]


def test_cache_keeps_to_its_size(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("spinscope.pipeline.evaluation.tasks.CACHE_BYTES", 250)
    (tmp_path / "results").mkdir()
    for age in range(4):
        file = tmp_path / "results" / str(age)
        file.write_bytes(b"." * 100)
        os.utime(file, (1000 - age, 1000 - age))
    _limit_cache(tmp_path)
    assert sorted(path.name for path in (tmp_path / "results").iterdir()) == ["0", "1"]


@pytest.mark.filterwarnings("ignore")  # Dask's own
@pytest.mark.filterwarnings("default")  # Dask warns of slow machines
def test_two_workers_of_a_dask_cluster(tmp_path: Path) -> None:
    import distributed as dask

    with (
        dask.LocalCluster(n_workers=2, threads_per_worker=1, processes=False, dashboard_address=None) as cluster,
        task_workers(cluster=cluster.scheduler_address) as workers,
    ):
        rows = run([Task(pow_of, {"number": number}) for number in range(6)], TaskContext(tmp_path), workers)
        with pytest.raises(ParameterError, match="no"):
            run([*squares(3), Task(failing), *squares(9)[3:]], TaskContext(tmp_path), workers)
    assert [row["power"] for row in rows] == [2**n for n in range(6)]


@pytest.mark.filterwarnings("ignore")  # Dask's own
@pytest.mark.filterwarnings("default")  # Dask warns of slow machines
def test_a_cluster_without_workers_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    import distributed as dask

    monkeypatch.setattr("spinscope.pipeline.evaluation.workers.CLUSTER_WAIT_S", 0.1)
    with (
        dask.LocalCluster(n_workers=0, processes=False, dashboard_address=None) as cluster,
        pytest.raises(ParameterError, match="has no workers"),
        task_workers(cluster=cluster.scheduler_address),
    ):
        pass


def pow_of(context: TaskContext, number: int) -> list[Row]:
    return [{"power": 2**number}]
