"""The table of what became of the recordings of a folder."""

from __future__ import annotations

from pathlib import Path

from spinscope.pipeline.evaluation.lab_recordings import SPINNER, LabFolder, recordings_table
from spinscope.pipeline.evaluation.tables import Row


def test_mixed_sensors_are_said_with_the_remedy() -> None:
    folder = LabFolder(Path("day"), (), {"wrong.raw": "no [truth]"})
    rows: list[Row] = [
        {"recording": "a.raw", "sensor": "1280x720"},
        {"recording": "b.raw", "sensor": "640x480"},
        {"recording": "c.raw", "error": "damaged"},
    ]
    lines = recordings_table(folder, (SPINNER,), rows).rows
    assert lines[0] == ("evaluated", 2, None)
    assert [line[2] for line in lines[1:3]] == ["c.raw: damaged", "wrong.raw: no [truth]"]
    assert lines[3][:2] == ("mixed sensors", 2) and "1280x720, 640x480: state each camera" in str(lines[3][2])
    assert len(recordings_table(folder, (SPINNER,), rows[:1]).rows) == 2
