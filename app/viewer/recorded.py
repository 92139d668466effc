"""A run as an .rrd file."""

from __future__ import annotations

from pathlib import Path

from spinscope.pipeline.files import atomic_file

from .ball import ball_chunks
from .layouts import blueprint
from .painting import painting_chunks
from .rerun_api import Chunk, file_with
from .run import ViewedRun
from .score import score_chunks
from .stages import STAGES
from .summary import summary_chunks


def chunks(run: ViewedRun) -> list[Chunk]:
    """Everything there is to see of a run."""
    return [
        chunk for stage in (*STAGES, score_chunks, ball_chunks, painting_chunks, summary_chunks) for chunk in stage(run)
    ]


def write_rrd(run: ViewedRun, path: Path, layout: str) -> None:
    """Write the run and its layouts, whole or not at all; raises RecordingError when that fails."""
    made = chunks(run)
    with atomic_file(path, ".rrd file") as part:
        part.touch()  # Rerun's own message for a path that cannot be written is no help
        file_with(made, blueprint(run, layout), part, run.name)
