"""What the command line shows while it works and when it is done: progress, tables, one-line notes."""

from __future__ import annotations

import sys
import time
from types import TracebackType
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

PATIENCE_S = 1.0  # work that ends sooner shows no bar


def note(text: str) -> None:
    """One line on standard error."""
    print(text, file=sys.stderr, flush=True)


class ProgressBar:
    """A bar on standard error for work that takes longer than a second; calls take (share 0..1, what)."""

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
            if time.perf_counter() - self._begin < PATIENCE_S:
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

    class Announce(event.Listener):  # type: ignore[misc]  # numba has no types
        said = False

        def on_start(self, _: object) -> None:
            if not Announce.said:
                Announce.said = True
                note(
                    "compiling the kernels, once on this machine: half a minute or so, cached afterwards ..."
                )

        def on_end(self, _: object) -> None:
            pass

    event.register("numba:compile", Announce())


def print_reports(reports: list[dict[str, Any]]) -> None:
    """The reports of `analyze` as one table for people, with what they warn of below."""
    table = Table(title=None, header_style="bold", row_styles=["", "dim"] if len(reports) > 3 else None)
    for column in (
        "recording",
        "shot",
        "time [ms]",
        "speed [m/s]",
        "method",
        "spin [rps]",
        "axis (x, y, z)",
        "+- [deg]",
    ):
        table.add_column(column, overflow="fold")
    for report in reports:
        name = report["recording"]["path"].rpartition("/")[2]
        if "error" in report:
            table.add_row(name, "", "", "", "", f"error: {report['error']}")
        elif not report["shots"]:
            table.add_row(name, "none", "", "", "", report["no_shot_reason"])
        for number, shot in enumerate(report.get("shots", [])):
            _add_shot(table, name if number == 0 else "", number, shot)
    console = Console()
    console.print(table)
    console.print(
        "* = the answer that Spinscope trusts; +- is 1 sigma; axis in the camera frame (x right, y down, z away)"
    )
    for report in reports:
        for warning in report.get("warnings", []):
            note(f"warning: {warning}")


def _add_shot(table: Table, name: str, number: int, shot: dict[str, Any]) -> None:
    speed = shot["speed_m_s"]
    first = [
        name,
        str(number + 1),
        f"{shot['start_us'] / 1000:.1f} to {shot['end_us'] / 1000:.1f}",
        "" if speed is None else f"{speed:.2f}",
    ]
    for method, estimate in shot["spin"].items():
        label = f"{method} *" if method == shot["best"] else method
        if estimate["status"] == "ok":
            std, axis_std = estimate["magnitude_std_rps"], estimate["axis_std_deg"]
            spin = f"{estimate['magnitude_rps']:.2f}" + ("" if std is None else f" +- {std:.2f}")
            axis = ", ".join(f"{value:+.3f}" for value in estimate["axis"])
            table.add_row(*first, label, spin, axis, "" if axis_std is None else f"{axis_std:.1f}")
        else:
            table.add_row(*first, label, f"refused: {estimate['reason']}")
        first = [""] * len(first)
