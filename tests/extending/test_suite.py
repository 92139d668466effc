"""A suite registered in one place is found by the command line, and in its JSON, page, figures and rows."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from click.testing import CliRunner

from spinscope.app.cli import cli
from spinscope.pipeline.evaluation import ResultTable, Row, Suite, Task, TaskContext
from spinscope.pipeline.evaluation.plots import curve, panels
from spinscope.pipeline.evaluation.suites import SUITES

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def tasks(quick: bool) -> list[Task]:
    return [Task(measure, {"number": number}) for number in range(2 if quick else 4)]


def measure(context: TaskContext, number: int) -> list[Row]:
    return [{"number": number, "error_px": number / 2}]


def tables(rows: Sequence[Row]) -> list[ResultTable]:
    return [ResultTable("Toy errors [px]", ("n",), [(len(rows),)], "A note.")]


def figures(rows: Sequence[Row]) -> dict[str, Figure]:
    figure, axes = panels(1, 1)
    curve(axes[0, 0], rows, "number", "error_px", "errors")
    return {"curve": figure}


@pytest.fixture(autouse=True)
def registered() -> Iterator[None]:
    toy = Suite(name="toy", label="Toy suite", help="Nothing.", tasks=tasks, tables=tables, figures=figures)
    with SUITES.registered(toy):
        yield


def test_toy_suite_is_listed() -> None:
    listed = CliRunner().invoke(cli, ["evaluate", "--list"])
    assert listed.exit_code == 0
    lines = listed.output.splitlines()
    assert len(lines) == len(SUITES) and [line.split(maxsplit=1) for line in lines].count(["toy", "Nothing."]) == 1


def test_toy_suite_is_run_and_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    places = ["--json", tmp_path / "toy.json", "--figures", tmp_path / "figures", "--page", tmp_path / "page.md"]
    done = CliRunner().invoke(cli, ["evaluate", "toy", "--quick", "--workers", "1", *map(str, places)])
    assert done.exit_code == 0, done.output
    assert "A note." in done.output
    written = json.loads((tmp_path / "toy.json").read_text())
    assert (written["suite"], written["title"], written["quick"]) == ("toy", "Toy suite", True)
    assert written["rows"] == [{"number": 0, "error_px": 0.0}, {"number": 1, "error_px": 0.5}]
    page = (tmp_path / "page.md").read_text()
    assert "## Toy suite (`toy`)" in page and "### Toy errors [px]" in page
    assert "![toy: curve](figures/toy_curve.png)" in page
    assert (tmp_path / "figures" / "toy_curve.png").read_bytes().startswith(b"\x89PNG")
    rows = list(csv.DictReader((tmp_path / "figures" / "toy.csv").read_text().splitlines()))
    assert [row["error_px"] for row in rows] == ["0.0", "0.5"]


def test_suites_of_the_folder_are_registered_without_a_list() -> None:
    from spinscope.pipeline.evaluation import suites

    modules = {path.stem for path in Path(next(iter(suites.__path__))).glob("*.py")} - {"__init__"}
    assert set(SUITES.names) == modules | {"toy"}
