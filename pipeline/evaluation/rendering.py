"""Simulated recordings for the suites, rendered once and kept on disk."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path

from ..biases import PAPER, BiasParameters
from ..chain import EventsInMemory
from ..errors import RecordingError
from ..events import EventBatch
from ..recordings import open_recording, write_recording
from ..results import Truth
from ..simulator import Scene, SensorModel, simulate_scene
from .tasks import TaskContext, digest, text_digest


@dataclass(frozen=True, eq=False)
class RenderedRecording:
    """A simulated recording in memory.

    Attributes
    ----------
    identity : str
        Digest of scene, biases, seed and the simulator's code.
    events : EventBatch
    truth : Truth
    width_px, height_px, duration_us : int
    """

    identity: str
    events: EventBatch
    truth: Truth
    width_px: int
    height_px: int
    duration_us: int

    @property
    def source(self) -> EventsInMemory:
        """All events, as the chain takes them."""
        return EventsInMemory(self.identity, self.events, self.width_px, self.height_px, 0, self.duration_us)


def render(context: TaskContext, scene: Scene, *, seed: int, biases: BiasParameters = PAPER) -> RenderedRecording:
    """The scene before the paper's camera at these biases, from the cache where it is there."""
    sensor = asdict(SensorModel.of(biases))
    identity = digest([scene.to_dict(), sensor, seed, text_digest("simulator")])
    duration_us = round(scene.duration_s * 1e6)
    place = None if context.cache is None else context.cache / "recordings" / f"{identity}.h5"
    if place is not None and place.exists():
        try:
            recording = open_recording(place)
            events, truth = recording.read(), recording.truth
            if truth is not None and truth.label.size == len(events):
                return RenderedRecording(identity, events, truth, recording.width_px, recording.height_px, duration_us)
        except RecordingError:
            pass  # damaged: rendered anew below
    made = simulate_scene(scene, sensor=biases, seed=seed)
    if place is not None:
        _keep(place, made.events, made.truth, made.width_px, made.height_px)
    return RenderedRecording(identity, made.events, made.truth, made.width_px, made.height_px, duration_us)


def _keep(place: Path, events: EventBatch, truth: Truth, width_px: int, height_px: int) -> None:
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordingError(f"the cache cannot be written ({error.strerror}): {place.parent}") from error
    write_recording(place, events, width_px=width_px, height_px=height_px, truth=truth)
