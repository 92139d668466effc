"""Opening of the camera, or of the recording that plays in its place, with the session's parameters."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from spinscope.pipeline.biases import BiasParameters, read_bias_values
from spinscope.pipeline.cameras import CameraOptions, EventCamera, ReplayCamera, open_camera
from spinscope.pipeline.errors import ParameterError
from spinscope.pipeline.live import session_of
from spinscope.pipeline.recordings import Recording
from spinscope.pipeline.session import Choices, Session


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraChoice:
    """Options that say where events come from.

    Attributes
    ----------
    serial : str, optional
        Serial number of the camera; the only one by default.
    biases : Path, optional
        File of its biases.
    options : CameraOptions
        What the camera leaves out by itself.
    replay : Path, optional
        Recording in the place of a camera.
    speed, loops, fault
        Of the replay; see `ReplayCamera`.
    """

    serial: str | None = None
    biases: Path | None = None
    options: CameraOptions = CameraOptions()
    replay: Path | None = None
    speed: float = 1.0
    loops: bool = False
    fault: str | None = None


def open_live(chosen: CameraChoice, choices: Choices) -> tuple[EventCamera, Session]:
    """The camera, and a session with its parameters; raises SpinscopeError."""
    biases = {} if chosen.biases is None else read_bias_values(chosen.biases)
    if choices.window_us is not None:
        raise ParameterError("a camera has no --window: `spinscope convert IN OUT --window` cuts a recording")
    if chosen.replay is not None:
        if chosen.serial is not None:
            raise ParameterError("--camera and --replay exclude each other: give one of them")
        if chosen.options != CameraOptions():
            raise ParameterError("--roi and --most-mev-s are of a camera: a recording has `convert --roi`")
        session = Session.open(chosen.replay, choices)
        camera = replay_of(session, chosen)
        if biases:
            camera.set_biases(biases)
        return camera, session
    if chosen.loops or chosen.fault is not None:
        raise ParameterError("--loop and --fake are of a recording: give --replay FILE with them")
    opened = open_camera(chosen.serial, biases, chosen.options)
    try:
        session = session_of(opened, choices)
    except BaseException:
        opened.close()
        raise
    return opened, session


def opened_anew(camera: EventCamera) -> EventCamera:
    """A camera that was unplugged, as it was set last; raises CameraError while it is not back."""
    if camera.is_replay:  # it goes on where it was
        return camera
    return open_camera(camera.serial, camera.biases, camera.options)


def replay_of(session: Session, chosen: CameraChoice) -> ReplayCamera:
    """A session's recording that plays like a camera, with the biases that its sidecar states."""
    recording, stated = session.recording, session.sidecar.biases or BiasParameters()
    limits = {name: (round(one.low or 0), round(one.high or 0)) for name, one in BiasParameters.tunables().items()}
    return ReplayCamera(
        lambda: recording.chunks() if isinstance(recording, Recording) else [recording.read()],
        recording.width_px,
        recording.height_px,
        name=recording.path.name,
        speed=chosen.speed,
        loops=chosen.loops,
        fault=chosen.fault,
        bias_limits=limits,
        biases={name: getattr(stated, name) for name in limits},
    )
