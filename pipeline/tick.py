"""Results of one tick: of the recording, and of every ball in flight."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

from .registry import distrust_reason, methods, trusted_method
from .results import MethodResult, Packet, SpinEstimate
from .track_evidence import TrackEvidence

if TYPE_CHECKING:
    from .spin.contrast import ContrastResult
    from .spin.trajectory.stage import TrajectoryResult
    from .stages.filter import FilterResult
    from .stages.flow import FlowResult
    from .stages.logo import LogoResult
    from .stages.rate import RateResult
    from .stages.surface import SurfaceResult
    from .stages.track_result import BallTrack, TrackResult


@dataclass(frozen=True, eq=False)
class StageResults:
    """Results by stage name, of the stages that were run."""

    results: Mapping[str, Any]

    def get(self, name: str) -> Any:
        """Result of a stage, None where it was not run."""
        return self.results.get(name)

    @cached_property
    def estimates(self) -> dict[str, SpinEstimate]:
        """Spin estimates from the present shot so far, by method, of the methods that were run."""
        return {method.name: self.results[method.name].estimate for method in methods() if method.name in self.results}


@dataclass(frozen=True, eq=False)
class BallTick(StageResults):
    """Results of one ball in one tick.

    Attributes
    ----------
    results : Mapping[str, Any]
        By name: the stages of one ball.
    packet : Packet
        The tick's events, from the start of the shot on.
    track : BallTrack
        The ball at the tick's end.
    evidence : TrackEvidence
        What its track shows from the shot's start to this tick.
    earlier : tuple of BallTick
        The ticks since the shot's start that came before it was announced, oldest first.
    """

    packet: Packet
    track: BallTrack
    evidence: TrackEvidence
    earlier: tuple[BallTick, ...] = ()

    @cached_property
    def best(self) -> str | None:
        """Method whose estimate is trusted, None where none is."""
        return trusted_method(self.estimates, self.evidence.doubt)

    @cached_property
    def best_reason(self) -> str | None:
        """Reason for trusting no estimate, in words for people; None where one is."""
        return distrust_reason(self.estimates, self.evidence.doubt)


@dataclass(frozen=True, eq=False)
class Tick(StageResults):
    """Results of one tick: attributes by stage name, of the stages that were run.

    Results of one ball are those of the ball that the detail views follow, the first one; without a ball they say why.

    Attributes
    ----------
    packet : Packet
        The tick's events.
    results : Mapping[str, Any]
        By name: the stages of the recording, and those of one ball for the followed ball, or for no ball.
    balls : tuple of BallTick
        Every ball in flight.
    """

    packet: Packet
    balls: tuple[BallTick, ...]

    @property
    def best(self) -> str | None:
        """Method whose estimate is trusted for the followed ball, None where none is."""
        return self.balls[0].best if self.balls else None

    if TYPE_CHECKING:  # results of the stages that ship; no fields, and not the only ones
        filter: ClassVar[FilterResult]
        surface: ClassVar[SurfaceResult]
        track: ClassVar[TrackResult]
        logo: ClassVar[LogoResult]
        rate: ClassVar[RateResult]
        flow: ClassVar[FlowResult]
        triplet: ClassVar[MethodResult]
        normal_flow: ClassVar[MethodResult]
        contrast: ClassVar[ContrastResult]
        trajectory: ClassVar[TrajectoryResult]

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        try:
            return self.results[name]
        except KeyError:
            raise AttributeError(f"{name} is not among the targets of this run: {', '.join(self.results)}") from None
