"""Video of a real frame camera: its pictures and their times."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import RecordingError
from ..isolation import IsolationError, iterate, without_time_limit
from ..text_table import table_rows

SUFFIXES = (".mp4", ".avi", ".mkv", ".mov")
TIMES = "times.csv"  # beside the video
# A lower rate is that of a slow motion's playback, or of a camera that sees no ball turn: at 50 rps it turns by half
# between two frames.
LEAST_RATE_HZ = 100.0
MOST_BYTES = 1_000_000_000  # of all pictures: 480 of 1920x1080, of which a flight of 0.2 s needs a fifth


def read_video(path: Path) -> tuple[NDArray[np.float64], list[NDArray[np.uint8]]]:
    """Times and pictures of a video.

    Parameters
    ----------
    path : Path
        With the times of its pictures in TIMES beside it: a column `t_us`, a row a picture. Without that file the
        video's own frame rate is taken.

    Returns
    -------
    (n,) float64
        Times, us.
    list of (height, width) uint8
        Brightness.

    Raises
    ------
    RecordingError
        The video cannot be read, is too long, or its times are not known.
    """
    pictures: list[NDArray[np.uint8]] = []
    rate_hz, size_bytes = 0.0, 0
    try:
        for stated_hz, picture in iterate(_frames, str(path)):
            rate_hz = stated_hz
            size_bytes += picture.nbytes
            if size_bytes > MOST_BYTES:
                raise RecordingError(f"the video is too long: cut it to the flight of its recording: {path}")
            pictures.append(picture)
    except (IsolationError, RuntimeError) as error:
        raise RecordingError(f"the video cannot be read ({str(error).splitlines()[-1]}): {path}") from error
    if not pictures:
        raise RecordingError(f"this is no video, or a damaged one: {path}")
    return _times_us(path, len(pictures), rate_hz), pictures


def _times_us(path: Path, count: int, rate_hz: float) -> NDArray[np.float64]:
    table = path.with_name(TIMES)
    if not table.is_file():
        if not LEAST_RATE_HZ <= rate_hz < math.inf:
            raise RecordingError(
                f"the times of the video's pictures are not known: it states {rate_hz:g} frames a second, which is "
                f"that of a playback; put {TIMES} beside it, with a column t_us and {count} rows, one a picture: {path}"
            )
        return np.arange(count) / rate_hz * 1e6
    try:
        times = np.array([float(row["t_us"]) for row in table_rows(table)[1]])
    except (KeyError, ValueError):
        raise RecordingError(f"the times of a video are a CSV with a column t_us of numbers: {table}") from None
    if times.size != count:
        raise RecordingError(f"{times.size} times are stated of the {count} pictures of {path.name}: {table}")
    if not (np.diff(times) > 0).all():
        raise RecordingError(f"the times of a video grow from row to row: {table}")
    return times


def _frames(path: str) -> Iterator[tuple[float, NDArray[np.uint8]]]:
    """Stated frame rate and brightness of each picture; none where this is no video."""
    with without_time_limit():
        import cv2

    video = cv2.VideoCapture(path)
    rate_hz = float(video.get(cv2.CAP_PROP_FPS))
    while True:
        is_there, picture = video.read()
        if not is_there:
            return
        yield rate_hz, np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), np.uint8)
