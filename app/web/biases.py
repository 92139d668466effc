"""Biases: a simulated scene again with another sensor setting, and what each bias does to noise and ball.

A finished recording of a real camera cannot be taken again: for it the biases are shown and locked.
"""

from __future__ import annotations

import json
import secrets
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spinscope.pipeline.biases import CURVES, BiasParameters, read_biases, write_biases
from spinscope.pipeline.errors import ParameterError, RecordingError, SpinscopeError
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.recordings import open_recording, readable_suffixes
from spinscope.pipeline.registry import Parameters
from spinscope.pipeline.session import AnyRecording
from spinscope.pipeline.simulated_recordings import BIASES, DESCRIPTION, simulate_again_to_file
from spinscope.pipeline.simulator import simulate_again

from .bench import Bench, Clip
from .jobs import Job

NOISE, HOT, EDGE, LOGO = 0, 4, 1, 2  # labels of the simulator's truth
MOST_POINTS = 25
# "Pixel sensitivity" in the paper's supplement: both thresholds at once.
TOGETHER = {"diff_on_off": ("diff_on", "diff_off")}
# Events this far outside the tracked outline still belong to the ball: its blurred edge and late pixels.
BESIDE_PX = 3.0


def scene_of(recording: AnyRecording) -> dict[str, Any] | None:
    """What it takes to simulate the recording again; None where it carries no scene."""
    try:
        description = json.loads(str(recording.attributes.get(DESCRIPTION, "null")))
    except json.JSONDecodeError:
        return None
    return description if isinstance(description, dict) else None


def state_of(recording: AnyRecording) -> dict[str, Any]:
    """For the page: the biases' declarations and values, whether they can be changed, and if not why."""
    values, locked = None, None
    beside = recording.path.with_suffix(".bias")
    try:
        if BIASES in recording.attributes:
            values = BiasParameters().with_values(json.loads(str(recording.attributes[BIASES]))).as_dict()
        elif beside.is_file():
            values = read_biases(beside).as_dict()
    except (SpinscopeError, json.JSONDecodeError, TypeError):
        values = None
    if scene_of(recording) is None:
        locked = (
            "This recording carries no scene: biases act in the camera while it records and cannot be changed "
            "afterwards. `spinscope simulate` makes recordings that can be taken again."
        )
    return {
        "values": values or BiasParameters().as_dict(),
        "known": values is not None,
        "locked": locked,
        "calibrated": all(curve.calibrated for curve in CURVES.values()),
        "ranges": {
            name: {"low": declared.low, "high": declared.high, "default": declared.default, "help": declared.help}
            for name, declared in BiasParameters.tunables().items()
        },
    }


def taken_again(job: Job, bench: Bench, biases: BiasParameters, folder: Path) -> Path:
    """Simulate the bench's scene with other biases into the folder; returns the new recording's path."""
    name = bench.original.stem
    bias_path = folder / f"{secrets.token_hex(4)}.bias"
    write_biases(biases, bias_path)
    target = folder / f"{bias_path.stem}-{name}.h5"

    def tell(share: float, _: str) -> None:
        job.check()
        job.tell(share=share)

    tell(0.0, "")
    simulate_again_to_file(bench.original, target, biases=biases, on_progress=tell)
    return target


def bias_curve(job: Job, bench: Bench, biases: BiasParameters, name: str, points: int) -> dict[str, Any]:
    """Noise and ball event rate, ON and OFF, against one bias, all else as given; told point by point."""
    names = TOGETHER.get(name, (name,))
    declared = BiasParameters.tunables()
    if not set(names) <= set(declared):
        raise ParameterError(f"bias {name!r} is unknown: there are {', '.join([*declared, *TOGETHER])}")
    low, high = max(declared[one].low or 0 for one in names), min(declared[one].high or 0 for one in names)
    if not 2 <= points <= MOST_POINTS:
        raise ParameterError(f"{points} points are out of range: 2 to {MOST_POINTS}")
    description = scene_of(open_recording(bench.original))
    if description is None:
        raise RecordingError("the recording carries no scene that could be simulated again")
    values = sorted({int(value) for value in np.rint(np.linspace(low, high, points))})
    found: list[dict[str, Any]] = []
    content = {"name": name, "total": len(values), "points": found, "source": "simulated"}
    job.tell(**content)
    for value in values:
        sensor = biases.with_values(dict.fromkeys(names, value))
        made = simulate_again(description, sensor=sensor, progress=lambda _: job.check())
        is_ball = np.isin(made.truth.label, (EDGE, LOGO))
        seconds = float(description["scene"]["duration_s"])
        is_noise = np.isin(made.truth.label, (NOISE, HOT))
        found.append({"value": value, **_rates(made.events, is_ball, is_noise, seconds)})
        job.tell(**{**content, "points": list(found)})
    return content


