"""The page's server: HTML and assets, parameters in, pictures and messages out."""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from typing import Any

from fastapi import FastAPI, HTTPException, Response
from fastapi.exceptions import RequestValidationError
from fastapi.responses import FileResponse, JSONResponse, StreamingResponse
from fastapi.staticfiles import StaticFiles
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException as StarletteHTTPException

from spinscope.app.viewer.rrd import layout_bytes
from spinscope.app.viewer.run import ViewedRun
from spinscope.app.viewer.views import views
from spinscope.pipeline.errors import SpinscopeError
from spinscope.pipeline.registry import STAGES

from . import presets
from .assets import STATIC, viewer_script, viewer_version, viewer_wasm
from .bench import OVERVIEW_BINS, Bench
from .biases import state_of
from .controls import sections
from .guard import Guard
from .page import Page, Wanted
from .requests import OpenPage, PresetText, Run, Settings, parameters_of
from .tools import PageOf, add_tools
from .workshop import Workshop

MESSAGE_MOST = 400
SWEEP_UP_S = 5.0


def application(workshop: Workshop) -> FastAPI:
    """The web application over the open recordings; raises SpinscopeError when the viewer is not installed right."""
    script, version = viewer_script(), viewer_version()

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        sweeping = asyncio.create_task(_sweep_up(workshop))
        yield
        sweeping.cancel()
        with suppress(asyncio.CancelledError):
            await sweeping
        await asyncio.to_thread(workshop.close)

    # Without the pages of documentation, which load their scripts from elsewhere.
    app = FastAPI(docs_url=None, redoc_url=None, openapi_url=None, lifespan=lifespan)
    app.add_middleware(Guard)
    _answer_errors(app)

    @app.get("/")
    async def index() -> FileResponse:
        return FileResponse(STATIC / "index.html", headers={"cache-control": "no-cache"})

    @app.get(f"/rerun/{version}/widget.js")
    async def widget() -> Response:
        return Response(script, media_type="text/javascript", headers={"cache-control": "max-age=31536000, immutable"})

    @app.get(f"/rerun/{version}/re_viewer_bg.wasm")
    async def wasm() -> FileResponse:
        forever = {"cache-control": "max-age=31536000, immutable"}
        return FileResponse(viewer_wasm(), media_type="application/wasm", headers=forever)

    app.mount("/static", StaticFiles(directory=STATIC), name="static")

    def page_of(page_id: str) -> Page:
        page = workshop.page(page_id)
        if page is None:
            raise HTTPException(404, "this page is not open any more: reload it")
        page.last_sign_of_life = time.monotonic()
        return page

    _page_routes(app, workshop, version, page_of)
    _preset_routes(app, page_of)
    add_tools(app, workshop, page_of)
    return app


def _page_routes(app: FastAPI, workshop: Workshop, version: str, page_of: PageOf) -> None:
    @app.post("/api/pages")
    async def open_page(request: OpenPage) -> dict[str, Any]:
        page = await run_in_threadpool(workshop.open_page, request.recording)
        return await run_in_threadpool(_opening, workshop, page, version)

    @app.get("/api/pages/{page_id}/recording")
    async def recording(page_id: str) -> dict[str, Any]:
        bench = page_of(page_id).bench
        return {"recording": await run_in_threadpool(_recording, bench), "biases": state_of(bench.session.recording)}

    @app.post("/api/pages/{page_id}/run", status_code=202)
    async def run(page_id: str, request: Run) -> dict[str, Any]:
        page = page_of(page_id)
        clip = page.bench.clip(request.start_us, request.end_us)
        parameters = parameters_of(request.parameters)
        pinned = None if request.pinned is None else parameters_of(request.pinned)
        for wanted in (parameters, pinned):
            if wanted is not None:
                clip.check(wanted)
        wish = Wanted(request.serial, parameters, pinned, clip.window_us, request.playhead_us, request.hasty)
        if not page.ask(wish):
            raise HTTPException(409, "a newer change has come in already")
        return {"serial": request.serial, "parameters": parameters.as_dict()}

    @app.get("/api/pages/{page_id}/messages")
    async def messages(page_id: str) -> StreamingResponse:
        page = page_of(page_id)
        headers = {"cache-control": "no-store", "x-accel-buffering": "no"}
        return StreamingResponse(_listen(page), media_type="text/event-stream", headers=headers)

    @app.get("/api/pages/{page_id}/pictures/{recording_id}")
    async def picture(page_id: str, recording_id: str) -> Response:
        found = page_of(page_id).picture(recording_id)
        if found is None:
            raise HTTPException(404, "a newer picture has taken this one's place")
        return Response(found, media_type="application/octet-stream", headers={"cache-control": "no-store"})

    @app.get("/api/pages/{page_id}/layout")
    async def layout(page_id: str, tab: str = "") -> Response:
        page = page_of(page_id)
        if page.finished is None:
            raise HTTPException(409, "nothing has been computed yet")
        made = await run_in_threadpool(layout_bytes, ViewedRun.of(page.finished), tab)
        return Response(made, media_type="application/octet-stream", headers={"cache-control": "no-store"})


