"""Analysis of recordings into a session, in the background: resumable, in processes, and following growing folders."""

from __future__ import annotations

import json
import threading
import traceback
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Future, wait
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from spinscope.app.batch import program_version
from spinscope.app.terminal import note
from spinscope.pipeline.errors import RecordingError, SpinscopeError
from spinscope.pipeline.evaluation.tables import Row
from spinscope.pipeline.evaluation.tasks import Task, TaskContext, digest, performed
from spinscope.pipeline.evaluation.workers import processor_count, task_workers
from spinscope.pipeline.live_spins import load_stages
from spinscope.pipeline.niceness import lower_priority
from spinscope.pipeline.recording_folders import recordings_in
from spinscope.pipeline.recordings.recording import file_identity
from spinscope.pipeline.session import Choices
from spinscope.pipeline.sidecar import Sidecar

from .session import KnownRecording, ShotSession
from .shot_record import RecordingShots, ShotRecord, analyze_for_session

NICENESS = 5  # a third of the share of the page, and of a running camera's tracker, where they want one core
MOST_WAIT_S = 10.0
POLL_S = 0.4  # a new shot is to appear within a second of its end
CRASHED = "the process that read it was ended, by lack of memory or a fault of a library"


@dataclass(frozen=True, slots=True)
class AnalysisProgress:
    """Recordings of the present work: how many, how many done, and whether any work is going on."""

    total: int = 0
    done: int = 0
    is_working: bool = False


class SessionAnalysis:
    """Thread that keeps a session up to date with files and folders of recordings.

    Parameters
    ----------
    session : ShotSession
        What the shots are added to.
    sources : sequence of Path
        Recordings, and folders that are looked at again and again.
    choices : Choices
        Options of the analysis.
    jobs : int, optional
        Processes; None = one a core.
    on_change : callable, optional
        Called, in the thread, when progress or the session has changed.
    is_playing : callable, optional
        Whether a shot is being played, whose spin is more urgent: the work then waits, up to `MOST_WAIT_S`.
    """

    def __init__(
        self,
        session: ShotSession,
        sources: Sequence[Path],
        choices: Choices,
        jobs: int | None = None,
        on_change: Callable[[], None] = lambda: None,
        is_playing: Callable[[], bool] = lambda: False,
    ) -> None:
        self._is_playing = is_playing
        self.session, self.choices, self.progress = session, choices, AnalysisProgress()
        self._sources, self._jobs, self._on_change = list(sources), jobs, on_change
        self._settings_hash = settings_hash(choices)
        self._version = program_version()
        self._ended: Future[None] = Future()
        self._seen: dict[Path, tuple[int, int]] = {}
        self._thread = threading.Thread(target=self._follow, name="session analysis", daemon=True)

    def start(self) -> None:
        """Begin the work."""
        self._thread.start()

    def close(self) -> None:
        """End the work; what is under way in other processes is left undone."""
        if not self._ended.done():
            self._ended.set_result(None)
        if self._thread.is_alive():
            self._thread.join(5.0)

    def run_once(self) -> None:
        """Analyze what is new or changed, and return when it is done."""
        pending = list(self._pending())
        if not pending:
            return
        self._tell(AnalysisProgress(len(pending), 0, True))
        with suppress(CancelledError):
            for number, (path, known, found) in enumerate(self._results(pending), start=1):
                self.session.add(str(path), known, found)
                self._tell(AnalysisProgress(len(pending), number, True))
        self._tell(AnalysisProgress(len(pending), self.progress.done, False))

    def _follow(self) -> None:
        lower_priority(NICENESS)
        waited_s = 0.0
        while not self._ended.done():
            if self._is_playing() and waited_s < MOST_WAIT_S:
                wait([self._ended], POLL_S)
                waited_s += POLL_S
                continue
            waited_s = 0.0
            try:
                self.run_once()
                if not self._ended.done():
                    load_stages()  # a single new recording is analyzed by this process
            except SpinscopeError as error:  # of the session itself, as a full disk
                note(f"warning: {error}")
            wait([self._ended], POLL_S)

    def _tell(self, progress: AnalysisProgress) -> None:
        self.progress = progress
        self._on_change()

    def _recordings(self) -> Iterator[Path]:
        for source in self._sources:
            try:
                yield from recordings_in([source.absolute()])
            except RecordingError:  # a folder that is still empty
                continue

    def _pending(self) -> Iterator[tuple[Path, KnownRecording]]:
        """Recordings whose results are not known, or of other content, settings or program."""
        all_known = self.session.known()
        own = self.session.folder.absolute() / "events"
        for path in self._recordings():
            try:
                stat = path.stat()
            except OSError:
                stat = None
            stamp = (stat.st_mtime_ns, stat.st_size) if stat else (0, 0)
            if self._seen.get(path) == stamp or own in path.parents:
                continue
            self._seen[path] = stamp
            try:
                content = file_identity(path) + Sidecar.beside(path).digest
                known = KnownRecording(content, self._settings_hash, self._version, None)
            except (SpinscopeError, OSError) as error:
                known = KnownRecording("", self._settings_hash, self._version, _line(error, path))
            if all_known.get(str(path)) != known:
                yield path, known

    def _results(
        self, pending: Sequence[tuple[Path, KnownRecording]]
    ) -> Iterator[tuple[Path, KnownRecording, RecordingShots | None]]:
        """Recordings with their analysis, in any order; None with the error of what cannot be analyzed."""
        left = {}
        for number, (path, known) in enumerate(pending):
            if known.error is not None:
                yield path, known, None
                continue
            arguments = {"path": path, "content": known.recording_hash, "choices": self.choices}
            left[number] = Task(session_rows, {**arguments, "folder": self.session.folder}, keep=False)
        jobs = min(processor_count() if self._jobs is None else self._jobs, len(left))
        while left:
            try:
                with task_workers(jobs) as workers:
                    for number, rows in performed(dict(left), TaskContext(), workers, self._ended):
                        del left[number]
                        yield (pending[number][0], *_unpacked(pending[number][1], str(rows[0]["found"])))
            except BrokenExecutor:
                if jobs == 1 or len(left) == 1:  # the one that ends its process
                    number = next(iter(left))
                    del left[number]
                    path, known = pending[number]
                    yield path, _failed(known, CRASHED), None
                jobs = 1


