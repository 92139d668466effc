"""`spinscope analyze`: the shots of a recording as JSON for programs."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from spinscope.pipeline.session import Choices, Progress, Session


def analyze(
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
    report = session.estimate(method, on_progress).to_dict()
    report["recording"]["path"] = str(path)
    report["seconds"] |= {"load": load_seconds, "total": time.perf_counter() - begin}
    return report
