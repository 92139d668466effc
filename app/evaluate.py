"""Evaluation suites: run one, show its tables, write JSON, CSV, figures and a page."""

from __future__ import annotations

import csv
import dataclasses
import datetime
import io
import json
import os
import platform
import re
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import platformdirs
from rich.console import Console
from rich.markup import escape
from rich.table import Table as ScreenTable

from spinscope.pipeline.evaluation import (
    LabFolder,
    Report,
    ResultTable,
    SceneChoices,
    TaskContext,
    evaluate,
    processor_count,
    task_workers,
)
from spinscope.pipeline.evaluation.best_methods import best_methods
from spinscope.pipeline.evaluation.plots import draw
from spinscope.pipeline.evaluation.protocol import protocol_findings
from spinscope.pipeline.evaluation.real_recordings import evaluate_real
from spinscope.pipeline.evaluation.suites import SUITES
from spinscope.pipeline.evaluation.tasks import Progress, write_whole
from spinscope.pipeline.evaluation.training_set import write_training_set
from spinscope.pipeline.session import Choices

from .terminal import console as terminal_console

WIDE = ("picture",)  # columns that no table of text should hold


@dataclass(frozen=True)
class Evaluation:
    """A suite's report with its date, machine and version.

    Attributes
    ----------
    report : Report
    date, machine, version : str
        ISO 8601 (UTC); processor, cores and system; of Spinscope.
    seconds : float
        Wall-clock time of this run; kept results make it short.
    """

    report: Report
    date: str
    machine: str
    version: str
    seconds: float

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        about = {"date": self.date, "machine": self.machine, "version": self.version, "seconds": round(self.seconds, 1)}
        return about | self.report.as_dict()


def evaluate_suite(
    name: str,
    *,
    quick: bool = False,
    workers: int | None = None,
    cluster: str | None = None,
    cache: Path | None = None,
    choices: Choices | None = None,
    scene: SceneChoices | None = None,
    real: Path | None = None,
    on_progress: Progress | None = None,
) -> Evaluation:
    """Run a suite; see `pipeline.evaluation.evaluate` and `evaluate_real`.

    Parameters
    ----------
    name : str
    quick : bool
    workers : int or None
        Processes on this machine; None = one a core.
    cluster : str or None
        Address of a Dask scheduler whose workers run the tasks instead; raises ParameterError when none answers.
    cache : Path or None
        Folder of the recordings and results kept between runs; None = in the user's cache folder.
    choices : Choices or None
        Preset and settings of the pipeline under evaluation; None = the defaults.
    scene : SceneChoices or None
        Ball and lens of the scenes; the pipeline is told of the lens.
    real : Path or None
        Folder of real recordings to run on instead of simulated ones.
    on_progress : callable or None
    """
    if SUITES[name].timed:
        workers, cluster = 1, None
    choices, scene = choices or Choices(), scene or SceneChoices()
    if scene.lens_mm is not None:
        lens = f"camera.focal_length_mm={scene.lens_mm:g}"
        choices = dataclasses.replace(choices, assignments=[lens, *choices.assignments])
    folder = cache or platformdirs.user_cache_path("spinscope") / "evaluation"
    context = TaskContext(folder, choices.parameters(), choices, scene)
    begin = time.perf_counter()
    with task_workers(processor_count() if workers is None else workers, cluster) as started:
        if real is None:
            report = evaluate(name, context, quick=quick, workers=started, on_progress=on_progress)
        else:
            report = evaluate_real(name, real, context, workers=started, on_progress=on_progress)
    seconds = time.perf_counter() - begin
    today = datetime.datetime.now(datetime.UTC).date().isoformat()
    return Evaluation(report, today, _machine(), version("spinscope"), seconds)


def make_training_set(
    folder: Path,
    *,
    shards: int,
    seed: int,
    workers: int | None = None,
    cluster: str | None = None,
    choices: Choices | None = None,
    on_progress: Progress | None = None,
) -> str:
    """Write a training set for learned estimators; see `write_training_set`. Returns what it holds, in words."""
    choices = choices or Choices()
    context = TaskContext(None, choices.parameters(), choices)
    with task_workers(processor_count() if workers is None else workers, cluster) as started:
        rows = write_training_set(folder, context, shards=shards, seed=seed, workers=started, on_progress=on_progress)
    samples, events = (sum(int(row[name] or 0) for row in rows) for name in ("samples", "events"))
    return f"wrote {samples} windows with {events} events in {len(rows)} files: {folder}"


def suite_list() -> str:
    """Name and description of every suite, one a line."""
    width = max(map(len, SUITES.names))
    return "\n".join(f"{suite.name:{width}}  {suite.help}" for suite in sorted(SUITES, key=lambda suite: suite.name))


def check_folder(folder: Path, choices: Choices, console: Console | None = None) -> int:
    """Show what a folder of real recordings lacks of the recording protocol; the exit status, 1 where it lacks any."""
    console = console or terminal_console()
    found = LabFolder.of(folder, choices)
    missing = protocol_findings(found)
    for finding in missing:
        console.print(f"{finding.recording}: {finding.what}", markup=False, highlight=False, soft_wrap=True)
    count = len(found.recordings) + len(found.wrong)
    lacking = len({finding.recording for finding in missing} - {found.path.name})
    console.print(f"{count} recordings, {lacking} lack something; see docs/recording_protocol.md", highlight=False)
    return 1 if missing else 0


