"""Training sets: what a sample holds agrees with the simulated ball, and the same numbers make the same set."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from spinscope.app.cli import cli
from spinscope.pipeline.evaluation import TaskContext, training_set
from spinscope.pipeline.evaluation.training_set import FEWEST_EVENTS, WINDOWS_US, write_training_set


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """One spinner of 20 ms, 12 windows."""
    monkeypatch.setattr(training_set, "RECORDINGS_A_SHARD", 1)
    monkeypatch.setattr(training_set, "SPINNER_MS", 20)
    monkeypatch.setattr(training_set, "WINDOWS_A_RECORDING", 12)


def test_samples_are_events_of_a_window_on_the_side_that_is_seen(tmp_path: Path) -> None:
    (row,) = write_training_set(tmp_path, TaskContext(), shards=1, seed=3)
    shard = np.load(tmp_path / str(row["shard"]))
    first, count = shard["first"], len(shard["window_us"])
    assert row["samples"] == count > 0 and first[-1] == len(shard["age_us"]) == row["events"]
    assert (np.diff(first) >= FEWEST_EVENTS).all()
    assert set(shard["window_us"]) <= set(WINDOWS_US)
    sample = np.repeat(np.arange(count), np.diff(first))
    assert ((shard["age_us"] > 0) & (shard["age_us"] <= shard["window_us"][sample])).all()
    np.testing.assert_allclose(np.linalg.norm(shard["normal"], axis=1), 1.0, atol=1e-5)
    assert (np.sum(shard["normal"] * shard["sight"][sample], axis=1) < 0.1).all()
    assert (np.linalg.norm(shard["spin_rps"], axis=1) > 4.9).all() and len(set(shard["seed"])) == 1
    again = tmp_path / "again"
    write_training_set(again, TaskContext(), shards=1, seed=3)
    assert (again / str(row["shard"])).read_bytes() == (tmp_path / str(row["shard"])).read_bytes()
    assert "shard_NNNN.npz" in (tmp_path / "README.md").read_text(encoding="utf-8")
    assert json.loads((tmp_path / "set.json").read_text(encoding="utf-8"))["shards"] == [row]


def test_the_command_asks_for_both_names() -> None:
    for arguments in (["dataset"], ["spinner", "--out", "set"], ["--out", "set"]):
        done = CliRunner().invoke(cli, ["evaluate", *arguments])
        assert done.exit_code == 2 and "give both, or neither" in done.output
