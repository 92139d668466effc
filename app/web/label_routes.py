"""Routes of labels of the ball: the labels, changes of them, and pictures of the exposures that they were found in."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Annotated

import cv2
import numpy as np
from fastapi import FastAPI, Query, Response
from starlette.concurrency import run_in_threadpool

from spinscope.pipeline.calibration.ball_labels import EXPOSURE_US, LATENCY_US, BallLabels
from spinscope.pipeline.events import EventBatch

from .app_state import AppState
from .client_session import ClientSession
from .label_schemas import Label, LabelChangeRequest, Labels, LabelVersion

MIDDLE_US = 1000  # of an exposure, drawn bright: in it a ball at 12 m/s travels by a third of its diameter
EXPOSED, IN_THE_MIDDLE = 90, 255  # grey values

Time = Annotated[float, Query(ge=-(2.0**62), le=2.0**62, allow_inf_nan=False)]


def add_label_routes(app: FastAPI, state: AppState, session_of: Callable[[str], ClientSession]) -> None:
    """Add the routes; raise RecordingError where there are no labels."""

    @app.get("/api/sessions/{session_id}/labels")
    async def labels(session_id: str) -> Labels:
        file = state.labels_of(session_of(session_id).runner.recording)
        found, version = await run_in_threadpool(file.read)
        columns = {name: getattr(found, name).tolist() for name in Label.model_fields}
        rows = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
        return Labels(path=str(file.path), version=version, labels=[Label.model_validate(row) for row in rows])

    @app.post("/api/sessions/{session_id}/labels")
    async def change(session_id: str, request: LabelChangeRequest) -> LabelVersion:
        file = state.labels_of(session_of(session_id).runner.recording)
        others = label_columns(request.labels)
        version = await run_in_threadpool(file.splice, request.version, request.first, request.removed, others)
        return LabelVersion(version=version)

    @app.get("/api/sessions/{session_id}/label.png")
    async def picture(session_id: str, t_us: Time) -> Response:
        source = session_of(session_id).runner.recording.session.source
        middle_us = round(t_us + LATENCY_US)  # when the pixels tell of it
        half_us = EXPOSURE_US // 2
        events = await run_in_threadpool(source.between, middle_us - half_us, middle_us + half_us)
        made = await run_in_threadpool(exposure_picture, events, middle_us, (source.height_px, source.width_px))
        return Response(made, media_type="image/png", headers={"cache-control": "no-store"})


def label_columns(labels: Sequence[Label]) -> BallLabels:
    """The labels of a request."""
    kinds = {"ball": np.int64, "state": np.str_}
    return BallLabels(
        **{
            name: np.array([getattr(label, name) for label in labels], kinds.get(name, np.float64))
            for name in Label.model_fields
        }
    )


def exposure_picture(events: EventBatch, middle_us: int, size: tuple[int, int]) -> bytes:
    """PNG (grey) of the pixels with events: those of the middle of the exposure bright, which show the ball there."""
    grey = np.zeros(size, np.uint8)
    grey[events.y_px, events.x_px] = EXPOSED
    middle = np.abs(events.t_us - middle_us) <= MIDDLE_US // 2
    grey[events.y_px[middle], events.x_px[middle]] = IN_THE_MIDDLE
    return bytes(cv2.imencode(".png", grey)[1])
