"""Suite `flights`: what each witness says of flights whose logo is seen well, near the rim, hardly, or not at all.

Choices were made on recordings of CHOICE_SEED and after, of which `--quick` takes some; SEED was drawn for the
published results and is used for nothing else. Every flight has air and plumb line of its own.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...kernels.rotation import rotations
from ...simulator import Scene, SensorModel, flight
from ...simulator.motion import matrix_of, quaternion_of
from ...simulator.real_scenes import weak_sensor
from ...simulator.scene import Flight
from ...simulator.thrower import HUMAN_SPEED_M_S, HUMAN_SPIN_RPS
from ..estimation import BEST, estimated
from ..plots import Figures, coverage_figure
from ..rendering import render
from ..segment_matching import MIXED, RIGHT, WRONG, segment_rows
from ..tables import Cell, ResultTable, Row, distinct, share, summary, where
from ..tasks import Task, TaskContext
from ..uncertainty_calibration import (
    ERRORS,
    FLIGHT_NOTE,
    GROSS_DEG,
    GROSS_RPS,
    RIGHT_NOTE,
    STATED,
    Goal,
    calibration_table,
    goals,
    is_answer,
    is_gross,
    ratios,
    refusals,
)

LABEL = "Flights and their witnesses"
HELP = "Flights with visible, rim and hidden logos, people's shots and weak sensors; what each method says of them."

TAKES_RIVALS = True

CHOICE_SEED, SEED = 76_000, 135_184
SEEDS = 8  # flights of each class
VISIBLE = 60  # logo events of a flight that shows its logo at all
LOWEST, HIGHEST = (6.0, 4.0), (150.0, 22.0)  # of spin in rps and speed in m/s
CLASSES = ("visible", "rim", "hidden", "people", "fast", "weak sensor")
SEATS = {"visible": (1, 2, 3, 4, 6, 7), "rim": (5,), "hidden": (2, 3, 4)}  # of the ball spinner's


def tasks(quick: bool) -> list[Task]:
    """One flight a task."""
    return tasks_of(CHOICE_SEED, 1, ("visible", "hidden", "weak sensor")) if quick else tasks_of(SEED, SEEDS)


def tasks_of(first_seed: int, seeds: int, classes: Sequence[str] = CLASSES) -> list[Task]:
    """Flights of these classes, so many of each."""
    return [
        Task(measure, {"name": name, "seed": seed})
        for name in classes
        for seed in range(first_seed, first_seed + seeds)
    ]


def measure(context: TaskContext, name: str, seed: int) -> list[Row]:
    """Every method's answer to one flight."""
    scene, sensor = flight_of(name, seed)
    recording = render(context, scene, seed=seed, sensor=sensor)
    about: Row = {"class": name, "seed": seed, "speed_m_s": float(np.linalg.norm(recording.truth.velocity_m_s[0]))}
    rows = segment_rows(recording, estimated(recording, context.parameters, rivals=context.choices.rivals), about)
    return [row | {"visible": int(row["logo_events"] or 0) >= VISIBLE} for row in rows]


def flight_of(name: str, seed: int) -> tuple[Scene, SensorModel]:
    """Scene and sensor of a flight: spins and speeds as people's, hidden logos under a ball with sidespin."""
    random = np.random.default_rng([seed, *name.encode()])
    values = []
    for (median, high, _), low, most in zip((HUMAN_SPIN_RPS, HUMAN_SPEED_M_S), LOWEST, HIGHEST, strict=True):
        sigma = math.log(high / median) / 1.645  # the standard normal's 95th percentile
        values.append(min(max(median * math.exp(sigma * float(random.standard_normal())), low), most))
    rps, speed_m_s = values
    if name == "fast":
        speed_m_s = float(random.uniform(15.0, HIGHEST[1]))
    kinds = {"hidden": ("left", "right"), "people": ("top", "back", "mixed")}.get(name, ("top", "back"))
    seat = None if name == "people" else int(random.choice(SEATS.get(name, SEATS["visible"])))
    scene = flight(kind=str(random.choice(kinds)), magnitude_rps=rps, speed_m_s=speed_m_s, ball=seat, seed=seed)
    sensor = weak_sensor(random) if name == "weak sensor" else SensorModel.of()
    return _turned_over(scene) if name == "hidden" else scene, sensor


