"""Tables of the best methods, from rows whose best are known."""

from __future__ import annotations

from collections.abc import Sequence

from spinscope.pipeline.evaluation import Report, Row
from spinscope.pipeline.evaluation.best_methods import best_methods
from spinscope.pipeline.evaluation.suites import SUITES


def report(name: str, rows: Sequence[Row]) -> Report:
    return Report(SUITES[name], False, list(rows), [])


def answer(method: str, error_rps: float | None, error_deg: float | None, window_ms: int = 10) -> Row:
    row: Row = {"method": method, "rps": 50.0, "window_ms": window_ms}
    return row | {"magnitude_error_rps": error_rps, "axis_error_deg": error_deg}


def test_each_column_names_its_best_and_easy_answers_alone_do_not_win() -> None:
    rows = [
        answer("steady", 1.0, 2.0),
        answer("steady", 2.0, 3.0),
        answer("sharp", 0.5, 9.0),
        answer("sharp", None, None),
    ]
    rows += [answer("shy", 0.1, 0.1), *[answer("shy", None, None)] * 4, answer("best", 0.0, 0.0)]
    table = best_methods([report("spinner", rows)])
    assert table is not None
    assert table.rows == [("spinner", "10 ms", 5, "steady (100%)", "sharp (0.50 rps)", "steady (2.50 degrees)", None)]


def test_kinds_of_recordings_are_told_apart_and_nobody_right_is_said() -> None:
    rows = [answer("steady", 1.0, 2.0, 100), answer("steady", 40.0, 2.0, 10)]
    table = best_methods([report("spinner", rows)])
    assert table is not None
    assert [row[1:4] for row in table.rows] == [("100 ms", 1, "steady (100%)"), ("10 ms", 1, None)]


def test_stages_of_the_detector_are_compared_by_the_place() -> None:
    rows: list[Row] = [
        {"scene": "arm", "stage": stage, "centre_error_px": px} for stage, px in (("hough", 1.0), ("refined", 0.2))
    ]
    table = best_methods([report("detector", rows)])
    assert table is not None and table.rows == [("detector", "arm", 1, None, None, None, "refined (0.20 px)")]


def test_suites_without_methods_are_left_out() -> None:
    assert best_methods([report("runtime", [{"tick_us": 5000, "tick_ms": 1.0}]), report("live", [])]) is None
