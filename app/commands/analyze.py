"""`spinscope analyze`: the shots of recordings for people, as JSON for programs, and as tables."""

from __future__ import annotations

import dataclasses
import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from spinscope.pipeline.errors import ParameterError, SpinscopeError
from spinscope.pipeline.files import check_writable
from spinscope.pipeline.flight_calibration import flight_calibration
from spinscope.pipeline.recording_folders import recordings_in
from spinscope.pipeline.registry import methods
from spinscope.pipeline.result_rows import ResultRow, shot_rows
from spinscope.pipeline.session import Choices, Result, Session
from spinscope.pipeline.shots import BEGAN_WORDS, ENDED_WORDS

from ..analysis import report_on
from ..batch import BatchWork, absolute_choices, analyze_to_table
from ..terminal import ProgressBar, note
from .options import RECORDING, ListingCommand, RegisteredName, rival_option, session_options, write_text


def _methods() -> dict[str, str]:
    """Names of the spin methods and what they do."""
    return {**{method.name: method.help for method in methods()}, "all": "All of them."}


class PartOf(click.ParamType[tuple[int, int]]):
    """I/N: the I-th of N parts."""

    name = "I/N"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[int, int]:
        """Value of the option; fails with what is allowed."""
        part, _, parts = str(value).partition("/")
        if not (part.isdecimal() and parts.isdecimal() and 1 <= int(part) <= int(parts)):
            self.fail(f"{value!r} is no part: write I/N, like 3/10 for the third of ten", param, ctx)
        return int(part), int(parts)


@dataclass(frozen=True, slots=True)
class PrintedRecording:
    """Report on one recording, and its shots as rows; no rows where it could not be analyzed."""

    report: dict[str, Any]
    rows: Sequence[ResultRow] = ()


@click.command(cls=ListingCommand, title="Methods", entries=_methods)
@click.argument("recordings", type=RECORDING, nargs=-1, required=True)
@click.option(
    "--json",
    "output",
    type=click.Path(),
    help="Write JSON, one object a recording and line, - for standard output.",
)
@click.option(
    "--method",
    type=RegisteredName(lambda: tuple(_methods())),
    default="all",
    show_default=True,
    help="Which estimates of the spin to report; only what they need is run.",
)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    metavar="TABLE.csv|.parquet|.jsonl",
    help="Write a table with a row for each shot. Recordings are worked on in parallel, each one's rows are kept at "
    "once; the same command resumes, also with more recordings.",
)
@click.option(
    "--series",
    type=click.Path(path_type=Path),
    metavar="TABLE.csv|.parquet|.jsonl",
    help="With --out: write circle, place, rates and spins of every tick as a second table.",
)
@click.option("--jobs", type=click.IntRange(1), help="With --out: processes on this machine; one a core by default.")
@click.option(
    "--cluster", metavar="ADDRESS", help="With --out: scheduler of a running Dask cluster that does the work."
)
@click.option(
    "--part",
    type=PartOf(),
    help="With --out: only the I-th of N parts, for array jobs. The command without --part then writes the table.",
)
@click.option("--overwrite", is_flag=True, help="With --out: begin anew where there are other results.")
@click.option(
    "--calibrate-flight",
    "calibration",
    type=click.Path(path_type=Path),
    metavar="OUT.toml",
    help="Take the recordings as one set-up: find its lift, drag and plumb line from the shots whose logo is seen "
    "well, write them, and answer all shots with them.",
)
@session_options
@rival_option
def analyze(
    recordings: tuple[Path, ...],
    output: str | None,
    method: str,
    out: Path | None,
    series: Path | None,
    jobs: int | None,
    cluster: str | None,
    part: tuple[int, int] | None,
    overwrite: bool,
    calibration: Path | None,
    choices: Choices,
) -> None:
    """Find the shots of recordings (files, folders, patterns) and estimate their spin.

    A shot is one free flight of one ball: a bounce or a hit ends it and begins another. A recording without a flight
    in which a ball turns in place is taken as one of a ball spinner, and it is said.

    In the table * marks the one estimate that the program itself trusts (`best` in JSON). An estimate without * may be
    right, but the program has no evidence for it; where no line has one, the line below them says why.

    +- is 1 sigma, the standard deviation that the method states for its own estimate: 68 % of the errors of the
    magnitude are expected within it. For the axis it is an angle in degrees, over both directions across the axis.

    The axis is a unit vector in the camera frame (x right, y down, z into the scene) about which the ball turns by the
    right-hand rule; rps are revolutions per second. `spinscope settings` lists what --set can change.
    """
    if output is not None and output != "-":
        check_writable(Path(output), "JSON")
    found = recordings_in(recordings, [path for path in (out, series) if path is not None])
    if calibration is not None:
        calibrate_to_file(found, choices, calibration)
        choices = dataclasses.replace(choices, flight_calibration=calibration)
    if out is None:
        batch_options = {"series": series, "jobs": jobs, "cluster": cluster, "part": part, "overwrite": overwrite}
        if given := [name for name, value in batch_options.items() if value]:
            raise click.UsageError(f"--{given[0]} goes with --out TABLE")
        has_failed = analyze_one_by_one(found, choices, method, output)
    else:
        if output is not None or (overwrite and part):
            raise click.UsageError("--json and --out, --overwrite and --part exclude each other: give one of them")
        work = BatchWork(
            choices=absolute_choices(choices),
            method=method,
            table=out,
            series=series,
            part=part,
            jobs=jobs,
            cluster=cluster,
            overwrite=overwrite,
        )
        has_failed = analyze_batch(found, work)
    if has_failed:
        sys.exit(2)


