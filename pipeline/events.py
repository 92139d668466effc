"""Events as the sensor sends them: four read-only columns."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import RecordingError


class ColumnBatch:
    """Base of dataclasses with slots whose fields are columns: one row an event, in order of time `t_us`.

    Attributes
    ----------
    KINDS : tuple of str
        numpy's kind of each column, as in `np.empty(0, kind)`.
    """

    __slots__: tuple[str, ...] = ()
    KINDS: ClassVar[tuple[str, ...]]
    t_us: NDArray[np.int64]

    @classmethod
    def empty(cls) -> Self:
        """A batch without events."""
        return cls(*(np.empty(0, kind) for kind in cls.KINDS))

    @property
    def columns(self) -> tuple[NDArray[Any], ...]:
        """All columns, in the order of the fields."""
        return tuple([getattr(self, name) for name in self.__slots__])

    @classmethod
    def concatenate(cls, batches: Iterable[Self]) -> Self:
        """Join batches that follow each other in time."""
        parts = list(batches)
        if len(parts) < 2:
            return parts[0] if parts else cls.empty()
        return cls(*(np.concatenate(column) for column in zip(*(part.columns for part in parts), strict=True)))

    def __len__(self) -> int:
        return self.t_us.size

    def __getitem__(self, rows: slice | NDArray[np.bool_] | NDArray[np.intp]) -> Self:
        """The events of a slice (views), of a mask or of indices (copies)."""
        return type(self)(*[column[rows] for column in self.columns])

    def between(self, start_us: float, end_us: float) -> Self:
        """The events of [start_us, end_us), as views."""
        first, last = self.t_us.searchsorted([start_us, end_us])
        return self[int(first) : int(last)]


@dataclass(frozen=True, slots=True, eq=False)
class EventBatch(ColumnBatch):
    """Events in order of time.

    All columns are read-only. The constructor trusts its arguments; data from outside the program comes in
    through `checked`.

    Attributes
    ----------
    t_us : (n,) int64
        Microseconds in the file's own time, never falling.
    x_px, y_px : (n,) uint16
        Pixel column (to the right) and row (down).
    on : (n,) bool
        True = ON (brighter), False = OFF (darker).
    """

    KINDS: ClassVar = ("i8", "u2", "u2", "?")
    t_us: NDArray[np.int64]
    x_px: NDArray[np.uint16]
    y_px: NDArray[np.uint16]
    on: NDArray[np.bool_]

    def __post_init__(self) -> None:
        for column in self.columns:
            column.flags.writeable = False

    @classmethod
    def checked(
        cls,
        t_us: ArrayLike,
        x_px: ArrayLike,
        y_px: ArrayLike,
        on: ArrayLike,
        *,
        width_px: int,
        height_px: int,
    ) -> EventBatch:
        """Copy columns from outside after checking lengths, order of time and the sensor's bounds.

        Raises RecordingError when the columns differ in length, time goes backwards or a pixel lies outside.
        """
        t = np.array(t_us, np.int64)
        x, y = np.asarray(x_px), np.asarray(y_px)
        polarity = np.array(on, np.bool_)
        if not (t.ndim == 1 and t.shape == x.shape == y.shape == polarity.shape):
            raise RecordingError(
                f"event columns differ in length: t {t.shape}, x {x.shape}, y {y.shape}, on {polarity.shape}"
            )
        if t.size and np.any(t[1:] < t[:-1]):
            at = int(np.argmax(t[1:] < t[:-1])) + 1
            raise RecordingError(f"time goes backwards at event {at}: {t[at - 1]} us, then {t[at]} us")
        for name, column, size in (("x", x, width_px), ("y", y, height_px)):
            if column.size and (int(column.min()) < 0 or int(column.max()) >= size):
                raise RecordingError(
                    f"{name} runs from {column.min()} to {column.max()} px, "
                    f"outside the sensor's {width_px} x {height_px} pixels: state the right --sensor WxH"
                )
        return cls(t, x.astype(np.uint16), y.astype(np.uint16), polarity)

    @property
    def columns(self) -> tuple[NDArray[np.int64], NDArray[np.uint16], NDArray[np.uint16], NDArray[np.bool_]]:
        """t_us, x_px, y_px and on, in this order."""
        return self.t_us, self.x_px, self.y_px, self.on
