"""`spinscope evaluate`: what it shows and writes."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from spinscope.app.evaluate import (
    Evaluation,
    evaluate_suite,
    print_evaluation,
    write_csv,
    write_figures,
    write_json,
    write_page,
)
from spinscope.pipeline.errors import ParameterError, RecordingError
from spinscope.pipeline.evaluation import ResultTable, Row, Suite, Summary, Task, TaskContext
from spinscope.pipeline.evaluation.plots import curve, panels
from spinscope.pipeline.evaluation.suites import SUITES


def measure(context: TaskContext, number: int) -> list[Row]:
    return [{"number": number, "error_px": number / 2, "picture": "QUJD"}]


def tasks(quick: bool) -> list[Task]:
    return [Task(measure, {"number": number}) for number in range(2 if quick else 4)]


def tables(rows: Sequence[Row]) -> list[ResultTable]:
    errors = Summary.over(row["error_px"] for row in rows)
    return [ResultTable("Errors [px]", ("what", "error [px]"), [("all", errors)], "Note.")]


def figures(rows: Sequence[Row]) -> dict[str, Any]:
    figure, axes = panels(1, 1)
    curve(axes[0, 0], rows, "number", "error_px", "errors")
    return {"errors": figure}


@pytest.fixture
def evaluation(tmp_path: Path) -> Iterator[Evaluation]:
    suite = Suite(name="made_up", label="Made up", help="", tasks=tasks, tables=tables, figures=figures)
    with SUITES.registered(suite):
        yield evaluate_suite("made_up", workers=1, cache=tmp_path / "cache")


def test_tables_on_screen_keep_their_units(evaluation: Evaluation) -> None:
    screen = Console(file=io.StringIO(), width=100)
    print_evaluation(evaluation, screen)
    shown = screen.file.getvalue()  # type: ignore[attr-defined]
    assert "Errors [px]" in shown and "0.75 ± 0.65 (0.75)" in shown and evaluation.machine.split()[0] in shown


def test_json_csv_and_page(evaluation: Evaluation, tmp_path: Path) -> None:
    write_json([evaluation], tmp_path / "all.json")
    found = json.loads((tmp_path / "all.json").read_text())
    assert found["suite"] == "made_up" and not found["quick"] and len(found["rows"]) == 4
    assert found["date"] and found["machine"] and found["version"]
    write_csv(evaluation, tmp_path / "rows.csv")
    rows = list(csv.DictReader((tmp_path / "rows.csv").read_text().splitlines()))
    assert [row["error_px"] for row in rows] == ["0.0", "0.5", "1.0", "1.5"] and "picture" not in rows[0]
    pictures = [tmp_path / "figures" / name for name in ("made_up_errors.png", "made_up.csv", "other_errors.png")]
    write_page([evaluation], tmp_path / "page.md", pictures)
    page = (tmp_path / "page.md").read_text()
    assert "| all | 0.75 ± 0.65 (0.75) |" in page and evaluation.machine in page and evaluation.date in page
    assert page.count("](figures/made_up_errors.png)") == page.count("![") == 1
    beside = json.loads((tmp_path / "page.json").read_text(encoding="utf-8"))
    table = {"title": "Errors [px]", "columns": ["what", "error [px]"], "rows": [["all", "0.75 ± 0.65 (0.75)"]]}
    assert beside["suite"] == "made_up" and beside["tables"] == [table]


def test_quick_is_said(evaluation: Evaluation, tmp_path: Path) -> None:
    quick = evaluate_suite("made_up", quick=True, workers=1, cache=tmp_path / "cache")
    write_page([quick], tmp_path / "page.md")
    assert len(quick.report.rows) == 2 and "thinned" in (tmp_path / "page.md").read_text()


def test_figures_in_a_new_folder(evaluation: Evaluation, tmp_path: Path) -> None:
    paths = write_figures(evaluation, tmp_path / "new" / "folder")
    assert [path.name for path in paths] == ["made_up_errors.png", "made_up.csv"]
    assert sorted(path.name for path in (tmp_path / "new" / "folder").iterdir()) == [
        "made_up.csv",
        "made_up_errors.png",
    ]


def test_nonsense(evaluation: Evaluation, tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="there is no suite 'spiner'"):
        evaluate_suite("spiner", workers=1, cache=tmp_path)
    (tmp_path / "file").write_text("")
    with pytest.raises(RecordingError, match="cannot be written"):
        write_figures(evaluation, tmp_path / "file")
    with pytest.raises(RecordingError, match="cannot be written"):
        write_json([evaluation], tmp_path / "file" / "all.json")
