"""Suite `scenes`: every free flight in scenes like a lab's or a club's, each beside its truth.

Choices were made on recordings of CHOICE_SEED and after, of which `--quick` takes some; SEED was drawn for the
published results and is used for nothing else.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ...registry import Parameters
from ...simulator.real_scenes import KINDS, real_scene
from ...simulator.scene_sampler import RealScene
from ..estimation import BEST, estimated
from ..plots import Figures, panels
from ..rendering import render
from ..segment_matching import INVENTED, MISSED, MIXED, OUTCOMES, RIGHT, WRONG, segment_rows
from ..tables import Cell, ResultTable, Row, distinct, share, summary, where
from ..tasks import Task, TaskContext
from ..uncertainty_calibration import ERRORS, FLIGHT_NOTE, RIGHT_NOTE, calibration_table, refusals

LABEL = "Real scenes"
HELP = "Every flight in scenes like a lab's or a club's: backgrounds, clutter, bounces, several balls, sensors."

TAKES_RIVALS = True

CHOICE_SEED, SEED = 75_000, 385_494
SEEDS = 2  # scenes of each kind
QUICK = ("davis346", "bounce", "crossing")

# Smallest share of flights answered, by group: what is asked of the program.
ANSWERED = {
    "background": 0.85,
    "clutter": 1.0,
    "poses": 1.0,
    "flicker": 1.0,
    "balls and logos": 0.65,
    "bounces and extreme spins": 0.87,
    "sensor trouble": 1.0,
    "edges and several balls": 0.92,
}


def tasks(quick: bool) -> list[Task]:
    """One scene a task."""
    return tasks_of(CHOICE_SEED, 1, QUICK) if quick else tasks_of(SEED, SEEDS)


def tasks_of(first_seed: int, seeds: int, kinds: Sequence[str] = tuple(KINDS)) -> list[Task]:
    """Scenes of these kinds, so many of each."""
    return [
        Task(measure, {"kind": kind, "seed": seed}) for kind in kinds for seed in range(first_seed, first_seed + seeds)
    ]


def measure(context: TaskContext, kind: str, seed: int) -> list[Row]:
    """Every method's answers to the free flights of one scene."""
    made = real_scene(kind, seed)
    recording = render(context, made.scene, seed=seed, sensor=made.sensor, camera=made.camera, lens=made.lens)
    result = estimated(recording, parameters_of(made, context.parameters), rivals=context.choices.rivals)
    return segment_rows(recording, result, {"group": KINDS[kind].group, "kind": kind, "seed": seed})


def parameters_of(made: RealScene, parameters: Parameters) -> Parameters:
    """The parameters with what a user knows of the scene's camera."""
    pixel_um = parameters.camera.pixel_um
    camera = {"focal_length_mm": made.camera.focal_px * pixel_um / 1000, "up": made.camera.up}
    return parameters.with_values({"camera": camera})


def tables(rows: Sequence[Row]) -> list[ResultTable]:
    """Outcomes by group and by kind, of every method, contacts, times to find, calibration, goals and refusals."""
    best = where(rows, method=BEST)
    flights = [row for row in rows if row["outcome"] != INVENTED]
    groups = [(str(group), where(flights, group=group)) for group in distinct(flights, "group")]
    header = ("n", *OUTCOMES, "found after [ms]", "magnitude error [rps]", "axis error [deg]")
    invented = len(where(best, outcome=INVENTED))
    return [
        ResultTable(
            "Flights by group, the program's own answer",
            ("scenes", *header),
            [(name, *outcomes(where(part, method=BEST))) for name, part in (*groups, ("all", flights))],
            NOTE + f" Trusted answers to what is no flight: {invented}.",
        ),
        ResultTable(
            "Flights by kind of scene, the program's own answer",
            ("scene", *header),
            [(kind, *outcomes(where(flights, kind=kind, method=BEST))) for kind in distinct(flights, "kind")],
        ),
        ResultTable(
            "All flights by method",
            ("method", *header),
            [(method, *outcomes(where(flights, method=method))) for method in distinct(flights, "method")],
        ),
        _contacts(best),
        _found(best),
        calibration_table([*groups, ("all", flights)], distinct(flights, "method")),
        _goals(groups),
        refusals([(name, [row | {"visible": True} for row in part]) for name, part in groups], "contrast"),
    ]


