"""Figures of README are those of the results pages, and these have the same tables as the JSON beside them."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
PAGES = ("results_rivals", "results", "results_scenes", "results_live")  # of a suite on two pages the later one counts


def suites(page: str) -> dict[str, list[dict[str, Any]]]:
    """Tables of a page by suite."""
    lines = (ROOT / f"docs/{page}.json").read_text(encoding="utf-8").splitlines()
    return {suite["suite"]: suite["tables"] for suite in map(json.loads, lines)}


SUITES = {name: tables for page in PAGES for name, tables in suites(page).items()}


def rows(suite: str, title: str, *first: str) -> list[dict[str, str]]:
    """Rows of a table whose first cells are these, by column."""
    (table,) = (one for one in SUITES[suite] if one["title"].startswith(title))
    found = [row for row in table["rows"] if row[: len(first)] == list(first)]
    assert found, (suite, title, first)
    return [dict(zip(table["columns"], row, strict=True)) for row in found]


def row(suite: str, title: str, *first: str) -> dict[str, str]:
    (found,) = rows(suite, title, *first)
    return found


def mean(cell: str) -> str:
    return cell.split(" ")[0]


def percent(cell: str) -> str:
    return f"{100 * float(cell):.0f} %"


def errors(found: dict[str, str]) -> str:
    """Mean errors, as README states them."""
    return f"{mean(found['magnitude error [rps]'])} rps, {mean(found['axis error [deg]'])} degrees"


def wrong(found: dict[str, str]) -> str:
    return "none wrong" if found["wrong"] == "0.00" else f"{100 * float(found['wrong']):.2g} % wrong"


def spread(window: str, quantity: str) -> str:
    """Smallest and largest of the paper's means over its balls."""
    found = [
        one for one in rows("spinner", f"Table 1: error of the spin {quantity}", window) if one["method"] == "paper"
    ]
    means = [
        float(mean(cell)) for one in found for name, cell in one.items() if name.startswith("ball") and cell != "-"
    ]
    return f"{min(means):.2g} to {max(means):.2g}"


def table_of_readme() -> list[str]:
    """Lines of README's table of errors."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    part = text.partition("| | paper, real recordings |")[2].partition("\n\n")[0]
    return part.splitlines()[2:]


def paper_spins(window: str) -> str:
    return f"{spread(window, 'magnitude')} rps, {spread(window, 'axis')} degrees"


def expected_table() -> list[str]:
    """Lines of README's table of errors, from the results."""
    spinner = {
        key: row("spinner", "All balls together", *key, "best")
        for key in [(window, spin) for window in ("100 ms", "10 ms") for spin in ("top/back", "side")]
    }
    long = [spinner["100 ms", spin] for spin in ("top/back", "side")]
    answers = row("spinner", "Errors over the stated error", "100 ms", "best")["answers"]
    short_top, short_side = (spinner["10 ms", spin] for spin in ("top/back", "side"))
    paper, paper_frame = (row("thrower", "Table 2", name) for name in ("paper, event", "paper, frame"))
    thrown, people = row("thrower", "Table 2", "best"), row("thrower", "Flying balls as people", "best")
    median = people["magnitude error [rps]"].split("(")[1].strip(")")
    frame, event = (row("frames", "Frame against event: flying", name) for name in ("frame", "best"))
    scenes = row("scenes", "Flights by group", "all")
    flights, seen = (row("flights", "Flights by class", name) for name in ("all", "with 60 logo events or more"))
    speeds = [
        one for one in rows("detector", "Ball detector by speed", "one ball") if one["stage"] == "refined + kalman"
    ]
    centres = [mean(one["centre [px]"]) for one in speeds]
    assert scenes["two spins for one"] == "0.00"
    assert (speeds[0]["speed [m/s]"], speeds[-1]["speed [m/s]"]) == ("4.00", "20.0")
    return [
        f"| ball spinner, 100 ms | {paper_spins('100 ms')} | top and back {errors(long[0])}; side {errors(long[1])}; "
        f"{answers} of {sum(int(one['n']) for one in long)} answered |",
        f"| ball spinner, 10 ms | {paper_spins('10 ms')} | top and back {errors(short_top)}, "
        f"{percent(short_top['success'])} answered "
        f"({percent(short_top['of those with logo'])} of the windows with logo); "
        f"side {errors(short_side)}, {percent(short_side['success'])} ({percent(short_side['of those with logo'])}) |",
        f"| {thrown['n']} thrown balls | {errors(paper)}, {percent(paper['success'])} answered | {errors(thrown)}, "
        f"{percent(thrown['success'])} answered ({percent(thrown['of those with logo'])} of the flights with logo) |",
        f"| {people['n']} shots at people's speeds and spins | - | "
        f"{errors(people).replace(' rps', f' rps (median {median})')}, {percent(people['success'])} answered |",
        f"| frame camera, every third thrown ball | {errors(paper_frame)}, {percent(paper_frame['success'])} answered "
        f"(all) | frame method {errors(frame)}, {percent(frame['success'])}; `best` {errors(event)}, "
        f"{percent(event['success'])} |",
        f"| {scenes['n']} flights in scenes of labs and clubs | - | {percent(scenes['right'])} right, "
        f"{percent(scenes['refused'])} refused, {wrong(scenes)}, no two spins taken for one |",
        f"| {flights['n']} flights with visible, rim and hidden logos | - | {percent(flights['answered'])} answered, "
        f"{wrong(flights)}; with 60 logo events or more {percent(seen['answered'])}, at "
        f"{errors(seen).replace(',', ' and')} |",
        f"| ball's centre, 4 to 20 m/s | below 1 px | {min(centres, key=float)} to {max(centres, key=float)} px |",
    ]


