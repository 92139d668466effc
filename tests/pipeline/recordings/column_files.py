"""Columns of events, and HDF5 files of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np

from spinscope.pipeline.events import EventBatch

N = 5000  # events


def some_columns(n: int = N, seed: int = 1) -> dict[str, Any]:
    """Columns of events over 1 s on 640 x 480 pixels; the last corner is used."""
    rng = np.random.default_rng(seed)
    x, y = rng.integers(0, 640, n), rng.integers(0, 480, n)
    x[n // 2], y[n // 2] = 639, 479
    return {"t": np.sort(rng.integers(0, 1_000_000, n)), "x": x, "y": y, "p": rng.integers(0, 2, n)}


def write_columns(path: Path, columns: dict[str, Any], group: str = "events", **options: Any) -> None:
    with h5py.File(path, "w") as file:
        for name, values in columns.items():
            file.create_dataset(f"{group}/{name}", data=values, **options)


def assert_columns(events: EventBatch, columns: dict[str, Any]) -> None:
    np.testing.assert_array_equal(events.t_us, columns["t"])
    np.testing.assert_array_equal(events.x_px, columns["x"])
    np.testing.assert_array_equal(events.y_px, columns["y"])
    np.testing.assert_array_equal(events.on, np.asarray(columns["p"]) == 1)
