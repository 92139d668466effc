"""Biases of the sensor: re-simulation of a scene with others, and event rates of ball and noise against one bias.

The biases of a real recording act in the camera while it records: they are shown, and cannot be changed afterwards.
"""

from __future__ import annotations

import json
import secrets
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spinscope.pipeline.biases import CURVES, BiasParameters
from spinscope.pipeline.errors import ParameterError, RecordingError, SpinscopeError
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.recordings import is_recording, open_recording
from spinscope.pipeline.recordings.source import AnyRecording
from spinscope.pipeline.registry import Parameters
from spinscope.pipeline.session import Session
from spinscope.pipeline.sidecar import biases_beside
from spinscope.pipeline.simulated_recordings import BIASES, description_in, simulate_again_to_file
from spinscope.pipeline.simulator import simulate_again

NOISE, HOT, EDGE, LOGO = 0, 4, 1, 2  # labels of the simulator's truth
MOST_POINTS = 25
# Events this far outside the tracked outline still belong to the ball: its blurred edge and late pixels.
BESIDE_PX = 3.0


@dataclass(frozen=True, slots=True)
class SweptBias:
    """Subject of one sweep: one bias, or several together."""

    name: str
    label: str
    biases: list[str]


# Both thresholds at once are the "pixel sensitivity" of the paper's supplement.
SWEPT = (
    SweptBias("diff_on_off", "diff_on = diff_off", ["diff_on", "diff_off"]),
    *(SweptBias(name, name, [name]) for name in BiasParameters.tunables()),
)


@dataclass(frozen=True, slots=True)
class BiasRange:
    """Declaration of one bias."""

    low: float
    high: float
    default: float
    help: str


@dataclass(frozen=True, slots=True)
class BiasState:
    """Biases of a recording.

    Attributes
    ----------
    values : dict
        Biases it was recorded with; the paper's where they are not known.
    known : bool
        Whether the recording or a .bias file beside it states them.
    locked : str or None
        Why they cannot be changed; None where they can.
    calibrated : bool
        Whether their meaning in physical units is calibrated.
    of_camera : bool
        Whether they are those of a running camera, which a change acts on unless they are locked.
    """

    values: dict[str, int]
    known: bool
    locked: str | None
    calibrated: bool
    ranges: dict[str, BiasRange]
    swept: list[SweptBias]
    of_camera: bool = False


@dataclass(frozen=True, slots=True)
class BiasSweepPoint:
    """Event rates with one setting, of the whole sensor; only `error` where a recording could not be used."""

    value: int | None = None
    recording: str | None = None
    biases: dict[str, int] = field(default_factory=dict)
    error: str | None = None
    ball_on_hz: float | None = None
    ball_off_hz: float | None = None
    noise_on_hz: float | None = None
    noise_off_hz: float | None = None


@dataclass(frozen=True, slots=True)
class BiasSweep:
    """The points of a sweep so far: over one bias (`name`), or of recordings whose biases are known.

    `proposal` says in words what the sweep of a camera proposes.
    """

    name: str | None
    total: int
    points: list[BiasSweepPoint]
    proposal: str | None = None


@dataclass(frozen=True, slots=True)
class Resimulation:
    """Progress of a re-simulation with these biases, as the share done."""

    share: float
    biases: dict[str, int]


def bias_state(recording: AnyRecording) -> BiasState:
    """Biases of an open recording with their declarations."""
    values = known_biases(recording.path, recording)
    locked = None
    if description_in(recording.attributes) is None:
        locked = (
            "This recording carries no scene: biases act in the camera while it records and cannot be changed "
            "afterwards. Recordings made by `spinscope simulate` can be simulated again with other biases."
        )
    return BiasState(
        values=(values or BiasParameters()).as_dict(),
        known=values is not None,
        locked=locked,
        calibrated=all(curve.calibrated for curve in CURVES.values()),
        ranges={
            name: BiasRange(declared.low or 0, declared.high or 0, declared.default, declared.help)
            for name, declared in BiasParameters.tunables().items()
        },
        swept=list(SWEPT),
    )


def known_biases(path: Path, recording: AnyRecording | None = None) -> BiasParameters | None:
    """Biases that a recording has in a sidecar, or states itself; None where it has none or is unreadable."""
    if not is_recording(path):
        return None
    try:
        beside = biases_beside(path)
        if beside is not None:
            return beside
        stated = (recording or open_recording(path)).attributes.get(BIASES)
        return None if stated is None else BiasParameters().with_values(json.loads(str(stated)))
    except (SpinscopeError, ValueError, TypeError, RecursionError):
        return None