def analyze_one_by_one(recordings: Sequence[Path], choices: Choices, method: str, output: str | None) -> bool:
    """Report on recordings as a table for people or as JSON; whether one of several could not be analyzed."""
    analyzed: list[PrintedRecording] = []

    def warn(session: Session) -> None:
        """Print the warnings that are not printed yet: the analysis of a mistaken unit of time may take long."""
        if output is None:
            for warning in session.warnings[len(printed) :]:
                note(f"warning: {recording.name}: {warning}")
                printed.append(warning)

    for recording in recordings:
        printed: list[str] = []
        try:
            with ProgressBar() as bar:
                report, result = report_on(recording, choices, method, bar, warn, cold=not analyzed)
            warn(result.session)
            analyzed.append(PrintedRecording(report, shot_rows(result)))
        except SpinscopeError as error:
            if len(recordings) == 1:
                raise
            note(f"error: {error}")
            failed = {"schema": 1, "recording": {"path": str(recording)}, "error": str(error)}
            analyzed.append(PrintedRecording(failed))
    if output is None:
        print_shots(analyzed)
    else:
        write_text(output, "".join(json.dumps(one.report, allow_nan=False) + "\n" for one in analyzed))
    return any("error" in one.report for one in analyzed)


def analyze_batch(recordings: Sequence[Path], work: BatchWork) -> bool:
    """Analyze recordings into a table and say what came of it; whether one could not be analyzed."""
    with ProgressBar() as bar:
        try:
            summary = analyze_to_table(recordings, work, bar)
        except KeyboardInterrupt:
            note(f"stopped: what is done is kept beside {work.table}, the same command goes on from there")
            raise
    for failure in summary.failed:
        note(f"error: {failure}")
    earlier = f", {summary.known} of them known from earlier" if summary.known else ""
    counts = f"{summary.recordings} recordings{earlier}, {len(summary.failed)} failed"
    if work.part is not None:
        note(f"part {work.part[0]} of {work.part[1]}: {counts}; the command without --part writes {work.table}")
    else:
        note(f"wrote {' and '.join(str(path) for path in (work.table, work.series) if path)}: {counts}")
    return bool(summary.failed)


