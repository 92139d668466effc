"""The coach's page on a running camera: each shot stands in the session as soon as its spin is final."""

from __future__ import annotations

import math
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

from spinscope.pipeline.cameras import ArrivedTick
from spinscope.pipeline.cameras.recent_events import KEPT_US
from spinscope.pipeline.live_outputs import LiveNotice, LiveOutput, LiveShot
from spinscope.pipeline.live_spins import load_stages
from spinscope.pipeline.result_rows import ResultRow
from spinscope.pipeline.session import Choices, Result
from spinscope.pipeline.tick import Tick

from ..batch import program_version
from ..coach.session import KnownRecording, ShotSession
from ..coach.session_analysis import SessionAnalysis
from ..coach.session_folders import other_sessions
from ..coach.shot_record import RecordingShots, live_record
from ..terminal import until_interrupted
from ..web.coach_application import CoachState
from ..web.coach_schemas import CameraNotice
from ..web.server import serve_coach
from .camera_thread import CameraObserver, CameraThread
from .headless import OpenLive, Outputs, run_headless
from .opening import CameraChoice
from .shot_table import events_folder

TABLE = "live.csv"
REST_S = 1.0  # without a ball, after which nobody plays


class LiveSession(CameraObserver):
    """Observer of a live run that adds its shots to a session.

    They come without logo and pictures, which follow when `SessionAnalysis` has analyzed each shot's recording.

    Parameters
    ----------
    session : ShotSession
        What the shots are added to.
    """

    kept_us = KEPT_US

    def __init__(self, session: ShotSession) -> None:
        super().__init__()
        self._session, self._version = session, program_version()
        self._notice: CameraNotice | None = None
        self._ball_s = -math.inf  # when a ball was last in flight

    def notice(self) -> CameraNotice | None:
        """Last thing that happened to the camera since the last shot; None where nothing did."""
        return self._notice

    def begin(self, live: OpenLive) -> None:
        """Take the run before it starts."""
        load_stages()  # before the first shot, rather than beside it
        super().begin(live)

    def is_playing(self) -> bool:
        """Whether a ball is in flight, or was less than REST_S ago."""
        return time.monotonic() - self._ball_s < REST_S

    def add_tick(self, arrived: ArrivedTick, tick: Tick) -> None:
        """Take a tick, in the tracker's thread."""
        if tick.track.balls:
            self._ball_s = time.monotonic()

    def add_output(self, output: LiveOutput, row: ResultRow | None) -> None:
        """Take a result; raises RecordingError when the session cannot be written."""
        if isinstance(output, LiveNotice):
            self._notice = CameraNotice(kind=output.kind, text=output.text)
        if not isinstance(output, LiveShot) or row is None or row["events_file"] is None:
            return
        self._notice = None
        path = str((self._session.folder / str(row["events_file"])).absolute())
        if path in self._session.known():  # the analysis was faster
            return
        ended_s = time.time() - output.latency_ms * 1e-3
        record = live_record(Result(self.opened.session, (output.shot,), None), path, ended_s)
        known = KnownRecording("", "", self._version, None)
        self._session.add(path, known, RecordingShots((record,), None, ()))

    def end(self, error: Exception | None) -> None:
        """Take note that the run has ended."""
        self._notice = CameraNotice(kind="ended", text="the camera has ended" if error is None else str(error))
        super().end(error)


def run_with_coach(
    chosen: CameraChoice, choices: Choices, method: str, to: Outputs, session: ShotSession, **page: Any
) -> None:
    """Run a camera in a thread, and serve the coach's page on its shots until Ctrl-C.

    The shots' events and their table are kept in the session's folder.

    Parameters
    ----------
    **page
        Arguments of `serve_coach`.

    Raises
    ------
    SpinscopeError
        For what cannot be opened or written.
    """
    table, observer = session.folder / TABLE, LiveSession(session)
    folder: Path = events_folder(table)
    work = CameraThread(lambda: run_headless(chosen, choices, method, replace(to, table=table), observer), observer)
    work.start()
    try:
        with until_interrupted():
            observer.has_begun.wait()
            if observer.is_open:
                analysis = SessionAnalysis(
                    session, [folder], choices.for_others, jobs=1, is_playing=observer.is_playing
                )
                sessions = [session, *other_sessions([session])]
                serve_coach(CoachState(sessions, [analysis], observer.notice), place="live", **page)
    finally:
        work.end()
