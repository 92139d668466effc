"""Training set for learned estimators: windows of logo events on the ball with the true spin, from the simulator.

Every sample is what a spin method gets of a window of a few milliseconds: each event's age, polarity and place on the
ball, by the track of the pipeline or, on a spinner, by a circle with the error of a measured one.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..errors import ParameterError
from ..files import atomic_file
from ..simulator import SimulatedRecording, human_shot, spinner
from ..tick import Tick
from .estimation import chain_over
from .rendering import camera_of, render
from .suites.spinner import known_circle
from .tables import Row
from .tasks import Progress, Task, TaskContext, make_folder, run, text_digest, write_whole
from .workers import TaskWorkers

RECORDINGS_A_SHARD = 8
WINDOWS_A_RECORDING = 32
WINDOWS_US = (3000, 5000, 10_000)
FEWEST_EVENTS = 30  # as the methods ask of a visible logo
SPINNER_MS = 50
LOWEST_RPS, HIGHEST_RPS = 5.0, 150.0
SCENE_SEEDS = 1 << 40  # drawn from so many, so that no suite's are among them
README = """\
# Training set of Spinscope's simulator

Made by `spinscope evaluate dataset`; the same command with the same numbers makes it again, event by event. Half of the
recordings are of a ball on a spinner (balls 1 to 7; axes evenly over all directions, so that none is likelier than
another; {lowest:g} to {highest:g} rps, evenly in the logarithm), half are flights as people play them. Windows of
{windows} ms end at random times; those with fewer than {fewest} logo events are left out. The events are those that
contrast takes: without the moving outline's, with those of the rim that cannot be the outline's.

`shard_NNNN.npz`, of n samples with m events together:

| array | shape and type | meaning |
|---|---|---|
| `first` | (n + 1,) int64 | the events of sample i are first[i] to first[i + 1] |
| `age_us` | (m,) int32 | time from the event to the window's end |
| `on` | (m,) bool | polarity |
| `normal` | (m, 3) float32 | outward unit normal of the ball where the event is, camera frame |
| `window_us` | (n,) int32 | length of the window |
| `radius_px` | (n,) float32 | radius of the ball in the image |
| `sight` | (n, 3) float32 | unit vector from the camera to the ball |
| `spin_rps` | (n, 3) float32 | truth, camera frame |
| `seed` | (n,) int64 | of the recording: keep recordings together when you split the set |
"""


@dataclass(slots=True)
class Samples:
    """Samples so far, array by array as in README."""

    counts: list[int] = field(default_factory=list)
    columns: dict[str, list[NDArray[Any]]] = field(default_factory=dict)

    def add(self, **arrays: NDArray[Any]) -> None:
        """One sample's arrays: those of its events (m, ...) and its own (1, ...)."""
        self.counts.append(len(arrays["age_us"]))
        for name, array in arrays.items():
            self.columns.setdefault(name, []).append(array)

    def arrays(self) -> dict[str, Any]:
        """All samples together."""
        first = np.concatenate([[0], np.cumsum(self.counts)]).astype(np.int64)
        return {"first": first, **{name: np.concatenate(parts) for name, parts in self.columns.items()}}


def write_training_set(
    folder: Path,
    context: TaskContext,
    *,
    shards: int = 16,
    seed: int = 0,
    workers: TaskWorkers | None = None,
    on_progress: Progress | None = None,
) -> list[Row]:
    """Write the shards of a training set and what they hold; one row a shard.

    Parameters
    ----------
    folder : Path
        For the shards, README.md and set.json.
    context : TaskContext
        Parameters of the pipeline that places the events.
    shards : int
        Number of files, of RECORDINGS_A_SHARD recordings each.
    seed : int
        Another one gives another set.
    workers, on_progress
        As of `tasks.run`.

    Raises
    ------
    ParameterError
        For no shards, or a negative seed.
    RecordingError
        Where the folder cannot be written.
    """
    if shards < 1 or seed < 0:
        raise ParameterError(f"{shards} shards with seed {seed} are no training set: give 1 or more, and a seed from 0")
    make_folder(folder)
    tasks = [
        Task(write_shard, {"folder": str(folder.absolute()), "shard": shard, "seed": seed}, keep=False)
        for shard in range(shards)
    ]
    rows = run(tasks, context, workers, on_progress)
    windows = ", ".join(f"{us / 1000:g}" for us in WINDOWS_US)
    about = README.format(lowest=LOWEST_RPS, highest=HIGHEST_RPS, windows=windows, fewest=FEWEST_EVENTS)
    write_whole(folder / "README.md", about)
    stated = {"seed": seed, "shards": rows, "code": text_digest(""), "parameters": context.parameters.as_dict()}
    write_whole(folder / "set.json", json.dumps(stated, indent=1) + "\n")
    return rows