def test_the_table_of_readme_is_that_of_the_results() -> None:
    assert table_of_readme() == expected_table()


def test_the_words_below_the_table_are_those_of_the_results() -> None:
    text = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    answered = [row("thrower", "Table 2", name)["success"] for name in ("triplet", "triplet, paper preset")]
    stated = {
        key: row("thrower", "Errors over the stated error", *key)
        for key in [
            ("thrower", "triplet"),
            ("thrower", "triplet, paper preset"),
            ("thrower", "best"),
            ("people", "best"),
        ]
    }
    gross = [percent(stated["thrower", name]["gross"]) for name in ("triplet", "triplet, paper preset")]
    assert (
        f"`triplet` answers {percent(answered[0])} of the thrown balls, and {gross[0]} of these answers are off by "
        f"more than 10 rps or 20 degrees; with the settings that the paper states "
        f"{percent(answered[1]).removesuffix(' %')} and {gross[1]}."
    ) in text
    within = [
        f"{percent(found['magnitude within 1 sigma']).removesuffix(' %')} and {percent(found['magnitude, 2 sigma'])}"
        for found in (stated["thrower", "best"], stated["people", "best"])
    ]
    assert f"of `best` in magnitude {within[0]} (thrown) and {within[1]} (people) lie within 1 and 2" in text


@pytest.mark.parametrize("page", PAGES)
def test_a_page_has_the_tables_of_its_json(page: str) -> None:
    text = (ROOT / f"docs/{page}.md").read_text(encoding="utf-8")
    parts = dict(re.findall(r"^## [^\n]*\(`(\w+)`\)\n(.*?)(?=^## |\Z)", text, re.MULTILINE | re.DOTALL))
    assert {name: re.findall(r"^### (.*)", part, re.MULTILINE) for name, part in parts.items()} == {
        name: [table["title"] for table in tables] for name, tables in suites(page).items()
    }
    for name, tables in suites(page).items():
        shown = [line for line in parts[name].splitlines() if line.startswith("| ")]
        assert shown == [f"| {' | '.join(cells)} |" for table in tables for cells in [table["columns"], *table["rows"]]]
