"""Suite `thrower`: flying balls (section 4.3, table 2 and its figures).

Over the supplement's table of the thrower's settings, and, which the paper has not, shots with the speeds and spins
that people play.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ...session import Result
from ...simulator import SimulatedRecording, human_shot, thrown
from ...simulator.thrower import THROWER_BACKTOP_RPS, THROWER_SIDE_RPS, THROWER_SPEED_M_S
from .. import paper
from ..estimation import COLUMNS, PRESET_NOTE, estimated, logo_events, longest, method_lines, rows_of_both_presets
from ..lab_recordings import FLIGHT, SIDE, LabRecording
from ..plots import Figures, coverage_figure, flight_figure
from ..rendering import camera_of, render
from ..tables import Cell, ResultTable, Row, distinct, summary, where
from ..tasks import Task, TaskContext
from ..uncertainty_calibration import OF_TRUTH, RIGHT_NOTE, Goal, calibration_table, goals, refusals

LABEL = "Ball thrower: the paper's table 2"
HELP = "Spin of flying balls: the thrower's settings and shots as people play them (table 2)."

TAKES_SCENE_CHOICES = True
TAKES_RIVALS = True
REAL_KINDS = (FLIGHT,)

QUICK_SEED, SEED = 360_550, 605_499  # of this suite alone: of `--quick`, and drawn for the published results
QUICK_HUMAN_SEED, HUMAN_SEED = 880_697, 778_849
HUMAN_SHOTS = 40
VISIBLE = 500  # logo events in a flight from which an answer is asked for

THROWER, HUMAN = "thrower", "people"  # who plays

QUICK = {(25, -3, False), (15, 0, True)}


def flights(quick: bool) -> list[dict[str, Any]]:
    """Arguments of `flight_of` for every entry of the paper's table of ground truth."""
    entries = [
        (velocity, spin, side)
        for side, table in ((True, THROWER_SIDE_RPS), (False, THROWER_BACKTOP_RPS))
        for velocity, row in table.items()
        for spin in row
    ]
    first_seed = QUICK_SEED if quick else SEED
    return [
        {"velocity": entry[0], "spin": entry[1], "side": entry[2], "seed": first_seed + number}
        for number, entry in enumerate(entries)
        if not quick or entry in QUICK
    ]


def tasks(quick: bool) -> list[Task]:
    """One flight a task: the thrower's, then people's."""
    seeds = [QUICK_HUMAN_SEED] if quick else range(HUMAN_SEED, HUMAN_SEED + HUMAN_SHOTS)
    people = [Task(measure_human, {"seed": seed}) for seed in seeds]
    return [Task(measure, flight) for flight in flights(quick)] + people


def measure(context: TaskContext, **flight: Any) -> list[Row]:
    """Every method's errors in one flight, with the tracker's own positions."""
    return _measured(context, *flight_of(context, **flight))


def measure_human(context: TaskContext, seed: int) -> list[Row]:
    """The same in a shot as people play them."""
    scene = human_shot(ball=context.scene.ball, camera=camera_of(context), seed=seed)
    recording = render(context, scene, seed=seed)
    about: Row = {"velocity_setting": None, "spin_setting": None, "side": None, "seed": seed, "by": HUMAN}
    about["speed_m_s"] = float(np.linalg.norm(recording.truth.velocity_m_s[0]))
    about["rps"] = float(np.linalg.norm(recording.truth.spin_rps[0]))
    return _measured(context, recording, about | _visibility(recording))


def real(context: TaskContext, recording: LabRecording) -> list[Row]:
    """The same of a real recording of one flight; of several the longest counts."""
    truth = recording.stated
    session, kind = recording.session, recording.kind_of_spin
    about: Row = {"velocity_setting": None, "spin_setting": None, "side": None if kind is None else kind == SIDE}
    about |= {"setting": truth.setting, "dotted_shots": truth.dotted_shots}
    about |= {"seed": None, "by": THROWER, "speed_m_s": truth.speed_m_s, "rps": truth.rps}
    about["duration_ms"] = (session.source.end_us - session.source.start_us) / 1000
    about |= {"logo_events": None, "visible": None}
    result = session.estimate()
    return rows_of_both_presets(result, truth, about | _tracked(result))


def _measured(context: TaskContext, recording: SimulatedRecording, about: Row) -> list[Row]:
    result = estimated(recording, context.parameters, rivals=context.choices.rivals)
    return rows_of_both_presets(result, recording.truth, about | _tracked(result))


def _tracked(result: Result) -> Row:
    shot = longest(result)
    return {"tracked_ms": 0.0 if shot is None else (shot.end_us - shot.start_us) / 1000}


