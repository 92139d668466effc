"""Answers to requests that are refused: one line of JSON."""

from __future__ import annotations

from typing import Any

from fastapi import FastAPI
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from starlette.exceptions import HTTPException as StarletteHTTPException

from spinscope.pipeline.errors import SpinscopeError

MESSAGE_MOST = 400


def add_error_handlers(app: FastAPI) -> None:
    """Make every refusal one line of JSON: {"error": ...}."""

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
