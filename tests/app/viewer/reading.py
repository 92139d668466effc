"""Reads back what was logged into an .rrd file: for tests."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from rerun.chunk import RrdReader


@dataclass
class Rows:
    """What one entity holds: static values, and for every component rows in order of time."""

    static: dict[str, Any] = field(default_factory=dict)
    t_us: dict[str, np.ndarray] = field(default_factory=dict)
    values: dict[str, list[Any]] = field(default_factory=dict)

    def at(self, component: str, t_us: int) -> Any:
        """The newest value of a component at a time."""
        row = int(np.searchsorted(self.t_us[component], t_us, side="right")) - 1
        return self.values[component][row]

    def picture(self, t_us: int) -> np.ndarray:
        """(height, width, 3) the newest image at a time."""
        ((buffer,), (form,)) = self.at("buffer", t_us), self.at("format", t_us)
        return np.array(buffer, np.uint8).reshape(form["height"], form["width"], 3)


def read_back(path: Path, blueprint: bool = False) -> dict[str, Rows]:
    """Every entity of the recording, or of its blueprint, by its path; components by their short names."""
    reader = RrdReader(path)
    (store,) = reader.blueprints() if blueprint else reader.recordings()
    found: dict[str, Rows] = {}
    for chunk in reader.stream(store=store):
        rows = found.setdefault(chunk.entity_path, Rows())
        batch = chunk.to_record_batch()
        timeline = next((name for name in chunk.timeline_names if name in batch.schema.names), None)
        for name in batch.schema.names:
            if name == timeline or ":" not in name:
                continue
            component, values = name.split(":")[-1], batch.column(name).to_pylist()
            if timeline is None or blueprint:
                rows.static[component] = values[-1]
            else:
                t_us = batch.column(timeline).cast("int64").to_numpy() / 1000
                assert component not in rows.t_us, f"{chunk.entity_path} logs {component} twice"
                rows.t_us[component], rows.values[component] = t_us, values
    return found
