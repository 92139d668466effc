"""Suite `spinner`: the ball spinner (section 4.3, table 1 and the figure of errors against rps)."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np

from ...errors import RecordingError
from ...results import Truth
from ...simulator import spinner
from .. import paper
from ..estimation import COLUMNS, PRESET_NOTE, estimated, logo_events, method_lines, rows_of_both_presets
from ..lab_recordings import SIDE, SPINNER, TOP_BACK, LabRecording
from ..plots import LABELS, Figures, coverage_figure, curve, label_axes, method_colors, panels
from ..rendering import render
from ..tables import Cell, ResultTable, Row, distinct, summary, where
from ..tasks import Task, TaskContext
from ..uncertainty_calibration import ERRORS, RIGHT_NOTE, Goal, calibration_table, goals, refusals

LABEL = "Ball spinner: the paper's table 1"
HELP = "Spin of a mounted ball: 7 logos, 10 to 100 rps, windows of 10 and 100 ms (table 1)."

TAKES_SCENE_CHOICES = True
TAKES_RIVALS = True
REAL_KINDS = (SPINNER,)

QUICK_SEED, SEED = 284_876, 510_723  # of this suite alone: of `--quick`, and drawn for the published results
CENTRE_STD_PX = 0.3  # how well the place of a mounted ball is known, for centre and radius
DURATION_MS = 100
# Logo events from which an answer is asked for.
VISIBLE = {10: 100, 100: 1000}
NOT_STATED = "not stated"  # of a real recording
WINDOWS_MS = ((0, 100), (0, 10), (45, 55), (90, 100))


def tasks(quick: bool) -> list[Task]:
    """One recording a task: balls 1-7, top, back and side, 10 to 100 rps."""
    first_seed = QUICK_SEED if quick else SEED
    if quick:
        chosen = [(1, "top", 50.0), (2, "side", 50.0), (4, "back", 80.0)]
    else:
        steps = [10.0 * step for step in range(1, 11)]
        chosen = list(itertools.product(range(1, 8), ("top", "back", "side"), steps))
    return [
        Task(measure, {"ball": ball, "kind": kind, "rps": rps, "seed": first_seed + number})
        for number, (ball, kind, rps) in enumerate(chosen)
    ]


def measure(context: TaskContext, ball: int, kind: str, rps: float, seed: int) -> list[Row]:
    """Every method's errors in the whole recording and in short windows of it."""
    if context.scene.ball not in (None, ball):
        return []
    scene = spinner(ball=ball, kind=kind, magnitude_rps=rps, duration_ms=DURATION_MS, seed=seed)
    recording = render(context, scene, seed=seed)
    parameters = context.parameters.with_values({"track": known_circle(recording.truth, seed)})
    rows: list[Row] = []
    for start_ms, end_ms in WINDOWS_MS:
        window_us = (start_ms * 1000, end_ms * 1000)
        seen = logo_events(recording, window_us)
        about: Row = {"ball": ball, "kind": kind, "rps": rps, "seed": seed, "window_ms": end_ms - start_ms}
        about |= {"start_ms": start_ms, "logo_events": seen, "visible": seen >= VISIBLE[end_ms - start_ms]}
        rows += rows_of_both_presets(
            estimated(recording, parameters, window_us, context.choices.rivals), recording.truth, about
        )
    return rows


def real(context: TaskContext, recording: LabRecording) -> list[Row]:
    """The same of a real recording, as far as it is long enough."""
    truth = recording.stated
    start_us, end_us = recording.span_us
    rows: list[Row] = []
    for start_ms, end_ms in WINDOWS_MS:
        if start_us + end_ms * 1000 > end_us:
            continue
        about: Row = {"ball": truth.ball, "kind": recording.kind_of_spin, "rps": truth.rps, "seed": None}
        about |= {"window_ms": end_ms - start_ms, "start_ms": start_ms, "logo_events": None, "visible": None}
        window = recording.from_whole_ticks(start_ms, end_ms)
        rows += rows_of_both_presets(window.estimate(), truth, about)
    if not rows:
        lasts_ms = (end_us - start_us) / 1000
        raise RecordingError(f"it lasts {lasts_ms:g} ms: record {DURATION_MS} ms or more of a ball on a spinner")
    return rows


def known_circle(truth: Truth, seed: int) -> dict[str, str | float]:
    """Track parameters of a mounted ball: its true circle with an error of measurement of CENTRE_STD_PX."""
    x, y, radius = CENTRE_STD_PX * np.random.default_rng([seed, 7]).standard_normal(3)
    return {
        "ball": "fixed",
        "fixed_x_px": float(truth.x_px[0] + x),
        "fixed_y_px": float(truth.y_px[0] + y),
        "fixed_radius_px": float(truth.radius_px[0] + radius),
        "fixed_std_px": CENTRE_STD_PX,
    }


