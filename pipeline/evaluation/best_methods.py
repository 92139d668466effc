"""Best methods by suite and kind of recording: those with the most right answers and with the smallest errors."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from .estimation import BEST
from .suite import Report
from .tables import Cell, ResultTable, Row, distinct, rounded, share, summary, where
from .uncertainty_calibration import ERRORS, is_right

# Columns by which suites tell kinds of recordings apart; a suite has one of them, or none.
KINDS = ("window_ms", "class", "group", "by", "scene")
# A method that answers what is easy alone has small errors: so many of the most right answers are asked for.
RIGHT_ENOUGH = 0.5


def best_methods(reports: Sequence[Report]) -> ResultTable | None:
    """The table over all suites whose rows are of methods or of the ball detector's stages; None where none is."""
    lines = [line for report in reports for line in _of_report(report)]
    if not lines:
        return None
    return ResultTable(
        "Who is best at what",
        ("suite", "recordings", "n", "most right answers", "smallest magnitude error", "smallest axis error", "place"),
        lines,
        "Shares of right answers as above; medians of the errors in rps and degrees, of the methods with at least "
        f"{RIGHT_ENOUGH:.0%} of the most right answers; place: median error of the ball's centre in px. The "
        f"program's own choice, `{BEST}`, is none of them. Rivals are there where they were named (`--rival`).",
    )


def _of_report(report: Report) -> Iterator[tuple[Cell, ...]]:
    rows = report.rows
    if not rows:
        return
    kind = next((name for name in KINDS if all(name in row for row in rows)), None)
    for value in [None] if kind is None else distinct(rows, kind):
        part = rows if kind is None else where(rows, **{kind: value})
        label = f"{value} ms" if kind == "window_ms" else value
        if all(name in row for row in part for name in ("method", "rps", *ERRORS)):
            count, cells = _of_methods([row for row in part if row["method"] != BEST])
            yield (report.suite.name, label, count, *cells, None)
        elif all("stage" in row and "centre_error_px" in row for row in part):
            stages = {stage: where(part, stage=stage) for stage in distinct(part, "stage")}
            count = max(len(own) for own in stages.values())
            yield (report.suite.name, label, count, None, None, None, _least(stages, "centre_error_px", "px"))


def _of_methods(rows: Sequence[Row]) -> tuple[int, tuple[Cell, Cell, Cell]]:
    """Number of recordings, and the best by right answers, magnitude and axis."""
    methods = {method: where(rows, method=method) for method in distinct(rows, "method")}
    right = {method: share(own, is_right) or 0.0 for method, own in methods.items()}
    most = max(right.values(), default=0.0)
    if most == 0.0:
        return max(map(len, methods.values()), default=0), (None, None, None)
    able = {method: own for method, own in methods.items() if right[method] >= RIGHT_ENOUGH * most}
    first = ", ".join(method for method in methods if right[method] == most)
    magnitude, axis = (_least(able, name, unit) for name, unit in zip(ERRORS, ("rps", "degrees"), strict=True))
    return max(map(len, methods.values())), (f"{first} ({most:.0%})", magnitude, axis)


def _least(rows: Mapping[str, Sequence[Row]], name: str, unit: str) -> Cell:
    """The one with the smallest median, and it; None where nobody has one."""
    medians = {who: summary(own, name).median for who, own in rows.items()}
    known = {who: median for who, median in medians.items() if median is not None}
    if not known:
        return None
    who = min(known, key=lambda one: known[one])
    return f"{who} ({rounded(known[who])} {unit})"
