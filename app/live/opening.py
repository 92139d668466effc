"""Opening of the camera, or of a recording or simulated scene in its place, with the session's parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from spinscope.pipeline.biases import BiasParameters, read_bias_values, read_biases
from spinscope.pipeline.camera import Camera
from spinscope.pipeline.cameras import CameraOptions, EventCamera, ReplayCamera, SimulatedCamera, open_camera
from spinscope.pipeline.errors import ParameterError
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.live import session_of
from spinscope.pipeline.recordings import Recording
from spinscope.pipeline.session import Choices, Session

from ..terminal import note

# The simulated camera: small, so that two cores keep up in all its noise, before a ball of 5 m/s in half-light, where
# the most sensitive biases are too noisy.
SIMULATED_SIZE_PX, SIMULATED_ROUND_S = (346, 260), 1.0
SIMULATED_LUX, SIMULATED_SPEED_M_S, SIMULATED_SPIN_RPS = 300.0, 5.0, 30.0


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
    simulates : bool
        Whether a simulated camera takes the place of one.
    speed : float
        Of replay and simulation; see `ReplayCamera`.
    loops, fault
        Of the replay; see `ReplayCamera`.
    """

    serial: str | None = None
    biases: Path | None = None
    options: CameraOptions = CameraOptions()
    replay: Path | None = None
    simulates: bool = False
    speed: float = 1.0
    loops: bool = False
    fault: str | None = None


def open_live(chosen: CameraChoice, choices: Choices) -> tuple[EventCamera, Session]:
    """The camera, and a session with its parameters; raises SpinscopeError."""
    if choices.window_us is not None:
        raise ParameterError("a camera has no --window: `spinscope convert IN OUT --window` cuts a recording")
    sources = {"--camera": chosen.serial, "--replay": chosen.replay, "--simulate": chosen.simulates or None}
    given = [name for name, value in sources.items() if value is not None]
    if len(given) > 1:
        raise ParameterError(f"{' and '.join(given)} exclude each other: give one of them")
    if chosen.options != CameraOptions() and given in (["--replay"], ["--simulate"]):
        raise ParameterError("--roi and --most-mev-s are of a camera alone: a recording has `convert --roi`")
    if chosen.replay is not None:
        if chosen.biases is not None:
            raise ParameterError("--biases are of a camera: the events of a recording do not change with them any more")
        session = Session.open(chosen.replay, choices)
        return replay_of(session, chosen), session
    if chosen.loops or chosen.fault is not None:
        raise ParameterError("--loop and --fake are of a recording: give --replay FILE with them")
    opened: EventCamera
    if chosen.simulates:
        biases = BiasParameters() if chosen.biases is None else read_biases(chosen.biases)
        opened = simulated_camera(choices, biases, chosen.speed)
    else:
        values = {} if chosen.biases is None else read_bias_values(chosen.biases)
        opened = open_camera(chosen.serial, values, chosen.options)
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
    recording, stated = session.recording, session.sidecar.biases
    return ReplayCamera(
        lambda: recording.chunks() if isinstance(recording, Recording) else [recording.read()],
        recording.width_px,
        recording.height_px,
        name=recording.path.name,
        speed=chosen.speed,
        loops=chosen.loops,
        fault=chosen.fault,
        biases=None if stated is None else stated.as_dict(),
    )


def simulated_camera(choices: Choices, biases: BiasParameters, speed: float) -> SimulatedCamera:
    """A simulated EVK4 of few pixels, with the optics chosen, before a ball that is thrown again and again."""
    from spinscope.pipeline.simulator import Light, rally, simulate_scene

    parameters = choices.parameters()
    optics = Camera.of(parameters.camera, *SIMULATED_SIZE_PX)
    scene = rally(
        shots=1,
        duration_s=SIMULATED_ROUND_S,
        speed_m_s=(SIMULATED_SPEED_M_S, SIMULATED_SPEED_M_S),
        magnitude_rps=(SIMULATED_SPIN_RPS, SIMULATED_SPIN_RPS),
        light=Light(illuminance_lux=SIMULATED_LUX),
        camera=optics,
    )
    ball = replace(scene.balls[0], radius_m=parameters.ball.diameter_mm / 2000)
    scene = replace(scene, balls=(ball,))

    def simulate(values: Mapping[str, int]) -> EventBatch:
        return simulate_scene(scene, camera=optics, sensor=BiasParameters(**values)).events

    limits = {name: (round(one.low or 0), round(one.high or 0)) for name, one in BiasParameters.tunables().items()}
    note("simulating the scene before the camera ...")
    return SimulatedCamera(
        simulate,
        round(SIMULATED_ROUND_S * 1e6),
        *SIMULATED_SIZE_PX,
        bias_limits=limits,
        biases=biases.as_dict(),
        speed=speed,
    )
