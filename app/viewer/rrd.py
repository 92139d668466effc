"""A run as an .rrd file, and its parts as bytes for the page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from rerun.chunk import ChunkStore

from spinscope.pipeline.files import atomic_file

from . import entities as at
from .drawers import run_chunks
from .fitting import ViewerSize
from .rerun_api import Chunk, file_content
from .run import ViewedRun
from .views import VIEWS, blueprint


def write_rrd(run: ViewedRun, path: Path, layout: str) -> None:
    """Write the run and its views, whole or not at all; raises RecordingError when that fails."""
    content = file_content(run_chunks(run), blueprint(run, layout), run.name)
    with atomic_file(path, ".rrd file") as part:
        part.write_bytes(content)


def rrd_bytes(chunks: Sequence[Chunk], recording_id: str) -> bytes:
    """The chunks as one recording of this id, without a blueprint."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "run.rrd"
        ChunkStore.from_chunks(list(chunks)).write_rrd(path, application_id=at.APPLICATION, recording_id=recording_id)
        return path.read_bytes()


def layout_bytes(
    run: ViewedRun, tab: str, *, compare: bool = True, size: ViewerSize | None = None
) -> tuple[bytes, str]:
    """Blueprint of the page's viewer, and the id of its root container, by which the viewer names it.

    Parameters
    ----------
    run : ViewedRun
        The run, for ranges and sizes.
    tab : str
        Label of the view in front; the first one when there is none of that label.
    compare : bool
        Whether there are the views of two runs.
    size : ViewerSize or None
        See `blueprint`.
    """
    layout = next((view.name for view in VIEWS if view.label == tab), "")
    with TemporaryDirectory() as folder:
        path = Path(folder) / "page.rbl"
        made = blueprint(run, layout, compare=compare, is_lasting=True, size=size)
        made.save(at.APPLICATION, path)
        return path.read_bytes(), str(made.root_container.id)