def flight_of(context: TaskContext, velocity: int, spin: int, side: bool, seed: int) -> tuple[SimulatedRecording, Row]:
    """The recording of a flight at these settings of the thrower, and the columns that tell flights apart."""
    scene = thrown(velocity, spin, side=side, ball=context.scene.ball, camera=camera_of(context), seed=seed)
    recording = render(context, scene, seed=seed)
    about: Row = {"velocity_setting": velocity, "spin_setting": spin, "side": side, "seed": seed, "by": THROWER}
    about["speed_m_s"] = THROWER_SPEED_M_S[velocity]
    about["rps"] = (THROWER_SIDE_RPS if side else THROWER_BACKTOP_RPS)[velocity][spin]
    return recording, about | _visibility(recording)


def _visibility(recording: SimulatedRecording) -> Row:
    seen = logo_events(recording)
    return {"duration_ms": recording.duration_us / 1000, "logo_events": seen, "visible": seen >= VISIBLE}


def tables(rows: Sequence[Row]) -> list[ResultTable]:
    """Table 2, the same by velocity and by kind of spin, people's shots, calibration and goals."""
    methods = distinct(rows, "method")
    human, both, rows = where(rows, by=HUMAN), rows, where(rows, by=THROWER)
    players = [(who, part) for who in (THROWER, HUMAN) if (part := where(both, by=who))]
    return [
        ResultTable("Table 2: flying balls", COLUMNS, [*paper.TABLE_2, *method_lines(rows)], NOTE),
        _by(rows, "speed [m/s]", "speed_m_s", {speed: str(speed) for speed in _stated(rows, "speed_m_s")}),
        _by(rows, "spin", "side", {True: "side", False: "top/back"}),
        *_by_setting(rows),
        ResultTable(
            "Flying balls as people play them",
            COLUMNS,
            method_lines(human),
            "Log-normal speeds and spins with the published quantiles: spin median 46, 95 % below 120 rps; speed "
            "median 9, 95 % below 20 m/s; top, back and mixed.",
        ),
        calibration_table(players, methods),
        _goals(where(both, method="contrast")),
        refusals(players, "contrast"),
    ]


def _by_setting(rows: Sequence[Row]) -> list[ResultTable]:
    """The methods' lines by setting of real recordings, beside the truth and its error; none where none states it."""
    lines: list[tuple[Cell, ...]] = []
    for setting in sorted({str(row["setting"]) for row in rows if row.get("setting")}):
        part = [row for row in rows if row.get("setting") == setting]
        of_truth = [summary(part, name).median for name in ("rps", *OF_TRUTH.values())]
        lines += method_lines(part, setting, part[0]["dotted_shots"], *of_truth)
    columns = ("setting", "dotted shots", "spin [rps]", "its error [rps]", "that of its axis [deg]", *COLUMNS)
    return [ResultTable("Flying balls by setting", columns, lines, SETTING_NOTE)] if lines else []


SETTING_NOTE = (
    "Errors against the truth that is stated for the setting. That of dotted balls is their mean; its error, 1 sigma, "
    "is the scatter of another shot about it, and what SpinDOE is off by (1% and 2.4 degrees)."
)


def _goals(own: Sequence[Row]) -> ResultTable:
    """Goals of `contrast` in flight."""
    asked = []
    for what, part in (
        ("back/top", where(own, by=THROWER, side=False)),
        ("mixed axes", where(own, by=THROWER, side=True)),
        ("people", where(own, by=HUMAN)),
        ("all flights", own),
    ):
        for name, some, answered in ((what, part, 0.81), (f"{what}, logo visible", where(part, visible=True), 0.9)):
            asked.append(Goal(name, some, answered=answered, rps=1.0, deg=5.0, gross=0.02))
    asked.append(Goal("logo never seen", where(own, logo_events=0), answered=0.0, refuse=True))
    return goals("`contrast` beside its goals", asked, "Mean absolute errors of the answers.")


NOTE = (
    f"'of those with logo': flights with at least {VISIBLE} logo events. Without a ball, or where a method refuses, "
    "an answer counts as failed. " + PRESET_NOTE + RIGHT_NOTE
)


def _stated(rows: Sequence[Row], name: str) -> list[Any]:
    """The values of a column that are known, rising."""
    return sorted(value for value in distinct(rows, name) if value is not None)


def _by(rows: Sequence[Row], header: str, column: str, labels: Mapping[Any, str]) -> ResultTable:
    """The methods' lines apart by one column."""
    lines = [line for value, label in labels.items() for line in method_lines(where(rows, **{column: value}), label)]
    return ResultTable(f"Flying balls by {header}", (header, *COLUMNS), lines)


def figures(rows: Sequence[Row]) -> Figures:
    """The paper's figure of the thrower's flights, and error against coverage of all flights."""
    return flight_figure(where(rows, by=THROWER)) | {"coverage": coverage_figure([("flying balls", rows)])}
