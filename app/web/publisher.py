"""Publisher of a client session: draws results, keeps the newest pictures and reports progress."""

from __future__ import annotations

import base64
import threading
import time
from collections import OrderedDict
from collections.abc import Hashable, Sequence
from typing import Any, Literal

from spinscope.app.tuning.parameter_sweep import sensible_highs
from spinscope.app.viewer.comparison import compared, difference_chunks, note_with_a, note_without_a
from spinscope.app.viewer.drawing_cache import DrawingCache
from spinscope.app.viewer.preview import preview, preview_words
from spinscope.app.viewer.rrd import rrd_bytes
from spinscope.app.viewer.run import ViewedRun
from spinscope.pipeline.metrics import RunMetrics
from spinscope.pipeline.registry import STAGES
from spinscope.pipeline.session import Result
from spinscope.pipeline.tick import Tick

from .message_queue import MessageQueue
from .message_schemas import Picture, PreviewMessage, RunMessage
from .open_recording import OpenRecording
from .presets import differences
from .schemas import RunRequest

# A client learns of a run's progress this often, and not at all of one that is over at once: every change of the page
# has the browser put the whole picture together anew, in the very time in which it is waited for.
REPORT_S, QUIET_S = 0.05, 0.3
PICTURES_BYTES, PICTURES_LEAST = 32_000_000, 3  # kept for the way back: fifteen settings of a flight of 100 ms
DRAWING = "drawing"  # counted beside the stages

State = Literal["loading", "computing", "drawing", "partial", "done", "failed"]


def preview_message(ticks: Sequence[Tick], serial: int, *, is_whole: bool) -> PreviewMessage:
    """Message of the preview at the end of the last tick; `is_whole` where the slow methods have run, too."""
    picture = f"data:image/png;base64,{base64.b64encode(preview(ticks)).decode()}"
    words = preview_words(ticks[-1], is_whole=is_whole)
    return PreviewMessage(serial=serial, t_us=ticks[-1].packet.end_us, picture=picture, words=words)


class RunReport:
    """Progress of one run request: seconds by stage and what is being done, told at a bearable rate."""

    def __init__(self, queue: MessageQueue, serial: int) -> None:
        self.serial = serial
        self._queue = queue
        self._began_s = time.perf_counter()
        self._seconds = dict.fromkeys([*STAGES.names, DRAWING], 0.0)
        self._told: tuple[str, float] = ("", 0.0)  # what was told last, and when
        self._lock = threading.Lock()

    def add(self, seconds: dict[str, float]) -> None:
        """Count what stages took; from any thread."""
        with self._lock:
            for stage, more in seconds.items():
                self._seconds[stage] += more

    def show(self, ticks: Sequence[Tick]) -> None:
        """Show the client a preview of what is known at the end of these ticks."""
        self._queue.put(preview_message(ticks, self.serial, is_whole=False))

    def tell(self, state: State, share: float = 0.0, *, force: bool = False, **content: Any) -> None:
        """Tell the client, unless it was told of this state a moment ago."""
        now_s, (last_state, last_s) = time.perf_counter(), self._told
        is_due = state != last_state or now_s - last_s >= REPORT_S
        if not force and not (is_due and now_s - self._began_s >= QUIET_S):
            return
        self._told = state, now_s
        self._queue.put(
            RunMessage(
                serial=self.serial,
                state=state,
                share=share,
                stages_ms={name: 1000 * seconds for name, seconds in self._seconds.items()},
                total_ms=1000 * (now_s - self._began_s),
                **content,
            )
        )


