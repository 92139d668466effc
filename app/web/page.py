"""One open page: what it wants to see, the thread that makes it, and the pictures it has not fetched yet."""

from __future__ import annotations

import secrets
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Collection, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any

from spinscope.app.viewer.comparison import compared, note_with_a, note_without_a
from spinscope.app.viewer.drawing_cache import DrawingCache
from spinscope.app.viewer.rrd import rrd_bytes
from spinscope.app.viewer.run import ViewedRun
from spinscope.pipeline.chain import Tick
from spinscope.pipeline.registry import STAGES, Parameters, quick_stages
from spinscope.pipeline.session import Result

from .bench import Bench, Clip
from .jobs import Job, fault
from .measures import measures
from .outbox import Outbox
from .presets import differences

# A page learns of a run's progress this often, and not at all of one that is over at once: every change of the page
# has the browser put the whole picture together anew, in the very time in which it is waited for.
REPORT_S, QUIET_S = 0.05, 0.3
# After so long without a wish, or at the latest after so many wishes, old drawings are sorted out.
IDLE_S, UNTIDIED_MOST = 1.0, 10
# The rest of a clip is waited for when it takes no longer than this: drawing a part of it first takes its time, too.
REST_WORTH_WAITING_S = 0.5
TIMED_TICKS = 5  # from fewer it cannot be told how long the rest takes
PICTURES_KEPT = 3


@dataclass(frozen=True, slots=True)
class Wanted:
    """What a page asks for; `serial` counts its wishes, the highest is the newest.

    hasty : a slider is being dragged: a picture without the slowest stages is better than waiting for them
    """

    serial: int
    parameters: Parameters
    pinned: Parameters | None
    window_us: tuple[int, int]
    playhead_us: float | None = None
    hasty: bool = False


class Superseded(Exception):  # no error: the page wants something newer
    """A newer wish came in, or the page was closed."""


@dataclass(slots=True, eq=False)
class _Report:
    """What the page's bar shows of a wish: seconds by stage, share done, what is being done."""

    outbox: Outbox
    serial: int
    began: float = field(default_factory=time.perf_counter)
    seconds: dict[str, float] = field(default_factory=lambda: dict.fromkeys([*STAGES.names, "drawing"], 0.0))
    told: tuple[str, float] = ("", 0.0)  # what was told last, and when
    lock: threading.Lock = field(default_factory=threading.Lock)

    def add(self, seconds: dict[str, float]) -> None:
        """Count what stages took; from any thread."""
        with self.lock:
            for stage, more in seconds.items():
                self.seconds[stage] += more

    def tell(self, state: str, share: float = 0.0, *, force: bool = False, **more: Any) -> None:
        now, (last_state, last) = time.perf_counter(), self.told
        is_due = state != last_state or now - last >= REPORT_S
        if force or (is_due and now - self.began >= QUIET_S):
            self.told = state, now
            milliseconds = {name: 1000 * seconds for name, seconds in self.seconds.items()}
            total = 1000 * (now - self.began)
            self.outbox.put(
                "run", serial=self.serial, state=state, share=share, stages=milliseconds, total=total, **more
            )


