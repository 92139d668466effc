"""Spin in the words of table tennis: its kind, revolutions per minute, kilometres per hour, uncertainty."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .results import SpinEstimate

Vector = NDArray[np.float64]

# A direction of flight that is nearly up or down leaves no sideways axis to call top or back: sin of 5 degrees.
STEEP = 0.087
# A second component is worth a word from here on: a third of the spin turns the axis by 20 degrees.
WORTH_A_WORD = 1 / 3

_AXES = (
    ("to the right in the image", (1, 0, 0)),
    ("to the left in the image", (-1, 0, 0)),
    ("down the image", (0, 1, 0)),
    ("up the image", (0, -1, 0)),
    ("away from the camera", (0, 0, 1)),
    ("towards the camera", (0, 0, -1)),
)


@dataclass(frozen=True, slots=True)
class Kind:
    """The kind of a spin relative to the flight, or its axis alone where there is no flight.

    Attributes
    ----------
    name : str
        Of the dominant component: topspin, backspin, left sidespin, right sidespin, corkscrew, reverse corkscrew;
        "axis to the right in the image" and the like without a direction of flight; "no spin" for zero.
    off_deg : float
        Angle between the spin and the pure kind of that name.
    parts_rps : dict[str, float]
        Every named component (by its positive name: topspin, left sidespin, corkscrew), signed; empty without a
        direction of flight.
    """

    name: str
    off_deg: float
    parts_rps: dict[str, float]

    @property
    def sentence(self) -> str:
        """The kind with what else is in it, like `topspin with right sidespin (axis tilted 24° from pure topspin)`."""
        if not self.parts_rps or self.name == "no spin":
            return self.name if self.name == "no spin" else f"{self.name}, tilted by {self.off_deg:.0f}°"
        whole = np.linalg.norm(list(self.parts_rps.values()))
        ranked = sorted(self.parts_rps.items(), key=lambda part: -abs(part[1]))[1:]
        also = [_signed_name(name, value) for name, value in ranked if abs(value) >= WORTH_A_WORD * whole]
        mixture = f" with {' and '.join(also)}" if also else ""
        return f"{self.name}{mixture} (axis tilted {self.off_deg:.0f}° from pure {self.name})"


def kind_of_spin(spin_rps: Vector, velocity_m_s: Vector | None, up: Sequence[float]) -> Kind:
    """Name a spin (3,) in rps by the direction of flight (3,) and the up direction, all in the camera frame.

    With v, u and s = u x v made unit vectors: topspin = spin . s, left sidespin = spin . u, corkscrew = spin . v;
    their opposites are backspin, right sidespin and reverse corkscrew. A ball that does not fly (velocity None), or
    straight up or down, has its axis named by the image instead.
    """
    spin = np.asarray(spin_rps, np.float64)
    magnitude = float(np.linalg.norm(spin))
    if magnitude == 0:
        return Kind("no spin", 0.0, {})
    directions = _directions(velocity_m_s, up)
    if directions is None:
        cosines = [float(spin @ np.array(axis)) / magnitude for _, axis in _AXES]
        at = int(np.argmax(cosines))
        return Kind(f"axis {_AXES[at][0]}", _degrees(cosines[at]), {})
    parts = {name: float(spin @ direction) for name, direction in directions.items()}
    main = max(parts, key=lambda name: abs(parts[name]))
    return Kind(_signed_name(main, parts[main]), _degrees(abs(parts[main]) / magnitude), parts)


def rpm(spin_rps: float) -> float:
    """Revolutions per minute."""
    return 60.0 * spin_rps


def km_h(speed_m_s: float) -> float:
    """Kilometres per hour."""
    return 3.6 * speed_m_s


def vector_words(spin_rps: Vector | None) -> str:
    """Components of a spin (3,) in whole rps, "nothing" without one."""
    return "nothing" if spin_rps is None else f"({', '.join(f'{value:.0f}' for value in spin_rps)}) rps"


def std_words(std: float) -> str:
    """One decimal, or two where one would say that there is no uncertainty."""
    return f"{std:.1f}" if std >= 0.095 else f"{std:.2f}"


def axis_words(estimate: SpinEstimate) -> str:
    """`(+0.98, -0.17, +0.05) ± 2.1°` in the camera frame, or a dash where there is none."""
    axis, std_deg = estimate.axis, estimate.axis_std_deg
    if axis is None:
        return "–"
    margin = "" if std_deg is None else f" ± {std_deg:.1f}°"
    return f"({axis[0]:+.2f}, {axis[1]:+.2f}, {axis[2]:+.2f}){margin}"


def speed_words(velocity_m_s: Vector | None) -> str:
    """`8.8 m/s (32 km/h)`, or that the ball stays in place."""
    if velocity_m_s is None:
        return "in place"
    speed = float(np.linalg.norm(velocity_m_s))
    return f"{speed:.1f} m/s ({km_h(speed):.0f} km/h)"


def _directions(velocity_m_s: Vector | None, up: Sequence[float]) -> dict[str, Vector] | None:
    if velocity_m_s is None:
        return None
    speed = float(np.linalg.norm(velocity_m_s))
    if speed == 0:
        return None
    v = np.asarray(velocity_m_s, np.float64) / speed
    u = np.asarray(up, np.float64) / np.linalg.norm(up)
    s = np.cross(u, v)
    if np.linalg.norm(s) < STEEP:
        return None
    return {"topspin": s / np.linalg.norm(s), "left sidespin": u, "corkscrew": v}


def _signed_name(name: str, value: float) -> str:
    opposite = {
        "topspin": "backspin",
        "left sidespin": "right sidespin",
        "corkscrew": "reverse corkscrew",
    }
    return name if value >= 0 else opposite[name]


def _degrees(cosine: float) -> float:
    return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
