"""The suite of live runs: shots of the replay are those of the events read at once."""

from __future__ import annotations

from pathlib import Path

import pytest

from spinscope.pipeline.evaluation.suites import live
from spinscope.pipeline.evaluation.tables import Row
from spinscope.pipeline.evaluation.tasks import TaskContext


def test_a_second_of_replay(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live, "load_kernels", lambda: None)
    rows = list[Row]()
    for tick_us in (5000, 1000):
        some = live.measure(TaskContext(tmp_path), rate_mev_s=0.2, tick_us=tick_us, seconds=1.0)
        assert {row["identical"] for row in some} == {True}
        assert sum(row["what"] == "track" for row in some) + some[0]["skipped"] == 1_000_000 // tick_us
        rows += some
    (table,) = live.tables(rows)
    assert [line[:2] for line in table.rows[1:]] == [("0.2 Mev/s", 5.0), ("0.2 Mev/s", 1.0)]
    assert len(table.rows[1]) == len(table.rows[0]) == len(table.columns)
    assert set(live.figures(rows)) == {"latency"}


def test_the_round_has_the_rate_asked_for(samples: Path) -> None:
    from spinscope.pipeline.session import Session

    events = live.busy_round(Session.open(samples / "flight_fast_top.h5"), 1.0)
    assert len(events) == 1_000_000
    assert (events.t_us[1:] >= events.t_us[:-1]).all()
