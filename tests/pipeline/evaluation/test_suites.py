"""Every suite, thinned, against what the truth, the paper and physics say."""

from __future__ import annotations

import statistics
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from spinscope.pipeline.errors import ParameterError
from spinscope.pipeline.evaluation import SUITES, Bench, Report, evaluate
from spinscope.pipeline.evaluation.biases import picture_of
from spinscope.pipeline.evaluation.figures import DRAWINGS, draw
from spinscope.pipeline.evaluation.tables import Row, where


@pytest.fixture(scope="session")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Recordings that several suites share are rendered once."""
    return tmp_path_factory.mktemp("evaluation")


def run(name: str, cache: Path) -> Report:
    report = evaluate(name, Bench(cache), quick=True)
    assert report.rows and report.tables
    for table in report.tables:
        assert table.rows and all(len(row) == len(table.columns) for row in table.rows)
    for path in draw(report, cache / "figures"):
        assert path.read_bytes().startswith(b"\x89PNG")
    return report


def errors(rows: list[Row], column: str) -> list[float]:
    return [value for row in rows if isinstance(value := row[column], float)]


def test_unknown_suite() -> None:
    with pytest.raises(ParameterError, match="there are detector, spinner"):
        evaluate("spinners", Bench())


def test_every_suite_has_figures_and_distinct_full_tasks() -> None:
    assert set(DRAWINGS) == set(SUITES)
    for suite in SUITES.values():
        every = [(task.function, repr(task.arguments)) for task in suite.tasks(False)]
        assert len(set(every)) == len(every) > 2 * len(suite.tasks(True))


def test_spinner(cache: Path) -> None:
    rows = run("spinner", cache).rows
    trusted = [row for row in where(rows, method="best") if row["visible"]]
    assert len(errors(trusted, "axis_error_deg")) >= 0.8 * len(trusted)
    assert statistics.median(errors(trusted, "magnitude_error_rps")) < 3
    assert statistics.median(errors(trusted, "axis_error_deg")) < 6
    assert {row["window_ms"] for row in rows} == {10, 100}


def test_thrower_and_the_frame_camera_beside_it(cache: Path) -> None:
    rows = run("thrower", cache).rows
    best = where(rows, method="best", visible=True)
    assert best and len(errors(best, "axis_error_deg")) == len(best)
    assert max(errors(best, "magnitude_error_rps")) < 8 and max(errors(best, "axis_error_deg")) < 12
    frames = run("frames", cache).rows
    assert all(row in rows for row in where(frames, method="best"))  # the same flights, not run again
    rival = where(frames, method="frame")
    assert len(rival) == len(where(frames, method="best")) > 0
    assert max(errors(rival, "magnitude_error_rps")) < 1 and max(errors(rival, "axis_error_deg")) < 8


def test_detector(cache: Path) -> None:
    rows = run("detector", cache).rows
    for scene in ("one ball", "two balls"):
        ours = where(rows, scene=scene, stage="refined + kalman")
        assert sum(bool(row["found"]) for row in ours) > 0.9 * len(ours)
        assert statistics.fmean(errors(ours, "centre_error_px")) < 0.3
    for row in where(rows, found=True):
        along, across, centre = (float(str(row[name])) for name in ("along_px", "across_px", "centre_error_px"))
        assert np.hypot(along, across) == pytest.approx(centre)


def test_filters(cache: Path) -> None:
    rows = where(run("filters", cache).rows, question="kept")
    kept = {mode: [row["kept_ball"] for row in where(rows, mode=mode)] for mode in ("stc", "trail", "stc_cut_trail")}
    assert kept["stc"] == sorted(kept["stc"]) and kept["trail"] == sorted(kept["trail"], reverse=True)  # type: ignore[type-var]
    for both, stc, trail in zip(kept["stc_cut_trail"], kept["stc"], kept["trail"], strict=True):
        assert both <= stc + 1e-9 and both <= trail + 1e-9  # type: ignore[operator]


def test_biases(cache: Path) -> None:
    rows = run("biases", cache).rows

    def rates(what: str, sweep: str, name: str) -> list[Any]:
        return [
            row[name] for row in sorted(where(rows, what=what, sweep=sweep), key=lambda row: int(str(row["value"])))
        ]

    for what in ("noise", "ball"):
        for polarity in ("on_hz", "off_hz"):
            falling = rates(what, "diff_on = diff_off", polarity)
            assert falling == sorted(falling, reverse=True)
            for sweep in ("refr", "fo"):
                rising = rates(what, sweep, polarity)
                assert rising == sorted(rising)
    picture = picture_of(where(rows, what="picture")[-1])
    assert picture.max() > 0.5 and picture.min() < -0.5 and np.count_nonzero(picture) > 100


def test_runtime(cache: Path) -> None:
    report = run("runtime", cache)
    assert {row["tick_us"] for row in report.rows} == {5000, 1000}
    for row in report.rows:
        parts = sum(float(str(row[f"{name}_ms"])) for name in ("filter", "surface", "track", "logo"))
        assert parts == pytest.approx(float(str(row["latency_ms"]))) and parts > 0
    for _, _, _, _, spin, contrast, everything in report.tables[0].rows[1:]:
        assert spin.mean > 0 and contrast.mean > 0  # type: ignore[union-attr]
        assert everything.mean > spin.mean + contrast.mean  # type: ignore[union-attr]
