"""Pictures of the camera beneath the events."""

from __future__ import annotations

import dataclasses

import numpy as np

from spinscope.app.viewer import entities as at
from spinscope.app.viewer.drawers import run_chunks
from spinscope.app.viewer.run import ViewedRun
from spinscope.pipeline.recordings import CameraFrame


def test_pictures_of_the_camera_stand_beneath_the_events_at_their_exposure(flight: ViewedRun) -> None:
    assert not [chunk for chunk in run_chunks(flight) if chunk.entity_path == at.CAMERA_FRAMES]
    times_us = [flight.start_us + 20_000, flight.start_us + 60_000]
    frames = [CameraFrame(t_us, 40, 30, np.full((50, 60), 90, np.uint8)) for t_us in times_us]
    pictured = dataclasses.replace(flight, frames=frames)
    static, timed = (chunk for chunk in run_chunks(pictured) if chunk.entity_path == at.CAMERA_FRAMES)
    assert static.is_static and not timed.is_static
    batch = timed.to_record_batch()
    assert (batch.column(at.TIMELINE).cast("int64").to_numpy() / 1000).tolist() == times_us
    (corner,) = static.to_record_batch().column("Transform3D:translation").to_pylist()
    assert np.allclose(corner, [[39.5, 29.5, 0.0]])
