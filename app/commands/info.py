"""`spinscope info`: summary of a recording for programs and for people."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import click
from rich.table import Table

from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.recording_folders import recordings_in
from spinscope.pipeline.recordings import ReadingOptions, RecordingInfo, open_recording, summary
from spinscope.pipeline.session import Progress

from ..terminal import ProgressBar, console, note
from .options import RECORDING, reading_options, write_text

# Of the table, with their alignment.
TABLE_HEADINGS: dict[str, Literal["left", "right"]] = {
    "recording": "left",
    "format": "left",
    "sensor, px": "left",
    "events": "right",
    "s": "right",
    "Mev/s": "right",
    "triggers": "right",
    "damage": "right",
}
SHOWN = 60  # characters of an attribute; a simulation's scene is a page long


@click.command()
@click.argument("recordings", type=RECORDING, nargs=-1, required=True)
@reading_options
@click.option("--json", "output", type=click.Path(), help="Write JSON to this file, - for standard output.")
def info(recordings: tuple[Path, ...], reading: ReadingOptions, output: str | None) -> None:
    """Say what a recording holds: format, sensor, events, duration, rates, hot pixels, triggers, damage.

    Of several recordings, or of those in a folder, print a table with one line each.
    """
    found: list[RecordingInfo | UnreadableRecording] = []
    if len(recordings) == 1 and not recordings[0].is_dir():
        with ProgressBar() as bar:
            found.append(information(recordings[0], reading, bar))
    else:
        found += informations(recordings_in(recordings), reading)
    if output:
        write_text(output, "".join(json.dumps(one.as_dict(), allow_nan=False) + "\n" for one in found))
    elif len(found) == 1 and isinstance(found[0], RecordingInfo):
        print_information(found[0])
    else:
        print_table(found)
    if any(isinstance(one, UnreadableRecording) for one in found):
        sys.exit(2)


@dataclass(frozen=True, slots=True)
class UnreadableRecording:
    """A file that could not be read, and why."""

    path: Path
    error: str

    def as_dict(self) -> dict[str, Any]:
        """Names and values ready for JSON."""
        return {"path": str(self.path), "error": self.error}


def informations(paths: Sequence[Path], reading: ReadingOptions) -> Iterator[RecordingInfo | UnreadableRecording]:
    """Yield the summaries of recordings, with those that cannot be read in their places."""
    for path in paths:
        try:
            with ProgressBar() as bar:
                yield information(path, reading, bar)
        except RecordingError as error:
            yield UnreadableRecording(path, str(error).removesuffix(f": {path}"))


def print_table(found: Sequence[RecordingInfo | UnreadableRecording]) -> None:
    """Print one line a recording, not folded where the output is no terminal; then what is wrong with them."""
    table = Table(box=None, padding=(0, 2, 0, 0))
    for heading, justify in TABLE_HEADINGS.items():
        table.add_column(heading, justify=justify, no_wrap=True)
    for one in found:
        if isinstance(one, UnreadableRecording):
            table.add_row(str(one.path), "unreadable")
            continue
        rate = "" if one.mean_rate_hz is None else f"{one.mean_rate_hz / 1e6:.3f}"
        damage = sum(one.damage.values())
        table.add_row(
            str(one.path),
            one.format,
            f"{one.width_px} x {one.height_px}",
            f"{one.events:,}",
            f"{one.duration_us / 1e6:.3f}",
            rate,
            f"{one.triggers:,}",
            f"{damage:,}" if damage else "",
        )
    screen = console()
    screen.print(table, soft_wrap=True)
    for one in found:
        if isinstance(one, UnreadableRecording):
            screen.print(f"error: {one.path}: {one.error}", style="red", highlight=False, soft_wrap=True)
            continue
        for warning in one.warnings:
            screen.print(f"warning: {one.path}: {warning}", style="yellow", highlight=False, soft_wrap=True)


def information(path: Path, reading: ReadingOptions, on_progress: Progress) -> RecordingInfo:
    """Summarise a recording in one pass; raises RecordingError."""

    def report(share: float) -> None:
        on_progress(share, "reading")

    recording = open_recording(path, **asdict(reading), on_progress=report)
    if recording.is_large:
        size_px = f"{recording.width_px} x {recording.height_px} px (from: {recording.sensor_from})"
        note(f"{recording.format}, {size_px}, {path.stat().st_size / 1e6:,.0f} MB: counting the events ...")
    return summary(recording, report)


def print_information(info: RecordingInfo) -> None:
    """Print a table of the summary, with units."""
    peak_hz = info.peak_rate_hz
    damage = ", ".join(f"{count:,} {name.replace('_', ' ')}" for name, count in info.damage.items() if count)
    rows = {
        "format": info.format,
        "sensor": f"{info.width_px} x {info.height_px} px (from: {info.sensor_from})",
        "events": f"{info.events:,}",
        "time": "no events" if info.first_us is None else f"{info.first_us:,} to {info.last_us:,} us",
        "duration": f"{info.duration_us / 1e6:.6f} s",
        "ON share": "" if info.on_share is None else f"{100 * info.on_share:.1f} %",
        "event rate": "" if info.mean_rate_hz is None else f"{info.mean_rate_hz / 1e6:.3f} Mev/s on average",
        "peak rate": "" if peak_hz is None else f"{peak_hz / 1e6:.3f} Mev/s in the fullest millisecond",
        "hot pixels": f"{info.hot_pixels:,} with {100 * info.hot_share:.1f} % of the events",
        "triggers": f"{info.triggers:,}",
        "t_offset": "" if info.t_offset_us is None else f"{info.t_offset_us:,} us (not added)",
        "damage": damage or "none",
        **{f"attribute {name}": _shortened(str(value)) for name, value in info.attributes.items()},
    }
    table = Table(show_header=False, box=None, padding=(0, 2, 0, 0))
    for name, value in rows.items():
        if value:
            table.add_row(name, value)
    screen = console()
    screen.print(str(info.path), highlight=False, soft_wrap=True)
    screen.print(table)
    for warning in info.warnings:
        screen.print(f"warning: {warning}", style="yellow", highlight=False, soft_wrap=True)


def _shortened(text: str) -> str:
    return text if len(text) <= SHOWN else text[: SHOWN - 4] + " ..."
