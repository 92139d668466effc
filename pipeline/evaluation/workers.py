"""Processes that perform tasks: of this machine, or of a running Dask cluster."""

from __future__ import annotations

import importlib
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass

from ..errors import ParameterError

PARENT_CHECK_S = 1.0  # how often a process looks whether the one that started it still lives
CLUSTER_WAIT_S = 10.0  # the longest that a cluster and its first worker are waited for


@dataclass(frozen=True, slots=True)
class TaskWorkers:
    """Processes that perform tasks.

    Attributes
    ----------
    executor : concurrent.futures.Executor
        Takes the calls.
    count : int
        Number of calls that are worked on at once.
    """

    executor: Executor
    count: int


@contextmanager
def task_workers(count: int = 1, cluster: str | None = None) -> Iterator[TaskWorkers | None]:
    """Start workers for a `with` block; None where this process does the work.

    Parameters
    ----------
    count : int
        Number of processes on this machine; up to 1, this process does the work.
    cluster : str or None
        Address of a Dask scheduler, like "tcp://127.0.0.1:8786", whose workers do the work instead.

    Raises
    ------
    ParameterError
        Where Dask is not installed, no scheduler answers or it has no workers.
    """
    if cluster is not None:
        with cluster_workers(cluster) as workers:
            yield workers
    elif count > 1:
        with local_workers(count) as workers:
            yield workers
    else:
        yield None


@contextmanager
def local_workers(count: int) -> Iterator[TaskWorkers]:
    """Start processes of this machine; an error in the `with` block, Ctrl-C among them, ends them at once.

    On Linux they are copies of this process, which has loaded everything already, unless it has threads: a lock that
    another thread holds would stay locked in the copy. Elsewhere, and then, they start anew.
    """
    is_copied = sys.platform == "linux" and threading.active_count() == 1
    context = multiprocessing.get_context("fork" if is_copied else "spawn")
    count = min(count, 61) if sys.platform == "win32" else count  # Windows waits for no more at once
    with ProcessPoolExecutor(count, context, _begin_work, (os.getpid(),)) as executor:
        try:
            yield TaskWorkers(executor, count)
        except BaseException:
            for process in list((executor._processes or {}).values()):  # Python 3.14 has `kill_workers` for this
                process.kill()
            raise


@contextmanager
def cluster_workers(cluster: str) -> Iterator[TaskWorkers]:
    """Connect to the workers of a Dask cluster; see `task_workers`."""
    try:
        dask = importlib.import_module("distributed")  # an extra: not everybody has a cluster
    except ImportError:
        raise ParameterError("a cluster needs Dask: install it with `pip install spinscope[cluster]`") from None
    try:
        client = dask.Client(cluster, timeout=CLUSTER_WAIT_S)
    except (OSError, ValueError) as error:
        reason = " ".join(str(error).split())[:200]
        raise ParameterError(f"no Dask cluster answers at {cluster} ({reason}): is it running?") from error
    with client:
        try:
            client.wait_for_workers(1, timeout=CLUSTER_WAIT_S)
        except TimeoutError as error:
            raise ParameterError(f"the Dask cluster at {cluster} has no workers: start some") from error
        # Not pure: a call is made again, even if the scheduler knows what an equal one gave.
        yield TaskWorkers(client.get_executor(pure=False), sum(client.nthreads().values()))


def processor_count() -> int:
    """Number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count() or 1


def _begin_work(parent: int) -> None:
    """Leave Ctrl-C to the parent, and end when it has been killed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for name in ("SIGTERM", "SIGHUP"):  # a copied process has the parent's handlers
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_DFL)

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(PARENT_CHECK_S)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