def calibrate_to_file(recordings: Sequence[Path], choices: Choices, out: Path) -> None:
    """Calibrate the set-up by the flights of those recordings that can be read; raises SpinscopeError."""
    if out.suffix != ".toml":
        raise ParameterError(f"a calibration is a TOML file: give a name that ends with .toml instead of {out}")
    check_writable(out, "calibration")
    calibration = flight_calibration(_results(recordings, choices))
    calibration.write(out)
    note(f"calibrated: {calibration}: {out}")


def _results(recordings: Sequence[Path], choices: Choices) -> Iterator[Result]:
    """The results of the recordings that can be read; the others are reported when they are answered."""
    for recording in recordings:
        try:
            with ProgressBar() as bar:
                yield Session.open(recording, choices, bar).estimate(on_progress=bar)
        except SpinscopeError:
            continue


def print_shots(analyzed: Sequence[PrintedRecording]) -> None:
    """Print the shots for people: a heading for every shot and a row for every method under it."""
    for one in analyzed:
        report = one.report
        name = Path(report["recording"]["path"]).name
        if "error" in report:
            print(f"{name}: error: {report['error']}")
        elif not report["shots"]:
            print(f"{name}: {report['no_shot_reason']} (a ball on a spinner needs --fixed-ball)")
        for shot, row in zip(report.get("shots", ()), one.rows, strict=False):
            how = f"{BEGAN_WORDS[shot['began_by']]}, {ENDED_WORDS[shot['ended_by']]}"
            speed = "" if shot["speed_m_s"] is None else f"{shot['speed_m_s']:.2f} m/s, "
            print(
                f"{name}, shot {row['shot']} of {row['shots']}: {shot['start_us'] / 1000:.1f} to "
                f"{shot['end_us'] / 1000:.1f} ms ({how}), {speed}{row['distance_m']:.2f} m from the camera, "
                f"{shot['logo_events']} logo events"
            )
            print(f"    {'method':<12} {'spin [rps]':>18}   {'axis x, y, z':<24}  {'+- [deg]':>8}{_truth_heading(row)}")
            for method, estimate in shot["spin"].items():
                print(f"  {'*' if method == shot['best'] else ' '} {method:<12} {_row(estimate)}{_errors(row, method)}")
            if shot["best"] is None:
                print(f"    none is trusted: {shot['best_reason']}")
            elif row["topspin_rps"] is not None:
                parts = (f"{name} {row[f'{name}_rps']:+.1f}" for name in ("topspin", "sidespin", "corkscrew"))
                print(f"    {row['kind']}: {', '.join(parts)} rps")
    print("* = trusted; +- is 1 sigma; axis in the camera frame: x right, y down, z into the scene; sidespin + = left")


def _truth_heading(row: ResultRow) -> str:
    """Heading of the errors, with the truth; empty where there is none."""
    return "" if row.get("true_magnitude_rps") is None else f"  off the truth, {row['true_magnitude_rps']:.2f} rps"


def _errors(row: ResultRow, method: str) -> str:
    """Errors of a method against the truth; empty where they are not known."""
    error_rps, error_deg = row.get(f"{method}_error_rps"), row.get(f"{method}_error_deg")
    angle = "" if error_deg is None else f", {error_deg:.1f} deg"
    return "" if error_rps is None else f"  {error_rps:.2f} rps{angle}"


def _row(estimate: dict[str, Any]) -> str:
    if estimate["status"] != "ok":
        return f"refused: {estimate['reason']}"
    std, axis_std = estimate["magnitude_std_rps"], estimate["axis_std_deg"]
    spin = f"{estimate['magnitude_rps']:.2f}" + ("" if std is None else f" +- {std:.2f}")
    axis = ", ".join(f"{value:+.3f}" for value in estimate["axis"])
    return f"{spin:>18}   {axis:<24}  " + ("" if axis_std is None else f"{axis_std:>8.1f}")
