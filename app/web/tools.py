"""Routes of the page's tools: tuning curve, search, fixed ball, biases, and results to take away."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from fastapi import FastAPI, HTTPException, Response
from starlette.concurrency import run_in_threadpool

from spinscope.pipeline.biases import BiasParameters, read_biases, write_biases
from spinscope.pipeline.errors import ParameterError, SpinscopeError
from spinscope.pipeline.registry import Parameters
from spinscope.pipeline.stages.fixed_ball import find_fixed_ball

from . import biases, curve, exports, search
from .bench import Bench, Clip
from .page import Page
from .requests import BiasCurve, Biases, BiasText, Cancel, Curve, Search, Settings, parameters_of
from .workshop import Workshop

PageOf = Callable[[str], Page]


def clip_of(page: Page, request: Settings) -> tuple[Clip, Parameters]:
    """The clip and the parameters that a request means; raises ParameterError."""
    bench = page.bench
    start_us, end_us = bench.first_clip_us()
    if request.start_us is not None and request.end_us is not None:
        start_us, end_us = request.start_us, request.end_us
    clip, parameters = bench.clip(start_us, end_us), parameters_of(request.parameters)
    clip.check(parameters)
    return clip, parameters


def add_tools(app: FastAPI, workshop: Workshop, page_of: PageOf) -> None:
    """Add the routes."""
    _add_curves(app, page_of)
    _add_ball(app, page_of)
    _add_exports(app, page_of)
    _add_biases(app, workshop, page_of)


def _add_curves(app: FastAPI, page_of: PageOf) -> None:
    @app.post("/api/pages/{page_id}/curve", status_code=202)
    async def start_curve(page_id: str, request: Curve) -> dict[str, Any]:
        page = page_of(page_id)
        clip, parameters = clip_of(page, request)
        tunable = curve.declared(parameters, request.name)
        values = curve.values_over(tunable, request.name, request.low, request.high, request.points)
        page.start("curve", lambda job: curve.curve(job, clip, parameters, request.name, values))
        return {"values": values}

    @app.post("/api/pages/{page_id}/search", status_code=202)
    async def start_search(page_id: str, request: Search) -> dict[str, Any]:
        page = page_of(page_id)
        clip, parameters = clip_of(page, request)
        wanted = request.names, request.objective, request.trials
        search.check(clip, parameters, *wanted)
        page.start("search", lambda job: search.search(job, clip, parameters, *wanted))
        return {"trials": request.trials}

    @app.post("/api/pages/{page_id}/cancel")
    async def cancel(page_id: str, request: Cancel) -> dict[str, Any]:
        page_of(page_id).cancel(request.kind)
        return {}


def _add_ball(app: FastAPI, page_of: PageOf) -> None:
    @app.get("/api/pages/{page_id}/events.png")
    async def events_picture(page_id: str, start_us: int, end_us: int) -> Response:
        source = page_of(page_id).bench.clip(start_us, end_us).session.source
        made = await run_in_threadpool(exports.picture_of, source.events, source.width_px, source.height_px)
        return Response(made, media_type="image/png", headers={"cache-control": "no-store"})

    @app.post("/api/pages/{page_id}/find_ball")
    async def find_ball(page_id: str, request: Settings) -> dict[str, Any]:
        clip, parameters = clip_of(page_of(page_id), request)
        camera, track = clip.session.chain.camera(parameters), parameters.track
        limits = track.radius_min_px, track.radius_max_px
        circle, std_px = await run_in_threadpool(find_fixed_ball, clip.session.source.events, camera, *limits)
        found = {"x": circle.x_px, "y": circle.y_px, "radius": circle.radius_px, "std": std_px}
        return {f"fixed_{name}_px": round(float(value), 2) for name, value in found.items() if math.isfinite(value)}


def _add_exports(app: FastAPI, page_of: PageOf) -> None:
    makers: dict[str, tuple[Callable[..., str | bytes], str, str]] = {
        "results.json": (exports.as_json, "application/json", "json"),
        "spins.csv": (exports.spins_csv, "text/csv", "spins.csv"),
        "track.csv": (exports.track_csv, "text/csv", "track.csv"),
        "run.rrd": (exports.as_rrd, "application/octet-stream", "rrd"),
    }

    @app.get("/api/pages/{page_id}/export/{name}")
    async def export(page_id: str, name: str) -> Response:
        page = page_of(page_id)
        if name not in makers:
            raise HTTPException(404, f"there is no {name}: there are {', '.join(makers)}")
        if page.finished is None:
            raise HTTPException(409, "nothing has been computed yet")
        make, media_type, suffix = makers[name]
        stem = page.bench.original.stem
        made = await run_in_threadpool(make, page.finished)
        headers = {"content-disposition": f'attachment; filename="{_plain(stem)}.{suffix}"'}
        return Response(made, media_type=media_type, headers=headers)


def _add_biases(app: FastAPI, workshop: Workshop, page_of: PageOf) -> None:
    @app.post("/api/pages/{page_id}/biases", status_code=202)
    async def take_again(page_id: str, request: Biases) -> dict[str, Any]:
        page = page_of(page_id)
        wanted = BiasParameters().with_values(request.biases)
        state = biases.state_of(page.bench.session.recording)
        if state["locked"]:
            raise ParameterError(state["locked"])

        def work(job: Any) -> dict[str, Any]:
            path = biases.taken_again(job, page.bench, wanted, workshop.scratch)
            page.bench = Bench.open(path, page.bench.choices, page.bench.original)
            return {"biases": wanted.as_dict()}

        page.start("biases", work)
        return {"biases": wanted.as_dict()}

    @app.post("/api/pages/{page_id}/bias_curve", status_code=202)
    async def start_bias_curve(page_id: str, request: BiasCurve) -> dict[str, Any]:
        page = page_of(page_id)
        wanted = BiasParameters().with_values(request.biases)
        bench = page.bench
        if biases.scene_of(bench.session.recording) is None:
            parameters, own = bench.session.parameters, wanted if request.is_known else None
            page.start("bias_curve", lambda job: biases.measured_curve(job, bench, parameters, own))
        else:
            arguments = wanted, request.name, request.points
            page.start("bias_curve", lambda job: biases.bias_curve(job, bench, *arguments))
        return {}

    @app.post("/api/biases/read")
    async def read(request: BiasText) -> dict[str, Any]:
        with TemporaryDirectory() as folder:
            path = Path(folder) / "page.bias"
            path.write_text(request.text, encoding="utf-8")
            try:
                return {"biases": read_biases(path).as_dict()}
            except SpinscopeError as error:
                raise ParameterError(str(error).removesuffix(f": {path}")) from None

    @app.post("/api/biases/write")
    async def write(request: Biases) -> dict[str, Any]:
        with TemporaryDirectory() as folder:
            path = Path(folder) / "page.bias"
            write_biases(BiasParameters().with_values(request.biases), path)
            return {"text": path.read_text(encoding="utf-8")}


def _plain(name: str) -> str:
    """A file's name without what a header must not hold."""
    return "".join(letter if letter.isalnum() or letter in "-_." else "_" for letter in name)
