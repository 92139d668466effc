"""Recording of a table's edges before a camera whose place is known, for tests of its marking."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from spinscope.pipeline.calibration.table_pose import LENGTH_M, WIDTH_M
from spinscope.pipeline.camera import Camera
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.kernels.rotation import rotations
from spinscope.pipeline.recordings import write_recording
from spinscope.pipeline.registry import Parameters

SIZE_PX = 1280, 720
EVENTS = 40_000
CORNERS_M = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]) * (LENGTH_M / 2, WIDTH_M / 2, 0.0)
TURN = rotations(np.array([2.3, 0.1, -0.05]))[0]  # looks down on the table at a slant
MIDDLE_M = np.array([0.1, 0.2, 5.5])


def camera() -> Camera:
    """The camera that recordings without any statement are taken to be made by."""
    return Camera.of(Parameters().camera, *SIZE_PX)


def corners_px() -> NDArray[np.float64]:
    """(4, 2) columns and rows of the corners."""
    return camera().project(CORNERS_M @ TURN.T + MIDDLE_M)


def write_table_recording(path: Path) -> None:
    """Write events along the edges of the table."""
    random = np.random.default_rng(1)
    edge, share = random.integers(0, 4, EVENTS), random.random(EVENTS)[:, None]
    corners = corners_px()
    places = np.rint((1 - share) * corners[edge] + share * np.roll(corners, -1, axis=0)[edge])
    x_px, y_px = places.T.astype(np.uint16)
    t_us = np.sort(random.integers(0, 500_000, EVENTS))
    events = EventBatch(t_us, x_px, y_px, random.random(EVENTS) < 0.5)
    write_recording(path, events, width_px=SIZE_PX[0], height_px=SIZE_PX[1])
