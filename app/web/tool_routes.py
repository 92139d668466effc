"""Routes of the tools: presets, sweeps, optimization, fixed ball, biases, exports."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

from fastapi import FastAPI, HTTPException, Response
from starlette.concurrency import run_in_threadpool

from spinscope.app.tuning import bias_sweep, optimization, parameter_sweep
from spinscope.pipeline.biases import BiasParameters, read_biases, write_biases
from spinscope.pipeline.errors import ParameterError, SpinscopeError
from spinscope.pipeline.registry import Parameters
from spinscope.pipeline.session import Session
from spinscope.pipeline.simulated_recordings import description_in
from spinscope.pipeline.stages.fixed_ball import find_fixed_ball

from . import exports, presets, schemas
from .app_state import AppState
from .client_session import ClientSession
from .controls import setup_of
from .jobs import Job
from .message_schemas import BiasesMessage, BiasSweepMessage, OptimizationMessage, SweepMessage
from .open_recording import COLUMNS_KEPT, OpenRecording

TUNED_BYTES = 400_000_000  # results kept of all clips that are tuned at once
SessionOf = Callable[[str], ClientSession]


def add_tool_routes(app: FastAPI, state: AppState, session_of: SessionOf) -> None:
    """Add the routes of all tools."""
    _add_presets(app, session_of)
    _add_sweeps(app, state, session_of)
    _add_ball(app, session_of)
    _add_exports(app, session_of)
    _add_biases(app, state, session_of)


def _clip_of(session: ClientSession, request: schemas.SettingsRequest) -> tuple[Session, Parameters]:
    """Clip and parameters that a request means; raises ParameterError."""
    recording = session.runner.recording
    start_us, end_us = recording.first_clip_us()
    if request.start_us is not None and request.end_us is not None:
        start_us, end_us = request.start_us, request.end_us
    clip = recording.clip(start_us, end_us)
    clip.chain.check(request.parameters, recording.max_frame_bytes)
    return clip, request.parameters


def _add_presets(app: FastAPI, session_of: SessionOf) -> None:
    @app.post("/api/sessions/{session_id}/presets/read")
    async def read_preset(session_id: str, request: schemas.TextRequest) -> schemas.PresetValues:
        opened = session_of(session_id).runner.recording.session.parameters
        notices: list[str] = []
        parameters = presets.applied(request.text, opened, notices.append)
        return schemas.PresetValues(parameters=parameters.as_dict(), notices=notices)

    @app.post("/api/sessions/{session_id}/presets/write")
    async def write_preset(session_id: str, request: schemas.SettingsRequest) -> schemas.WrittenSettings:
        recording, parameters = session_of(session_id).runner.recording, request.parameters
        window = None
        if request.start_us is not None and request.end_us is not None:
            window = request.start_us, request.end_us
        # The whole recording needs no window, but one chosen on the command line stays.
        if window == recording.window_us and recording.choices.window_us is None:
            window = None
        again = recording.is_resimulated
        return schemas.WrittenSettings(
            toml=presets.as_toml(parameters),
            command=presets.command(recording.original, parameters, window, again=again),
            needs=presets.BIAS_FILE if again else None,
        )


def _add_sweeps(app: FastAPI, state: AppState, session_of: SessionOf) -> None:
    @app.post("/api/sessions/{session_id}/sweep", status_code=202)
    async def start_sweep(session_id: str, request: schemas.SweepRequest) -> schemas.Done:
        session = session_of(session_id)
        clip, parameters = _clip_of(session, request)
        declared = parameter_sweep.declaration(parameters, request.name)
        values = parameter_sweep.sweep_values(declared, request.name, request.low, request.high, request.points)

        def work(job: Job) -> parameter_sweep.ParameterSweep:
            return parameter_sweep.sweep(clip, parameters, request.name, values, job.report, job.check)

        session.start(SweepMessage, work)
        return schemas.Done()

    @app.post("/api/sessions/{session_id}/optimization", status_code=202)
    async def start_optimization(session_id: str, request: schemas.OptimizationRequest) -> schemas.Done:
        session = session_of(session_id)
        shown = optimization.TunedClip(*_clip_of(session, request))
        wanted = request.names, request.objective, request.trials
        optimization.check_request(shown, *wanted)
        for start_us, end_us in request.clips_us:
            session.runner.recording.check_clip(start_us, end_us)

        def work(job: Job) -> optimization.Optimization:
            skipped: list[str] = []
            clips = _tuned_clips(state, session.runner.recording, request, shown, skipped.append)

            def report(found: optimization.Optimization) -> None:
                job.report(dataclasses.replace(found, skipped=skipped))

            found = optimization.optimize(clips, *wanted, report, job.check)
            return dataclasses.replace(found, skipped=skipped)

        session.start(OptimizationMessage, work)
        return schemas.Done()

    @app.post("/api/sessions/{session_id}/cancel")
    async def cancel(session_id: str, request: schemas.CancelRequest) -> schemas.Done:
        session_of(session_id).cancel(request.kind)
        return schemas.Done()


def _tuned_clips(
    state: AppState,
    recording: OpenRecording,
    request: schemas.OptimizationRequest,
    shown: optimization.TunedClip,
    on_skip: Callable[[str], None],
) -> list[optimization.TunedClip]:
    """Clips that an optimization is for; those of other recordings in their own set-up.

    `on_skip` is told of each recording that cannot be read, or lacks the truth that the objective needs.
    """
    count = max(len(request.clips_us) + len(request.recordings), 1)
    budget_bytes = TUNED_BYTES // count

    def part(session: Session, start_us: int, end_us: int) -> Session:
        return session.clip(start_us, end_us, budget_bytes=budget_bytes, max_columns=COLUMNS_KEPT)

    clips = [
        optimization.TunedClip(part(recording.session, start_us, end_us), shown.parameters)
        for start_us, end_us in request.clips_us
    ]
    for name in request.recordings:
        path = state.folders.path(name)
        if path == recording.original:
            clips.append(shown)
            continue
        try:
            other = OpenRecording.open(path, recording.choices.for_others)
        except SpinscopeError as error:
            on_skip(str(error))
            continue
        if request.objective == "truth" and other.session.truth is None:
            on_skip(f"{name} carries no truth")
            continue
        own = request.parameters.with_values(setup_of(other.session.parameters))
        clips.append(optimization.TunedClip(part(other.session, *other.first_clip_us()), own))
    return clips or [shown]


def _add_ball(app: FastAPI, session_of: SessionOf) -> None:
    @app.get("/api/sessions/{session_id}/events.png")
    async def events_picture(session_id: str, start_us: int, end_us: int) -> Response:
        source = session_of(session_id).runner.recording.clip(start_us, end_us).source
        events = await run_in_threadpool(source.between, start_us, end_us)
        made = await run_in_threadpool(exports.event_picture, events, source.width_px, source.height_px)
        return Response(made, media_type="image/png", headers={"cache-control": "no-store"})

    @app.post("/api/sessions/{session_id}/find_ball")
    async def find_ball(session_id: str, request: schemas.SettingsRequest) -> dict[str, float]:
        clip, parameters = _clip_of(session_of(session_id), request)
        camera, track = clip.chain.camera(parameters), parameters.track
        limits = track.radius_min_px, track.radius_max_px
        events = await run_in_threadpool(clip.source.between, clip.source.start_us, clip.source.end_us)
        circle, std_px = await run_in_threadpool(find_fixed_ball, events, camera, *limits)
        found = {"x": circle.x_px, "y": circle.y_px, "radius": circle.radius_px, "std": std_px}
        return {f"fixed_{name}_px": round(float(value), 2) for name, value in found.items() if math.isfinite(value)}


def _add_exports(app: FastAPI, session_of: SessionOf) -> None:
    @app.get("/api/sessions/{session_id}/export/{name}")
    async def export(session_id: str, name: str) -> Response:
        session = session_of(session_id)
        made = exports.EXPORTS.get(name)
        if made is None:
            raise HTTPException(404, f"there is no {name}: there are {', '.join(exports.EXPORTS)}")
        if session.runner.result is None:
            raise HTTPException(409, "nothing has been computed yet")
        beside = {name: getattr(session.runner, name) for name in made.takes}
        content = await run_in_threadpool(made.make, session.runner.result, **beside)
        stem = "".join(c if c.isalnum() or c in "-_." else "_" for c in session.runner.recording.original.stem)
        headers = {"content-disposition": f'attachment; filename="{stem}.{made.suffix}"'}
        return Response(content, media_type=made.media_type, headers=headers)


def _add_biases(app: FastAPI, state: AppState, session_of: SessionOf) -> None:
    @app.post("/api/sessions/{session_id}/biases", status_code=202)
    async def resimulate(session_id: str, request: schemas.BiasRequest) -> schemas.Done:
        session, live = session_of(session_id), state.live
        if live is not None:
            live.set_biases(request.biases)
            session.start(BiasesMessage, lambda job: bias_sweep.Resimulation(1.0, request.biases))
            return schemas.Done()
        recording, biases = session.runner.recording, BiasParameters().with_values(request.biases)
        locked = bias_sweep.bias_state(recording.session.recording).locked
        if locked:
            raise ParameterError(locked)

        def work(job: Job) -> bias_sweep.Resimulation:
            path = bias_sweep.resimulate(recording.original, biases, state.scratch, job.report, job.check)
            session.runner.recording = OpenRecording.open(path, recording.choices, recording.original)
            return bias_sweep.Resimulation(1.0, biases.as_dict())

        session.start(BiasesMessage, work)
        return schemas.Done()

    @app.post("/api/sessions/{session_id}/bias_sweep", status_code=202)
    async def start_bias_sweep(session_id: str, request: schemas.BiasSweepRequest) -> schemas.Done:
        session, live = session_of(session_id), state.live
        if live is not None:
            name, points = request.name, request.points
            session.start(BiasSweepMessage, lambda job: live.sweep_bias(name, points, job.report, job.check))
            return schemas.Done()
        recording, biases = session.runner.recording, BiasParameters().with_values(request.biases)
        original = recording.original

        def open_clip(path: Path) -> Session:
            choices = recording.choices if path == original else recording.choices.for_others
            return OpenRecording.open(path, choices).first_clip()

        def work(job: Job) -> bias_sweep.BiasSweep:
            if description_in(recording.session.recording.attributes) is not None:
                return bias_sweep.sweep_bias(original, biases, request.name, request.points, job.report, job.check)
            own, parameters = biases if request.is_known else None, recording.session.parameters
            return bias_sweep.measure_folder(original, own, parameters, open_clip, job.report, job.check)

        session.start(BiasSweepMessage, work)
        return schemas.Done()

    @app.post("/api/biases/read")
    async def read(request: schemas.TextRequest) -> schemas.BiasValues:
        with TemporaryDirectory() as folder:
            path = Path(folder) / "page.bias"
            path.write_text(request.text, encoding="utf-8")
            try:
                return schemas.BiasValues(biases=read_biases(path).as_dict())
            except SpinscopeError as error:
                raise ParameterError(str(error).removesuffix(f": {path}")) from None

    @app.post("/api/biases/write")
    async def write(request: schemas.BiasRequest) -> schemas.BiasText:
        with TemporaryDirectory() as folder:
            path = Path(folder) / "page.bias"
            write_biases(BiasParameters().with_values(request.biases), path)
            return schemas.BiasText(text=path.read_text(encoding="utf-8"))
