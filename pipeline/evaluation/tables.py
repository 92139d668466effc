"""Results: rows as measured, summaries of them, and tables of summaries."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

Value = str | int | float | bool | None
Row = dict[str, Value]  # one measurement; names carry their units


@dataclass(frozen=True, slots=True)
class Summary:
    """Statistics of errors, over `count` values from so many attempts.

    `mean`, `sd` and `median` are None without values; the standard deviation of the sample needs two.
    """

    count: int
    of: int
    mean: float | None
    sd: float | None
    median: float | None

    @classmethod
    def over(cls, values: Iterable[Value]) -> Summary:
        """Of these attempts; None and what is no number count as failures."""
        attempts = list(values)
        good = [float(v) for v in attempts if v is not None and not isinstance(v, str) and math.isfinite(v)]
        if not good:
            return cls(0, len(attempts), None, None, None)
        sd = statistics.stdev(good) if len(good) > 1 else None
        return cls(len(good), len(attempts), statistics.fmean(good), sd, statistics.median(good))

    @property
    def success(self) -> float | None:
        """Share of attempts that gave a value; None without attempts."""
        return self.count / self.of if self.of else None

    def __str__(self) -> str:
        if self.mean is None or self.median is None:
            return "-"
        if self.sd is None:
            return rounded(self.mean)
        return f"{rounded(self.mean)} ± {rounded(self.sd)} ({rounded(self.median)})"


Cell = Value | Summary


@dataclass(frozen=True, slots=True)
class ResultTable:
    """A table for people; a Summary reads "mean ± sd (median)"."""

    title: str
    columns: tuple[str, ...]
    rows: list[tuple[Cell, ...]]
    note: str = ""  # explanation of the numbers in one or two sentences

    def as_text(self) -> list[list[str]]:
        """Every cell as text, row by row."""
        return [[text(cell) for cell in row] for row in self.rows]

    def as_dict(self) -> dict[str, Any]:
        """For JSON: summaries with all their fields."""
        return asdict(self)


def text(cell: Cell) -> str:
    """One cell for people."""
    if cell is None:
        return "-"
    return rounded(cell) if isinstance(cell, float) else str(cell)


def rounded(value: float) -> str:
    """Three digits, no more than the statistics carry."""
    size = abs(value)
    if 0 < size < 0.1:
        return f"{value:.3f}"
    return f"{value:.0f}" if size >= 100 else f"{value:.1f}" if size >= 10 else f"{value:.2f}"


def share(part: Sequence[Row], wanted: Callable[[Row], bool]) -> float | None:
    """The share of rows that are as wanted; None without rows."""
    return sum(map(wanted, part)) / len(part) if part else None


def distinct(rows: Sequence[Row], name: str) -> list[Any]:
    """The values of a column in the order of their first appearance."""
    return list(dict.fromkeys(row[name] for row in rows))


def where(rows: Sequence[Row], **wanted: Value) -> list[Row]:
    """The rows with these values."""
    return [row for row in rows if all(row[name] == value for name, value in wanted.items())]


def summary(rows: Sequence[Row], name: str) -> Summary:
    """Of one column over these rows."""
    return Summary.over(row[name] for row in rows)
