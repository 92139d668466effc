"""Web application of the coach's page: sessions of shots, without the viewer."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import AsyncIterator, Collection, Sequence
from contextlib import asynccontextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

from fastapi import FastAPI, HTTPException, Query, Response
from fastapi.responses import FileResponse, JSONResponse, StreamingResponse
from fastapi.staticfiles import StaticFiles

from spinscope.app.coach.flight_path import checked_pose, flight_path
from spinscope.app.coach.report import report_html
from spinscope.app.coach.session import NAMES, Row, ShotSession
from spinscope.app.coach.session_analysis import AnalysisProgress, SessionAnalysis
from spinscope.app.coach.session_table import write_session_table
from spinscope.app.coach.shot_words import ShotWords, kind_codes
from spinscope.app.coach.statistics import series_statistics
from spinscope.app.coach.terms import clock_hours, confidence, corkscrew_share, effect_word, spin_effect
from spinscope.app.coach.texts import texts
from spinscope.app.coach.video import write_video

from .coach_schemas import (
    AnalysisState,
    CoachShot,
    Kept,
    Names,
    NamesRequest,
    PoseRequest,
    SessionNames,
    SessionShots,
    ShotDetail,
    Statistics,
    StatisticsRequest,
    WordsQuery,
)
from .error_answers import add_error_handlers
from .security import SecurityMiddleware

STATIC = Path(__file__).parent / "static"
POLL_S = 0.3  # a session that another program writes to; a new shot is to appear within a second
SESSION = "/api/coach/{session}/"


class CoachState:
    """Open sessions by name, and the work that fills them.

    Parameters
    ----------
    sessions : sequence of ShotSession
        The first one is shown.
    analyses : sequence of SessionAnalysis
        Started with the server.
    """

    def __init__(self, sessions: Sequence[ShotSession], analyses: Sequence[SessionAnalysis] = ()) -> None:
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
            total=progress.total, done=progress.done, is_working=progress.is_working, failures=failures
        )

    def progress(self, session: ShotSession) -> AnalysisProgress:
        """Progress of the work on a session."""
        return next((one.progress for one in self._analyses if one.session is session), AnalysisProgress())

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
            shots=[coach_shot(row) for row in own.shots(since)],
            analysis=state.analysis(own),
            now=Names(**now),
        )

    @app.get(SESSION + "shots/{shot_id}")
    def shot(session: str, shot_id: int) -> ShotDetail:
        own = state.session(session)
        row = own.shot(shot_id)
        detail = row["detail"]
        drawn = {name: detail[name] for name in ("spin_rps", "reference_us", "hitter", "texture", "proof")}
        return ShotDetail(shot=coach_shot(row), flight=flight_path(row, detail, own.setting("pose")), **drawn)

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

    @app.post(SESSION + "statistics")
    def statistics(session: str, request: StatisticsRequest) -> Statistics:
        rows = {row["id"]: row for row in state.session(session).shots()}
        return Statistics(
            series={
                name: series_statistics([rows[one] for one in ids if one in rows])
                for name, ids in request.series.items()
            }
        )


def _add_exports(app: FastAPI, state: CoachState) -> None:
    @app.get(SESSION + "shots.csv", include_in_schema=False)
    def table(session: str) -> Response:
        with TemporaryDirectory(prefix="spinscope-") as folder:
            path = Path(folder) / "shots.csv"
            write_session_table(state.session(session), path)
            return Response(path.read_bytes(), media_type="text/csv; charset=utf-8")

    @app.get(SESSION + "report.html", include_in_schema=False)
    def report(session: str, words: Annotated[WordsQuery, Query()]) -> Response:
        page = report_html(state.session(session), ShotWords(**words.model_dump()))
        return Response(page, media_type="text/html; charset=utf-8")

    @app.get(SESSION + "shots/{shot_id}/video.mp4", include_in_schema=False)
    def video(session: str, shot_id: int, words: Annotated[WordsQuery, Query()]) -> Response:
        shot = state.session(session).shot(shot_id)
        with TemporaryDirectory(prefix="spinscope-") as folder:
            path = Path(folder) / "shot.mp4"
            write_video(shot, shot["detail"], path, ShotWords(**words.model_dump()))
            return Response(path.read_bytes(), media_type="video/mp4")


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

    @app.post(SESSION + "pose")
    def pose(session: str, request: PoseRequest) -> Kept:
        own = state.session(session)
        own.keep_setting("pose", None if request.pose is None else checked_pose(request.pose))
        return Kept(revision=own.revision)


def coach_shot(row: Row) -> CoachShot:
    """A row of a session in the terms of coaches."""
    spin, speed = row["spin_rps"], row["speed_m_s"]
    is_named = spin is not None and row["topspin_rps"] is not None
    effect = spin_effect(spin, speed) if spin is not None and speed else None
    columns = {name: value for name, value in row.items() if name in CoachShot.model_fields}
    return CoachShot(
        **{**columns, "marked": bool(row["marked"]), "deleted": bool(row["deleted"])},
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
    told: tuple[int, AnalysisProgress] | None = None
    while not state.is_closed:
        present = (await asyncio.to_thread(lambda: session.revision), state.progress(session))
        if present != told:
            told = present
            yield f"data: {present[0]}\n\n"
        await asyncio.sleep(POLL_S)
