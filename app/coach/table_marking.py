"""Marking of the table: a picture of a recording's events, and the camera's place by the corners marked in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from spinscope.pipeline.calibration.table_pose import table_pose
from spinscope.pipeline.errors import ParameterError
from spinscope.pipeline.recordings import open_recording
from spinscope.pipeline.session import Choices, Session

from .session import ShotSession

PICTURE_US = 2_000_000  # of the recording's begin: players and lamps have shown the table's edges by then
BRIGHTEST_PERCENT = 99.5  # of the pixels with events; what is beyond, as hot pixels, is white, too


def marking_recordings(session: ShotSession) -> list[str]:
    """Recordings of a session that are still there, the newest first."""
    there = [path for path in session.recordings() if Path(path).is_file()]
    return sorted(there, key=lambda path: Path(path).stat().st_mtime, reverse=True)


def event_picture(session: ShotSession, recording: str, choices: Choices) -> bytes:
    """PNG (grey, of the sensor's size) of the events of a recording's begin; raises SpinscopeError."""
    import cv2  # 60 ms to load

    opened = open_recording(_known(session, recording), **asdict(choices.reading))
    counts = np.zeros(opened.height_px * opened.width_px)
    start_us = None
    for events in opened.chunks():
        counts += np.bincount(events.y_px.astype(np.int64) * opened.width_px + events.x_px, minlength=counts.size)
        start_us = int(events.t_us[0]) if start_us is None else start_us
        if events.t_us[-1] - start_us > PICTURE_US:
            break
    counts = np.log1p(counts)  # edges at rest have a hundredth of the events of what moves
    full = np.percentile(counts[counts > 0], BRIGHTEST_PERCENT) if counts.any() else 1.0
    grey = (255 * np.clip(counts / full, 0, 1)).astype(np.uint8).reshape(opened.height_px, opened.width_px)
    return bytes(cv2.imencode(".png", grey)[1])


def mark_table(
    session: ShotSession, recording: str, corners_px: Sequence[tuple[float, float]], choices: Choices
) -> dict[str, Any]:
    """Keep the camera's place over the table with a session, and return it.

    Parameters
    ----------
    recording : str
        Path of the recording that the corners are marked in; its camera is taken.
    corners_px : sequence of 4 (float, float)
        Columns and rows in order round the table.

    Returns
    -------
    dict
        `axes`: rows of the table's frame (along it, to the left, up) in that of the camera; `camera_m`: the camera's
        place from the middle of the net's line on the table; `recording`, `corners_px`; `off_px`: largest distance of a
        corner from where the pose puts it.

    Raises
    ------
    SpinscopeError
        Where the recording cannot be read, or the corners are no table of the official size.
    """
    camera = Session.open(_known(session, recording), choices).camera
    pose = table_pose(corners_px, camera)
    axes = np.stack([pose.along, np.cross(pose.up, pose.along), pose.up])
    kept = {
        "axes": axes.tolist(),
        "camera_m": (-axes @ pose.middle_m).tolist(),
        "recording": recording,
        "corners_px": [list(corner) for corner in corners_px],
        "off_px": pose.reprojection_px,
    }
    session.keep_setting("pose", kept)
    return kept


def _known(session: ShotSession, recording: str) -> Path:
    """Path of a recording of the session, never of another file; raises ParameterError."""
    if recording not in session.recordings():
        raise ParameterError(f"{Path(recording).name} is no recording of this session: choose one of the list")
    return Path(recording)
