"""Routes of the recordings that can be opened: lists of folders, summaries, dropped files."""

from __future__ import annotations

from typing import Annotated

from fastapi import FastAPI, HTTPException, Query, Request
from starlette.concurrency import run_in_threadpool
from starlette.requests import ClientDisconnect

from .app_state import AppState
from .schemas import Done, Dropped, FolderListing, RecordingSummary
from .security import DROP_PATH

Name = Annotated[str, Query(max_length=1000)]


def add_folder_routes(app: FastAPI, state: AppState) -> None:
    """Add the routes."""

    @app.get("/api/folder")
    async def listing(folder: Name = "") -> FolderListing:
        return await run_in_threadpool(state.folders.listing, folder)

    @app.get("/api/summary")
    async def summary(name: Name) -> RecordingSummary:
        return await run_in_threadpool(state.summary, name)

    @app.get("/api/openable")
    async def openable(name: Name) -> Done:
        await run_in_threadpool(state.recording, name)
        return Done()

    @app.post(DROP_PATH)
    async def drop(name: Name, request: Request) -> Dropped:
        try:
            path = await state.folders.drop(name, request.stream())
        except ClientDisconnect:
            raise HTTPException(408, f"the rest of {name} did not come") from None
        return Dropped(name=state.folders.name_of(path))
