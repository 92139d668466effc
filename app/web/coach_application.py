"""Web application of the coach's page: sessions of shots, without the viewer."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import AsyncIterator, Callable, Collection, Sequence
from contextlib import asynccontextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Literal

from fastapi import FastAPI, HTTPException, Query, Response
from fastapi.responses import FileResponse, JSONResponse, StreamingResponse
from fastapi.staticfiles import StaticFiles

from spinscope.app.coach.flight_path import flight_path
from spinscope.app.coach.report import write_report
from spinscope.app.coach.session import NAMES, Row, ShotSession
from spinscope.app.coach.session_analysis import AnalysisProgress, SessionAnalysis
from spinscope.app.coach.session_table import write_session_table
from spinscope.app.coach.shot_words import ShotWords, kind_codes
from spinscope.app.coach.statistics import compared, series_statistics
from spinscope.app.coach.table_marking import event_picture, mark_table, marking_recordings
from spinscope.app.coach.terms import clock_hours, confidence, corkscrew_share, effect_word, spin_effect
from spinscope.app.coach.texts import texts
from spinscope.app.coach.video import write_video
from spinscope.pipeline.session import Choices

from .coach_schemas import (
    AnalysisState,
    CameraNotice,
    CoachShot,
    Kept,
    Landings,
    Names,
    NamesRequest,
    SessionNames,
    SessionShots,
    ShotDetail,
    Statistics,
    StatisticsRequest,
    TableMarks,
    TableRequest,
    WordsQuery,
)
from .error_answers import add_error_handlers
from .security import SecurityMiddleware

STATIC = Path(__file__).parent / "static"
POLL_S = 0.1  # a session that another program writes to; a new shot is to appear within a second
SESSION = "/api/coach/{session}/"
MEDIA_TYPES = {
    ".csv": "text/csv; charset=utf-8",
    ".parquet": "application/vnd.apache.parquet",
    ".html": "text/html; charset=utf-8",
    ".pdf": "application/pdf",
    ".mp4": "video/mp4",
}


class CoachState:
    """Open sessions by name, and the work that fills them.

    Parameters
    ----------
    sessions : sequence of ShotSession
        The first one is shown.
    analyses : sequence of SessionAnalysis
        Started with the server.
    camera_notice : callable
        What happened to a running camera last; None where nothing did.
    """

    def __init__(
        self,
        sessions: Sequence[ShotSession],
        analyses: Sequence[SessionAnalysis] = (),
        camera_notice: Callable[[], CameraNotice | None] = lambda: None,
    ) -> None:
        self.camera_notice = camera_notice
        self.sessions: dict[str, ShotSession] = {}
        for session in sessions:
            name, number = session.name, 2
            while name in self.sessions:
                name, number = f"{session.name} {number}", number + 1
            self.sessions[name] = session
        self._analyses = list(analyses)
        self._closed = threading.Event()

    @property
    def is_closed(self) -> bool:
        """Whether the server is about to end."""
        return self._closed.is_set()

    def session(self, name: str) -> ShotSession:
        """The session of that name; raises HTTPException where there is none."""
        if name not in self.sessions:
            raise HTTPException(404, "this session is not open: reload the page")
        return self.sessions[name]

    def analysis(self, session: ShotSession) -> AnalysisState:
        """State of the work in the background for a session."""
        failures = {
            Path(path).name: row["error"] for path, row in session.recordings().items() if row["error"] is not None
        }
        progress = self.progress(session)
        return AnalysisState(
            total=progress.total,
            done=progress.done,
            is_working=progress.is_working,
            failures=failures,
            camera_notice=self.camera_notice(),
        )

    def progress(self, session: ShotSession) -> AnalysisProgress:
        """Progress of the work on a session."""
        return next((one.progress for one in self._analyses if one.session is session), AnalysisProgress())

    def choices(self, session: ShotSession) -> Choices:
        """Options of the analysis of a session."""
        return next((one.choices for one in self._analyses if one.session is session), Choices())

    def start(self) -> None:
        """Begin the work in the background."""
        for analysis in self._analyses:
            analysis.start()

    def close(self) -> None:
        """End the work and the connections."""
        self._closed.set()
        for analysis in self._analyses:
            analysis.close()


def coach_application(state: CoachState, token: str | None = None, hosts: Collection[str] = ()) -> FastAPI:
    """The application over the open sessions; see SecurityMiddleware for `token` and `hosts`."""

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        yield
        await asyncio.to_thread(state.close)

    # Without the pages of documentation, which load their scripts from elsewhere.
    app = FastAPI(docs_url=None, redoc_url=None, openapi_url=None, lifespan=lifespan)
    app.add_middleware(SecurityMiddleware, token=token, hosts=hosts)
    add_error_handlers(app)

    @app.get("/", include_in_schema=False)
    def index() -> FileResponse:
        return FileResponse(STATIC / "coach/index.html", headers={"cache-control": "no-cache"})

    app.mount("/static", StaticFiles(directory=STATIC), name="static")

    @app.get("/api/coach/texts", include_in_schema=False)
    def table_of_texts() -> JSONResponse:
        return JSONResponse(texts())

    @app.get("/api/coach/sessions")
    def sessions() -> SessionNames:
        return SessionNames(sessions=list(state.sessions))

    _add_shot_routes(app, state)
    _add_name_routes(app, state)
    _add_table_routes(app, state)
    _add_exports(app, state)
    return app


def _add_shot_routes(app: FastAPI, state: CoachState) -> None:
    @app.get(SESSION + "shots")
    def shots(session: str, since: int = -1) -> SessionShots:
        own = state.session(session)
        revision = own.revision  # before the shots: what changes meanwhile comes again
        now = {name: value for name, value in (own.setting("now") or {}).items() if name in NAMES}
        return SessionShots(
            revision=revision,
            shots=[coach_shot(session, row) for row in own.shots(since)],
            analysis=state.analysis(own),
            now=Names(**now),
        )

    @app.get(SESSION + "shots/{shot_id}")
    def shot(session: str, shot_id: int) -> ShotDetail:
        own = state.session(session)
        row = own.shot(shot_id)
        detail = row["detail"]
        drawn = {name: detail[name] for name in ("spin_rps", "reference_us", "hitter", "texture", "proof")}
        return ShotDetail(shot=coach_shot(session, row), flight=flight_path(row, detail, own.setting("pose")), **drawn)

    @app.get(SESSION + "landings")
    def landings(session: str) -> Landings:
        own = state.session(session)
        pose = own.setting("pose")
        paths = {row["id"]: flight_path(row, row["detail"], pose) for row in own.bounced()} if pose else {}
        return Landings(landings={one: path.landing_m for one, path in paths.items() if path and path.landing_m})

    @app.get(SESSION + "pictures/{shot_id}", include_in_schema=False)
    def picture(session: str, shot_id: int) -> Response:
        path = state.session(session).picture(shot_id)
        if path is None:
            raise HTTPException(404, "this shot has no picture")
        return FileResponse(path, media_type="image/png", headers={"cache-control": "no-cache"})

    @app.get(SESSION + "messages", include_in_schema=False)
    async def messages(session: str) -> StreamingResponse:
        own = state.session(session)
        headers = {"cache-control": "no-store", "x-accel-buffering": "no"}
        return StreamingResponse(_revisions(state, own), media_type="text/event-stream", headers=headers)

    @app.post("/api/coach/statistics")
    def statistics(request: StatisticsRequest) -> Statistics:
        names = dict.fromkeys(name for series in request.series.values() for name in series)
        rows = {(name, row["id"]): row for name in names for row in state.session(name).shots()}
        found = {}
        for name, series in request.series.items():
            own = [rows[key] for session, ids in series.items() for one in ids if (key := (session, one)) in rows]
            found[name] = series_statistics(sorted(own, key=lambda row: row["recorded_s"]), request.since_s)
        order, is_clear = compared(found)
        return Statistics(series=found, order=order, is_clear=is_clear)


def _add_exports(app: FastAPI, state: CoachState) -> None:
    @app.get(SESSION + "shots.{kind}", include_in_schema=False)
    def table(session: str, kind: Literal["csv", "parquet"]) -> Response:
        own = state.session(session)
        return _file(f"shots.{kind}", lambda path: write_session_table(own, path))

    @app.get(SESSION + "report.{kind}", include_in_schema=False)
    def report(session: str, kind: Literal["html", "pdf"], words: Annotated[WordsQuery, Query()]) -> Response:
        own = state.session(session)
        return _file(f"report.{kind}", lambda path: write_report(own, path, ShotWords(**words.model_dump())))

    @app.get(SESSION + "shots/{shot_id}/video.mp4", include_in_schema=False)
    def video(session: str, shot_id: int, words: Annotated[WordsQuery, Query()]) -> Response:
        shot = state.session(session).shot(shot_id)
        drawn = ShotWords(**words.model_dump())
        return _file("shot.mp4", lambda path: write_video(shot, shot["detail"], path, drawn))


def _file(name: str, write: Callable[[Path], None]) -> Response:
    """Answer with the content that is written to a file of that name."""
    with TemporaryDirectory(prefix="spinscope-") as folder:
        path = Path(folder) / name
        write(path)
        return Response(path.read_bytes(), media_type=MEDIA_TYPES[path.suffix])


def _add_name_routes(app: FastAPI, state: CoachState) -> None:
    @app.post(SESSION + "names")
    def names(session: str, request: NamesRequest) -> Kept:
        own = state.session(session)
        own.name_shots(request.ids, request.values)
        return Kept(revision=own.revision)

    @app.post(SESSION + "now")
    def now(session: str, request: Names) -> Kept:
        own = state.session(session)
        own.keep_setting("now", {name: value for name, value in request.model_dump().items() if value})
        return Kept(revision=own.revision)


def _add_table_routes(app: FastAPI, state: CoachState) -> None:
    @app.get(SESSION + "table")
    def table(session: str) -> TableMarks:
        return _marks(state.session(session))

    @app.get(SESSION + "table.png", include_in_schema=False)
    def picture(session: str, recording: str) -> Response:
        own = state.session(session)
        return Response(event_picture(own, recording, state.choices(own)), media_type="image/png")

    @app.post(SESSION + "table")
    def mark(session: str, request: TableRequest) -> TableMarks:
        own = state.session(session)
        corners_px = [(x_px, y_px) for x_px, y_px in request.corners_px]
        mark_table(own, request.recording, corners_px, state.choices(own))
        return _marks(own)


def _marks(session: ShotSession) -> TableMarks:
    pose = session.setting("pose") or {}
    marks = {name: pose.get(name) for name in ("recording", "corners_px", "off_px")}
    height_m = pose["camera_m"][2] if pose else None
    return TableMarks(recordings=marking_recordings(session), height_m=height_m, **marks)


def coach_shot(session: str, row: Row) -> CoachShot:
    """A row of the session of that name in the terms of coaches."""
    spin, speed = row["spin_rps"], row["speed_m_s"]
    is_named = spin is not None and row["topspin_rps"] is not None
    effect = spin_effect(spin, speed) if spin is not None and speed else None
    columns = {name: value for name, value in row.items() if name in CoachShot.model_fields}
    return CoachShot(
        **{**columns, "session": session, "marked": bool(row["marked"]), "deleted": bool(row["deleted"])},
        has_picture=row["picture_file"] is not None,
        kind=list(kind_codes(row)),
        effect=effect,
        effect_word=None if effect is None else effect_word(effect),
        confidence=None if spin is None else confidence(spin, row["spin_std_rps"], row["axis_std_deg"]),
        clock_hours=clock_hours(row["topspin_rps"], row["sidespin_rps"]) if is_named else None,
        corkscrew_share=corkscrew_share(row["corkscrew_rps"], spin) if is_named else None,
    )


async def _revisions(state: CoachState, session: ShotSession) -> AsyncIterator[str]:
    """Server-sent events: the revision, whenever it or the work in the background has changed."""
    yield "retry: 500\n\n"
    told: tuple[int, AnalysisProgress, CameraNotice | None] | None = None
    while not state.is_closed:
        present = (await asyncio.to_thread(lambda: session.revision), state.progress(session), state.camera_notice())
        if present != told:
            told = present
            yield f"data: {present[0]}\n\n"
        await asyncio.sleep(POLL_S)
