"""Simulated recordings: the scene of a ball spinner, a flight or a rally before the camera, in memory or in a file."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from .biases import PAPER, BiasParameters
from .camera import Camera, CameraParameters
from .errors import ParameterError, RecordingError
from .files import check_writable
from .parameters import ParameterGroup, choice, switch, tunable
from .recordings import format_to_write, open_recording, write_recording
from .recordings.in_memory import RecordingInMemory
from .simulator import (
    Background,
    Light,
    Scene,
    SimulatedRecording,
    flight,
    rally,
    simulate_again,
    simulate_scene,
    spinner,
)
from .simulator.flights import FLIGHT_KINDS
from .simulator.simulation import Progress

KINDS = ("spinner", "flight", "rally")
# At 1000 rps an outline crosses 0.25 px, the simulator's step, in 2.4 us. The fastest spin measured: 152 rps.
MAX_SPIN_RPS = 1000.0
DESCRIPTION = "simulation"  # root attribute: what `simulate_again` needs, as JSON
BIASES = "biases"  # root attribute: the biases alone, as JSON


@dataclass(frozen=True, kw_only=True)
class SceneParameters(ParameterGroup):
    """Options of a scene; none = the kind's own default, or drawn from the seed."""

    seed: int = tunable(0, 0, 2**31 - 1, 1, "", "same seed and options, same events")
    spin: str = choice("top", (*FLIGHT_KINDS, "side"), "kind of spin; spinner: top, back, side")
    magnitude_rps: float | None = tunable(None, 0.0, MAX_SPIN_RPS, 5.0, "rps", "none = 50 (rally: 10 to 80)")
    speed_m_s: float | None = tunable(None, 0.5, 50.0, 0.5, "m/s", "none = 7.5 (rally: 4 to 10)")
    duration_ms: float | None = tunable(
        None, 1.0, 600_000.0, 10.0, "ms", "none = spinner 100, rally 20000, flight until the ball is gone"
    )
    ball: float | None = tunable(None, 1, 7, 1, "", "how the logo sits; none = 1 (flight: any way)")
    radius_mm: float = tunable(20.0, 1.0, 500.0, 0.5, "mm", "radius of the balls, their logos with them")
    heading_deg: float | None = tunable(None, -360.0, 360.0, 5.0, "deg", "0 = to the right, 90 = down; none = along")
    spin_decay_hz: float = tunable(0.0, 0.0, 10.0, 0.1, "Hz", "the spin falls as exp(-spin_decay_hz t)")
    shots: int = tunable(8, 1, 1000, 1, "", "shots of a rally")
    second_ball: bool = switch(False, "another ball crosses")
    arm: bool = switch(False, "an arm swings at the border of the image")
    bounce: bool = switch(False, "the ball bounces on the table")
    background: str = choice("auto", ("auto", "plain", "table"), "auto: plain for a spinner, else table")
    texture: float = tunable(0.0, 0.0, 2.0, 0.05, "", "contrast of the background's texture (log intensity)")
    light_lux: float = tunable(1930.0, 1.0, 100_000.0, 10.0, "lx", "illuminance on the table")
    flicker_depth: float = tunable(0.0, 0.0, 0.99, 0.05, "", "half the light's swing; 0 = steady")
    flicker_hz: float = tunable(100.0, 1.0, 1000.0, 10.0, "Hz", "of the flicker (mains: 100 or 120)")
    width_px: int = tunable(1280, 16, 2048, 1, "px", "columns of the sensor")
    height_px: int = tunable(720, 16, 2048, 1, "px", "rows of the sensor")
    focal_length_mm: float = tunable(8.0, 0.5, 1000.0, 0.1, "mm", "focal length of the lens")


# Options that do not belong to every kind of scene.
OWN = {
    "spinner": ("spin", "ball"),
    "flight": ("spin", "ball", "speed_m_s", "heading_deg", "spin_decay_hz", "second_ball", "arm", "bounce"),
    "rally": ("speed_m_s", "shots", "arm"),
}


@dataclass(frozen=True, slots=True)
class WrittenSimulation:
    """A simulated recording on disk, and in words what the format does not hold of it."""

    path: Path
    recording: SimulatedRecording
    warnings: list[str]


def simulate(
    kind: str,
    *,
    spin_rps: Sequence[float] | None = None,
    logo: str = "andro",
    biases: BiasParameters | None = None,
    on_progress: Progress | None = None,
    **options: Any,
) -> SimulatedRecording:
    """Simulate a ball before an event camera; the same arguments give the same events.

    Parameters
    ----------
    kind : str
        "spinner" (a ball that turns in place), "flight" (one shot across the image) or "rally" (several shots).
    spin_rps : sequence of 3 floats or None
        Exact spin (x, y, z) in the camera frame, instead of the options `spin` and `magnitude_rps`.
    logo : str
        Name of a logo, or a PNG file.
    biases : BiasParameters or None
        Of the sensor; None = the paper's.
    on_progress : callable or None
        Called with the share done (0..1) and what is being done.
    **options
        Fields of SceneParameters, like `seed=7`; None counts as not given.

    Returns
    -------
    SimulatedRecording
        Events, truth and scene.

    Raises
    ------
    ParameterError
        For an unknown kind or option, a value out of range, an option that does not belong to the kind.

    Examples
    --------
    >>> made = simulate("flight", spin_rps=(40, 0, -10), seed=7)  # doctest: +SKIP
    >>> result = estimate(made)  # doctest: +SKIP
    """
    if kind not in KINDS:
        raise ParameterError(f"{kind!r} cannot be simulated: there are {', '.join(KINDS)}")
    given = {name: value for name, value in options.items() if value is not None}
    chosen = SceneParameters().with_values(given)
    foreign = {name for own in OWN.values() for name in own} - set(OWN[kind])
    for name in given:
        if name in foreign and given[name] != SceneParameters.tunables()[name].default:
            raise ParameterError(f"{name} does not belong to a {kind}: leave it out")
    optics = CameraParameters(focal_length_mm=chosen.focal_length_mm)
    camera = Camera.of(optics, chosen.width_px, chosen.height_px)
    scene = _scene(kind, chosen, spin_rps, logo, camera)
    scene = replace(scene, balls=tuple(replace(ball, radius_m=chosen.radius_mm * 1e-3) for ball in scene.balls))
    return simulate_scene(scene, camera=camera, sensor=biases or PAPER, seed=chosen.seed, on_progress=on_progress)


