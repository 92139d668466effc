"""Suite `thrower`: flying balls (section 4.3, table 2 and its figures).

Over the supplement's table of the thrower's settings, and, which the paper has not, shots with the speeds and spins
that people play.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..simulator import human_shot, thrown
from ..simulator.thrower import THROWER_BACKTOP_RPS, THROWER_SIDE_RPS, THROWER_SPEED_M_S
from . import paper
from .estimating import COLUMNS, estimate_rows, logo_events, longest, method_line, shots_of
from .honesty import Goal, goals, honesty, refusals
from .rendering import Rendered, rendered
from .tables import Cell, Row, Table, distinct, where
from .work import Bench, Task

SEED = 72_000  # of this suite alone: nothing was tuned on these recordings
HUMAN_SEED = 72_500
HUMAN_SHOTS = 40
VISIBLE = 500  # logo events in a flight from which an answer is asked for

THROWER, HUMAN = "thrower", "people"  # who plays

Setting = tuple[int, int, bool, int]  # velocity setting, spin setting, side spin, seed


def settings(quick: bool) -> list[Setting]:
    """All settings of the paper's table of ground truth, each once."""
    every = [
        (velocity, spin, side)
        for side, table in ((True, THROWER_SIDE_RPS), (False, THROWER_BACKTOP_RPS))
        for velocity, row in table.items()
        for spin in row
    ]
    numbered = [(*setting, SEED + number) for number, setting in enumerate(every)]
    return [setting for setting in numbered if setting[:3] in QUICK] if quick else numbered


QUICK = {(25, -3, False), (20, 4, False), (15, 0, True)}


def tasks(quick: bool) -> list[Task]:
    """One flight a task: the thrower's, then people's."""
    people = [Task(measure_human, {"seed": HUMAN_SEED + number}) for number in range(1 if quick else HUMAN_SHOTS)]
    return thrower_tasks(quick) + people


def thrower_tasks(quick: bool) -> list[Task]:
    """The thrower's flights alone."""
    return [
        Task(measure, {"velocity": velocity, "spin": spin, "side": side, "seed": seed})
        for velocity, spin, side, seed in settings(quick)
    ]


def measure(bench: Bench, velocity: int, spin: int, side: bool, seed: int) -> list[Row]:
    """Every method's errors in one flight, with the tracker's own positions."""
    recording = flight_of(bench, velocity, spin, side, seed)
    return _measured(bench, recording, about_flight(recording, velocity, spin, side, seed))


def measure_human(bench: Bench, seed: int) -> list[Row]:
    """The same in a shot as people play them."""
    recording = rendered(bench, human_shot(seed=seed), seed=seed)
    about: Row = {"velocity_setting": None, "spin_setting": None, "side": None, "seed": seed, "by": HUMAN}
    about["speed_m_s"] = float(np.linalg.norm(recording.truth.velocity_m_s[0]))
    about["rps"] = float(np.linalg.norm(recording.truth.spin_rps[0]))
    return _measured(bench, recording, about | _seen(recording))


def _measured(bench: Bench, recording: Rendered, about: Row) -> list[Row]:
    log = shots_of(recording, bench.parameters)
    shot = longest(log)
    about["tracked_ms"] = 0.0 if shot is None else (shot.end_us - shot.start_us) / 1000
    return estimate_rows(log, recording.truth, about)


def flight_of(bench: Bench, velocity: int, spin: int, side: bool, seed: int) -> Rendered:
    """The recording of a setting."""
    return rendered(bench, thrown(velocity, spin, side=side, seed=seed), seed=seed)


def about_flight(recording: Rendered, velocity: int, spin: int, side: bool, seed: int) -> Row:
    """What the truth knows of a flight."""
    table = THROWER_SIDE_RPS if side else THROWER_BACKTOP_RPS
    return {
        "velocity_setting": velocity,
        "spin_setting": spin,
        "side": side,
        "seed": seed,
        "by": THROWER,
        "speed_m_s": THROWER_SPEED_M_S[velocity],
        "rps": table[velocity][spin],
        **_seen(recording),
    }


def _seen(recording: Rendered) -> Row:
    seen = logo_events(recording.truth, recording)
    return {"duration_ms": recording.duration_us / 1000, "logo_events": seen, "visible": seen >= VISIBLE}


def tables(rows: Sequence[Row]) -> list[Table]:
    """Table 2, the same by velocity and by kind of spin, people's shots, and how honest the uncertainties are."""
    methods = distinct(rows, "method")
    human, both, rows = where(rows, by=HUMAN), rows, where(rows, by=THROWER)
    players = [(who, part) for who in (THROWER, HUMAN) if (part := where(both, by=who))]
    lines: list[tuple[Cell, ...]] = []
    for name, (success, magnitude, axis) in paper.TABLE_2.items():
        lines.append((f"paper, {name}", None, success, None, magnitude, axis))
    lines += [method_line(where(rows, method=method), method) for method in methods]
    return [
        Table("Table 2: flying balls", COLUMNS, lines, NOTE),
        _by(rows, "speed [m/s]", "speed_m_s", {speed: str(speed) for speed in THROWER_SPEED_M_S.values()}),
        _by(rows, "spin", "side", {True: "side", False: "top/back"}),
        Table(
            "Flying balls as people play them",
            COLUMNS,
            [method_line(where(human, method=method), method) for method in methods],
            "Log-normal speeds and spins with the published quantiles: spin median 46, 95 % below 120 rps; speed "
            "median 9, 95 % below 20 m/s; top, back and mixed.",
        ),
        honesty(players, methods),
        _goals(where(both, method="contrast")),
        refusals(players, "contrast"),
    ]


def _goals(own: Sequence[Row]) -> Table:
    """What is asked of `contrast` in flight."""
    asked = []
    for what, part in (
        ("back/top", where(own, by=THROWER, side=False)),
        ("mixed axes", where(own, by=THROWER, side=True)),
        ("people", where(own, by=HUMAN)),
        ("all flights", own),
    ):
        asked.append(Goal(what, part, answered=0.81, rps=1.0, deg=5.0, gross=0.02))
        asked.append(
            Goal(f"{what}, logo visible", where(part, visible=True), answered=0.9, rps=1.0, deg=5.0, gross=0.02)
        )
    asked.append(Goal("logo never seen", where(own, logo_events=0), answered=0.0, refuse=True))
    return goals("`contrast` beside its goals", asked, "Mean absolute errors of the answers.")


NOTE = (
    f"'of those with logo': flights with at least {VISIBLE} logo events. Without a ball, or where a method refuses, "
    "an answer counts as failed."
)


def _by(rows: Sequence[Row], header: str, column: str, labels: Mapping[Any, str]) -> Table:
    """The methods' lines apart by one column."""
    lines: list[tuple[Cell, ...]] = []
    for value, label in labels.items():
        part = where(rows, **{column: value})
        lines += [(label, *method_line(where(part, method=m), m)) for m in distinct(part, "method")]
    return Table(f"Flying balls by {header}", (header, *COLUMNS), lines)
