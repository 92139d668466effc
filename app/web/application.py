"""Web application: the page and its assets, sessions with their runs, pictures and messages."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator, Callable, Collection
from contextlib import asynccontextmanager, suppress
from typing import Annotated

from fastapi import FastAPI, HTTPException, Query, Response
from fastapi.responses import FileResponse, StreamingResponse
from fastapi.staticfiles import StaticFiles
from starlette.concurrency import run_in_threadpool

from spinscope.app.tuning.bias_sweep import bias_state
from spinscope.app.viewer.fitting import ViewerSize
from spinscope.app.viewer.rrd import layout_bytes
from spinscope.app.viewer.run import ViewedRun

from .app_state import AppState
from .assets import STATIC, chart_script, viewer_script, viewer_version, viewer_wasm
from .client_session import ClientSession
from .error_answers import add_error_handlers
from .folder_routes import add_folder_routes
from .label_routes import add_label_routes
from .live_routes import add_live_routes
from .message_schemas import PreviewMessage
from .opening import opening, recording_description
from .publisher import preview_message
from .schemas import Done, Opening, OpenRequest, Reopened, RunRequest
from .security import SecurityMiddleware
from .tool_routes import add_tool_routes
from .video_routes import add_video_routes

SWEEP_UP_S = 5.0
FOREVER = {"cache-control": "max-age=31536000, immutable"}
NO_STORE = {"cache-control": "no-store"}

Side = Annotated[float, Query(gt=0, allow_inf_nan=False)]
SessionOf = Callable[[str], ClientSession]


def application(state: AppState, token: str | None = None, hosts: Collection[str] = ()) -> FastAPI:
    """The application over the open recordings; raises SpinscopeError when the viewer is not installed right.

    See SecurityMiddleware for `token` and `hosts`.
    """
    viewer_version()

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        sweeping = asyncio.create_task(_close_lonely_sessions(state))
        yield
        sweeping.cancel()
        with suppress(asyncio.CancelledError):
            await sweeping
        await asyncio.to_thread(state.close)

    # Without the pages of documentation, which load their scripts from elsewhere.
    app = FastAPI(docs_url=None, redoc_url=None, openapi_url=None, lifespan=lifespan)
    app.add_middleware(SecurityMiddleware, token=token, hosts=hosts)
    add_error_handlers(app)
    _add_assets(app)

    def session_of(session_id: str) -> ClientSession:
        session = state.sessions.get(session_id)
        if session is None:
            raise HTTPException(404, "this page is not open any more: reload it")
        session.last_sign_of_life_s = time.monotonic()
        return session

    @app.post("/api/sessions")
    async def open_session(request: OpenRequest) -> Opening:
        session = await run_in_threadpool(state.open_session, request.recording)
        return await run_in_threadpool(opening, state, session)

    _add_session_routes(app, state, session_of)
    add_folder_routes(app, state)
    add_tool_routes(app, state, session_of)
    add_label_routes(app, state, session_of)
    add_live_routes(app, state.live)
    add_video_routes(app)
    return app


def _add_assets(app: FastAPI) -> None:
    script, version = viewer_script(), viewer_version()

    @app.get("/", include_in_schema=False)
    async def index() -> FileResponse:
        return FileResponse(STATIC / "index.html", headers={"cache-control": "no-cache"})

    @app.get(f"/rerun/{version}/widget.js", include_in_schema=False)
    async def widget() -> Response:
        return Response(script, media_type="text/javascript", headers=FOREVER)

    @app.get(f"/rerun/{version}/re_viewer_bg.wasm", include_in_schema=False)
    async def wasm() -> FileResponse:
        return FileResponse(viewer_wasm(), media_type="application/wasm", headers=FOREVER)

    @app.get("/plotly/plotly.min.js", include_in_schema=False)
    async def plotly() -> FileResponse:
        return FileResponse(chart_script(), media_type="text/javascript", headers={"cache-control": "max-age=86400"})

    app.mount("/static", StaticFiles(directory=STATIC), name="static")


def _add_session_routes(app: FastAPI, state: AppState, session_of: SessionOf) -> None:
    @app.get("/api/sessions/{session_id}/recording")
    async def recording(session_id: str) -> Reopened:
        opened = session_of(session_id).runner.recording
        info = await run_in_threadpool(recording_description, opened, state.folders.name_of(opened.original))
        return Reopened(recording=info, biases=bias_state(opened.session.recording))

    @app.post("/api/sessions/{session_id}/run", status_code=202)
    async def run(session_id: str, request: RunRequest) -> Done:
        session = session_of(session_id)
        recording = session.runner.recording
        clip = recording.clip(request.start_us, request.end_us)
        for parameters in (request.parameters, request.pinned):
            if parameters is not None:
                clip.chain.check(parameters, recording.max_frame_bytes)
        if not session.requests.put(request):
            raise HTTPException(409, "a newer change has come in already")
        return Done()

    @app.get("/api/sessions/{session_id}/messages", include_in_schema=False)
    async def messages(session_id: str) -> StreamingResponse:
        headers = {**NO_STORE, "x-accel-buffering": "no"}
        return StreamingResponse(_events(session_of(session_id)), media_type="text/event-stream", headers=headers)

    @app.get("/api/sessions/{session_id}/pictures/{picture_id}")
    async def picture(session_id: str, picture_id: str) -> Response:
        found = session_of(session_id).publisher.picture(picture_id)
        if found is None:
            raise HTTPException(404, "a newer picture has taken this one's place")
        return Response(found, media_type="application/octet-stream", headers=NO_STORE)

    @app.get("/api/sessions/{session_id}/preview")
    async def preview(session_id: str, t_us: float) -> PreviewMessage:
        result = session_of(session_id).runner.result
        if result is None:
            raise HTTPException(409, "nothing has been computed yet")
        ticks = [tick for tick in result.ticks if tick.packet.end_us <= t_us] or result.ticks[:1]
        return await run_in_threadpool(preview_message, ticks, 0, is_whole=True)

    @app.get("/api/sessions/{session_id}/layout")
    async def layout(
        session_id: str, tab: str = "", tools: bool = True, width_px: Side = 1000.0, height_px: Side = 600.0
    ) -> Response:
        result = session_of(session_id).runner.result
        if result is None:
            raise HTTPException(409, "nothing has been computed yet")
        size = ViewerSize(width_px, height_px)
        made, root = await run_in_threadpool(layout_bytes, ViewedRun.of(result), tab, compare=tools, size=size)
        return Response(made, media_type="application/octet-stream", headers={**NO_STORE, "X-Layout-Root": root})


async def _events(session: ClientSession) -> AsyncIterator[str]:
    """The session's messages as server-sent events, until it or the server goes."""
    session.listeners += 1
    try:
        yield "retry: 500\n\n"
        async for message in session.messages.messages():
            yield f"data: {message.model_dump_json()}\n\n"
    finally:
        session.listeners -= 1
        session.last_sign_of_life_s = time.monotonic()


async def _close_lonely_sessions(state: AppState) -> None:
    while True:
        await asyncio.sleep(SWEEP_UP_S)
        state.close_lonely_sessions()
