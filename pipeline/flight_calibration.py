"""Calibration of a set-up by its flights: lift, drag and plumb line from the shots whose logo is seen well."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from .errors import RecordingError
from .files import atomic_file
from .kernels.arrays import Floats
from .registry import STAGES, Parameters
from .session import Progress, Result, Session
from .shots import Shot
from .spin.trajectory.calibration import KnownFlight, calibrate, up_from_flights
from .spin.trajectory.likelihood import SetUp
from .spin.trajectory.stage import set_up_of
from .stage import SpinMethod

LOGO_METHOD = "contrast"
# The direction of gravity is said to be wrong beyond so many sigma and degrees: what a tripod is level to by eye.
DOUBT_SIGMAS, DOUBT_DEG = 5.0, 3.0


@dataclass(frozen=True, slots=True, eq=False)
class FlightCalibration:
    """Lift, drag and plumb line of a set-up by its flights.

    Attributes
    ----------
    set_up : SetUp
        Lift, drag and plumb line with their errors.
    flights : int
        Number of shots behind it.
    """

    set_up: SetUp
    flights: int

    @property
    def values(self) -> dict[str, dict[str, Any]]:
        """Parameters by group and field, as `estimate` and presets take them."""
        set_up = self.set_up
        names = ("lift_scale", "lift_std", "drag_per_m", "drag_std_per_m", "plumb_std_deg")
        return {
            "trajectory": {name: round(float(getattr(set_up, name)), 5) for name in names},
            "camera": {"up": [round(value, 6) for value in set_up.up.tolist()]},
        }

    def write(self, path: str | Path) -> None:
        """Write the values as a TOML file for `--flight-calibration`; raises RecordingError."""
        with atomic_file(path, "calibration") as part:
            part.write_text(tomli_w.dumps(self.values), encoding="utf-8")

    def __str__(self) -> str:
        set_up = self.set_up
        up = ", ".join(f"{value:+.3f}" for value in set_up.up)
        return (
            f"lift {set_up.lift_scale:.2f} +- {set_up.lift_scale * set_up.lift_std:.2f} times that of the reference, "
            f"drag {set_up.drag_per_m:.3f} +- {set_up.drag_std_per_m:.3f} /m, "
            f"up ({up}) +- {set_up.plumb_std_deg:.1f} degrees, from {self.flights} shots"
        )


def flight_calibration(results: Iterable[Result]) -> FlightCalibration:
    """Calibrate a set-up by the shots of its recordings; raises RecordingError where the logo tells no shot's spin."""
    flights: list[KnownFlight] = []
    parameters = None
    for result in results:
        parameters = parameters or result.session.parameters
        flights += known_flights(result.shots)
    if parameters is None or not flights:
        raise RecordingError(
            f"no flight to calibrate by: a shot is needed whose spin {LOGO_METHOD} tells, five are better"
        )
    ball_radius_m = parameters.ball.diameter_mm / 2000.0
    return FlightCalibration(calibrate(flights, _set_up(parameters), ball_radius_m), len(flights))


def known_flights(shots: Iterable[Shot]) -> list[KnownFlight]:
    """The shots whose flight was fitted and whose spin the logo tells, without doubts about their track."""
    method = STAGES[LOGO_METHOD]
    assert isinstance(method, SpinMethod)
    return [
        KnownFlight(shot.motion, shot.estimates[LOGO_METHOD])
        for shot in shots
        if shot.best is not None and shot.motion is not None
        if LOGO_METHOD in shot.estimates and method.is_trusted(shot.estimates)
    ]


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredUp:
    """Direction against which the balls of a recording fall, where it is not camera.up.

    Attributes
    ----------
    up : (3,) float64
        Unit vector, camera frame.
    std_deg : float
        1 sigma in each direction.
    believed : (3,) float64
        The unit vector of camera.up.
    """

    up: Floats
    std_deg: float
    believed: Floats

    @property
    def values(self) -> dict[str, dict[str, Any]]:
        """Parameters by group and field: the direction, and its error for the trajectory."""
        return {
            "trajectory": {"plumb_std_deg": min(max(self.std_deg, 0.01), 45.0)},
            "camera": {"up": tuple(self.up.tolist())},
        }

    def warning(self, is_stated: bool) -> str:
        """Sentence for people, who stated camera.up themselves or did not."""
        off_deg = math.degrees(math.acos(float(np.clip(self.up @ self.believed, -1.0, 1.0))))
        words = ",".join(f"{value:.2f}" for value in self.up)
        said = f"their flights say {words} +- {self.std_deg:.0f} degrees, {off_deg:.0f} degrees off"
        if not is_stated:
            return f"camera.up is not given and taken from how the balls fall: {said} a camera that looks down"
        believed = ",".join(f"{value:g}" for value in self.believed)
        return f"the balls do not fall against camera.up = {believed}: {said}; if so give --set camera.up={words}"


def estimate_with_measured_up(session: Session, method: str = "all", on_progress: Progress | None = None) -> Result:
    """Estimate the spin of every shot, see `with_measured_up`."""
    return with_measured_up(session, lambda: session.estimate(method, on_progress))


def with_measured_up(session: Session, estimated: Callable[[], Result]) -> Result:
    """Result of `estimated`, with camera.up from the flights where nobody states it and they contradict it.

    The session's warnings say so, as where a stated direction is contradicted, which stands.
    """
    result = estimated()
    measured = measured_up(result)
    if measured is None:
        return result
    session.warnings.append(measured.warning(session.states_up))
    if session.states_up:
        return result
    session.parameters = session.parameters.with_values(measured.values)
    return estimated()


def measured_up(result: Result) -> MeasuredUp | None:
    """Up by the shots whose logo tells the spin; None where they agree with camera.up or tell nothing."""
    flights = known_flights(result.shots)
    if not flights:
        return None
    set_up = _set_up(result.session.parameters)
    up, covariance = up_from_flights(flights, set_up, result.session.ball_radius_m)
    across = np.eye(3) - np.outer(set_up.up, set_up.up)
    off = across @ (up / np.linalg.norm(up) - set_up.up)
    spread = across @ covariance @ across + math.radians(set_up.plumb_std_deg) ** 2 * np.eye(3)
    sigmas = math.sqrt(float(off @ np.linalg.solve(spread, off)))
    length = float(np.linalg.norm(up))
    up = up / length
    if sigmas < DOUBT_SIGMAS or math.degrees(math.acos(float(np.clip(up @ set_up.up, -1.0, 1.0)))) < DOUBT_DEG:
        return None
    leaning = (float(np.trace(covariance)) - float(up @ covariance @ up)) / 2
    return MeasuredUp(up, math.degrees(math.sqrt(leaning) / length), set_up.up)


def _set_up(parameters: Parameters) -> SetUp:
    up = np.array(parameters.camera.up)
    return set_up_of(parameters.trajectory, tuple(up / np.linalg.norm(up)))