def tables(rows: Sequence[Row]) -> list[ResultTable]:
    """Table 1 by quantity, the methods over all balls, the calibration of their uncertainties, and the goals."""
    methods = distinct(rows, "method")
    windows = [(f"{ms} ms", where(rows, window_ms=ms)) for ms in sorted(distinct(rows, "window_ms"))]
    return [
        _table_1(rows, "magnitude_error_rps", "Table 1: error of the spin magnitude [rps]", 0),
        _table_1(rows, "axis_error_deg", "Table 1: error of the spin axis [degrees]", 1),
        _table_1(rows, None, "Table 1: success rate", None),
        ResultTable(
            "All balls together",
            ("window", "spin", *COLUMNS),
            [line for ms, group, part in _groups(rows) for line in method_lines(part, f"{ms} ms", group)],
            "Success counts answers over recordings; 'of those with logo' leaves out windows with fewer than 1,000 "
            "(100 ms) or 100 (10 ms) logo events. " + PRESET_NOTE + RIGHT_NOTE,
        ),
        calibration_table(windows, methods),
        _goals(rows),
        refusals(windows, "contrast"),
    ]


def _goals(rows: Sequence[Row]) -> ResultTable:
    """Goals of `contrast`: answers for windows with a visible logo, refusals for those without one."""
    own = where(rows, method="contrast")
    long, short = (where(own, window_ms=ms, visible=True) for ms in (100, 10))
    asked = [Goal("100 ms, all balls", long, answered=0.95, rps=0.2, deg=3.0)]
    for ball in sorted(distinct(long, "ball")):
        asked.append(Goal(f"100 ms, ball {ball}", where(long, ball=ball), answered=0.95, rps=0.2, deg=3.0))
    for group, rps in ((TOP_BACK, 2.0), (SIDE, 0.7)):
        part = [row for row in short if group_of(row) == group]
        asked.append(Goal(f"10 ms, {group}", part, answered=0.7, rps=rps, deg=4.0))
    unseen = [row for row in own if row["logo_events"] == 0]
    asked.append(Goal("logo never seen", unseen, answered=0.0, refuse=True))
    note = "Recordings with a visible logo (see above), so many; mean absolute errors."
    return goals("`contrast` beside its goals", asked, note)


def group_of(row: Row) -> str:
    """The paper's two kinds of spin, or NOT_STATED."""
    kind = row["kind"]
    return NOT_STATED if kind is None else SIDE if kind == SIDE else TOP_BACK


def _groups(rows: Sequence[Row]) -> list[tuple[int, str, list[Row]]]:
    """(window in ms, kind of spin, rows), as the paper's table goes."""
    return [
        (window_ms, group, part)
        for window_ms in sorted(distinct(rows, "window_ms"))
        for group in (TOP_BACK, SIDE, NOT_STATED)
        if (part := [row for row in rows if row["window_ms"] == window_ms and group_of(row) == group])
    ]


def _table_1(rows: Sequence[Row], column: str | None, title: str, of_paper: int | None) -> ResultTable:
    """One quantity (None = success rate) by window, kind of spin and method, a column a ball."""
    balls = sorted(distinct(rows, "ball"), key=lambda ball: ball or math.inf)
    lines: list[tuple[Cell, ...]] = []
    for window_ms, group, part in _groups(rows):
        if of_paper is not None:
            printed = paper.TABLE_1.get((window_ms, group), {})
            own = [printed[ball][of_paper] if ball in printed else None for ball in balls]
            lines.append((f"{window_ms} ms", group, "paper", *own))
        for method in distinct(part, "method"):
            cells: list[Cell] = []
            for ball in balls:
                errors = summary(where(part, method=method, ball=ball), column or "magnitude_error_rps")
                cells.append((errors if column else errors.success) if errors.of else None)
            lines.append((f"{window_ms} ms", group, method, *cells))
    return ResultTable(title, ("window", "spin", "method", *(f"ball {ball or NOT_STATED}" for ball in balls)), lines)


def figures(rows: Sequence[Row]) -> Figures:
    """Errors against rps (the paper's figure): top/back with balls 1, 6, 7, side with 2, 3, 4."""
    windows = sorted(distinct(rows, "window_ms"))
    figure, axes = panels(2, len(windows))
    chosen = [
        row for row in rows if row["ball"] is None or row["ball"] in ((2, 3, 4) if group_of(row) == SIDE else (1, 6, 7))
    ]
    for line, name, label in zip(axes, ERRORS, LABELS, strict=True):
        for panel, window_ms in zip(line, windows, strict=True):
            for group, style in ((TOP_BACK, "-"), (SIDE, "--"), (NOT_STATED, ":")):
                for color, method in method_colors(rows):
                    part = [r for r in where(chosen, window_ms=window_ms, method=method) if group_of(r) == group]
                    curve(panel, part, "rps", name, f"{method}, {group}", style, color)
            label_axes(panel, f"ball spinner, {window_ms} ms", "spin [rps]", label, log=True)
    groups = [(f"ball spinner, {window_ms} ms", where(rows, window_ms=window_ms)) for window_ms in windows]
    return {"errors": figure, "coverage": coverage_figure(groups)}