def print_evaluation(evaluation: Evaluation, console: Console | None = None) -> None:
    """Show the tables on a terminal."""
    console = console or terminal_console()
    for table in evaluation.report.tables:
        screen = ScreenTable(title=escape(table.title), header_style="bold", title_justify="left")
        for column in table.columns:
            screen.add_column(escape(column), overflow="fold")
        for row in table.as_text():
            screen.add_row(*(escape(cell) for cell in row))
        console.print(screen)
        if table.note:
            console.print(escape(table.note))
    console.print(escape(_how_made(evaluation)))


def write_json(evaluations: Sequence[Evaluation], path: Path) -> None:
    """Write one JSON object a suite and line; raises RecordingError."""
    write_whole(path, "".join(json.dumps(one.as_dict(), allow_nan=False) + "\n" for one in evaluations))


def write_csv(evaluation: Evaluation, path: Path) -> None:
    """Write the rows as measured, a column a quantity; raises RecordingError."""
    rows = evaluation.report.rows
    names = [name for name in dict.fromkeys(name for row in rows for name in row) if name not in WIDE]
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, names, extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    write_whole(path, text.getvalue())


def write_figures(evaluation: Evaluation, folder: Path) -> list[Path]:
    """Write the suite's figures and its rows as CSV into a folder; returns their paths; raises RecordingError."""
    paths = draw(evaluation.report, folder)
    rows = folder / f"{evaluation.report.suite.name}.csv"
    write_csv(evaluation, rows)
    return [*paths, rows]


ABOUT = """\
# Results

Made by `spinscope evaluate`: the paper's experiments on recordings of Spinscope's simulator, beside the paper's own
numbers on its real ones. The simulator stands in for the lab; its numbers are no measurement of a real camera. The
seeds of these recordings are used for nothing else; they were drawn afresh for this version. All parameters were chosen
on other recordings.

Errors: mean ± standard deviation (median). A refusal, or no ball, counts as failed in the success rate and not in the
errors. `triplet` is the paper's method, `best` the answer that the program itself trusts.
"""


ABOUT_REAL = """\
# Results on real recordings

Made by `spinscope evaluate --real`: the paper's experiments on recordings of a folder, with the truth that stands
beside them, next to the paper's own numbers. What could not be evaluated is named in the first table of each suite.

Errors: mean ± standard deviation (median), against the truth as it was stated. A refusal, or no ball, counts as failed
in the success rate and not in the errors. `triplet` is the paper's method, `best` the answer that the program itself
trusts. Which events are the logo's is not known, so shares "of those with logo" are left out.
"""


def write_page(evaluations: Sequence[Evaluation], path: Path, pictures: Sequence[Path] = ()) -> None:
    """Write the tables of these suites, with their figures from `write_figures`, as one page of Markdown.

    The same tables stand beside it as JSON, one object a suite and line, with the cells as the page shows them.
    Raises RecordingError.
    """
    lines = [ABOUT if any(one.report.folder is None for one in evaluations) else ABOUT_REAL]
    overview = best_methods([one.report for one in evaluations])
    lines += [] if overview is None else _table_lines(overview, "##")
    for one in evaluations:
        lines += [f"## {one.report.title} (`{one.report.suite.name}`)", "", _how_made(one), ""]
        for picture in pictures:
            if picture.suffix == ".png" and picture.name.startswith(f"{one.report.suite.name}_"):
                place = Path(os.path.relpath(picture, path.parent)).as_posix()
                lines += [f"![{picture.stem.replace('_', ': ')}]({place})", ""]
        for table in one.report.tables:
            lines += _table_lines(table, "###")
    write_whole(path, "\n".join(lines).rstrip() + "\n")
    tables = [json.dumps(_page_tables(one), ensure_ascii=False) for one in evaluations]
    write_whole(path.with_suffix(".json"), "\n".join(tables) + "\n")


def _page_tables(one: Evaluation) -> dict[str, Any]:
    """A suite's tables, cells as text, with how they were made."""
    shown = [{"title": table.title, "columns": table.columns, "rows": table.as_text()} for table in one.report.tables]
    return {"suite": one.report.suite.name, "made": _how_made(one), "tables": shown}


def _table_lines(table: ResultTable, heading: str) -> list[str]:
    """A table as lines of Markdown, with a heading of this level."""
    lines = [f"{heading} {table.title}", "", "| " + " | ".join(table.columns) + " |", "|" + "---|" * len(table.columns)]
    lines += ["| " + " | ".join(row) + " |" for row in table.as_text()]
    return [*lines, "", *([table.note, ""] if table.note else [])]


def _how_made(one: Evaluation) -> str:
    thinned = ", thinned (--quick)" if one.report.quick else ""
    thinned += f", real recordings of {one.report.folder.name}" if one.report.folder else ""
    return f"{one.date}, Spinscope {one.version}, {one.machine}{thinned}."


def _machine() -> str:
    """Processor, cores and system, as far as the system tells."""
    name = platform.processor() or platform.machine()
    with suppress(OSError):  # only Linux has it
        cpuinfo = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace")
        if model := re.search(r"^model name\s*:\s*(.+?)\s*$", cpuinfo, re.MULTILINE):
            name = model[1]
    return f"{name}, {os.cpu_count()} cores, {platform.system()}, Python {platform.python_version()}"