def measured_curve(
    job: Job, bench: Bench, parameters: Parameters, own_biases: BiasParameters | None = None
) -> dict[str, Any]:
    """The same rates from the folder's recordings whose biases are known: stated in them, or by NAME.bias beside.

    own_biases : those of the bench's recording, where the user knows better
    """
    known = {path: values for path in sorted(bench.original.parent.iterdir()) if (values := known_biases(path))}
    if own_biases is not None:
        known[bench.original] = own_biases
    if not known:
        raise RecordingError(
            "no recording of this folder has a .bias file of its own name beside it: put NAME.bias beside NAME.raw, "
            "or load the .bias file that this recording was taken with"
        )
    found: list[dict[str, Any]] = []
    content = {"name": None, "total": len(known), "points": found, "source": "recorded"}
    job.tell(**content)
    for path, biases in known.items():
        job.check()
        try:
            taken = Bench.open(path, bench.choices if path == bench.original else bench.choices.for_others)
            clip = taken.clip(*taken.first_clip_us())
            is_ball = _on_ball(job, clip, parameters)
        except SpinscopeError as error:
            found.append({"recording": path.name, "error": str(error)})
            continue
        events = clip.session.source.events
        seconds = (clip.window_us[1] - clip.window_us[0]) * 1e-6
        found.append({"recording": path.name, "biases": biases.as_dict(), **_rates(events, is_ball, ~is_ball, seconds)})
        job.tell(**{**content, "points": list(found)})
    return content


def known_biases(path: Path) -> BiasParameters | None:
    """The biases a recording states or has in a .bias file of its name beside it; None for none, or no recording."""
    if path.suffix.lower() not in readable_suffixes() or not path.is_file():
        return None
    beside = path.with_suffix(".bias")
    try:
        if beside.is_file():
            return read_biases(beside)
        stated = open_recording(path).attributes.get(BIASES)
        return None if stated is None else BiasParameters().with_values(json.loads(str(stated)))
    except (SpinscopeError, json.JSONDecodeError, TypeError):
        return None


def _rates(
    events: EventBatch, is_ball: NDArray[np.bool_], is_noise: NDArray[np.bool_], seconds: float
) -> dict[str, float]:
    """Events a second of the whole sensor."""
    return {
        "ball_on_hz": float(np.count_nonzero(is_ball & events.on)) / seconds,
        "ball_off_hz": float(np.count_nonzero(is_ball & ~events.on)) / seconds,
        "noise_on_hz": float(np.count_nonzero(is_noise & events.on)) / seconds,
        "noise_off_hz": float(np.count_nonzero(is_noise & ~events.on)) / seconds,
    }


def _on_ball(job: Job, clip: Clip, parameters: Parameters) -> NDArray[np.bool_]:
    """Which of the clip's events lie on the tracked ball or just beside it."""
    marks = [np.empty(0, np.bool_)]
    for step in clip.run(parameters, ("track",)):
        job.check()
        events, ball = step.tick.packet.events, step.tick.track.ball
        if ball is None:
            marks.append(np.zeros(len(events), np.bool_))
            continue
        x, y = ball.centre_px(events.t_us)
        distance_px = np.hypot(events.x_px - x, events.y_px - y)
        marks.append(distance_px <= ball.mean[4] + BESIDE_PX)
    return np.concatenate(marks)
