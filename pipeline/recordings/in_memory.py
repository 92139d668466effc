"""Recording whose events are in memory already: from a simulation, a notebook or another program."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from ..events import EventBatch
from ..results import Truth


@dataclass(eq=False)
class RecordingInMemory:
    """Events in memory behind the interface of `Recording`.

    Attributes
    ----------
    path : Path
        Name for people; no file.
    attributes : dict
        Camera values as a file would state them (`camera.focal_length_mm` ...).
    """

    data: EventBatch
    width_px: int
    height_px: int
    path: Path = Path("events in memory")
    attributes: dict[str, str | float] = field(default_factory=dict)
    truth: Truth | None = None
    warnings: list[str] = field(default_factory=list)
    format: str = "events in memory"

    def identity(self) -> str:
        """Hash of all events."""
        digest = hashlib.blake2b(digest_size=16)
        for column in self.data.columns:
            digest.update(column.tobytes())
        return digest.hexdigest()

    def read(
        self, start_us: int | None = None, end_us: int | None = None, on_progress: Callable[[float], None] | None = None
    ) -> EventBatch:
        """The events of [start_us, end_us), all by default."""
        return self.data.between(-(2**63) if start_us is None else start_us, 2**63 - 1 if end_us is None else end_us)
