"""`spinscope info`: what a recording holds, for programs and for people."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from .session import Progress


def information(path: Path, sensor_px: tuple[int, int] | None, on_progress: Progress) -> dict[str, Any]:
    """One pass over the recording; raises RecordingError."""
    from pipeline.recordings import open_recording, summary

    recording = open_recording(path, sensor=sensor_px)
    found = summary(recording, on_progress=lambda share: on_progress(share, "reading"))
    raise NotImplementedError(found)


def print_information(found: dict[str, Any]) -> None:
    """A table of what `information` found."""
    table = Table(show_header=False, box=None)
    Console().print(table)