def write_shard(context: TaskContext, folder: str, shard: int, seed: int) -> list[Row]:
    """Simulate the recordings of a shard and write their windows."""
    samples = Samples()
    for number in range(RECORDINGS_A_SHARD):
        add_recording(samples, context, shard * RECORDINGS_A_SHARD + number, seed)
    path = Path(folder) / f"shard_{shard:04}.npz"
    with atomic_file(path, "training set") as part, part.open("wb") as file:
        np.savez_compressed(file, **samples.arrays())
    return [{"shard": path.name, "samples": len(samples.counts), "events": sum(samples.counts)}]


def add_recording(samples: Samples, context: TaskContext, number: int, seed: int) -> None:
    """Simulate a recording, a spinner's or a flight by turns, and take windows of it."""
    random = np.random.default_rng([number, seed])
    scene_seed = int(random.integers(SCENE_SEEDS))
    parameters, camera = context.parameters, camera_of(context)
    if number % 2:
        scene = human_shot(camera=camera, seed=scene_seed)
    else:
        rps = math.exp(random.uniform(math.log(LOWEST_RPS), math.log(HIGHEST_RPS)))
        axis, ball = random.standard_normal(3), int(random.integers(1, 8))
        spin_rps = rps * axis / np.linalg.norm(axis)
        scene = spinner(ball=ball, spin_rps=spin_rps.tolist(), duration_ms=SPINNER_MS, seed=scene_seed)
    recording = render(context, scene, seed=scene_seed)
    if not number % 2:
        parameters = parameters.with_values({"track": known_circle(recording.truth, scene_seed)})
    shots: dict[int, list[Tick]] = {}
    for tick in chain_over(recording).run(parameters, ("logo",), forget=("filter", "surface")):
        if tick.balls:
            shots.setdefault(tick.balls[0].track.shot, []).append(tick)
    ticks = max(shots.values(), key=len, default=[])
    if ticks:
        _add_windows(samples, recording, camera, ticks, random, scene_seed)


def _add_windows(
    samples: Samples,
    recording: SimulatedRecording,
    camera: Camera,
    ticks: Sequence[Tick],
    random: np.random.Generator,
    seed: int,
) -> None:
    """Take windows of a shot that end at random times."""
    turning = [tick.logo.turning for tick in ticks]
    names = ("t_us", "on", "normals", "centre_x_px", "centre_y_px")
    t_us, on, normals, x_px, y_px = (np.concatenate([getattr(part, name) for part in turning]) for name in names)
    rays = camera.rays(x_px, y_px)
    ends_us = np.array([tick.packet.end_us for tick in ticks])
    start_us = ticks[0].packet.start_us
    for _ in range(WINDOWS_A_RECORDING):
        window_us = int(random.choice(WINDOWS_US))
        end_us = int(random.integers(start_us, ends_us[-1] + 1))
        first, last = np.searchsorted(t_us, [end_us - window_us, end_us])
        if end_us - window_us < start_us or last - first < FEWEST_EVENTS:
            continue
        tick = ticks[min(int(np.searchsorted(ends_us, end_us)), len(ticks) - 1)]
        sight = (rays[first:last] / np.linalg.norm(rays[first:last], axis=1)[:, None]).mean(axis=0)
        truth = recording.truth
        spin = [np.interp(end_us - window_us / 2, truth.t_us, truth.spin_rps[:, axis]) for axis in range(3)]
        samples.add(
            age_us=(end_us - t_us[first:last]).astype(np.int32),
            on=on[first:last],
            normal=normals[first:last].astype(np.float32),
            window_us=np.array([window_us], np.int32),
            radius_px=np.array([tick.logo.radius_px], np.float32),
            sight=(sight / np.linalg.norm(sight)).astype(np.float32)[None],
            spin_rps=np.array([spin], np.float32),
            seed=np.array([seed], np.int64),
        )
