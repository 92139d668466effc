"""Messages of the server to the page while it works; `static/messages.d.ts` is generated from them."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from spinscope.app.tuning.bias_sweep import BiasSweep, Resimulation
from spinscope.app.tuning.optimization import Optimization
from spinscope.app.tuning.parameter_sweep import ParameterSweep
from spinscope.pipeline.metrics import RunMetrics

from .schemas import Response


class Picture(Response):
    """An .rrd picture that is ready to be fetched.

    `seen_shots` are, of B and then of A where it is pinned, the times from which on the detail views show another shot,
    with its number from 1.
    """

    id: str
    size_bytes: int
    start_us: int
    end_us: int
    opening_us: int
    seen_shots: list[list[tuple[int, int]]]


class Message(Response):
    """Message of the server."""

    kind: str


class RunMessage(Message):
    """Progress or result of a run request.

    Attributes
    ----------
    stages_ms, total_ms : dict, float
        Time spent for this request so far, by stage.
    metrics, pinned_metrics : RunMetrics or None
        Metrics of B and A once all ticks are there.
    costs_ms, pinned_costs_ms : dict or None
        What each stage of B and A took when it was computed, perhaps for an earlier request.
    differences : list
        (stage.field, value of A, value of B) of all that differs.
    highs : dict
        Upper ends of ranges that make sense for the ball of B, below the declared ones.
    """

    kind: Literal["run"] = "run"
    serial: int
    state: Literal["loading", "computing", "drawing", "partial", "done", "failed"]
    share: float
    stages_ms: dict[str, float]
    total_ms: float
    error: str | None = None
    picture: Picture | None = None
    metrics: RunMetrics | None = None
    costs_ms: dict[str, float] | None = None
    pinned_metrics: RunMetrics | None = None
    pinned_costs_ms: dict[str, float] | None = None
    differences: list[tuple[str, Any, Any]] = Field(default_factory=list)
    highs: dict[str, float] = Field(default_factory=dict)


class PreviewMessage(Message):
    """Preview of a run at a time, before its picture: the address of a PNG, and the answer in words."""

    kind: Literal["preview"] = "preview"
    serial: int
    t_us: int
    picture: str
    words: str


class ShotsMessage(Message):
    """Shots of a long recording found so far, [start, end) in us, and the share of it that was searched."""

    kind: Literal["shots"] = "shots"
    share: float
    shots: list[tuple[int, int]]
    error: str | None = None


class JobMessage(Message):
    """Progress of a job; `content` holds what there is so far."""

    state: Literal["running", "done", "cancelled", "failed"]
    error: str | None = None
    content: Any = None


class SweepMessage(JobMessage):
    """Progress of a parameter sweep."""

    kind: Literal["sweep"] = "sweep"
    content: ParameterSweep | None = None


class OptimizationMessage(JobMessage):
    """Progress of an optimization."""

    kind: Literal["optimization"] = "optimization"
    content: Optimization | None = None


class BiasesMessage(JobMessage):
    """Progress of a re-simulation."""

    kind: Literal["biases"] = "biases"
    content: Resimulation | None = None


class BiasSweepMessage(JobMessage):
    """Progress of a bias sweep."""

    kind: Literal["bias_sweep"] = "bias_sweep"
    content: BiasSweep | None = None


ServerMessage = (
    RunMessage | PreviewMessage | ShotsMessage | SweepMessage | OptimizationMessage | BiasesMessage | BiasSweepMessage
)
