"""Runs of the real chain, shared by the viewer's tests: a flight, a fixed ball, and a recording without a ball."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from spinscope.app.viewer.run import ViewedRun
from spinscope.pipeline.registry import STAGES
from spinscope.pipeline.session import Choices, Session
from spinscope.pipeline.tick import Tick


def run_of(path: Path, choices: Choices) -> ViewedRun:
    """Run the chain over a recording, as `spinscope view` does."""
    return ViewedRun.of(Session.open(path, choices).estimate_keeping_ticks())


def with_results(tick: Tick, **results: Any) -> Tick:
    """The tick, and its only ball, with other results of some stages; None for a stage that was not run."""
    changed = {name: result for name, result in {**tick.results, **results}.items() if result is not None}
    own = {name: result for name, result in changed.items() if STAGES[name].scope == "ball"}
    balls = tuple(dataclasses.replace(ball, results=own) for ball in tick.balls)
    return dataclasses.replace(tick, results=changed, balls=balls)


@pytest.fixture(scope="session")
def flight(samples: Path) -> ViewedRun:
    """A topspin shot of 96 ms."""
    return run_of(samples / "flight_fast_top.h5", Choices())


@pytest.fixture(scope="session")
def spinner(samples: Path) -> ViewedRun:
    """A ball on a spinner at 50 rps."""
    return run_of(samples / "spinner_ball1_top.h5", Choices(fixed_ball=(663.8, 272.4, 16.5)))


@pytest.fixture(scope="session")
def no_ball(tmp_path_factory: pytest.TempPathFactory) -> ViewedRun:
    """60 ms of noise, beginning at 5 s of the file's time."""
    path = tmp_path_factory.mktemp("noise") / "noise.h5"
    random, count = np.random.default_rng(1), 4000
    with h5py.File(path, "w") as file:
        file.attrs.update(width=1280, height=720)
        file["events/t"] = np.sort(random.integers(5_000_000, 5_060_000, count))
        file["events/x"] = random.integers(0, 1280, count).astype(np.uint16)
        file["events/y"] = random.integers(0, 720, count).astype(np.uint16)
        file["events/p"] = random.integers(0, 2, count).astype(np.uint8)
    return run_of(path, Choices())