def resimulate(
    original: Path,
    biases: BiasParameters,
    folder: Path,
    report: Callable[[Resimulation], None],
    check: Callable[[], None],
) -> Path:
    """Simulate the scene of a recording with other biases.

    Parameters
    ----------
    original : Path
        Simulated recording with its scene.
    folder : Path
        Where the new recording goes.
    report, check : callable
        See `parameter_sweep.sweep`.

    Returns
    -------
    Path
        The new recording.
    """
    target = folder / f"{secrets.token_hex(4)}-{original.stem}.h5"

    def progress(share: float, _: str) -> None:
        check()
        report(Resimulation(share, biases.as_dict()))

    progress(0.0, "")
    simulate_again_to_file(original, target, biases=biases, on_progress=progress)
    return target


def sweep_bias(
    original: Path,
    biases: BiasParameters,
    name: str,
    points: int,
    report: Callable[[BiasSweep], None],
    check: Callable[[], None],
) -> BiasSweep:
    """Simulate the scene of a recording over the range of one of SWEPT, all other biases fixed."""
    swept = next((one for one in SWEPT if one.name == name), None)
    if swept is None:
        raise ParameterError(f"bias {name!r} is unknown: there are {', '.join(one.name for one in SWEPT)}")
    declared = [BiasParameters.tunables()[one] for one in swept.biases]
    low, high = max(one.low or 0 for one in declared), min(one.high or 0 for one in declared)
    if not 2 <= points <= MOST_POINTS:
        raise ParameterError(f"{points} points are out of range: 2 to {MOST_POINTS}")
    description = description_in(open_recording(original).attributes)
    if description is None:
        raise RecordingError("the recording carries no scene that could be simulated again")
    values = sorted({int(value) for value in np.rint(np.linspace(low, high, points))})
    found: list[BiasSweepPoint] = []
    report(BiasSweep(name, len(values), []))
    for value in values:
        sensor = biases.with_values(dict.fromkeys(swept.biases, value))
        made = simulate_again(description, sensor=sensor, on_progress=lambda _share, _what: check())
        is_ball, is_noise = (np.isin(made.truth.label, labels) for labels in ((EDGE, LOGO), (NOISE, HOT)))
        rates = _rates(made.events, is_ball, is_noise, float(description["scene"]["duration_s"]))
        found.append(BiasSweepPoint(value=value, **rates))
        report(BiasSweep(name, len(values), list(found)))
    return BiasSweep(name, len(values), found)


def measure_folder(
    original: Path,
    own_biases: BiasParameters | None,
    parameters: Parameters,
    open_clip: Callable[[Path], Session],
    report: Callable[[BiasSweep], None],
    check: Callable[[], None],
) -> BiasSweep:
    """Measure event rates of the recordings of a folder whose biases are known.

    Parameters
    ----------
    original : Path
        Recording whose folder it is.
    own_biases : BiasParameters or None
        Biases of `original`, where the user knows better.
    open_clip : callable
        Opens a recording and returns the clip to measure; may raise SpinscopeError.
    """
    known = {path: values for path in sorted(original.parent.iterdir()) if (values := known_biases(path))}
    if own_biases is not None:
        known[original] = own_biases
    if not known:
        raise RecordingError(
            "no recording of this folder has a .bias file of its own name beside it: put NAME.bias beside NAME.raw, "
            "or load the .bias file that this recording was recorded with"
        )
    found: list[BiasSweepPoint] = []
    report(BiasSweep(None, len(known), []))
    for path, biases in known.items():
        check()
        try:
            clip = open_clip(path)
            is_ball = _on_ball(clip, parameters, check)
        except SpinscopeError as error:
            found.append(BiasSweepPoint(recording=path.name, error=str(error)))
            continue
        seconds = (clip.source.end_us - clip.source.start_us) * 1e-6
        rates = _rates(clip.source.between(clip.source.start_us, clip.source.end_us), is_ball, ~is_ball, seconds)
        found.append(BiasSweepPoint(recording=path.name, biases=biases.as_dict(), **rates))
        report(BiasSweep(None, len(known), list(found)))
    return BiasSweep(None, len(known), found)


def _rates(
    events: EventBatch, is_ball: NDArray[np.bool_], is_noise: NDArray[np.bool_], seconds: float
) -> dict[str, Any]:
    kinds, polarities = {"ball": is_ball, "noise": is_noise}, {"on": events.on, "off": ~events.on}
    return {
        f"{kind}_{polarity}_hz": float(np.count_nonzero(of_kind & of_polarity)) / seconds
        for kind, of_kind in kinds.items()
        for polarity, of_polarity in polarities.items()
    }


def _on_ball(clip: Session, parameters: Parameters, check: Callable[[], None]) -> NDArray[np.bool_]:
    """Whether each event of the clip lies on the tracked ball or just beside it."""
    marks = [np.empty(0, np.bool_)]
    for tick in clip.chain.run(parameters, ("track",)):
        check()
        events, ball = tick.packet.events, tick.track.ball
        if ball is None:
            marks.append(np.zeros(len(events), np.bool_))
            continue
        x, y = ball.centre_px(events.t_us)
        distance_px = np.hypot(events.x_px - x, events.y_px - y)
        marks.append(distance_px <= ball.mean[4] + BESIDE_PX)
    return np.concatenate(marks)
