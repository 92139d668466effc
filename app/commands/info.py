"""`spinscope info`: summary of a recording for programs and for people."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import click
from rich.table import Table

from spinscope.pipeline.recordings import ReadingOptions, RecordingInfo, open_recording, summary
from spinscope.pipeline.session import Progress

from ..terminal import ProgressBar, console
from .options import RECORDING, reading_options, write_text

SHOWN = 60  # characters of an attribute; a simulation's scene is a page long


@click.command()
@click.argument("recording", type=RECORDING)
@reading_options
@click.option("--json", "output", type=click.Path(), help="Write JSON to this file, - for standard output.")
def info(recording: Path, reading: ReadingOptions, output: str | None) -> None:
    """Say what a recording holds: format, sensor, events, duration, rates, hot pixels, triggers, damage."""
    with ProgressBar() as bar:
        found = information(recording, reading, bar)
    if output:
        write_text(output, json.dumps(found.as_dict(), allow_nan=False) + "\n")
    else:
        print_information(found)


def information(path: Path, reading: ReadingOptions, on_progress: Progress) -> RecordingInfo:
    """Summarise a recording in one pass; raises RecordingError."""

    def report(share: float) -> None:
        on_progress(share, "reading")

    return summary(open_recording(path, **asdict(reading), on_progress=report), report)


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
