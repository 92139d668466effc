"""Tasks of a suite: run in parallel, their rows kept on disk, so that an interrupted run resumes where it stopped."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from functools import lru_cache
from itertools import islice
from pathlib import Path
from typing import Any

from ..files import atomic_file
from ..registry import Parameters
from ..session import Choices
from .tables import Row
from .workers import TaskWorkers

PIPELINE = Path(__file__).parents[1]
CACHE_BYTES = 2 << 30  # a full run of all suites keeps some 200 MB; older versions' files go first
Progress = Callable[[float, str], None]  # share done (0..1) and what is being done


@dataclass(frozen=True, slots=True)
class SceneChoices:
    """Choices of the user for the scenes of a suite; None = as the suite has it.

    Attributes
    ----------
    ball : int or None
        Number of the ball, 1 to 7: the seat of its logo. Of recordings of a folder, those of this ball.
    lens_mm : float or None
        Focal length of the simulated camera's lens.
    """

    ball: int | None = None
    lens_mm: float | None = None


@dataclass(frozen=True)
class TaskContext:
    """Everything that goes for all tasks of a run.

    Attributes
    ----------
    cache : Path or None
        Folder for recordings and rows; None keeps nothing.
    parameters : Parameters
        Of the pipeline under evaluation.
    choices : Choices
        The options that gave the parameters: for recordings that state camera and ball themselves.
    scene : SceneChoices
    """

    cache: Path | None = None
    parameters: Parameters = field(default_factory=Parameters)
    choices: Choices = Choices()
    scene: SceneChoices = SceneChoices()


@dataclass(frozen=True)
class Task:
    """A call that gives rows: `function(context, **arguments)`.

    Attributes
    ----------
    function : callable
        Found by its module and name, so that other processes can call it.
    arguments : mapping
        Of values that JSON can hold.
    keep : bool
        Whether the rows may be kept for the next run; run times may not.
    needs : tuple of str
        The files and packages of `pipeline` whose text the kept rows depend on; "" = all of it, and the parameters.
    """

    function: Callable[..., list[Row]]
    arguments: Mapping[str, Any] = field(default_factory=dict)
    keep: bool = True
    needs: tuple[str, ...] = ("",)


def run(
    tasks: Sequence[Task],
    context: TaskContext,
    workers: TaskWorkers | None = None,
    on_progress: Progress | None = None,
) -> list[Row]:
    """All tasks' rows in the tasks' order, run by `workers` (None: by this process) unless kept by an earlier run.

    An error in a task cancels the others; the rows of those that are done stay on disk.
    """
    if context.cache is not None:
        _limit_cache(context.cache)
    rows = {number: kept for number, task in enumerate(tasks) if (kept := _kept(context, task)) is not None}
    pending = {number: task for number, task in enumerate(tasks) if number not in rows}
    for number, result in performed(pending, context, workers):
        rows[number] = result
        if on_progress:
            on_progress(len(rows) / len(tasks), f"{len(rows)} of {len(tasks)}")
    return [row for number in range(len(tasks)) for row in rows[number]]


def performed(
    tasks: Mapping[int, Task],
    context: TaskContext,
    workers: TaskWorkers | None = None,
    stop: Future[None] | None = None,
) -> Iterator[tuple[int, list[Row]]]:
    """Each task's number and rows as soon as they are known, in any order; `workers`: see `run`.

    An error in a task, or closing the iterator, leaves those that were not begun. Of a worker that has ended a
    BrokenExecutor tells. Another thread stops the wait by setting the result of `stop`: a CancelledError.
    """
    stop = stop or Future()
    if workers is None:
        for number, task in tasks.items():
            if stop.done():
                raise CancelledError
            yield _perform(context, task, number)
        return
    coming = iter(tasks.items())
    executor = workers.executor

    def begun(count: int) -> set[Future[tuple[int, list[Row]]]]:
        return {executor.submit(_perform, context, task, number) for number, task in islice(coming, count)}

    under_way = begun(workers.count)
    try:
        while under_way:
            awaited: list[Future[Any]] = [*under_way, stop]
            done, _ = wait(awaited, return_when=FIRST_COMPLETED)
            if stop in done:
                raise CancelledError
            under_way = (under_way - done) | begun(len(done))
            for future in done:
                yield future.result()
    finally:
        for future in under_way:
            future.cancel()


def _perform(context: TaskContext, task: Task, number: int) -> tuple[int, list[Row]]:
    """Run a task and keep its rows; its number tells results apart that come in any order."""
    rows = task.function(context, **task.arguments)
    path = _path(context, task)
    if path is not None and not any("error" in row for row in rows):  # what failed is tried again
        write_whole(path, json.dumps(rows))
    return number, rows


def _kept(context: TaskContext, task: Task) -> list[Row] | None:
    """The rows kept of a task, None where there are none or they are damaged."""
    path = _path(context, task)
    if path is None:
        return None
    try:
        rows: list[Row] = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return rows


def _path(context: TaskContext, task: Task) -> Path | None:
    """File of a task's rows: named by all that they depend on, the program's own text included."""
    if context.cache is None or not task.keep:
        return None
    name = f"{task.function.__module__}.{task.function.__qualname__}"
    everything = [name, dict(task.arguments), *(text_digest(part) for part in task.needs)]
    if "" in task.needs:
        everything.append(context.parameters.as_dict())
    if (context.choices, context.scene) != (Choices(), SceneChoices()):
        everything += [list(context.choices.assignments), asdict(context.scene), *context.choices.rivals]
    return context.cache / "results" / f"{digest(everything)}.json"


def digest(value: Any) -> str:
    """24 hexadecimal digits that tell this value (of JSON's kinds) from any other."""
    content = json.dumps(value, sort_keys=True).encode()
    return hashlib.blake2b(content, digest_size=12).hexdigest()


@lru_cache
def text_digest(part: str) -> str:
    """Digest of the text of `pipeline`, of a package or a file in it: rows are valid for one version only."""
    hashed = hashlib.blake2b(digest_size=12)
    place = PIPELINE / part
    for path in sorted(place.rglob("*.py")) if place.is_dir() else [place]:
        hashed.update(path.relative_to(PIPELINE).as_posix().encode() + b"\0" + path.read_bytes())
    return hashed.hexdigest()


def write_whole(path: Path, content: str | bytes) -> None:
    """Write a file that is there whole or not at all; raises RecordingError when it cannot be written."""
    make_folder(path.parent)
    with atomic_file(path, "results") as part:
        part.write_bytes(content.encode() if isinstance(content, str) else content)


def make_folder(folder: Path) -> None:
    """Make a folder and those above it, as far as they can be made: the message comes from the writing."""
    with suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)


def _limit_cache(cache: Path) -> None:
    """Delete what was not written for longest until the cache keeps to its size."""
    files = [(path.stat().st_mtime, path.stat().st_size, path) for path in cache.glob("*/*") if path.is_file()]
    total = sum(size for _, size, _ in files)
    for _, size, path in sorted(files):
        if total <= CACHE_BYTES:
            return
        path.unlink(missing_ok=True)
        total -= size
