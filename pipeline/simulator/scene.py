"""A scene: balls, an arm, a background and the light, in the camera frame, convertible to and from JSON.

Everything random was drawn when the scene was made, so the same scene can be simulated again with other
biases.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

from ..errors import ParameterError
from .logos import Logo

Vector3 = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]  # (w, x, y, z), unit: ball frame -> camera frame


@dataclass(frozen=True)
class Fixed:
    """A ball that turns in place (the ball spinner) during [start_s, end_s)."""

    start_s: float
    end_s: float
    position_m: Vector3
    spin_rps: Vector3
    orientation: Quaternion  # at start_s


@dataclass(frozen=True)
class Flight:
    """A ball in free flight during [start_s, end_s), with gravity, drag and Magnus force; its state is at start_s."""

    start_s: float
    end_s: float
    position_m: Vector3
    velocity_m_s: Vector3
    spin_rps: Vector3
    orientation: Quaternion
    spin_decay_hz: float = 0.0  # the spin falls as exp(-spin_decay_hz t)
    bounces: bool = False  # off the table of the scene


@dataclass(frozen=True)
class Rolling:
    """A ball that moves straight at constant velocity and spin during [start_s, end_s), as one rolling on a table."""

    start_s: float
    end_s: float
    position_m: Vector3
    velocity_m_s: Vector3
    spin_rps: Vector3
    orientation: Quaternion


Motion = Fixed | Flight | Rolling


@dataclass(frozen=True)
class Air:
    """Gravity and aerodynamics of a flying ball.

    With the spin parameter S = |spin across the flight| radius / speed the lift coefficient is
    lift_max tanh(magnus S / lift_max), along spin x velocity: it rises as magnus S and saturates at lift_max.

    Attributes
    ----------
    drag : float
        Drag coefficient. 0.55 slows a ball of 40 mm and 2.7 g by 0.154 |v| v (1/m).
    magnus : float
        Lift coefficient per spin parameter of a slow spin.
    lift_max : float or None
        Lift coefficient of a fast spin; None = it never saturates, as in scenes of earlier versions.

    Notes
    -----
    Fitted on 203 real flights with measured spin (2.8-10 m/s; the recordings of SpinDOE, Gossard et al., IROS 2023):
    C_L / S is 0.65 at S = 0.15, 0.56 at 0.35, 0.4 at 0.5 and 0.22 at 1, which is 0.26 tanh(S / 0.4); drag 0.145 to
    0.19 /m (quartiles), 0.125 elsewhere.
    """

    gravity_m_s2: float = 9.81
    density_kg_m3: float = 1.2
    drag: float = 0.55
    magnus: float = 0.65
    lift_max: float | None = 0.26


# Scatter from one set-up to another: drag of 0.125 to 0.19 /m (`Air`), 12 % of the lift (1 sigma; temperature, surface
# and wear of the balls), a plumb line that is set to 1 degree in each direction (a spirit level on a tripod).
DRAG_RANGE, LIFT_STD, PLUMB_STD_DEG = (0.448, 0.68), 0.12, 1.0


@dataclass(frozen=True)
class Ball:
    """A matte ball with a logo; `motions` follow each other in time, between them the ball is away."""

    motions: tuple[Motion, ...]
    radius_m: float = 0.02
    mass_kg: float = 0.0027
    albedo: float = 0.85
    ink_albedo: float = 0.12
    logo: Logo = field(default_factory=Logo)


@dataclass(frozen=True)
class Arm:
    """A forearm that swings about its elbow: a capsule, sleeve and hand of one brightness each.

    The hand points along `rest` turned about `axis` by swing_rad sin(2 pi frequency_hz t + phase_rad).
    """

    elbow_m: Vector3
    rest: Vector3  # unit vector
    axis: Vector3  # unit vector
    length_m: float = 0.4
    radius_elbow_m: float = 0.045
    radius_hand_m: float = 0.035
    swing_rad: float = 0.7
    frequency_hz: float = 1.0
    phase_rad: float = 0.0
    sleeve_albedo: float = 0.06
    hand_albedo: float = 0.45


@dataclass(frozen=True)
class Net:
    """A net that swings: a tape between two ends and upright cords below it, fixed at their feet.

    A point of the tape at the share s of its length moves across it by swing_m sin(pi s) sin(2 pi frequency_hz t +
    phase_rad), the first mode of a string.
    """

    left_m: Vector3
    right_m: Vector3
    height_m: float = 0.1525  # rules of table tennis, as the tape's width of 15 mm
    cords: int = 24
    swing_m: float = 0.01
    frequency_hz: float = 6.0
    phase_rad: float = 0.0
    tape_albedo: float = 0.75
    cord_albedo: float = 0.05


@dataclass(frozen=True)
class Shake:
    """Vibration of the camera: its direction turns, so that the middle of the image moves by so many pixels.

    A sum of three sines an axis between half and twice `frequency_hz`, of random weights and phases; `amplitude_px` is
    the largest that they may reach together.
    """

    amplitude_px: float = 0.0
    frequency_hz: float = 20.0
    seed: int = 0


@dataclass(frozen=True)
class Background:
    """Static background: a plane `height_m` below the camera, with a random texture."""

    kind: str = "table"  # "plain" (table everywhere) or "table" (with white lines, and the floor beyond)
    height_m: float = 2.0
    albedo: float = 0.12  # of the table
    line_albedo: float = 0.7
    floor_albedo: float = 0.25
    contrast: float = 0.0  # of the texture: standard deviation in log intensity
    grain_px: float = 6.0
    texture_seed: int = 0

    def __post_init__(self) -> None:
        if self.kind not in ("plain", "table"):
            raise ParameterError(f"background {self.kind!r} is unknown: there are plain, table")


@dataclass(frozen=True)
class Light:
    """Soft light from above: a bright ceiling (`sky`), panels (the rest), and what comes from below (`bounce`).

    The bounce stands for table, walls and the light that plastic lets through. The two shares are chosen so
    that the events of a flying ball lie on its disc as they do for real balls (accumulated frames of
    cogsys-tuebingen/snn-edge-benchmark: occupancy flat up to 0.6 radii, a ring above); with a ball darker at
    its limb OFF events begin far inside it.
    """

    illuminance_lux: float = 1930.0  # on the table; the paper's are the reference of all intensities
    sky: float = 0.9
    bounce: float = 0.5
    flicker_depth: float = 0.0  # amplitude over the mean, 0 = steady LED panels
    flicker_hz: float = 100.0
    shadow: float = 0.0  # share of the table's light that a ball takes away below it
    lamp: Vector3 = (0.3, 0.2, -0.93)  # direction towards the lamp that casts the shadow
    penumbra_rad: float = 0.05  # sigma of the shadow's edge over its distance: half the angle of a panel


@dataclass(frozen=True)
class Scene:
    """Everything in front of the camera during [0, duration_s); the first ball is the one of the truth."""

    duration_s: float
    balls: tuple[Ball, ...]
    arm: Arm | None = None
    net: Net | None = None
    background: Background = Background()
    light: Light = Light()
    air: Air = Air()
    shake: Shake = Shake()
    up: Vector3 = (0.0, 0.0, -1.0)
    description: str = ""

    def __post_init__(self) -> None:
        if not 0 < self.duration_s <= 3600:
            raise ParameterError(f"a scene of {self.duration_s:g} s is out of range: more than 0, at most 3600 s")
        for ball in self.balls:
            if not 0.001 <= ball.radius_m <= 0.5:
                raise ParameterError(f"ball radius {ball.radius_m * 1e3:g} mm is out of range: 1 to 500 mm")
            if not ball.mass_kg > 0:
                raise ParameterError(f"ball mass {ball.mass_kg:g} kg is out of range: more than 0")
            for motion in ball.motions:
                spin = math.hypot(*motion.spin_rps)
                if not spin <= 1000:
                    raise ParameterError(f"spin of {spin:g} rps is out of range: at most 1000 rps")
                if not motion.position_m[2] > 2 * ball.radius_m:
                    raise ParameterError(f"the ball at {motion.position_m} m is not in front of the camera")

    def to_dict(self) -> dict[str, Any]:
        """Plain dictionaries and tuples, ready for JSON."""
        return dataclasses.asdict(self)

    @classmethod
    def from_dict(cls, plain: Mapping[str, Any]) -> Scene:
        """The scene again; raises ParameterError when something is missing or unknown."""
        try:
            values = dict(plain)
            values["balls"] = tuple(_ball(ball) for ball in values["balls"])
            values["arm"] = None if values.get("arm") is None else built(Arm, values["arm"])
            values["net"] = None if values.get("net") is None else built(Net, values["net"])
            # Scenes of earlier versions have a linear lift and do not state its limit.
            values["air"] = {"lift_max": None, **values["air"]} if "air" in values else {}
            for name, kind in (("background", Background), ("light", Light), ("air", Air), ("shake", Shake)):
                values[name] = built(kind, values.get(name, {}))
            return built(cls, values)
        except (KeyError, TypeError, AttributeError, ValueError) as error:
            raise ParameterError(f"this is no scene of the simulator: {error}") from error


Kind = TypeVar("Kind")


def built(kind: type[Kind], plain: Mapping[str, Any]) -> Kind:
    """An instance of a dataclass from its fields, lists of JSON made tuples."""
    return kind(**{name: tuple(value) if isinstance(value, list) else value for name, value in plain.items()})


def _ball(plain: Mapping[str, Any]) -> Ball:
    values = dict(plain)
    values["motions"] = tuple(built(_motion_kind(motion), motion) for motion in values["motions"])
    values["logo"] = built(Logo, values.get("logo", {}))
    return built(Ball, values)


def _motion_kind(plain: Mapping[str, Any]) -> type[Fixed] | type[Flight] | type[Rolling]:
    if "velocity_m_s" not in plain:
        return Fixed
    return Flight if "bounces" in plain else Rolling
