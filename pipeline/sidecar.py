"""Sidecars: statements beside a recording about its camera, ball, truth and biases.

`NAME.toml` beside `NAME.raw` has the tables [camera] and [ball] (parameters), [fixed_ball] (`x_px`, `y_px`,
`radius_px`), [truth] and [biases]; `NAME.bias` is as the camera's software writes it. A `truth.csv` states the same of
all recordings of a folder; what `NAME.toml` states goes before it.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from .biases import BiasParameters, read_biases
from .camera import BallParameters, CameraParameters
from .dotted_shots import DottedShots
from .errors import ParameterError, RecordingError
from .extensions import did_you_mean
from .files import file_bytes
from .parameters import ParameterGroup
from .toml import MAX_BYTES, toml_tables
from .truth_table import stated_tables, truth_table_of

GROUPS: dict[str, type[ParameterGroup]] = {"camera": CameraParameters, "ball": BallParameters}
BALL_NUMBERS = range(1, 8)  # of the paper
TABLES = (*GROUPS, "fixed_ball", "truth", "biases")


@dataclass(frozen=True, slots=True, kw_only=True)
class StatedTruth:
    """Truth of a real recording, as it was set or measured beside the camera.

    Attributes
    ----------
    spin_rps : (float, float, float), optional
        Spin in the camera frame; None where only its magnitude is known.
    rps : float
        Magnitude, as of a tachometer.
    spin_std_rps, axis_std_deg : float, optional
        1 sigma of the magnitude, and of the axis (root of the trace of both its directions).
    ball : int, optional
        Number of the ball, 1 to 7 of the paper's.
    speed_m_s : float, optional
        Speed as set.
    setting : str, optional
        Setting of the spinner or thrower, in the user's words.
    dotted_shots : int, optional
        Number of dotted balls of which the spin is the mean.
    """

    spin_rps: tuple[float, float, float] | None
    rps: float
    spin_std_rps: float | None = None
    axis_std_deg: float | None = None
    ball: int | None = None
    speed_m_s: float | None = None
    setting: str | None = None
    dotted_shots: int | None = None

    @classmethod
    def of(cls, table: Mapping[str, Any], folder: Path = Path()) -> StatedTruth:
        """The truth of a table with `spin_rps`, `axis` and `rps`, `rps` alone, or `dotted_shots`.

        `dotted_shots` is the file of their spins or the folder of their trajectories, and `camera_frame` that of
        `spinscope calibrate stereo` or `table` where the spin is stated in the frame camera's or the table's frame;
        both from the folder on. Raises SpinscopeError.
        """
        known = (*(one.name for one in fields(cls)), "axis", "camera_frame", "dotted_trajectories")
        for name in table:
            if name not in known:
                raise ParameterError(f"truth.{name} is unknown{did_you_mean(name, known)}")
        if "dotted_shots" in table:
            return cls._of_dotted_shots(table, folder)
        if "dotted_trajectories" in table:
            raise ParameterError("truth.dotted_trajectories are numbers of dotted_shots: give its folder, too")
        spin, rps = _vector(table, "spin_rps"), _number(table, "rps")
        axis = _vector(table, "axis")
        if axis is not None:
            length = math.hypot(*axis)
            if spin is not None or rps is None or length == 0:
                raise ParameterError("truth.axis goes with truth.rps: give spin_rps = [x, y, z], or axis and rps")
            x, y, z = (rps * component / length for component in axis)
            spin = (x, y, z)
        elif spin is not None and rps is not None:
            raise ParameterError("truth.spin_rps is the whole vector, truth.rps its length: give one of them")
        elif spin is None and rps is None:
            raise ParameterError(
                "truth states no spin: give spin_rps = [x, y, z], axis and rps, rps alone, or dotted_shots"
            )
        if spin is not None:
            spin = _in_event_camera(spin, table, folder)
        return cls(
            spin_rps=spin,
            rps=math.hypot(*(spin or ())) if rps is None else rps,
            spin_std_rps=_number(table, "spin_std_rps"),
            axis_std_deg=_number(table, "axis_std_deg"),
            **_circumstances(table),
        )

    @classmethod
    def _of_dotted_shots(cls, table: Mapping[str, Any], folder: Path) -> StatedTruth:
        twice = [name for name in ("spin_rps", "axis", "rps", "spin_std_rps", "axis_std_deg") if name in table]
        if twice:
            raise ParameterError(f"truth.dotted_shots tells the spin, and so does {', '.join(twice)}: give one of them")
        about = _circumstances(table)
        shots = DottedShots.read(folder / str(table["dotted_shots"]), about["setting"], _trajectories(table))
        if about["speed_m_s"] is None:
            about["speed_m_s"] = shots.speed_m_s
        x, y, z = shots.mean_rps.tolist()
        return cls(
            spin_rps=_in_event_camera((x, y, z), table, folder),
            rps=math.hypot(x, y, z),
            spin_std_rps=shots.magnitude_std_rps,
            axis_std_deg=shots.axis_std_deg,
            dotted_shots=len(shots.spins_rps),
            **about,
        )


@dataclass(frozen=True, slots=True)
class Sidecar:
    """Statements beside a recording about camera, ball, truth and biases; empty where there is no file.

    Attributes
    ----------
    parameters : dict of str to any
        By `group.field`, of the groups camera and ball.
    fixed_ball : (x_px, y_px, radius_px), optional
        Circle of a ball spinner's ball.
    truth : StatedTruth, optional
    biases : BiasParameters, optional
        Of the table [biases].
    """

    parameters: Mapping[str, Any] = field(default_factory=dict)
    fixed_ball: tuple[float, float, float] | None = None
    truth: StatedTruth | None = None
    biases: BiasParameters | None = None

    @property
    def digest(self) -> str:
        """Digest of all that is stated; "" where nothing is."""
        if self == Sidecar():
            return ""
        return hashlib.blake2b(repr(self).encode(), digest_size=12).hexdigest()

    @classmethod
    def beside(cls, recording: Path) -> Sidecar:
        """Statements of `NAME.toml` and `truth.csv` on a recording; raises RecordingError or ParameterError."""
        own, table = recording.with_suffix(".toml"), truth_table_of(recording)
        stated = cls._of(stated_tables(table, recording), table) if table else cls()
        return cls._of(_toml_tables(own), own)._over(stated) if own.is_file() else stated

    def _over(self, other: Sidecar) -> Sidecar:
        """These statements, and the other ones where these say nothing."""
        return Sidecar(
            parameters={**other.parameters, **self.parameters},
            fixed_ball=self.fixed_ball or other.fixed_ball,
            truth=self.truth or other.truth,
            biases=self.biases or other.biases,
        )

    @classmethod
    def _of(cls, tables: Mapping[str, Any], path: Path) -> Sidecar:
        try:
            return cls._of_tables(tables, path.parent)
        except ParameterError as error:
            raise ParameterError(f"{error}: {path}") from None
        except (ValueError, OverflowError):  # whole numbers beyond all floats, or too long to be shown
            raise ParameterError(f"a number is too large: {path}") from None

    @classmethod
    def _of_tables(cls, tables: Mapping[str, Any], folder: Path) -> Sidecar:
        for name, table in tables.items():
            if name not in TABLES:
                hint = did_you_mean(name, TABLES)
                raise ParameterError(f"a sidecar has no table [{name}]{hint}; settings of stages go with --preset")
            if not isinstance(table, Mapping):
                raise ParameterError(f"{name} = {table!r} is not a table: write [{name}]")
        parameters: dict[str, Any] = {}
        for name, group in GROUPS.items():
            stated = group().with_values(tables.get(name, {}))
            parameters |= {f"{name}.{one}": getattr(stated, one) for one in tables.get(name, {})}
        circle = tables.get("fixed_ball")
        biases = tables.get("biases")
        return cls(
            parameters=parameters,
            fixed_ball=None if circle is None else _circle(circle),
            truth=StatedTruth.of(tables["truth"], folder) if "truth" in tables else None,
            biases=None
            if biases is None
            else BiasParameters().with_values({name.removeprefix("bias_"): value for name, value in biases.items()}),
        )


def biases_beside(recording: Path) -> BiasParameters | None:
    """Biases of a recording's `NAME.bias`, else of its `NAME.toml`; None without; raises as `read_biases` does."""
    path = recording.with_suffix(".bias")
    return read_biases(path) if path.is_file() else Sidecar.beside(recording).biases


