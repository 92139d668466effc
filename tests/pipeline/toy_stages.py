"""Toy stages that count their steps, for tests of the chain's bookkeeping."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from spinscope.pipeline.event_source import EventsInMemory
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.registry import STAGES, Parameters
from spinscope.pipeline.stage import Stage

DEFAULT = Parameters()
INPUTS = {
    "filter": ("packet",),
    "surface": ("packet", "filter"),
    "track": ("packet", "filter", "surface"),
    "logo": ("packet", "filter", "ball"),
    "rate": ("packet", "logo"),
    "flow": ("packet", "ball", "logo", "rate"),
    "triplet": ("packet", "flow", "rate"),
    "normal_flow": ("packet", "logo", "flow", "rate"),
    "contrast": ("packet", "ball", "logo", "normal_flow"),
    "trajectory": ("packet", "ball"),
    "combined": ("packet", "rate", "normal_flow", "contrast", "trajectory"),
}
OF_RECORDING = ("filter", "surface", "track")
BELOW_LOGO = {"logo", "rate", "flow", "triplet", "normal_flow", "contrast", "combined"}
ALL_BUT_CONTRAST = tuple(name for name in INPUTS if name not in ("contrast", "combined"))


@dataclass(frozen=True)
class ToyBall:
    """One ball of the toy tracker."""

    shot: int
    t_us: float = 0.0
    start_us: int = 0
    earlier: tuple[ToyBall, ...] = ()
    mean: NDArray[np.float64] = field(default_factory=lambda: np.ones(5), compare=False)
    measured: None = None
    doubt: None = None


@dataclass(frozen=True)
class ToyTrack:
    """Result of the toy tracker: the balls in flight, and everything seen so far."""

    balls: tuple[ToyBall, ...]
    seen: tuple[Any, ...]
    reason: str = "no ball"


class Toys:
    """Toy stages in place of the real ones, whose results name everything seen so far.

    counts : how often each stage stepped
    flying : the shots or balls in flight by tick number; one ball throughout by default
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.counts = dict.fromkeys(INPUTS, 0)
        self.flying: Callable[[int], tuple[int | ToyBall, ...]] = lambda index: (0,)
        self.steps: dict[str, Callable[..., Any]] = {}
        self.stages = {stage.name: self._toy(stage) for stage in STAGES if stage.name in INPUTS}
        monkeypatch.setattr(STAGES, "_entries", self.stages)

    def _toy(self, stage: Stage) -> Stage:
        def step(parameters: Any, state: list[str], packet: Any, *inputs: Any) -> Any:
            self.counts[stage.name] += 1
            state.append(f"{packet.index}:{len(packet.events)}")
            seen = (stage.name, parameters, tuple(state), inputs)
            if stage.name == "track":
                flying = self.flying(packet.index)
                return ToyTrack(tuple(ToyBall(one) if isinstance(one, int) else one for one in flying), seen)
            return seen

        self.steps[stage.name] = step
        absent = (lambda parameters, reason: (stage.name, reason)) if stage.scope == "ball" else None
        return dataclasses.replace(
            stage,
            inputs=INPUTS[stage.name],
            start=lambda parameters, context: [],
            step=lambda *given: self.steps[stage.name](*given),
            absent=absent,
        )


def source(count: int = 100, step_us: int = 1000, first_us: int = 0) -> EventsInMemory:
    t = first_us + np.arange(count, dtype=np.int64) * step_us
    zeros = np.zeros(count, np.uint16)
    events = EventBatch(t, zeros, zeros, zeros.astype(bool))
    return EventsInMemory("toy", events, 8, 8, int(t[0]), int(t[-1]) + 1)