class Publisher:
    """Draws the results of a client's runs and tells it where to fetch them."""

    def __init__(self, session_id: str, queue: MessageQueue, drawings: DrawingCache) -> None:
        self.drawings = drawings
        self._session_id, self._queue = session_id, queue
        self._pictures: OrderedDict[Hashable, tuple[Picture, bytes]] = OrderedDict()  # by what they show

    def report(self, request: RunRequest) -> RunReport:
        """Report on a new request."""
        return RunReport(self._queue, request.serial)

    def picture(self, picture_id: str) -> bytes | None:
        """Bytes of a picture; None where newer ones have taken its place."""
        return next((content for made, content in tuple(self._pictures.values()) if made.id == picture_id), None)

    def draw(self, b: Result, a: Result | None, report: RunReport, *, followed: int | None, partial: bool) -> Picture:
        """Draw a run with a shot followed, beside that of A if there is one; the picture kept of the same, if any."""
        report.tell("drawing", 1.0)
        began_s = time.perf_counter()
        results = (b,) if a is None else (b, a)
        shown = followed, *map(_shown, results)
        if shown in self._pictures:
            self._pictures.move_to_end(shown)
            picture, _ = self._pictures[shown]
        else:
            runs = [ViewedRun.of(result, followed) for result in results]
            picture_id = f"{self._session_id}-{report.serial}{f'-part{len(b.ticks)}' if partial else ''}"
            content = rrd_bytes(self._all_chunks(results, runs), picture_id)
            picture = Picture(
                id=picture_id,
                size_bytes=len(content),
                start_us=runs[0].start_us,
                end_us=runs[0].end_us,
                opening_us=runs[0].opening_us,
                seen_shots=[run.seen_shots for run in runs],
            )
            self._pictures[shown] = picture, content
            self._keep_budget()
        report.add({DRAWING: time.perf_counter() - began_s})
        return picture

    def publish(
        self,
        recording: OpenRecording,
        picture: Picture,
        b: Result,
        a: Result | None,
        report: RunReport,
        *,
        partial: bool,
    ) -> None:
        """Tell the client of a picture, with the metrics of a run that is whole."""
        is_whole = len(b.ticks) == b.session.chain.tick_count(b.session.parameters)
        content: dict[str, Any] = {}
        if is_whole:
            metrics = RunMetrics.of(b)
            costs_ms = recording.costs_ms(b.session, b.session.parameters)
            content |= {"metrics": metrics, "costs_ms": costs_ms, "highs": sensible_highs(metrics)}
        if a is not None:
            content |= {
                "pinned_metrics": RunMetrics.of(a),
                "pinned_costs_ms": recording.costs_ms(a.session, a.session.parameters),
                "differences": differences(a.session.parameters, b.session.parameters),
            }
        report.tell("partial" if partial else "done", 1.0, force=True, picture=picture, **content)

    def _all_chunks(self, results: Sequence[Result], runs: Sequence[ViewedRun]) -> list[Any]:
        """Everything there is to see of B, and of A beside it where it is pinned."""
        (b, *pinned), (run, *runs_a) = results, runs
        chunks = self._chunks(b, run)
        if not pinned:
            return chunks + note_without_a(run)
        chunks += [*compared(self._chunks(pinned[0], runs_a[0])), *difference_chunks(runs_a[0], run)]
        return chunks + note_with_a(run, _difference_text(pinned[0], b))

    def _keep_budget(self) -> None:
        """Drop the pictures that were not asked for longest."""
        while len(self._pictures) > PICTURES_LEAST:
            if sum(picture.size_bytes for picture, _ in self._pictures.values()) <= PICTURES_BYTES:
                return
            self._pictures.popitem(last=False)

    def _chunks(self, result: Result, run: ViewedRun) -> list[Any]:
        return self.drawings.chunks(run, result.session.chain.keys(result.session.parameters))


def _shown(result: Result) -> Hashable:
    """Key of what a picture of a result shows: equal keys, equal pictures."""
    session, ticks = result.session, result.ticks
    return session.chain.source.identity, session.parameters, len(ticks), tuple(ticks[0].results)


def _difference_text(a: Result, b: Result) -> str:
    """Table of the Compare tab: which parameters of A and B differ."""
    rows = differences(a.session.parameters, b.session.parameters)
    if not rows:
        return "## A and B have the same parameters\n\nChange one: that is B."
    lines = ["| parameter | A | B |", "|---|---|---|"]
    return "\n".join([*lines, *(f"| {name} | {first} | {second} |" for name, first, second in rows)])
