"""Tasks of a suite: run in parallel, their results kept on disk, so that an interrupted run goes on where it was."""

from __future__ import annotations

import hashlib
import importlib
import json
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

from ..errors import ParameterError
from ..files import atomic_file
from ..registry import Parameters
from .tables import Row

PIPELINE = Path(__file__).parents[1]
CACHE_BYTES = 2 << 30  # a full run of all suites keeps some 200 MB; older versions' files go first
Progress = Callable[[float, str], None]  # share done (0..1) and what is being done


@dataclass(frozen=True)
class Bench:
    """What every task works with.

    cache : folder for recordings and results, None = keep nothing
    parameters : of the pipeline that is evaluated
    """

    cache: Path | None = None
    parameters: Parameters = field(default_factory=Parameters)


@dataclass(frozen=True)
class Task:
    """A call that gives rows: function(bench, **arguments), with arguments that JSON can hold.

    keep : whether its rows may be kept for the next run (not so for times)
    needs : the parts of `pipeline` (files and packages) whose text the kept rows depend on; "" = all of it, and the
        bench's parameters
    """

    function: Callable[..., list[Row]]
    arguments: Mapping[str, Any] = field(default_factory=dict)
    keep: bool = True
    needs: tuple[str, ...] = ("",)


@contextmanager
def executor(workers: int = 1, cluster: str | None = None) -> Iterator[Executor | None]:
    """Who does the work: processes of this machine, or a running Dask cluster; None = this very process.

    workers : number of processes, 0 = none but this one
    cluster : address of a Dask scheduler, like "tcp://127.0.0.1:8786"
    Raises ParameterError when there is no Dask or no cluster at the address.
    """
    if cluster is not None:
        yield from _of_cluster(cluster)
    elif workers == 0:
        yield None
    else:
        # Fresh processes: a copy of this one would share its threads' locks (progress bars, HDF5).
        fresh = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(workers, fresh, initializer=_end_with_parent) as pool:
            _start_deaf(pool)
            yield pool


def _end_with_parent() -> None:
    """Let a worker end when the process that started it is gone, however it ended; it would wait for work for ever."""
    parent = multiprocessing.parent_process()

    def wait() -> None:
        if parent is not None:
            parent.join()
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()


def _start_deaf(pool: Executor) -> None:
    """Start a pool's processes so that Ctrl-C is for this process alone, which then stops them."""
    if threading.current_thread() is not threading.main_thread():
        return  # only the main thread may say so
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)  # the new processes inherit it
    try:
        pool.submit(int)
    finally:
        signal.signal(signal.SIGINT, before)


def _of_cluster(address: str) -> Iterator[Executor]:
    try:
        dask = importlib.import_module("distributed")  # an extra: not everybody has a cluster
    except ImportError:
        raise ParameterError("a cluster needs Dask: install it with `pip install spinscope[cluster]`") from None
    try:
        client = dask.Client(address, timeout=10)
    except (OSError, ValueError) as error:
        reason = " ".join(str(error).split())[:200]
        raise ParameterError(f"no Dask cluster answers at {address} ({reason}): is it running?") from error
    with client:
        yield client.get_executor()


def run(tasks: Sequence[Task], bench: Bench, by: Executor | None, on_progress: Progress | None = None) -> list[Row]:
    """All tasks' rows in the tasks' order; what an earlier run has kept is not done again.

    Any error stops the run; rows of the tasks that are done stay on disk.
    """
    if bench.cache is not None:
        _make_room(bench.cache)
    rows: dict[int, list[Row]] = {}
    pending: list[int] = []
    for number, task in enumerate(tasks):
        kept = _kept(bench, task)
        if kept is None:
            pending.append(number)
        else:
            rows[number] = kept
    for number, result in _performed(tasks, pending, bench, by):
        rows[number] = result
        if on_progress:
            on_progress(len(rows) / len(tasks), f"{len(rows)} of {len(tasks)}")
    return [row for number in range(len(tasks)) for row in rows[number]]


def _performed(
    tasks: Sequence[Task], pending: Sequence[int], bench: Bench, by: Executor | None
) -> Iterator[tuple[int, list[Row]]]:
    """(number, rows) of the pending tasks as they get done."""
    if by is None:
        for number in pending:
            yield number, perform(bench, tasks[number])
        return
    futures = {by.submit(perform, bench, tasks[number]): number for number in pending}
    try:
        for future in as_completed(futures):
            yield futures[future], future.result()
    finally:
        for future in futures:
            future.cancel()


def perform(bench: Bench, task: Task) -> list[Row]:
    """Do a task and keep its rows."""
    rows = task.function(bench, **task.arguments)
    place = _place(bench, task)
    if place is not None:
        write_whole(place, json.dumps(rows))
    return rows


def _kept(bench: Bench, task: Task) -> list[Row] | None:
    """The rows kept of a task, None where there are none or they are damaged."""
    place = _place(bench, task)
    if place is None:
        return None
    try:
        rows: list[Row] = json.loads(place.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return rows


def _place(bench: Bench, task: Task) -> Path | None:
    """Where a task's rows are kept: named by all that they depend on, the program's own text included."""
    if bench.cache is None or not task.keep:
        return None
    name = f"{task.function.__module__}.{task.function.__qualname__}"
    everything = [name, dict(task.arguments), *(text_of(part) for part in task.needs)]
    if "" in task.needs:
        everything.append(bench.parameters.as_dict())
    return bench.cache / "results" / f"{digest(everything)}.json"


def digest(value: Any) -> str:
    """24 hexadecimal digits that tell this value (of JSON's kinds) from any other."""
    content = json.dumps(value, sort_keys=True).encode()
    return hashlib.blake2b(content, digest_size=12).hexdigest()


@lru_cache
def text_of(part: str) -> str:
    """Digest of the text of `pipeline`, of a package or a file in it: results are good for one version only."""
    hashed = hashlib.blake2b(digest_size=12)
    place = PIPELINE / part
    for path in [place] if place.is_file() else sorted(place.rglob("*.py")):
        hashed.update(path.relative_to(PIPELINE).as_posix().encode() + b"\0" + path.read_bytes())
    return hashed.hexdigest()


def write_whole(path: Path, content: str) -> None:
    """Write a file that is there whole or not at all; raises RecordingError when it cannot be written."""
    with suppress(OSError):  # the message comes from the writing
        path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_file(path, "results") as part:
        part.write_text(content, encoding="utf-8")


def _make_room(cache: Path) -> None:
    """Delete what was not written for longest until the cache keeps to its size."""
    files = [(path.stat().st_mtime, path.stat().st_size, path) for path in cache.glob("*/*") if path.is_file()]
    total = sum(size for _, size, _ in files)
    for _, size, path in sorted(files):
        if total <= CACHE_BYTES:
            return
        path.unlink(missing_ok=True)
        total -= size
