"""Runner of a client session: the thread that runs the chain for the newest request."""

from __future__ import annotations

import dataclasses
import threading
import time
from collections.abc import Collection, Iterator
from concurrent.futures import ThreadPoolExecutor

from spinscope.app.viewer.run import ViewedRun
from spinscope.pipeline.registry import STAGES, Parameters, quick_stages
from spinscope.pipeline.session import Result, Session
from spinscope.pipeline.tick import Tick

from .jobs import error_text
from .message_queue import RequestQueue, Superseded
from .open_recording import OpenRecording
from .publisher import Publisher, RunReport
from .schemas import RunRequest

# After so long without a request, or at the latest after so many of them, old drawings are dropped.
IDLE_S, REQUESTS_MOST = 1.0, 10
# The rest of a clip is waited for when it takes no longer than this: drawing a part of it first takes its time, too.
REST_WORTH_WAITING_S = 0.5
# A slider whose preview is seen for so long without another request rests: the picture of it is drawn, which takes
# longer than a preview. A page asks again a tenth of a second after a preview, without a graphics card too.
DRAG_REST_S = 0.15
TIMED_TICKS = 5  # from fewer it cannot be told how long the rest takes


class Runner:
    """Runs the chain for one client; the newest request wins, between two ticks.

    Attributes
    ----------
    recording : OpenRecording
        What is run; another one takes its place when the scene is simulated again.
    result, pinned : Result or None
        Results of the last request that was completed: B, and A beside it.
    followed : int or None
        Number of the shot that it followed.
    """

    def __init__(self, recording: OpenRecording, requests: RequestQueue, publisher: Publisher) -> None:
        self.recording = recording
        self.result: Result | None = None
        self.pinned: Result | None = None
        self.followed: int | None = None
        self._requests, self._publisher = requests, publisher
        self._slow = ThreadPoolExecutor(1, "slow stages")
        self._thread = threading.Thread(target=self._work, name="runner", daemon=True)
        self._thread.start()

    def join(self, seconds: float) -> None:
        """Wait for the thread to end, once the requests are closed."""
        self._thread.join(seconds)

    def _work(self) -> None:
        untidied = 0
        while True:
            try:
                request = self._requests.get(IDLE_S) if untidied < REQUESTS_MOST else None
                if request is None:
                    self._publisher.drawings.keep_budget()
                    untidied = 0
                    request = self._requests.get()
            except Superseded:
                self._slow.shutdown(wait=False)
                return
            assert request is not None
            untidied += 1
            self._run(request)

    def _run(self, request: RunRequest) -> None:
        recording, report = self.recording, self._publisher.report(request)
        try:
            with recording.at_work():
                if not recording.are_kernels_loaded:
                    report.tell("loading", force=True)
                    recording.load_kernels()
                clip = recording.clip(request.start_us, request.end_us)
                a = None
                if request.pinned is not None:
                    a = Result.of(_with(clip, request.pinned), list(self._ticks(clip, request.pinned, request, report)))
                self.result, self.pinned = self._complete(clip, request, report, a), a
                self.followed = request.followed
                self._show(self.result, a, request, report)
        except Superseded:
            return
        except Exception as error:  # noqa: BLE001  # whatever a stage raises, the session goes on
            report.tell("failed", force=True, error=error_text(error))

    def _complete(self, clip: Session, request: RunRequest, report: RunReport, a: Result | None) -> Result:
        """Run a clip to its end, the slow stages in a thread of their own behind the others.

        Where that takes long it shows, beside A if there is one, first what is there at the playhead. For a dragged
        slider it shows a preview, and once that rests all but the slow stages, which have to wait that long.
        """
        parameters, chain, session = request.parameters, clip.chain, _with(clip, request.parameters)
        count, began_s, playhead_us = chain.tick_count(parameters), time.perf_counter(), request.playhead_us
        is_known = all(chain.knows(parameters, stage) for stage in chain.stages)
        if is_known and not request.has_preview:  # on the way back there is nothing to begin with
            return Result.of(session, self._whole(clip, request, report))
        is_fast_first = request.interactive and not is_known
        whole = None if is_fast_first else self._slow.submit(self._whole, clip, request, report)
        ticks: list[Tick] = []
        is_previewed = not request.has_preview
        for tick in self._ticks(clip, parameters, request, report, quick_stages()):
            ticks.append(tick)
            if not is_previewed and playhead_us is not None and tick.packet.end_us >= playhead_us:
                is_previewed = True
                self._preview(ticks, request, report)
            if request.interactive:
                continue
            if playhead_us is not None and tick.packet.end_us >= playhead_us and len(ticks) >= TIMED_TICKS:
                playhead_us = None
                rest_s = (time.perf_counter() - began_s) / len(ticks) * (count - len(ticks))
                if rest_s > REST_WORTH_WAITING_S:
                    self._show(Result.of(session, ticks), a, request, report, partial=True)
        early = Result.of(session, ticks)
        if not is_previewed:
            opening_us = ViewedRun.of(early, request.followed).opening_us
            seen = [tick for tick in ticks if tick.packet.end_us <= opening_us] or ticks[:1]
            self._preview(seen, request, report)
        if is_fast_first:
            self._show(early, a, request, report, partial=True)
        else:
            self._publisher.drawings.begin(ViewedRun.of(early, request.followed), chain.keys(parameters))
        return Result.of(session, self._whole(clip, request, report) if whole is None else whole.result())

    def _preview(self, ticks: list[Tick], request: RunRequest, report: RunReport) -> None:
        """Show a preview; of a dragged slider nothing more while it moves on."""
        report.show(ticks)
        if request.interactive:
            self._requests.rest(request, DRAG_REST_S)

    def _whole(self, clip: Session, request: RunRequest, report: RunReport) -> list[Tick]:
        """All ticks with the results of all stages."""
        ticks: list[Tick] = []
        count = clip.chain.tick_count(request.parameters)
        for tick in self._ticks(clip, request.parameters, request, report):
            ticks.append(tick)
            report.tell("computing", len(ticks) / count)
        return ticks

    def _ticks(
        self,
        clip: Session,
        parameters: Parameters,
        request: RunRequest,
        report: RunReport,
        targets: Collection[str] | None = None,
    ) -> Iterator[Tick]:
        """The clip's ticks, until something newer is requested; counts what the stages take."""
        total, seconds = dict.fromkeys(STAGES.names, 0.0), dict.fromkeys(STAGES.names, 0.0)
        try:
            for tick in clip.chain.run(parameters, targets, seconds=seconds):
                report.add(seconds)
                for stage, more in seconds.items():
                    total[stage] += more
                    seconds[stage] = 0.0
                self._requests.check(request)
                yield tick
        finally:
            self.recording.note_costs(clip, parameters, total)

    def _show(
        self,
        b: Result,
        a: Result | None,
        request: RunRequest,
        report: RunReport,
        *,
        partial: bool = False,
    ) -> None:
        """Draw and publish a result, unless something newer was requested meanwhile."""
        self._requests.check(request)
        picture = self._publisher.draw(b, a, report, followed=request.followed, partial=partial)
        self._requests.check(request)
        self._publisher.publish(self.recording, picture, b, a, report, partial=partial)


def _with(clip: Session, parameters: Parameters) -> Session:
    return dataclasses.replace(clip, parameters=parameters)
