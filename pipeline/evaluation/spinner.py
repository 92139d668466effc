"""Suite `spinner`: the ball spinner (section 4.3, table 1 and the figure of errors against rps)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..simulator import spinner
from . import paper
from .estimating import COLUMNS, estimate_rows, logo_events, method_line, shots_of
from .honesty import Goal, goals, honesty, refusals
from .rendering import Rendered, rendered
from .tables import Cell, Row, Table, distinct, summary, where
from .work import Bench, Task

SEED = 71_000  # of this suite alone: nothing was tuned on these recordings
CENTRE_STD_PX = 0.3  # how well the place of a mounted ball is known, for centre and radius
DURATION_MS = 100
# Logo events from which an answer is asked for.
VISIBLE = {10: 100, 100: 1000}
WINDOWS_MS = ((0, 100), (0, 10), (45, 55), (90, 100))


def tasks(quick: bool) -> list[Task]:
    """One recording a task: balls 1-7, top, back and side, 10 to 100 rps."""
    if quick:
        chosen = [(1, "top", 50.0), (2, "side", 50.0), (4, "back", 80.0)]
    else:
        chosen = [
            (ball, kind, 10.0 * step)
            for ball in range(1, 8)
            for kind in ("top", "back", "side")
            for step in range(1, 11)
        ]
    return [
        Task(measure, {"ball": ball, "kind": kind, "rps": rps, "seed": SEED + number})
        for number, (ball, kind, rps) in enumerate(chosen)
    ]


def measure(bench: Bench, ball: int, kind: str, rps: float, seed: int) -> list[Row]:
    """Every method's errors in the whole recording and in short windows of it."""
    scene = spinner(ball=ball, kind=kind, magnitude_rps=rps, duration_ms=DURATION_MS, seed=seed)
    recording = rendered(bench, scene, seed=seed)
    parameters = bench.parameters.with_values({"track": known_circle(recording, seed)})
    rows: list[Row] = []
    for start_ms, end_ms in WINDOWS_MS:
        window_us = (start_ms * 1000, end_ms * 1000)
        seen = logo_events(recording.truth, recording, window_us)
        about: Row = {
            "ball": ball,
            "kind": kind,
            "rps": rps,
            "seed": seed,
            "window_ms": end_ms - start_ms,
            "start_ms": start_ms,
            "logo_events": seen,
            "visible": seen >= VISIBLE[end_ms - start_ms],
        }
        rows += estimate_rows(shots_of(recording, parameters, window_us), recording.truth, about)
    return rows


def known_circle(recording: Rendered, seed: int) -> dict[str, str | float]:
    """Track parameters of the fixed ball: the truth and an error of measuring it."""
    x, y, radius = CENTRE_STD_PX * np.random.default_rng([seed, 7]).standard_normal(3)
    truth = recording.truth
    return {
        "ball": "fixed",
        "fixed_x_px": float(truth.x_px[0] + x),
        "fixed_y_px": float(truth.y_px[0] + y),
        "fixed_radius_px": float(truth.radius_px[0] + radius),
        "fixed_std_px": CENTRE_STD_PX,
    }


def tables(rows: Sequence[Row]) -> list[Table]:
    """Table 1 by quantity, the methods over all balls, how honest their uncertainties are, and the goals."""
    methods = distinct(rows, "method")
    windows = [(f"{ms} ms", where(rows, window_ms=ms)) for ms in sorted(distinct(rows, "window_ms"))]
    return [
        _table_1(rows, "magnitude_error_rps", "Table 1: error of the spin magnitude [rps]", 0),
        _table_1(rows, "axis_error_deg", "Table 1: error of the spin axis [degrees]", 1),
        _table_1(rows, None, "Table 1: success rate", None),
        Table(
            "All balls together",
            ("window", "spin", *COLUMNS),
            [
                (f"{window_ms} ms", group, *method_line(part, method))
                for window_ms, group, part_of_group in _groups(rows)
                for method in methods
                if (part := where(part_of_group, method=method))
            ],
            "Success counts answers over recordings; 'of those with logo' leaves out windows with fewer than 1,000 "
            "(100 ms) or 100 (10 ms) logo events.",
        ),
        honesty(windows, methods),
        _goals(rows),
        refusals(windows, "contrast"),
    ]


def _goals(rows: Sequence[Row]) -> Table:
    """What is asked of `contrast`; of windows with a visible logo, and of those without one a refusal."""
    own = where(rows, method="contrast")
    long, short = (where(own, window_ms=ms, visible=True) for ms in (100, 10))
    asked = [Goal("100 ms, all balls", long, answered=0.95, rps=0.2, deg=3.0)]
    for ball in sorted(distinct(long, "ball")):
        asked.append(Goal(f"100 ms, ball {ball}", where(long, ball=ball), answered=0.95, rps=0.2, deg=3.0))
    for group, rps in (("top/back", 2.0), ("side", 0.7)):
        part = [row for row in short if group_of(row) == group]
        asked.append(Goal(f"10 ms, {group}", part, answered=0.7, rps=rps, deg=4.0))
    unseen = [row for row in own if row["logo_events"] == 0]
    asked.append(Goal("logo never seen", unseen, answered=0.0, refuse=True))
    note = "Recordings with a visible logo (see above), so many; mean absolute errors."
    return goals("`contrast` beside its goals", asked, note)


def group_of(row: Row) -> str:
    """The paper's two kinds of spin."""
    return "side" if row["kind"] == "side" else "top/back"


def _groups(rows: Sequence[Row]) -> list[tuple[int, str, list[Row]]]:
    """(window in ms, kind of spin, rows), as the paper's table goes."""
    return [
        (window_ms, group, part)
        for window_ms in sorted(distinct(rows, "window_ms"))
        for group in ("top/back", "side")
        if (part := [row for row in rows if row["window_ms"] == window_ms and group_of(row) == group])
    ]


def _table_1(rows: Sequence[Row], column: str | None, title: str, of_paper: int | None) -> Table:
    """One quantity (None = success rate) by window, kind of spin and method, a column a ball."""
    balls = sorted(distinct(rows, "ball"))
    lines: list[tuple[Cell, ...]] = []
    for window_ms, group, part in _groups(rows):
        if of_paper is not None:
            printed = paper.TABLE_1[window_ms, group]
            own = [printed[ball][of_paper] if ball in printed else None for ball in balls]
            lines.append((f"{window_ms} ms", group, "paper", *own))
        for method in distinct(part, "method"):
            cells: list[Cell] = []
            for ball in balls:
                errors = summary(where(part, method=method, ball=ball), column or "axis_error_deg")
                cells.append((errors if column else errors.success) if errors.of else None)
            lines.append((f"{window_ms} ms", group, method, *cells))
    return Table(title, ("window", "spin", "method", *(f"ball {ball}" for ball in balls)), lines)
