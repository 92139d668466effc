"""Trials: every event from one trigger on to the next, once, in the recording's own time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from spinscope.app.cli import cli
from spinscope.pipeline.errors import ParameterError, RecordingError
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.recordings import Triggers, open_recording, write_recording
from spinscope.pipeline.recordings.trials import split_by_triggers, trial_windows_us


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """Events every millisecond for a second; rising edges on input 0 at 100, 400 and 700 ms, falling ones after."""
    count = 1000
    events = EventBatch(
        np.arange(count) * 1000,
        np.arange(count, dtype=np.uint16) % 640,
        np.zeros(count, np.uint16),
        np.arange(count) % 2 > 0,
    )
    edges = np.array([100, 150, 400, 450, 700, 750]) * 1000
    triggers = Triggers(edges, np.array([1, 0] * 3, np.uint8), np.zeros(6, np.uint8))
    write_recording(tmp_path / "day.raw", events, width_px=640, height_px=480, triggers=triggers)
    (tmp_path / "day.toml").write_text("[truth]\nrps = 20\n")
    return tmp_path / "day.raw"


def test_trials_hold_every_event_once(recording: Path, tmp_path: Path) -> None:
    files = split_by_triggers(recording, tmp_path / "trials")
    assert [path.name for path in files] == ["day_001.h5", "day_002.h5", "day_003.h5"]
    opened = [open_recording(path) for path in files]
    times = np.concatenate([one.read().t_us for one in opened])
    assert np.array_equal(times, np.arange(100, 1000) * 1000)
    assert [one.triggers.t_us.tolist() for one in opened] == [
        [100_000, 150_000],
        [400_000, 450_000],
        [700_000, 750_000],
    ]
    assert all(path.with_suffix(".toml").read_text() == "[truth]\nrps = 20\n" for path in files)
    assert (opened[0].width_px, opened[0].height_px) == (640, 480)
    with pytest.raises(RecordingError, match="there already"):
        split_by_triggers(recording, tmp_path / "trials")


def test_windows(recording: Path, tmp_path: Path) -> None:
    opened = open_recording(recording)
    assert trial_windows_us(opened, before_us=20_000, length_us=50_000) == [
        (80_000, 150_000),
        (380_000, 450_000),
        (680_000, 750_000),
    ]
    with pytest.raises(ParameterError, match="positive times"):
        trial_windows_us(opened, before_us=-1)
    with pytest.raises(RecordingError, match=r"0 rising trigger edges on input 3.*some on inputs"):
        trial_windows_us(opened, channel=3)
    done = CliRunner().invoke(cli, ["split", str(recording), "--out", str(tmp_path / "b"), "--length-ms", "10"])
    assert done.exit_code == 0 and "wrote 3 trials" in done.output
    assert len(open_recording(tmp_path / "b" / "day_002.h5").read()) == 10


def test_a_recording_without_triggers_is_said(tmp_path: Path) -> None:
    events = EventBatch(np.arange(10), np.zeros(10, np.uint16), np.zeros(10, np.uint16), np.ones(10, bool))
    write_recording(tmp_path / "none.raw", events, width_px=640, height_px=480)
    with pytest.raises(RecordingError, match="0 rising trigger edges: 1 to"):
        trial_windows_us(open_recording(tmp_path / "none.raw"))
