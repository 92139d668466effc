"""Evaluation suites: run one, show its tables, write JSON, CSV, figures and a page."""

from __future__ import annotations

import csv
import datetime
import io
import json
import os
import platform
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import platformdirs
from rich.console import Console
from rich.markup import escape
from rich.table import Table as ScreenTable

from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.evaluation import SUITES, Report, Row, TaskContext, evaluate, executor
from spinscope.pipeline.evaluation.plots import draw
from spinscope.pipeline.evaluation.tasks import write_whole
from spinscope.pipeline.registry import Parameters

Progress = Callable[[float, str], None]
WIDE = ("picture",)  # columns that no table of text should hold


@dataclass(frozen=True)
class Evaluation:
    """A suite's report with its date, machine and version.

    Attributes
    ----------
    report : Report
    date : str
        ISO 8601, UTC.
    machine : str
        Processor, cores and system.
    version : str
        Of Spinscope.
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
        about = {
            "date": self.date,
            "machine": self.machine,
            "version": self.version,
            "seconds": round(self.seconds, 1),
        }
        return {**about, **self.report.as_dict()}


def evaluate_suite(
    name: str,
    *,
    quick: bool = False,
    parameters: Parameters | None = None,
    workers: int | None = None,
    cluster: str | None = None,
    cache: Path | None = None,
    on_progress: Progress | None = None,
) -> Evaluation:
    """Run a suite.

    Parameters
    ----------
    name : str
        Of a registered suite.
    quick : bool
        Whether to thin the suite to about ten seconds.
    parameters : Parameters or None
        Of the pipeline under evaluation; None = the defaults.
    workers : int or None
        Processes on this machine; None = one a core.
    cluster : str or None
        Address of a Dask scheduler whose workers run the tasks instead.
    cache : Path or None
        Folder of recordings and results; None = the user's own cache folder.
    on_progress : callable or None
        Called with the share done (0..1) and what is being done.

    Raises
    ------
    SpinscopeError
        For an unknown suite, no cluster, a cache that cannot be written.
    """
    if SUITES[name].timed:
        workers, cluster = 1, None
    context = TaskContext(cache or default_cache(), parameters or Parameters())
    begin = time.perf_counter()
    with executor(_cores() if workers is None else workers, cluster) as parallel:
        report = evaluate(name, context, quick=quick, parallel=parallel, on_progress=on_progress)
    seconds = time.perf_counter() - begin
    today = datetime.datetime.now(datetime.UTC).date().isoformat()
    return Evaluation(report, today, _machine(), _version(), seconds)


def default_cache() -> Path:
    """Folder of the recordings and results kept between runs."""
    return Path(platformdirs.user_cache_dir("spinscope")) / "evaluation"


def suite_list() -> str:
    """Name and description of every suite, one a line."""
    width = max(map(len, SUITES.names))
    return "\n".join(f"{suite.name:{width}}  {suite.help}" for suite in sorted(SUITES, key=lambda suite: suite.name))


def print_evaluation(evaluation: Evaluation, console: Console | None = None) -> None:
    """Show the tables on a terminal."""
    console = console or Console()
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
    text = "".join(json.dumps(one.as_dict(), allow_nan=False) + "\n" for one in evaluations)
    write_whole(path, text)


def write_csv(evaluation: Evaluation, path: Path) -> None:
    """Write the rows as measured, a column a quantity; raises RecordingError."""
    rows: list[Row] = evaluation.report.rows
    names = [name for name in dict.fromkeys(name for row in rows for name in row) if name not in WIDE]
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, names, extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    write_whole(path, text.getvalue())


def write_figures(evaluation: Evaluation, folder: Path) -> list[Path]:
    """Write the suite's figures and its rows as CSV into a folder; returns their paths; raises RecordingError."""
    if (folder.exists() and not folder.is_dir()) or not os.access(_existing(folder), os.W_OK):
        raise RecordingError(f"figures cannot be written, this is no folder that may be written to: {folder}")
    paths = draw(evaluation.report, folder)
    rows = folder / f"{evaluation.report.suite.name}.csv"
    write_csv(evaluation, rows)
    return [*paths, rows]


ABOUT = """\
# Results

Made by `spinscope evaluate`: the paper's experiments on recordings of Spinscope's simulator, beside the paper's own
numbers on its real ones. The simulator stands in for the lab; its numbers are no measurement of a real camera. The
seeds of these recordings are used for nothing else; `contrast.rival_sigmas` and its treatment of the rim were changed
after earlier results on them, all other parameters were chosen on other recordings.

Errors: mean ± standard deviation (median). A refusal, or no ball, counts as failed in the success rate and not in the
errors. `triplet` is the paper's method, `best` the answer that the program itself trusts.
"""


def write_page(evaluations: Sequence[Evaluation], path: Path, pictures: Sequence[Path] = ()) -> None:
    """Write the tables of these suites as one page of Markdown; raises RecordingError.

    Parameters
    ----------
    evaluations : sequence of Evaluation
    path : Path
        The page.
    pictures : sequence of Path
        The suites' figures as `write_figures` names them, shown under their suite.
    """
    lines = [ABOUT]
    for one in evaluations:
        lines += [f"## {one.report.suite.label} (`{one.report.suite.name}`)", "", _how_made(one), ""]
        for picture in pictures:
            if picture.suffix == ".png" and picture.name.startswith(f"{one.report.suite.name}_"):
                place = Path(os.path.relpath(picture, path.parent)).as_posix()
                lines += [f"![{picture.stem.replace('_', ': ')}]({place})", ""]
        for table in one.report.tables:
            lines += [f"### {table.title}", ""]
            lines += ["| " + " | ".join(table.columns) + " |", "|" + "---|" * len(table.columns)]
            lines += ["| " + " | ".join(row) + " |" for row in table.as_text()]
            lines += ["", *([table.note, ""] if table.note else [])]
    write_whole(path, "\n".join(lines).rstrip() + "\n")


def _how_made(one: Evaluation) -> str:
    thinned = ", thinned (--quick)" if one.report.quick else ""
    return f"{one.date}, Spinscope {one.version}, {one.machine}{thinned}."


def _existing(folder: Path) -> Path:
    """The folder, or the nearest one above it that is there."""
    return folder if folder.exists() else _existing(folder.absolute().parent)


def _cores() -> int:
    return max(1, len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1)


def _machine() -> str:
    """Processor, cores and system, as far as the system tells."""
    name = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        for line in cpuinfo.read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                name = line.partition(":")[2].strip()
                break
    return f"{name}, {_cores()} cores, {platform.system()}, Python {platform.python_version()}"


def _version() -> str:
    try:
        return version("spinscope")
    except PackageNotFoundError:  # run from its folder without being installed
        return "unknown"