class Page:
    """A page's side on the server. Its thread runs the chain; the newest wish wins, between two ticks."""

    def __init__(self, bench: Bench, drawings: DrawingCache) -> None:
        self.id = secrets.token_urlsafe(12)
        self.bench = bench
        self.outbox = Outbox()
        self.last_sign_of_life = time.monotonic()
        self.listeners = 0
        self.finished: Result | None = None
        self._drawings = drawings
        self._pictures: OrderedDict[str, bytes] = OrderedDict()
        self._jobs: dict[str, Job] = {}
        self._wanted: Wanted | None = None
        self._newest = -1
        self._closed = False
        self._changed = threading.Condition()
        self._late = ThreadPoolExecutor(1, f"late {self.id}")
        self._thread = threading.Thread(target=self._work, name=f"page {self.id}", daemon=True)
        self._thread.start()

    def ask(self, wanted: Wanted) -> bool:
        """Take a wish; False when a newer one is already there."""
        with self._changed:
            if wanted.serial <= self._newest:
                return False
            self._newest, self._wanted = wanted.serial, wanted
            self._changed.notify()
            return True

    def picture(self, recording_id: str) -> bytes | None:
        """The bytes of a picture that is still there."""
        return self._pictures.get(recording_id)

    def start(self, kind: str, work: Callable[[Job], dict[str, Any]]) -> None:
        """Start longer work in place of what was going on of its kind."""
        self.cancel(kind)
        self._jobs[kind] = Job(kind, self.outbox, work)

    def cancel(self, kind: str) -> None:
        """Stop the work of this kind, if there is any."""
        if kind in self._jobs:
            self._jobs[kind].cancel()

    def close(self) -> None:
        """End the page's threads and its connection."""
        for job in self._jobs.values():
            job.cancel()
        with self._changed:
            self._closed = True
            self._changed.notify()
        self.outbox.close()

    def join(self, seconds: float) -> None:
        """Wait for the threads to end."""
        self._thread.join(seconds)
        for job in self._jobs.values():
            job.cancel(seconds)

    def _work(self) -> None:
        fulfilled = 0
        while True:
            with self._changed:
                is_idle = not self._changed.wait_for(self._has_work, IDLE_S)
            if is_idle or fulfilled == UNTIDIED_MOST:
                self._drawings.keep_budget()
                fulfilled = 0
            with self._changed:
                self._changed.wait_for(self._has_work)
                if self._closed:
                    self._late.shutdown(wait=False)
                    return
                wanted, self._wanted = self._wanted, None
            assert wanted is not None
            fulfilled += 1
            report = _Report(self.outbox, wanted.serial)
            try:
                with self.bench.at_work():
                    self._fulfil(wanted, report)
            except Superseded:
                continue
            except Exception as error:  # noqa: BLE001  # whatever a stage raises, the page goes on
                report.tell("failed", force=True, error=fault(error))

    def _has_work(self) -> bool:
        return self._closed or self._wanted is not None

    def _fulfil(self, wanted: Wanted, report: _Report) -> None:
        if not self.bench.are_kernels_loaded:
            report.tell("loading", force=True)
            self.bench.load_kernels()
        clip = self.bench.clip(*wanted.window_us)
        a = None
        if wanted.pinned is not None:
            a = self._finish(clip, wanted.pinned, wanted, report, is_shown=False)
        b = self._finish(clip, wanted.parameters, wanted, report, a)
        self.finished = b
        self._show(wanted, clip, b, a, report)

    def _finish(
        self,
        clip: Clip,
        parameters: Parameters,
        wanted: Wanted,
        report: _Report,
        a: Result | None = None,
        *,
        is_shown: bool = True,
    ) -> Result:
        """Run a clip to its end: the late stages in a thread of their own, behind the others.

        Where that takes long it shows, beside A if there is one, first what is there at the playhead. For a dragged
        slider it shows all but the late stages, which have to wait that long.
        """
        session = clip.with_parameters(parameters)
        ticks: list[Tick] = []
        count = clip.session.chain.tick_count(parameters)
        began, playhead_us = time.perf_counter(), wanted.playhead_us if is_shown else None
        is_first_early = is_shown and wanted.hasty and not clip.knows(parameters, STAGES.names)
        late = None if is_first_early else self._late.submit(self._whole, clip, parameters, wanted, report)
        for tick in self._steps(clip, parameters, wanted, report, quick_stages()):
            ticks.append(tick)
            if playhead_us is not None and tick.packet.end_us >= playhead_us and len(ticks) >= TIMED_TICKS:
                playhead_us = None
                rest_s = (time.perf_counter() - began) / len(ticks) * (count - len(ticks))
                if rest_s > REST_WORTH_WAITING_S:
                    self._show(wanted, clip, Result.of(session, ticks), a, report, partial=True)
        early = Result.of(session, ticks)
        if is_first_early:
            self._show(wanted, clip, early, a, report, partial=True)
        else:
            self._drawings.begin(ViewedRun.of(early), clip.keys(parameters))
        whole = self._whole(clip, parameters, wanted, report) if late is None else late.result()
        return Result.of(session, whole)

    def _whole(self, clip: Clip, parameters: Parameters, wanted: Wanted, report: _Report) -> list[Tick]:
        """All ticks with all stages' results."""
        ticks: list[Tick] = []
        count = clip.session.chain.tick_count(parameters)
        for tick in self._steps(clip, parameters, wanted, report, None):
            ticks.append(tick)
            report.tell("computing", len(ticks) / count)
        return ticks

    def _steps(
        self, clip: Clip, parameters: Parameters, wanted: Wanted, report: _Report, targets: Collection[str] | None
    ) -> Iterator[Tick]:
        """The clip's ticks, until something newer is wanted."""
        for step in clip.run(parameters, targets):
            if self._is_old(wanted):
                raise Superseded
            report.add(step.seconds)
            yield step.tick

    def _show(
        self,
        wanted: Wanted,
        clip: Clip,
        b: Result,
        a: Result | None,
        report: _Report,
        *,
        partial: bool = False,
    ) -> None:
        """Draw the run and tell the page where to fetch it."""
        if self._is_old(wanted):
            raise Superseded
        report.tell("drawing", 1.0)
        began = time.perf_counter()
        chunks = self._drawings.chunks(ViewedRun.of(b), clip.keys(b.session.parameters))
        if a is None:
            chunks = [*chunks, *note_without_a(ViewedRun.of(b))]
        else:
            a_chunks = self._drawings.chunks(ViewedRun.of(a), clip.keys(a.session.parameters))
            chunks = [*chunks, *compared(a_chunks), *note_with_a(ViewedRun.of(b), _difference_text(a, b))]
        recording_id = f"{self.id}-{wanted.serial}{f'-part{len(b.ticks)}' if partial else ''}"
        picture = rrd_bytes(chunks, recording_id)
        report.seconds["drawing"] += time.perf_counter() - began
        if self._is_old(wanted):
            raise Superseded
        is_whole = len(b.ticks) == clip.session.chain.tick_count(b.session.parameters)
        self._pictures[recording_id] = picture
        while len(self._pictures) > PICTURES_KEPT:
            self._pictures.popitem(last=False)
        report.tell(
            "partial" if partial else "done",
            1.0,
            force=True,
            recording=recording_id,
            bytes=len(picture),
            start_us=ViewedRun.of(b).start_us,
            end_us=ViewedRun.of(b).end_us,
            opening_us=ViewedRun.of(b).opening_us,
            measures=_measured(clip, b) if is_whole else None,
            pinned_measures=None if a is None else _measured(clip, a),
            differs=[] if a is None else differences(a.session.parameters, b.session.parameters),
        )

    def _is_old(self, wanted: Wanted) -> bool:
        return self._closed or wanted.serial != self._newest


def _measured(clip: Clip, finished: Result) -> dict[str, Any]:
    made = measures(finished)
    costs = clip.cost_of(finished.session.parameters)
    return {**made, "stage_ms": {stage: 1000 * seconds for stage, seconds in costs.items()}}


def _difference_text(a: Result, b: Result) -> str:
    """What the Compare tab says of A and B; the page's own table says more."""
    rows = differences(a.session.parameters, b.session.parameters)
    if not rows:
        return "## A and B are alike\n\nTurn a knob: that is B."
    lines = ["| parameter | A | B |", "|---|---|---|"]
    return "\n".join([*lines, *(f"| {name} | {first} | {second} |" for name, first, second in rows)])
