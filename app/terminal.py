"""What the command line shows while it works and when it is done: progress, tables, one-line notes."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from types import TracebackType
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

PATIENCE_S = 1.0  # work that ends sooner shows no bar


def note(text: str) -> None:
    """One line on standard error."""
    print(text, file=sys.stderr, flush=True)


class ProgressBar:
    """A bar on standard error of a terminal for work that takes longer than a second; calls take (share 0..1, what)."""

    def __init__(self) -> None:
        self._begin = time.perf_counter()
        self._bar: Progress | None = None

    def __enter__(self) -> ProgressBar:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar:
            self._bar.stop()

    def __call__(self, share: float, what: str) -> None:
        if self._bar is None:
            if time.perf_counter() - self._begin < PATIENCE_S or not sys.stderr.isatty():
                return
            self._bar = Progress(
                TextColumn("{task.description}"),
                BarColumn(),
                TextColumn("{task.percentage:>3.0f} %"),
                TimeRemainingColumn(),
                console=Console(stderr=True),
                transient=True,
            )
            self._bar.add_task(what, total=1.0)
            self._bar.start()
        self._bar.update(self._bar.task_ids[0], completed=share, description=what)


def announce_compilation() -> None:
    """Say once, in one line, when kernels are being compiled rather than loaded from the cache."""
    from numba.core import event

    class Announce(event.Listener):
        said = False

        def on_start(self, _: object) -> None:
            if not Announce.said:
                Announce.said = True
                note("compiling the kernels, once on this machine: half a minute or so, cached afterwards ...")

        def on_end(self, _: object) -> None:
            pass

    event.register("numba:compile", Announce())  # type: ignore[no-untyped-call]


def print_reports(reports: list[dict[str, Any]]) -> None:
    """The reports of `analyze` for people: a heading for every shot and a row for every method under it."""
    for report in reports:
        name = Path(report["recording"]["path"]).name
        if "error" in report:
            print(f"{name}: error: {report['error']}")
        elif not report["shots"]:
            print(f"{name}: {report['no_shot_reason']}")
        for number, shot in enumerate(report.get("shots", [])):
            speed = "" if shot["speed_m_s"] is None else f", {shot['speed_m_s']:.2f} m/s"
            print(
                f"{name}, shot {number + 1} of {len(report['shots'])}: {shot['start_us'] / 1000:.1f} to "
                f"{shot['end_us'] / 1000:.1f} ms{speed}, {shot['logo_events']} logo events"
            )
            print(f"    {'method':<12} {'spin [rps]':>18}   {'axis x, y, z':<24}  {'+- [deg]':>8}")
            for method, estimate in shot["spin"].items():
                print(f"  {'*' if method == shot['best'] else ' '} {method:<12} {_row(estimate)}")
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