def _preset_routes(app: FastAPI, page_of: PageOf) -> None:
    @app.post("/api/pages/{page_id}/presets/read")
    async def read_preset(page_id: str, request: PresetText) -> dict[str, Any]:
        opened = page_of(page_id).bench.session.parameters
        return {"parameters": presets.applied(request.text, opened).as_dict()}

    @app.post("/api/pages/{page_id}/presets/write")
    async def write_preset(page_id: str, request: Settings) -> dict[str, Any]:
        bench, parameters = page_of(page_id).bench, parameters_of(request.parameters)
        window = None
        if request.start_us is not None and request.end_us is not None:
            window = request.start_us, request.end_us
        # The whole recording needs no window, but one chosen on the command line stays.
        if window == bench.window_us and bench.choices.window_us is None:
            window = None
        return {
            "toml": presets.as_toml(parameters),
            "command": presets.command(bench.original, parameters, window, again=bench.is_taken_again),
            "needs": presets.BIAS_FILE if bench.is_taken_again else None,
        }


def _opening(workshop: Workshop, page: Page, version: str) -> dict[str, Any]:
    """All that a page needs to know at first."""
    bench = page.bench
    opened = bench.session.parameters
    return {
        "page": page.id,
        "viewer": version,
        "recording": _recording(bench),
        "recordings": workshop.recordings(),
        "sections": sections(),
        "stages": list(STAGES.names),
        "presets": presets.built_in(opened),
        "tabs": [view.label for view in views(compare=True)],
        "biases": state_of(bench.session.recording),
    }


def _recording(bench: Bench) -> dict[str, Any]:
    session = bench.session
    counts, edges_us = bench.rate(OVERVIEW_BINS)
    start_us, end_us = bench.window_us
    clip_start_us, clip_end_us = bench.first_clip_us()
    return {
        "name": bench.original.name,
        "events": len(session.source.events),
        "width_px": session.source.width_px,
        "height_px": session.source.height_px,
        "start_us": start_us,
        "end_us": end_us,
        "longest_us": bench.longest_us,
        "is_long": bench.is_long,
        "clip_us": [clip_start_us, clip_end_us],
        "has_truth": bench.truth is not None,
        "warnings": session.warnings,
        "rate": {"counts": counts.tolist(), "edges_us": edges_us.tolist()},
    }


async def _listen(page: Page) -> AsyncIterator[str]:
    """The page's messages as server-sent events, until it or the server goes."""
    page.listeners += 1
    try:
        yield "retry: 500\n\n"
        async for message in page.outbox.messages():
            yield f"data: {json.dumps(message, allow_nan=False)}\n\n"
    finally:
        page.listeners -= 1
        page.last_sign_of_life = time.monotonic()


async def _sweep_up(workshop: Workshop) -> None:
    while True:
        await asyncio.sleep(SWEEP_UP_S)
        workshop.close_lonely_pages()


def _answer_errors(app: FastAPI) -> None:
    """Every refusal is one line of JSON: {"error": ...}."""

    @app.exception_handler(SpinscopeError)
    async def ours(_: Any, error: SpinscopeError) -> JSONResponse:
        return _error(400, str(error))

    @app.exception_handler(RequestValidationError)
    async def malformed(_: Any, error: RequestValidationError) -> JSONResponse:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"] if part != "body")
        return _error(422, f"{place or 'the request'}: {first['msg']}")

    @app.exception_handler(StarletteHTTPException)
    async def http(_: Any, error: StarletteHTTPException) -> JSONResponse:
        return _error(error.status_code, str(error.detail))


def _error(status: int, text: str) -> JSONResponse:
    line = " ".join(text.split())
    return JSONResponse({"error": line if len(line) <= MESSAGE_MOST else f"{line[:MESSAGE_MOST]} ..."}, status)
