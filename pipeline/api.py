"""Entry points for scripts and notebooks: the spin of the shots of a recording, the calibration of a set-up."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .errors import ParameterError
from .events import EventBatch
from .flight_calibration import FlightCalibration, estimate_with_measured_up, flight_calibration
from .recordings import ReadingOptions
from .recordings.in_memory import RecordingInMemory
from .recordings.source import AnyRecording
from .registry import Parameters
from .session import Choices, Progress, Result, Session, check_method
from .simulated_recordings import in_memory
from .simulator import SimulatedRecording


def estimate(
    recording: AnyRecording | SimulatedRecording | EventBatch | str | Path,
    parameters: Parameters | Mapping[str, Any] | Sequence[str] | None = None,
    *,
    preset: str | Path | None = None,
    method: str = "all",
    rivals: Sequence[str] = (),
    window_us: tuple[int, int] | None = None,
    fixed_ball: tuple[float, float, float] | str | None = None,
    sensor_px: tuple[int, int] | None = None,
    on_progress: Progress | None = None,
) -> Result:
    """Estimate track and spin of every shot in a recording.

    Parameters
    ----------
    recording : path, Recording, SimulatedRecording or EventBatch
        File of any format that `open_recording` reads, an opened recording, the result of `simulate`, or events in
        memory (then `sensor_px` says how large the sensor is).
    parameters : Parameters, mapping or sequence of str, optional
        All parameters, or changes to the preset: `{"logo": {"pad_px": 3.0}}`, `{"logo.pad_px": 3.0}` or
        `["logo.pad_px=3"]`. What the recording states of its camera is taken unless it is changed here; where nobody
        states `camera.up` and the balls do not fall against it, it is taken from how they fall, and
        `result.session.warnings` says so with its error. `Parameters` are taken as they are.
    preset : str or Path, optional
        `default`, `paper`, or a TOML file of [group] tables.
    method : str
        Name of one spin method (`triplet`, `normal_flow`, `contrast`, `trajectory`), or `all`; only what it needs is
        computed.
    rivals : sequence of str
        Methods of other publications to run besides, for comparison.
    window_us : (int, int), optional
        [start, end) in us of the file's own time: only these events are used.
    fixed_ball : (float, float, float) or "auto", optional
        Centre x, y and radius in px of a ball spinner's ball.
    sensor_px : (int, int), optional
        Width and height of the sensor, where the file does not say it.
    on_progress : callable, optional
        Called with the share done (0..1) and what is being done.

    Returns
    -------
    Result
        `shots` with their tracks and estimates (empty where no ball was found, `no_shot_reason` says why), `ticks`
        with every stage's result on demand, `to_dict()` as `spinscope analyze` writes it.

    Raises
    ------
    RecordingError
        When the recording cannot be read or holds no events.
    ParameterError
        For an unknown parameter, method or preset, or a value out of range.

    Examples
    --------
    >>> result = estimate("shot.raw", {"camera": {"focal_length_mm": 16.0}})  # doctest: +SKIP
    >>> result.shots[0].estimates["contrast"].vector_rps  # doctest: +SKIP
    """
    check_method(method)
    session = _session(recording, parameters, preset, window_us, fixed_ball, sensor_px, on_progress, rivals)
    return estimate_with_measured_up(session, method, on_progress)


def _session(
    recording: AnyRecording | SimulatedRecording | EventBatch | str | Path,
    parameters: Parameters | Mapping[str, Any] | Sequence[str] | None = None,
    preset: str | Path | None = None,
    window_us: tuple[int, int] | None = None,
    fixed_ball: tuple[float, float, float] | str | None = None,
    sensor_px: tuple[int, int] | None = None,
    on_progress: Progress | None = None,
    rivals: Sequence[str] = (),
) -> Session:
    """An open session, see `estimate`."""
    if isinstance(parameters, Parameters) and preset is not None:
        raise ParameterError("parameters are given as a whole and as a preset: give one of them")
    assignments = () if isinstance(parameters, Parameters) else tuple(_assignments(parameters))
    if isinstance(recording, EventBatch):
        recording = _in_memory(recording, sensor_px)
    elif isinstance(recording, SimulatedRecording):
        recording = in_memory(recording)
    elif not isinstance(recording, AnyRecording | str | Path):
        raise ParameterError(
            f"a {type(recording).__name__} is no recording: give a path, a Recording, or an EventBatch "
            "(EventBatch.checked makes one of columns t_us, x_px, y_px, on)"
        )
    reading = ReadingOptions(sensor=sensor_px)
    choices = Choices(preset, assignments, window_us, None, reading, rivals=rivals)
    session = Session.open(recording, choices, on_progress)
    if isinstance(parameters, Parameters):
        session.parameters, session.states_up = parameters, True
    session.place_fixed_ball(fixed_ball)
    return session


def calibrate_flights(
    recordings: Iterable[AnyRecording | SimulatedRecording | EventBatch | str | Path],
    parameters: Parameters | Mapping[str, Any] | Sequence[str] | None = None,
    **options: Any,
) -> FlightCalibration:
    """Find what the flights of one set-up share: lift, drag and plumb line.

    Parameters
    ----------
    recordings : iterable
        Recordings of one set-up with shots whose logo is seen well; others do no harm.
    parameters, **options
        As `estimate` takes them, but for the method.

    Returns
    -------
    FlightCalibration
        Its `values` are what `estimate` takes as parameters; `write` makes a file for `--flight-calibration`.

    Raises
    ------
    RecordingError
        When a recording cannot be read, or no shot's spin is told by its logo.
    ParameterError
        See `estimate`.

    Examples
    --------
    >>> calibration = calibrate_flights(["top.raw", "back.raw", "side.raw"])  # doctest: +SKIP
    >>> estimate("side.raw", calibration.values).shots[0].estimates["trajectory"]  # doctest: +SKIP
    """
    return flight_calibration(_session(recording, parameters, **options).estimate() for recording in recordings)


def _in_memory(events: EventBatch, sensor_px: tuple[int, int] | None) -> RecordingInMemory:
    if sensor_px is None:
        raise ParameterError("events in memory do not say how large the sensor is: give sensor_px=(width, height)")
    width_px, height_px = sensor_px
    for name, column, size in (("x", events.x_px, width_px), ("y", events.y_px, height_px)):
        if column.size and int(column.max()) >= size:
            raise ParameterError(f"{name} = {int(column.max())} px lies outside sensor_px = {width_px} x {height_px}")
    return RecordingInMemory(events, width_px, height_px)


def _assignments(parameters: Mapping[str, Any] | Sequence[str] | None) -> Iterator[str]:
    """Changes to the preset as `--set` takes them; groups as nested mappings or names as `group.field`."""
    if parameters is None:
        return
    if not isinstance(parameters, Mapping):
        yield from (parameters,) if isinstance(parameters, str) else parameters
        return
    for name, value in parameters.items():
        if isinstance(value, Mapping):
            yield from (f"{name}.{field}={_assigned(one)}" for field, one in value.items())
        elif "." in name:
            yield f"{name}={_assigned(value)}"
        else:
            raise ParameterError(f"{name} = {value!r} is not a table of fields: give {{{name!r}: {{field: value}}}}")


def _assigned(value: Any) -> str:
    """A value as `--set` takes it."""
    if isinstance(value, (list, tuple, np.ndarray)):
        return ",".join(repr(float(item)) for item in value)
    return "none" if value is None else str(value)
