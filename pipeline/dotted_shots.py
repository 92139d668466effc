"""Truth of a ball thrower by dotted balls: the mean spin of the shots at one setting, and its spread.

A thrower scatters, and a ball with a logo cannot carry dots. The supplement ("Ball thrower benchmark") shoots dotted
balls five times at the settings of the balls with a logo, measures them by SpinDOE (Gossard 2023) and takes the mean
spin vector for the truth.

SpinDOE's own trajectories are a folder: `index.csv` with the number of each (`traj_file`) and its spin, and a file
`NNN.csv` for each with lines `time;x;y;z` (s and m), without a heading.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .errors import ParameterError
from .text_table import number_rows, table_rows

Floats = NDArray[np.float64]

# SpinDOE's own errors, as the supplement states them: of the magnitude, and of the axis.
SPINDOE_SHARE, SPINDOE_AXIS_DEG = 0.01, 2.4
RAD_S = 1.0 / (2.0 * math.pi)  # in rps
# Columns of a spin vector, and their unit in rps. SpinDOE's own tables (index.csv of its trajectories) have the first.
VECTORS = {
    ("x_spin", "y_spin", "z_spin"): RAD_S,
    ("spin_x_rad_s", "spin_y_rad_s", "spin_z_rad_s"): RAD_S,
    ("spin_x_rps", "spin_y_rps", "spin_z_rps"): 1.0,
}
INDEX, NUMBER = "index.csv", "traj_file"  # table of a folder of trajectories, and its column of their numbers
# A thrown ball loses a tenth of its speed to drag in 0.1 s, and a straight line through it leaves 5 cm of gravity out.
SPEED_S = 0.1


@dataclass(frozen=True, eq=False)
class DottedShots:
    """Spins of dotted balls shot at one setting.

    Attributes
    ----------
    spins_rps : (n, 3) float64
        One spin a shot, n >= 1, in the frame of the file.
    speed_m_s : float, optional
        Mean speed of the shots over their first SPEED_S, where each has a trajectory.
    """

    spins_rps: Floats
    speed_m_s: float | None = None

    @property
    def mean_rps(self) -> Floats:
        """(3,) float64 mean spin vector."""
        return np.asarray(self.spins_rps.mean(axis=0))

    @property
    def magnitude_std_rps(self) -> float:
        """1 sigma of the magnitude of another shot at this setting about that of the mean.

        The shots scatter about the true mean, and so does their mean: n shots with spread s give s sqrt(1 + 1 / n). To
        it comes what SpinDOE is off by. Of a single shot no spread is known, and SpinDOE's error is all.
        """
        magnitudes = np.linalg.norm(self.spins_rps, axis=1)
        return math.hypot(self._of_another(magnitudes - magnitudes.mean()), SPINDOE_SHARE * float(magnitudes.mean()))

    @property
    def axis_std_deg(self) -> float | None:
        """The same of the axis, root of the trace of both directions; None where the mean spin is nil."""
        mean, magnitudes = self.mean_rps, np.linalg.norm(self.spins_rps, axis=1)
        turning = magnitudes > 0
        if not np.any(mean) or not turning.any():
            return None
        cosines = self.spins_rps[turning] @ mean / (magnitudes[turning] * np.linalg.norm(mean))
        return math.hypot(self._of_another(np.degrees(np.arccos(np.clip(cosines, -1, 1)))), SPINDOE_AXIS_DEG)

    @staticmethod
    def _of_another(off: Floats) -> float:
        return math.sqrt(float(np.sum(off**2)) / (off.size - 1) * (1 + 1 / off.size)) if off.size > 1 else 0.0

    @classmethod
    def read(cls, table: Path, setting: str | None, numbers: Sequence[int] | None = None) -> DottedShots:
        """The shots of a table, one a row.

        Parameters
        ----------
        table : Path
            CSV with columns of the spin vector (`VECTORS` has the names), or a folder of trajectories with INDEX. Rows
            with the same `shot` (times of one flight) count as one, their mean. Other columns, as of the time, are not
            read.
        setting : str or None
            Where the table has a column `setting`, the rows of this one count.
        numbers : sequence of int, optional
            Of the trajectories that count; all of them if not given.

        Raises
        ------
        SpinscopeError
            A file cannot be read, or states no spin of this setting or trajectory.
        """
        table = table / INDEX if table.is_dir() else table
        columns, rows = table_rows(table)
        names = next((names for names in VECTORS if set(names) <= set(columns)), None)
        if names is None:
            wanted = "; or ".join(", ".join(names) for names in VECTORS)
            raise ParameterError(
                f"dotted shots have no spin in columns {', '.join(columns) or 'without names'}: give {wanted} (x_spin "
                f"is in rad/s): {table}"
            )
        if "setting" in columns:
            known = sorted({row.get("setting", "") for row in rows})
            rows = [row for row in rows if row.get("setting") == setting]
            if not rows:
                raise ParameterError(
                    f"no dotted shot is of the setting {setting!r}: the table has {', '.join(known)}; state [truth] "
                    f"setting as there: {table}"
                )
        if numbers is not None:
            of_number = {_trajectory_number(row): row for row in rows}
            if missing := [number for number in numbers if number not in of_number]:
                raise ParameterError(
                    f"no row of the setting has {NUMBER} {missing[0]}: state numbers of this table in "
                    f"dotted_trajectories: {table}"
                )
            rows = [of_number[number] for number in numbers]
        shots: dict[str, list[list[float]]] = {}
        for index, row in enumerate(rows):
            try:
                spin = [float(row[name]) * VECTORS[names] for name in names]
            except (KeyError, ValueError):
                spin = [math.nan]
            if not all(map(math.isfinite, spin)):
                raise ParameterError(
                    f"shot {index + 1} of the setting has no numbers in {', '.join(names)}: leave it out: {table}"
                )
            shots.setdefault(row.get("shot") or f"row {index}", []).append(spin)
        if not shots:
            raise ParameterError(f"dotted shots have no row: give one a shot: {table}")
        paths = [table.with_name(f"{number:03}.csv") for row in rows if (number := _trajectory_number(row)) is not None]
        speed_m_s = None
        if len(paths) == len(rows) and all(path.is_file() for path in paths):
            speed_m_s = float(np.mean([_speed_m_s(path) for path in paths]))
        return cls(np.array([np.mean(spins, axis=0) for spins in shots.values()]), speed_m_s)


def is_trajectory(path: Path) -> bool:
    """Whether a file is one of the numbered ones beside an INDEX."""
    return path.suffix == ".csv" and path.stem.isdecimal() and path.with_name(INDEX).is_file()


def _trajectory_number(row: dict[str, str]) -> int | None:
    """Number of a row's trajectory, written as 7, 7.0, 007 or 007.csv; None without."""
    try:
        return int(float(row.get(NUMBER, "").removesuffix(".csv")))
    except (ValueError, OverflowError):
        return None


def _speed_m_s(path: Path) -> float:
    """Speed over the first SPEED_S of a trajectory; raises SpinscopeError."""
    rows = number_rows(path)
    if rows.ndim == 2 and rows.shape[1] == 4:
        t_s, places_m = rows[:, 0] - rows[0, 0], rows[:, 1:]
        first = t_s <= SPEED_S
        if np.all(np.diff(t_s) >= 0) and t_s[first].max() > 0:  # two cameras may see the ball in the same millisecond
            return float(np.linalg.norm(np.polyfit(t_s[first], places_m[first], 1)[0]))
    raise ParameterError(
        f"a trajectory has lines time;x;y;z (s, m) in order of time, two or more in its first {SPEED_S:g} s: {path}"
    )
