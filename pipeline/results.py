"""Value types that stages and recordings hand on: frozen, and never sharing memory with state."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from .events import ColumnBatch, EventBatch

Vector = NDArray[np.float64]
# An error of more than this tells nothing of whether a spin is one of those looked for.
SHARE_BEYOND = 0.02
PLAIN = frozenset({bool, int, float, str, type(None)})  # types of values that hold no array


class ReadOnlyArrays:
    """Base of results, dataclasses with slots: makes their arrays and column batches read-only."""

    __slots__: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in self.__slots__:
            value = getattr(self, name)
            if type(value) is np.ndarray:
                value.flags.writeable = False
            elif isinstance(value, ColumnBatch) and type(value) is not EventBatch:
                for column in value.columns:
                    column.flags.writeable = False


@dataclass(frozen=True, slots=True, eq=False)
class Packet:
    """The events of one tick: [start_us, end_us), with start_us = index x tick length in file time."""

    index: int
    start_us: int
    end_us: int
    events: EventBatch


@dataclass(frozen=True, slots=True)
class Circle:
    """A circle in the image: centre and radius in pixels, `score` = how well it is supported (0..1)."""

    x_px: float
    y_px: float
    radius_px: float
    score: float


@dataclass(frozen=True, slots=True, eq=False)
class SpinEstimate(ReadOnlyArrays):
    """Spin estimate of one method, or the reason for its refusal.

    Attributes
    ----------
    vector_rps : (3,) float64
        Angular velocity in the camera frame (right-hand rule), rps; None when refused.
    covariance_rps2 : (3, 3) float64
        1-sigma covariance of the vector, rps^2; None when refused.
    reason : str, optional
        Why it is refused, in words for people; None when it is ok.
    events : int
        Number of events (or constraints) behind the answer.
    against : str, optional
        A method that is not to be trusted either where this one is refused: its answer excludes this one, or says less.
    """

    method: str
    vector_rps: Vector | None
    covariance_rps2: NDArray[np.float64] | None
    reason: str | None
    events: int = 0
    against: str | None = None

    @classmethod
    def refused(cls, method: str, reason: str, events: int = 0, against: str | None = None) -> SpinEstimate:
        """Refusal with its reason."""
        return cls(method, None, None, reason, events, against)

    def up_to(self, max_spin_rps: float, against: str | None = None) -> SpinEstimate:
        """The estimate, refused where its magnitude is above the highest spin that is looked for.

        Not so where it is by 1 sigma at most, and by no more than SHARE_BEYOND of it. `against` names a less accurate
        method that is not to be trusted then either.
        """
        beyond_rps = min(self.magnitude_std_rps or 0.0, SHARE_BEYOND * max_spin_rps)
        if self.magnitude_rps is None or self.magnitude_rps <= max_spin_rps + beyond_rps:
            return self
        reason = f"the spin is above spin.max_spin_rps = {max_spin_rps:g} rps: {self.magnitude_rps:.4g} rps"
        return SpinEstimate.refused(self.method, reason, self.events, against)

    @property
    def status(self) -> Literal["ok", "refused"]:
        """Whether there is an answer."""
        return "refused" if self.vector_rps is None else "ok"

    @property
    def magnitude_rps(self) -> float | None:
        """Length of the vector, rps; None when refused."""
        return None if self.vector_rps is None else math.sqrt(self.vector_rps @ self.vector_rps)

    @property
    def axis(self) -> Vector | None:
        """(3,) unit vector, the signed axis; None when refused or the magnitude is zero."""
        magnitude = self.magnitude_rps
        if self.vector_rps is None or not magnitude:
            return None
        return self.vector_rps / magnitude

    @property
    def magnitude_std_rps(self) -> float | None:
        """1 sigma of the magnitude: the covariance seen along the axis."""
        axis = self.axis
        if axis is None or self.covariance_rps2 is None:
            return None
        return math.sqrt(max(float(axis @ self.covariance_rps2 @ axis), 0.0))

    @property
    def axis_std_deg(self) -> float | None:
        """sqrt(trace of the 2 x 2 covariance of the direction in its tangent plane), degrees, at most 180."""
        axis, magnitude = self.axis, self.magnitude_rps
        if axis is None or magnitude is None or self.covariance_rps2 is None:
            return None
        across = float(np.trace(self.covariance_rps2) - axis @ self.covariance_rps2 @ axis)
        return min(math.degrees(math.sqrt(max(across, 0.0)) / magnitude), 180.0)

    def to_dict(self) -> dict[str, Any]:
        """The estimate as `spinscope analyze` writes it, ready for JSON."""
        return {
            "status": self.status,
            "reason": self.reason,
            "vector_rps": None if self.vector_rps is None else self.vector_rps.tolist(),
            "magnitude_rps": self.magnitude_rps,
            "magnitude_std_rps": self.magnitude_std_rps,
            "axis": None if self.axis is None else self.axis.tolist(),
            "axis_std_deg": self.axis_std_deg,
        }


def spin_errors(found_rps: Vector, true_rps: Vector) -> tuple[float, float]:
    """Error of the magnitude in rps and angle between the signed axes in degrees of two (3,) spins in rps."""
    size, true_size = float(np.linalg.norm(found_rps)), float(np.linalg.norm(true_rps))
    cosine = float(found_rps @ true_rps) / max(size * true_size, 1e-9)
    return abs(size - true_size), math.degrees(math.acos(min(max(cosine, -1.0), 1.0)))


@dataclass(frozen=True, slots=True, eq=False)
class MethodResult:
    """Result of a spin method that has no more to show than its estimate from the present shot so far."""

    estimate: SpinEstimate


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """Ground truth of a simulation, of the ball named first in its scene.

    Attributes
    ----------
    t_us : (n,) int64
        Rising.
    x_px, y_px, radius_px : (n,) float64
        Centre of the silhouette and geometric mean of its semi-axes.
    position_m, velocity_m_s, spin_rps : (n, 3) float64
        Camera frame.
    label : (events,) uint8
        0 noise, 1 ball edge and shading, 2 logo, 3 other object, 4 hot pixel.
    """

    t_us: NDArray[np.int64]
    x_px: Vector
    y_px: Vector
    radius_px: Vector
    position_m: Vector
    velocity_m_s: Vector
    spin_rps: Vector
    label: NDArray[np.uint8]


def nbytes(result: Any) -> int:
    """Bytes of all arrays held by a (nested) result; views count as what they show."""
    if isinstance(result, np.ndarray):
        return result.nbytes
    items: Iterable[Any]
    if isinstance(result, (tuple, list)):
        items = result
    elif isinstance(result, dict):
        items = result.values()
    else:
        items = [getattr(result, name) for name in _field_names(result.__class__)]
    total = 0
    for item in items:
        if item.__class__ not in PLAIN:  # nearly all are
            total += nbytes(item)
    return total


@cache
def _field_names(kind: type) -> tuple[str, ...]:
    """Names of a dataclass's fields, none of another type's."""
    return tuple(field.name for field in dataclasses.fields(kind)) if dataclasses.is_dataclass(kind) else ()