def simulate_to_file(kind: str, out: Path, **options: Any) -> WrittenSimulation:
    """Simulate and write a recording; see `simulate` for the options and `write_simulation` for the formats."""
    _check_writable(out)
    return write_simulation(simulate(kind, **options), out)


def simulate_again_to_file(
    recording: Path, out: Path, *, biases: BiasParameters | None = None, on_progress: Progress | None = None
) -> WrittenSimulation:
    """Simulate the scene of a simulated recording again, with other biases if given, and write it.

    Raises ParameterError and RecordingError, also where the recording holds no scene.
    """
    _check_writable(out)
    description = description_in(open_recording(recording).attributes)
    if description is None:
        raise RecordingError(
            f"the recording holds no scene: give one that `spinscope simulate` wrote as HDF5: {recording}"
        )
    return write_simulation(simulate_again(description, sensor=biases, on_progress=on_progress), out)


def description_in(attributes: Mapping[str, Any]) -> dict[str, Any] | None:
    """The description that `simulate_again` takes among a recording's attributes; None where there is none."""
    try:
        description = json.loads(str(attributes.get(DESCRIPTION, "null")))
    except (ValueError, RecursionError):  # RecursionError: nested thousands deep
        return None
    return description if isinstance(description, dict) else None


def in_memory(made: SimulatedRecording) -> RecordingInMemory:
    """The simulated recording behind the interface of recordings, with the attributes that its file would have."""
    focal_length_mm = made.description["camera"]["focal_px"] * CameraParameters().pixel_um / 1000
    attributes: dict[str, str | float] = {
        DESCRIPTION: json.dumps(made.description, separators=(",", ":")),
        "camera.focal_length_mm": round(focal_length_mm, 9),
    }
    if made.description["biases"] is not None:
        attributes[BIASES] = json.dumps(made.description["biases"])
    path = Path(made.scene.description or "simulation")
    return RecordingInMemory(made.events, made.width_px, made.height_px, path, attributes, made.truth)


def write_simulation(made: SimulatedRecording, out: Path) -> WrittenSimulation:
    """Write a simulated recording; the format follows the suffix of `out`.

    HDF5 carries the truth and what it takes to simulate the scene again; RAW (EVT3) and NPZ hold events alone.
    The file appears only when complete. Raises RecordingError.
    """
    keeps_truth = "truth" in format_to_write(out).keeps
    attributes = in_memory(made).attributes if keeps_truth else None
    write_recording(
        out, made.events, width_px=made.width_px, height_px=made.height_px, attributes=attributes, truth=made.truth
    )
    loss = f"{out.suffix.lower()} holds no truth and no scene: write .h5 to keep them"
    return WrittenSimulation(out, made, [] if keeps_truth else [loss])


def _check_writable(out: Path) -> None:
    """Raise before the work what would fail after it; a full disk shows in writing only."""
    format_to_write(out)
    check_writable(out, "recording")


def _scene(kind: str, chosen: SceneParameters, spin_rps: Sequence[float] | None, logo: str, camera: Camera) -> Scene:
    """The scene of these choices; what is not given is left to the function that makes it."""
    plain = {"auto": kind == "spinner", "plain": True, "table": False}[str(chosen.background)]
    light = Light(illuminance_lux=chosen.light_lux, flicker_depth=chosen.flicker_depth, flicker_hz=chosen.flicker_hz)
    background = Background(kind="plain" if plain else "table", contrast=chosen.texture)
    options: dict[str, Any] = {"seed": chosen.seed, "logo": logo, "background": background, "light": light}
    given = {name: getattr(chosen, name) for name in ("magnitude_rps", *OWN[kind])}
    options |= {name: value for name, value in given.items() if value is not None}
    if kind == "rally":
        if spin_rps is not None:
            raise ParameterError("spin_rps does not belong to a rally: its shots have spins of their own")
        for name in options.keys() & {"speed_m_s", "magnitude_rps"}:
            options[name] = (options[name], options[name])
        if chosen.duration_ms is not None:
            options["duration_s"] = chosen.duration_ms * 1e-3
        return rally(camera=camera, **options)
    if spin_rps is not None and not (size := math.hypot(*spin_rps)) <= MAX_SPIN_RPS:  # not a number fails here too
        raise ParameterError(
            f"spin of {size:g} rps is out of range: the simulator's time step allows {MAX_SPIN_RPS:g} rps"
        )
    options |= {"kind": options.pop("spin"), "spin_rps": spin_rps}
    if chosen.ball is not None:
        options["ball"] = int(chosen.ball)
    if kind == "spinner":
        return spinner(duration_ms=chosen.duration_ms or 100.0, **options)
    scene = flight(camera=camera, **options)
    if chosen.duration_ms is None:
        return scene
    return replace(scene, duration_s=min(scene.duration_s, chosen.duration_ms * 1e-3))
