"""Simulated recordings for the suites, rendered once and kept on disk."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import asdict

from ..biases import PAPER, BiasParameters
from ..errors import RecordingError
from ..recordings import open_recording
from ..simulated_recordings import description_in, write_simulation
from ..simulator import Scene, SensorModel, SimulatedRecording, simulate_scene
from .tasks import TaskContext, digest, make_folder, text_digest


def render(context: TaskContext, scene: Scene, *, seed: int, biases: BiasParameters = PAPER) -> SimulatedRecording:
    """The scene before the paper's camera at these biases, from the cache where it is there."""
    if context.cache is None:
        return simulate_scene(scene, sensor=biases, seed=seed)
    identity = digest([scene.to_dict(), asdict(SensorModel.of(biases)), seed, text_digest("simulator")])
    place = context.cache / "recordings" / f"{identity}.h5"
    if place.exists():
        with suppress(RecordingError):  # damaged: rendered anew below
            kept = open_recording(place)
            events, truth, description = kept.read(), kept.truth, description_in(kept.attributes)
            if truth is not None and description is not None and truth.label.size == len(events):
                return SimulatedRecording(events, truth, kept.width_px, kept.height_px, scene, description)
    made = simulate_scene(scene, sensor=biases, seed=seed)
    make_folder(place.parent)
    write_simulation(made, place)
    return made
