"""Suite `thrower`: the ball thrower (section 4.3, table 2 and its figures), over the supplement's table of settings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..simulator import thrown
from ..simulator.thrower import THROWER_BACKTOP_RPS, THROWER_SIDE_RPS, THROWER_SPEED_M_S
from . import paper
from .estimating import COLUMNS, calibration, estimate_rows, logo_events, longest, method_line, shots_of
from .rendering import Rendered, rendered
from .tables import Cell, Row, Table, distinct, where
from .work import Bench, Task

SEED = 72_000  # of this suite alone: nothing was tuned on these recordings
VISIBLE = 500  # logo events in a flight from which an answer is asked for

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
    """One flight a task."""
    return [
        Task(measure, {"velocity": velocity, "spin": spin, "side": side, "seed": seed})
        for velocity, spin, side, seed in settings(quick)
    ]


def measure(bench: Bench, velocity: int, spin: int, side: bool, seed: int) -> list[Row]:
    """Every method's errors in one flight, with the tracker's own positions."""
    recording = flight_of(bench, velocity, spin, side, seed)
    log = shots_of(recording, bench.parameters)
    shot = longest(log)
    about = about_flight(recording, velocity, spin, side, seed)
    about["tracked_ms"] = 0.0 if shot is None else (shot.end_us - shot.start_us) / 1000
    return estimate_rows(log, recording.truth, about)


def flight_of(bench: Bench, velocity: int, spin: int, side: bool, seed: int) -> Rendered:
    """The recording of a setting."""
    return rendered(bench, thrown(velocity, spin, side=side, seed=seed), seed=seed)


def about_flight(recording: Rendered, velocity: int, spin: int, side: bool, seed: int) -> Row:
    """What the truth knows of a flight."""
    seen = logo_events(recording.truth, recording)
    table = THROWER_SIDE_RPS if side else THROWER_BACKTOP_RPS
    return {
        "velocity_setting": velocity,
        "spin_setting": spin,
        "side": side,
        "seed": seed,
        "speed_m_s": THROWER_SPEED_M_S[velocity],
        "rps": table[velocity][spin],
        "duration_ms": recording.duration_us / 1000,
        "logo_events": seen,
        "visible": seen >= VISIBLE,
    }


def tables(rows: Sequence[Row]) -> list[Table]:
    """Table 2, the same by velocity and by kind of spin, and how honest the uncertainties are."""
    methods = distinct(rows, "method")
    lines: list[tuple[Cell, ...]] = []
    for name, (success, magnitude, axis) in paper.TABLE_2.items():
        lines.append((f"paper, {name}", None, success, None, magnitude, axis))
    lines += [method_line(where(rows, method=method), method) for method in methods]
    return [
        Table("Table 2: flying balls", COLUMNS, lines, NOTE),
        _by(rows, "speed [m/s]", "speed_m_s", {speed: str(speed) for speed in THROWER_SPEED_M_S.values()}),
        _by(rows, "spin", "side", {True: "side", False: "top/back"}),
        calibration(rows, methods),
    ]


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