NOTE = (
    f"Free flights of at least 20 ms in the image. {RIGHT_NOTE} {FLIGHT_NOTE} Two spins for one: "
    "an answer from events on both sides of a contact, or of two balls. Shares of all flights; the time to find "
    "counts from where the ball's centre comes into the image to the shot's first tick, which may be known some ticks "
    "later."
)


def outcomes(part: Sequence[Row]) -> tuple[Cell, ...]:
    """Count, share of each outcome, time to find and errors of these flights."""
    shares = (share(part, _is(outcome)) for outcome in OUTCOMES)
    return len(part), *shares, *(summary(part, name) for name in ("found_ms", *ERRORS))


def _contacts(best: Sequence[Row]) -> ResultTable:
    """Distances from contacts to the ends of the shots before and after them."""
    lines: list[tuple[Cell, ...]] = []
    for kind in distinct(best, "kind"):
        for name, column in (("ends before", "end_ms"), ("begins after", "begin_ms")):
            late = [float(value) for row in where(best, kind=kind) if isinstance(value := row[column], float)]
            if late:
                near = float(np.mean(np.array(late) <= 2.0))
                lines.append((kind, name, len(late), near, float(np.median(late)), float(np.max(late))))
    columns = ("scene", "the shot", "n", "within 2 ms", "median [ms]", "largest [ms]")
    return ResultTable("Contacts: how near the shots' ends are to them", columns, lines or [("none", *5 * (None,))])


def _found(best: Sequence[Row]) -> ResultTable:
    """Time to find, of the first and of further balls."""
    several = {row["kind"] for row in best if isinstance(row["ball"], int) and row["ball"] > 0}
    flights = [row for row in best if row["ball"] is not None]
    parts = (
        ("one ball", [row for row in flights if row["kind"] not in several]),
        ("first of several", [row for row in flights if row["kind"] in several and row["ball"] == 0]),
        ("further balls", [row for row in flights if row["kind"] in several and row["ball"] != 0]),
        ("low contrast", [row for row in flights if row["group"] == "background"]),
    )
    lines: list[tuple[Cell, ...]] = []
    for name, part in parts:
        late = np.array([float(value) for row in part if isinstance(value := row["found_ms"], float)])
        quantiles = np.quantile(late, (0.5, 0.95)).tolist() if late.size else (None, None)
        missed = share(part, _is(MISSED))
        lines.append((name, len(part), missed, *quantiles, float(late.max()) if late.size else None))
    columns = ("flights", "n", "missed", "median [ms]", "95 % [ms]", "largest [ms]")
    return ResultTable("Time from where a ball comes into the image to its first tick", columns, lines)


def _goals(groups: Sequence[tuple[str, Sequence[Row]]]) -> ResultTable:
    lines: list[tuple[Cell, ...]] = []
    for name, part in groups:
        best, goal = where(part, method=BEST), ANSWERED[name]
        right = share(best, _is(RIGHT)) or 0.0
        false = sum(_is(WRONG)(row) or _is(MIXED)(row) for row in best)
        lines.append(
            (name, len(best), right, f">= {goal:g}", false, "0", "yes" if right >= goal and not false else "no")
        )
    columns = ("scenes", "n", "right", "goal", "wrong or two spins for one", "goal", "met")
    return ResultTable("The program's own answer beside its goals", columns, lines)


def _is(outcome: str) -> Callable[[Row], bool]:
    return lambda row: row["outcome"] == outcome


def figures(rows: Sequence[Row]) -> Figures:
    """Share of each outcome by group."""
    best = [row for row in where(rows, method=BEST) if row["outcome"] != INVENTED]
    names = distinct(best, "group")
    figure, axes = panels(1, 1)
    panel, start = axes[0, 0], np.zeros(len(names))
    for outcome in OUTCOMES:
        part = np.array([share(where(best, group=name), _is(outcome)) or 0.0 for name in names])
        panel.barh(names, part, left=start, label=outcome, alpha=1.0 if outcome == RIGHT else 0.7)
        start = start + part
    panel.set_xlabel("share of the flights")
    panel.invert_yaxis()
    return {"outcomes": figure}
