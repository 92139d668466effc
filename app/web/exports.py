"""Exports of a result: .rrd, JSON as `spinscope analyze` writes it, tables, figures; and a picture of the events."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import cv2
import numpy as np

from spinscope.app.table_files import write_table
from spinscope.app.viewer import save
from spinscope.app.viewer.figure import series_figure
from spinscope.app.viewer.run import ViewedRun
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.result_rows import tick_columns, tick_rows
from spinscope.pipeline.session import Result


def as_json(result: Result) -> str:
    """JSON on one line, as `spinscope analyze --json` writes it for the clip with these settings."""
    return json.dumps(result.to_dict(), allow_nan=False) + "\n"


def spins_csv(result: Result) -> str:
    """CSV with a row for each shot and method."""
    rows = []
    for number, shot in enumerate(result.to_dict()["shots"]):
        own = {"shot": number + 1, **{key: shot[key] for key in ("start_us", "end_us", "speed_m_s", "logo_events")}}
        for method, estimate in shot["spin"].items():
            x, y, z = estimate["vector_rps"] or (None, None, None)
            rows.append(
                {
                    **own,
                    "method": method,
                    "trusted": int(shot["best"] == method),
                    "status": estimate["status"],
                    "reason": estimate["reason"],
                    "x_rps": x,
                    "y_rps": y,
                    "z_rps": z,
                    "magnitude_rps": estimate["magnitude_rps"],
                    "magnitude_std_rps": estimate["magnitude_std_rps"],
                    "axis_std_deg": estimate["axis_std_deg"],
                }
            )
    return _csv(rows)


def series(result: Result, suffix: str) -> bytes:
    """Table with a row for each shot and tick, as `spinscope analyze --series` writes it; `suffix` is the format's."""
    name = result.session.recording.path.name
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"series{suffix}"
        write_table(path, tick_columns(), ({"recording": name, **row} for row in tick_rows(result)))
        return path.read_bytes()


def as_rrd(result: Result, followed: int | None) -> bytes:
    """Run with its layouts as .rrd, as `spinscope view --save` writes it."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "run.rrd"
        save(result, path, followed=followed)
        return path.read_bytes()


def figure(result: Result, suffix: str, followed: int | None, pinned: Result | None) -> bytes:
    """Figure of the series for a publication; `suffix` is its format's."""
    a = None if pinned is None else ViewedRun.of(pinned, followed)
    return series_figure(ViewedRun.of(result, followed), suffix, a)


def event_picture(events: EventBatch, width_px: int, height_px: int) -> bytes:
    """PNG of the number of events of each pixel, the logarithm as brightness: where a ball in place is to be seen."""
    counts = np.zeros((height_px, width_px))
    np.add.at(counts, (events.y_px, events.x_px), 1)
    bright = np.log1p(counts)
    # The busiest thousandth are hot pixels and would leave the rest dark.
    top = max(float(np.quantile(bright, 0.999)), 1e-9)
    return bytes(cv2.imencode(".png", (255 * np.clip(bright / top, 0, 1)).astype(np.uint8))[1])


def _csv(rows: list[dict[str, Any]]) -> str:
    text = io.StringIO()
    if rows:
        writer = csv.DictWriter(text, rows[0].keys(), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    return text.getvalue()


@dataclass(frozen=True, slots=True)
class Export:
    """A kind of file that a result is saved as.

    Attributes
    ----------
    label : str
        For people.
    make : callable
        `make(result) -> content`, with what it `takes` by keyword.
    media_type, suffix : str
        Of the file.
    takes : tuple of str
        Attributes of the runner that it shows besides: `followed`, and `pinned` where A is shown beside the result.
    """

    label: str
    make: Callable[..., str | bytes]
    media_type: str
    suffix: str
    takes: tuple[str, ...] = ()


EXPORTS = {
    "run.rrd": Export("Recording with layout (.rrd)", as_rrd, "application/octet-stream", "rrd", ("followed",)),
    "results.json": Export("Results (JSON)", as_json, "application/json", "json"),
    "spins.csv": Export("Spin of every method (CSV)", spins_csv, "text/csv", "spins.csv"),
    "series.csv": Export("Series of every tick (CSV)", partial(series, suffix=".csv"), "text/csv", "series.csv"),
    "series.parquet": Export(
        "Series of every tick (Parquet)",
        partial(series, suffix=".parquet"),
        "application/vnd.apache.parquet",
        "series.parquet",
    ),
    "series.svg": Export(
        "Figure of the series (SVG)",
        partial(figure, suffix=".svg"),
        "image/svg+xml",
        "series.svg",
        ("followed", "pinned"),
    ),
    "series.pdf": Export(
        "Figure of the series (PDF)",
        partial(figure, suffix=".pdf"),
        "application/pdf",
        "series.pdf",
        ("followed", "pinned"),
    ),
}