def _toml_tables(path: Path) -> dict[str, Any]:
    """The tables of a TOML file; raises RecordingError."""
    try:
        return toml_tables(file_bytes(path, MAX_BYTES).decode("utf-8-sig"))
    except OSError as error:
        raise RecordingError(f"the sidecar cannot be read ({error.strerror}): {path}") from error
    except (UnicodeDecodeError, ParameterError) as error:
        raise RecordingError(f"the sidecar cannot be read ({error}): {path}") from None


def _circle(table: Mapping[str, Any]) -> tuple[float, float, float]:
    names = ("x_px", "y_px", "radius_px")
    if set(table) != set(names):
        raise ParameterError(f"[fixed_ball] has {', '.join(table) or 'nothing'}: give {', '.join(names)}")
    x, y, radius = (_finite(f"fixed_ball.{name}", table[name]) for name in names)
    return x, y, radius


def _number(table: Mapping[str, Any], name: str) -> float | None:
    value = _finite(f"truth.{name}", table[name]) if name in table else None
    if value is not None and value < 0:
        raise ParameterError(f"truth.{name} = {value:g} is not allowed: give a number of 0 or more")
    return value


def _in_event_camera(
    spin_rps: tuple[float, float, float], table: Mapping[str, Any], folder: Path
) -> tuple[float, float, float]:
    """A spin in the event camera's frame, from that of the table's `camera_frame`; raises SpinscopeError."""
    if "camera_frame" not in table:
        return spin_rps
    path = folder / str(table["camera_frame"])
    tables = _toml_tables(path) if path.is_file() else {}
    try:
        rotation = np.array((tables.get("stereo") or tables["table"])["rotation"], np.float64)
    except (KeyError, TypeError, ValueError):
        rotation = np.empty(0)
    if rotation.shape != (3, 3) or not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-3):
        raise ParameterError(
            "truth.camera_frame names no rotation from the camera's frame: `spinscope calibrate stereo` and `calibrate "
            f"table` write one: {path}"
        )
    x, y, z = (rotation.T @ spin_rps).tolist()
    return x, y, z


