"""Tables and curve of the error budget from outcomes made up here; making them takes minutes."""

from __future__ import annotations

from itertools import islice
from pathlib import Path

import pytest

from spinscope.pipeline.evaluation.contrast_budget import (
    CASES,
    FLIGHTS,
    Outcome,
    budget_table,
    draw_coverage,
    honesty_table,
    outcomes,
    scenes,
)

FOUND = [
    Outcome(f"{kind} {shot}", case, True, 0.01 * (shot + 1), 1.0 + shot - 0.1 * number, 0.015, 1.5)
    for kind in ("flight", "spinner")
    for shot in range(2)
    for number, case in enumerate(CASES)
]


def test_the_budget_holds_every_case_over_the_shots_that_all_answer() -> None:
    refused = Outcome("flight 2", CASES[0], False, 1.0, 1.0, float("nan"), float("nan"))
    table = budget_table([*FOUND, refused], "flight")
    assert "flights (2 shots)" in table
    assert all(f"| {case} |" in table for case in CASES)
    assert "0.015 (0.015) | 1.50 (1.50)" in table


def test_honesty_counts_what_is_within_the_stated_error() -> None:
    assert "| flights | 2 | 2 | 50 %, 100 % | 50 %, 100 % |" in honesty_table(FOUND)


def test_the_curve_is_drawn(tmp_path: Path) -> None:
    draw_coverage(FOUND, tmp_path / "curve.png")
    assert (tmp_path / "curve.png").read_bytes().startswith(b"\x89PNG")


def test_seeds_are_fixed_and_a_shot_gives_an_outcome_a_case() -> None:
    assert [seed for _, _, seed in scenes()] == [seed for _, _, seed in scenes()]
    name, scene, seed = next(islice(scenes(), FLIGHTS, None))
    assert name == "spinner 0"
    found = outcomes(name, scene, seed)
    assert [one.case for one in found] == list(CASES)
    assert found[1].magnitude_rps == pytest.approx(found[0].magnitude_rps, abs=0.5)
