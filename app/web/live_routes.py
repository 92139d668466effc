"""Routes of a running camera: its state and picture, its recording, and parameters from now on."""

from __future__ import annotations

from fastapi import FastAPI, HTTPException, Response
from starlette.concurrency import run_in_threadpool

from .live_schemas import (
    LiveMarkerRequest,
    LiveParametersRequest,
    LiveRecordingRequest,
    LiveSource,
    LiveView,
    LiveWindow,
    LiveWindowRequest,
)
from .schemas import Done


def add_live_routes(app: FastAPI, live: LiveSource | None) -> None:
    """Add the routes; where no camera runs they say so."""

    def running() -> LiveSource:
        if live is None:
            raise HTTPException(404, "no camera runs here: `spinscope live` opens this page on one")
        return live

    @app.get("/api/live/view")
    async def view() -> LiveView:
        return running().view()

    @app.get("/api/live/picture", include_in_schema=False)
    async def picture() -> Response:
        made = await run_in_threadpool(running().picture)
        return Response(made, media_type="image/png", headers={"cache-control": "no-store"})

    @app.post("/api/live/window")
    async def window(request: LiveWindowRequest) -> LiveWindow:
        path = await run_in_threadpool(running().save_window, request.seconds)
        return LiveWindow(recording=path.name)

    @app.post("/api/live/recording")
    async def recording(request: LiveRecordingRequest) -> LiveView:
        await run_in_threadpool(running().set_recording, request.is_on)
        return running().view()

    @app.post("/api/live/marker")
    async def marker(request: LiveMarkerRequest) -> LiveView:
        await run_in_threadpool(running().mark, request.text, request.seconds_ago)
        return running().view()

    @app.post("/api/live/parameters")
    async def parameters(request: LiveParametersRequest) -> Done:
        running().take_parameters(request.parameters)
        return Done()