def session_rows(context: TaskContext, path: Path, content: str, choices: Choices, folder: Path) -> list[Row]:
    """Analyze one recording, in whatever process; one row with what was found, or the error, as JSON."""
    try:
        found = analyze_for_session(path, content, choices, folder)
        shots = [shot.values() for shot in found.shots]
        written: dict[str, Any] = {"shots": shots, "reason": found.no_shot_reason, "warnings": found.warnings}
    except (SpinscopeError, OSError) as error:
        written = {"error": _line(error, path)}
    except Exception as error:  # noqa: BLE001  # whatever one recording meets, the others go on
        place = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{Path(place.filename).name}, line {place.lineno}"
        written = {"error": f"fault of the program ({type(error).__name__}: {error}; {where}): please report it"}
    return [{"found": json.dumps(written, allow_nan=False)}]


def settings_hash(choices: Choices) -> str:
    """Hash of all options that the results depend on."""
    return digest([choices.parameters().as_dict(), choices.window_us, choices.fixed_ball, asdict(choices.reading)])


def _unpacked(known: KnownRecording, text: str) -> tuple[KnownRecording, RecordingShots | None]:
    written = json.loads(text)
    if "error" in written:
        return _failed(known, written["error"]), None
    shots = tuple(ShotRecord(**shot) for shot in written["shots"])
    return known, RecordingShots(shots, written["reason"], tuple(written["warnings"]))


def _failed(known: KnownRecording, error: str) -> KnownRecording:
    return KnownRecording(known.recording_hash, known.settings_hash, known.version, error)


def _line(error: Exception, path: Path) -> str:
    return " ".join(str(error).split()).removesuffix(f": {path}")