def _trajectories(table: Mapping[str, Any]) -> list[int] | None:
    """Numbers of dotted balls' trajectories, one or several; None where the truth states none."""
    numbers = table.get("dotted_trajectories")
    if numbers is None:
        return None
    numbers = numbers if isinstance(numbers, list) else [numbers]
    if not numbers or not all(isinstance(one, int | float) and one == int(one) >= 0 for one in numbers):
        raise ParameterError(f"truth.dotted_trajectories = {numbers!r} is not allowed: give whole numbers, [0, 1, 2]")
    return list(dict.fromkeys(map(int, numbers)))


def _circumstances(table: Mapping[str, Any]) -> dict[str, Any]:
    """Statements of a truth besides the spin."""
    return {
        "ball": _ball_number(table),
        "speed_m_s": _number(table, "speed_m_s"),
        "setting": None if "setting" not in table else str(table["setting"]),
    }


def _ball_number(table: Mapping[str, Any]) -> int | None:
    number = table.get("ball")
    if number is not None and number not in BALL_NUMBERS:
        raise ParameterError(f"truth.ball = {number!r} is not allowed: give a number of the paper's balls, 1 to 7")
    return number


def _vector(table: Mapping[str, Any], name: str) -> tuple[float, float, float] | None:
    if name not in table:
        return None
    values = table[name]
    if not isinstance(values, list) or len(values) != 3:
        raise ParameterError(f"truth.{name} = {values!r} is not allowed: give three numbers [x, y, z]")
    x, y, z = (_finite(f"truth.{name}", value) for value in values)
    return x, y, z


def _finite(name: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ParameterError(f"{name} = {value!r} is not allowed: give a number")
    return float(value)
