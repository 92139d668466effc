"""Summaries and tables."""

from __future__ import annotations

import json
import math
import statistics

from hypothesis import given
from hypothesis import strategies as st

from spinscope.pipeline.evaluation.tables import ResultTable, Summary, text

numbers = st.floats(-1e6, 1e6)


@given(st.lists(st.none() | numbers, max_size=20))
def test_summary_is_that_of_the_answers(values: list[float | None]) -> None:
    found = Summary.over(values)
    good = [value for value in values if value is not None]
    assert (found.count, found.of) == (len(good), len(values))
    if not good:
        assert found.mean is found.median is found.sd is None
        return
    assert found.mean is not None and math.isclose(found.mean, statistics.fmean(good))
    assert found.median == statistics.median(good)
    assert (found.sd is None) == (len(good) == 1)
    if found.sd is not None:
        assert math.isclose(found.sd, statistics.stdev(good))


def test_infinite_errors_are_failures() -> None:
    assert Summary.over([math.inf, math.nan, 1.0]).success == 1 / 3
    assert Summary.over([]).success is None


def test_cells_read_well() -> None:
    assert text(Summary.over([1.0, 2.0, 4.0])) == "2.33 ± 1.53 (2.00)"
    assert text(Summary.over([3.0])) == "3.00"
    assert text(Summary.over([None])) == text(None) == "-"
    assert [text(cell) for cell in (0.123, 12.34, 1234.5, 7, "word")] == ["0.12", "12.3", "1234", "7", "word"]


def test_tables_go_through_json() -> None:
    table = ResultTable("t", ("a", "b"), [("x", Summary.over([1.0, 3.0]))], "note")
    back = json.loads(json.dumps(table.as_dict(), allow_nan=False))
    assert back["rows"][0][1] == {"count": 2, "of": 2, "mean": 2.0, "sd": math.sqrt(2), "median": 2.0}