def _turned_over(scene: Scene) -> Scene:
    """The scene with the ball turned by half a turn across its spin axis: a logo above is below."""
    ball = scene.balls[0]
    (motion,) = ball.motions
    assert isinstance(motion, Flight)
    across = np.cross(motion.spin_rps, (1.0, 0.0, 0.0))
    turn = rotations(np.pi * across / np.linalg.norm(across))[0] @ matrix_of(motion.orientation)
    return replace(scene, balls=(replace(ball, motions=(replace(motion, orientation=quaternion_of(turn)),)),))


def tables(rows: Sequence[Row]) -> list[ResultTable]:
    """Answers by class, by method, by what answered together, calibration, goals and refusals."""
    classes = [(name, where(rows, **{"class": name})) for name in distinct(rows, "class")]
    seen = where(rows, visible=True)
    best = where(rows, method=BEST)
    return [
        ResultTable(
            "Flights by class, the program's own answer",
            ("flights", *COLUMNS),
            [
                (name, *_answers(where(part, method=BEST)))
                for name, part in (*classes, ("all", rows), (f"with {VISIBLE} logo events or more", seen))
            ],
            NOTE,
        ),
        ResultTable(
            "Each witness alone, by class",
            ("flights", "method", *COLUMNS),
            [
                (name, method, *_answers(where(part, method=method)))
                for name, part in (*classes, ("all", rows))
                for method in distinct(part, "method")
            ],
        ),
        ResultTable(
            "By the witnesses that have an answer",
            ("witnesses", "trusted", *COLUMNS),
            [(witnesses, str(by), *_answers(part)) for witnesses, by, part in _combinations(rows, best)],
            "Witnesses: the methods that answer. Trusted: the method whose answer the program gives.",
        ),
        calibration_table([*classes, ("all", rows)], distinct(rows, "method")),
        goals(
            "The program's own answer beside its goals",
            [
                Goal(f"{VISIBLE} logo events or more", where(seen, method=BEST), 0.93, rps=0.2, deg=3.0, gross=0.02),
                Goal("all", best, gross=0.02),
            ],
            "Answered: trusted answers among all flights; mean absolute errors.",
        ),
        _flight_alone(classes),
        refusals(classes, "contrast"),
    ]


COLUMNS = ("n", "answered", "right", "wrong", "gross", "magnitude error [rps]", "axis error [deg]")
NOTE = (
    f"{RIGHT_NOTE} {FLIGHT_NOTE} Shares of all flights of the class. Gross: share of the answers that are more than "
    f"{GROSS_RPS:g} rps or {GROSS_DEG:g} degrees off."
)


def _answers(part: Sequence[Row]) -> tuple[Cell, ...]:
    answers = [row for row in part if is_answer(row)]
    right = share(part, lambda row: row["outcome"] == RIGHT)
    wrong = share(part, lambda row: row["outcome"] in (WRONG, MIXED))
    errors = (summary(answers, name) for name in ERRORS)
    return len(part), share(part, is_answer), right, wrong, share(answers, is_gross), *errors


def _flight_alone(classes: Sequence[tuple[str, Sequence[Row]]]) -> ResultTable:
    """Answers of the shape of the flight alone, beside the goals for hidden logos."""
    lines: list[tuple[Cell, ...]] = []
    for name, part in classes:
        answers = [row for row in where(part, method="trajectory") if is_answer(row)]
        magnitude = ratios(answers, *(pair[0] for pair in (ERRORS, STATED)))
        within = float(np.mean(magnitude <= 2)) if magnitude.size else None
        lines.append((name, len(answers), summary(answers, ERRORS[1]).median, "<= 12", within, ">= 0.9"))
    columns = ("flights", "answers", "median axis error [deg]", "goal", "magnitude within its 2 sigma", "goal")
    return ResultTable("`trajectory` alone", columns, lines, "The goals are those for hidden logos.")


def _combinations(rows: Sequence[Row], best: Sequence[Row]) -> list[tuple[str, str, list[Row]]]:
    """(methods that answer, method that is trusted, rows of `best`), the most frequent first."""
    groups: dict[tuple[str, str], list[Row]] = {}
    for row in best:
        same = where(rows, **{name: row[name] for name in ("class", "seed", "ball")})
        names = [str(one["method"]) for one in same if one["method"] != BEST and is_answer(one)]
        groups.setdefault((" + ".join(names) or "none", str(row["by"] or "none")), []).append(row)
    return sorted(((*names, part) for names, part in groups.items()), key=lambda group: -len(group[2]))


def figures(rows: Sequence[Row]) -> Figures:
    """Error against coverage, of all flights."""
    return {"coverage": coverage_figure([("flights", rows)])}
