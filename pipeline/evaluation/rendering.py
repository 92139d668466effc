"""Simulated recordings for the suites, rendered once and kept on disk."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import asdict, replace

from ..biases import PAPER, BiasParameters
from ..camera import Camera, CameraParameters
from ..errors import RecordingError
from ..recordings import open_recording
from ..simulated_recordings import description_in, write_simulation
from ..simulator import Lens, Scene, SensorModel, SimulatedRecording, default_camera, simulate_scene
from .tasks import TaskContext, digest, make_folder, text_digest


def camera_of(context: TaskContext) -> Camera:
    """The paper's camera, with the lens that the user chose."""
    lens_mm = context.scene.lens_mm
    if lens_mm is None:
        return default_camera()
    return replace(default_camera(), focal_px=lens_mm * 1000.0 / CameraParameters().pixel_um)


def render(
    context: TaskContext,
    scene: Scene,
    *,
    seed: int,
    sensor: SensorModel | BiasParameters = PAPER,
    camera: Camera | None = None,
    lens: Lens | None = None,
) -> SimulatedRecording:
    """The scene before a camera (`camera_of` by default), from the cache where it is there."""
    camera, lens = camera or camera_of(context), lens or Lens()
    if context.cache is None:
        return simulate_scene(scene, camera=camera, sensor=sensor, lens=lens, seed=seed)
    array = SensorModel.of(sensor) if isinstance(sensor, BiasParameters) else sensor
    parts = [scene.to_dict(), asdict(camera), asdict(array), asdict(lens)]
    identity = digest([*parts, seed, text_digest("simulator")])
    place = context.cache / "recordings" / f"{identity}.h5"
    if place.exists():
        with suppress(RecordingError):  # damaged: rendered anew below
            kept = open_recording(place)
            events, truth, description = kept.read(), kept.truth, description_in(kept.attributes)
            if truth is not None and description is not None and truth.label.size == len(events):
                return SimulatedRecording(events, truth, kept.width_px, kept.height_px, scene, description)
    made = simulate_scene(scene, camera=camera, sensor=sensor, lens=lens, seed=seed)
    make_folder(place.parent)
    write_simulation(made, place)
    return made
