"""Summary of a recording for the list of a folder: its events, its shots, its spin, and a picture of it."""

from __future__ import annotations

import base64
from pathlib import Path

import cv2
import numpy as np

from spinscope.app.analysis import analyzed_session
from spinscope.pipeline.errors import SpinscopeError
from spinscope.pipeline.metrics import RunMetrics
from spinscope.pipeline.session import Choices, Progress

from .exports import event_picture
from .open_recording import OpenRecording
from .schemas import RecordingSummary

PICTURE_PX = 120  # width of the picture


def summarize(path: Path, choices: Choices, on_progress: Progress | None = None) -> RecordingSummary:
    """Summary of a recording; of one that cannot be analyzed with the reason.

    A long recording is not searched for its shots, which takes as long as it lasts.
    """
    try:
        opened = OpenRecording.open(path, choices)
        source = opened.session.source
        start_us, end_us = opened.first_clip_us()
        picture = event_picture(source.between(start_us, end_us), source.width_px, source.height_px)
        summary = RecordingSummary(
            events=source.event_count,
            duration_us=source.end_us - source.start_us,
            picture=f"data:image/png;base64,{base64.b64encode(_small(picture)).decode()}",
        )
        if opened.is_long:
            return summary
        metrics = RunMetrics.of(analyzed_session(opened.session, on_progress=on_progress))
    except SpinscopeError as error:
        return RecordingSummary(error=str(error))
    except Exception as error:  # noqa: BLE001  # whatever one file does, the others are listed
        return RecordingSummary(error=f"{type(error).__name__}: {error}")
    best = metrics.main_shot
    spin = metrics.no_shot_reason if best is None else best.sentence
    if best is not None and best.best_reason is not None:
        spin = f"{best.sentence}: {best.best_reason}"
    return summary.model_copy(update={"shots": len(metrics.shots), "spin": spin})


def _small(picture: bytes) -> bytes:
    """PNG of a picture at the width of the list."""
    image = cv2.imdecode(np.frombuffer(picture, np.uint8), cv2.IMREAD_GRAYSCALE)
    assert image is not None
    height_px = max(round(image.shape[0] * PICTURE_PX / image.shape[1]), 1)
    return bytes(cv2.imencode(".png", cv2.resize(image, (PICTURE_PX, height_px), interpolation=cv2.INTER_AREA))[1])
