"""`spinscope analyze`: the shots of a recording as JSON for programs."""

from __future__ import annotations

import dataclasses
import json
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click

from spinscope.pipeline.errors import ParameterError, SpinscopeError
from spinscope.pipeline.files import check_writable
from spinscope.pipeline.flight_calibration import doubt_about_up, flight_calibration
from spinscope.pipeline.registry import methods
from spinscope.pipeline.session import Choices, Progress, Result, Session
from spinscope.pipeline.shots import BEGAN_WORDS, ENDED_WORDS

from ..terminal import ProgressBar, note
from .options import RECORDING, ListingCommand, RegisteredName, session_options, write_text


def _methods() -> dict[str, str]:
    """Names of the spin methods and what they do."""
    return {**{method.name: method.help for method in methods()}, "all": "All of them."}


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
    "--calibrate-flight",
    "calibration",
    type=click.Path(path_type=Path),
    metavar="OUT.toml",
    help="Take the recordings as one set-up: find its lift, drag and plumb line from the shots whose logo is seen "
    "well, write them, and answer all shots with them.",
)
@session_options
def analyze(
    recordings: tuple[Path, ...], output: str | None, method: str, calibration: Path | None, choices: Choices
) -> None:
    """Find the shots of recordings and estimate their spin.

    A shot is one free flight of one ball: a bounce or a hit ends it and begins another. In the table * marks the
    estimate that the program itself trusts, +- is 1 sigma, axes are in the camera frame.
    """
    if output is not None and output != "-":
        check_writable(Path(output), "JSON")
    if calibration is not None:
        calibrate_to_file(recordings, choices, calibration)
        choices = dataclasses.replace(choices, flight_calibration=calibration)
    reports: list[dict[str, Any]] = []
    for recording in recordings:
        try:
            with ProgressBar() as bar:
                reports.append(analyze_recording(recording, choices, method, bar, cold=not reports))
        except SpinscopeError as error:
            if len(recordings) == 1:
                raise
            note(f"error: {error}")
            reports.append({"schema": 1, "recording": {"path": str(recording)}, "error": str(error)})
    if output is None:
        print_reports(reports)
    else:
        write_text(output, "".join(json.dumps(report, allow_nan=False) + "\n" for report in reports))
    if any("error" in report for report in reports):
        sys.exit(2)


def calibrate_to_file(recordings: tuple[Path, ...], choices: Choices, out: Path) -> None:
    """Calibrate the set-up by the flights of those recordings that can be read; raises SpinscopeError."""
    if out.suffix != ".toml":
        raise ParameterError(f"a calibration is a TOML file: give a name that ends with .toml instead of {out}")
    check_writable(out, "calibration")
    calibration = flight_calibration(_results(recordings, choices))
    calibration.write(out)
    note(f"calibrated: {calibration}: {out}")


def _results(recordings: tuple[Path, ...], choices: Choices) -> Iterator[Result]:
    """The results of the recordings that can be read; the others are reported when they are answered."""
    for recording in recordings:
        try:
            with ProgressBar() as bar:
                yield Session.open(recording, choices, bar).estimate(on_progress=bar)
        except SpinscopeError:
            continue


def analyze_recording(
    path: Path, choices: Choices, method: str, on_progress: Progress | None = None, *, cold: bool = True
) -> dict[str, Any]:
    """The report on one recording (tests/app/analyze.schema.json); raises SpinscopeError.

    Parameters
    ----------
    path : Path
        The recording.
    choices : Choices
        Options of the command line.
    method : str
        Name of a spin method, or "all".
    on_progress : callable, optional
        Told the share done and what is being done.
    cold : bool
        Whether this is the process's first; loading the kernels is then told apart from the work itself.
    """
    begin = time.perf_counter()
    session = Session.open(path, choices, on_progress)
    load_seconds = session.load_kernels(method) if cold else 0.0
    result = session.estimate(method, on_progress)
    report = result.to_dict()
    report["warnings"] = [*report["warnings"], *filter(None, [doubt_about_up(result)])]
    report["recording"]["path"] = str(path)
    report["seconds"] |= {"load": load_seconds, "total": time.perf_counter() - begin}
    return report


def print_reports(reports: list[dict[str, Any]]) -> None:
    """The reports of `analyze` for people: a heading for every shot and a row for every method under it."""
    for report in reports:
        name = Path(report["recording"]["path"]).name
        if "error" in report:
            print(f"{name}: error: {report['error']}")
        elif not report["shots"]:
            print(f"{name}: {report['no_shot_reason']} (a ball on a spinner needs --fixed-ball)")
        for number, shot in enumerate(report.get("shots", [])):
            speed = "" if shot["speed_m_s"] is None else f", {shot['speed_m_s']:.2f} m/s"
            how = f"{BEGAN_WORDS[shot['began_by']]}, {ENDED_WORDS[shot['ended_by']]}"
            print(
                f"{name}, shot {number + 1} of {len(report['shots'])}: {shot['start_us'] / 1000:.1f} to "
                f"{shot['end_us'] / 1000:.1f} ms ({how}){speed}, "
                f"{shot['logo_events']} logo events"
            )
            print(f"    {'method':<12} {'spin [rps]':>18}   {'axis x, y, z':<24}  {'+- [deg]':>8}")
            for method, estimate in shot["spin"].items():
                print(f"  {'*' if method == shot['best'] else ' '} {method:<12} {_row(estimate)}")
            if shot["best"] is None:
                print(f"    none is trusted: {shot['best_reason']}")
    print("* = trusted; +- is 1 sigma; axis in the camera frame: x right, y down, z into the scene")
    for report in reports:
        for warning in report.get("warnings", []):
            note(f"warning: {Path(report['recording']['path']).name}: {warning}")


def _row(estimate: dict[str, Any]) -> str:
    if estimate["status"] != "ok":
        return f"refused: {estimate['reason']}"
    std, axis_std = estimate["magnitude_std_rps"], estimate["axis_std_deg"]
    spin = f"{estimate['magnitude_rps']:.2f}" + ("" if std is None else f" +- {std:.2f}")
    axis = ", ".join(f"{value:+.3f}" for value in estimate["axis"])
    return f"{spin:>18}   {axis:<24}  " + ("" if axis_std is None else f"{axis_std:>8.1f}")
