"""Declaration of one stage of the chain, of one spin method, and of what they are started with."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal

from .call_cache import CallCache
from .camera import Camera
from .parameters import ParameterGroup
from .results import SpinEstimate


@dataclass(frozen=True, slots=True)
class Context:
    """Surroundings of a stage that do not change within a recording.

    Attributes
    ----------
    camera : Camera
        The camera on this sensor.
    ball_radius_m : float
        Radius of the ball, m.
    values : Mapping[str, Any]
        Parameters of other groups by `group.field`: those that the stage declares in `Stage.reads`, no others.
    calls : CallCache
        Results of a stage's slow functions, under these and under other parameters.
    """

    camera: Camera
    ball_radius_m: float
    values: Mapping[str, Any] = field(default_factory=dict)
    calls: CallCache = field(default_factory=CallCache, compare=False, repr=False)

    def __getitem__(self, name: str) -> Any:
        """Value of a declared parameter of another group; raises KeyError for one that the stage does not declare."""
        try:
            return self.values[name]
        except KeyError:
            raise KeyError(f"{name}: a stage must declare in `reads` what it takes from other groups") from None


@dataclass(frozen=True, kw_only=True)
class Stage:
    """One stage of the chain: all that chain, command line, sliders, viewer and tests need to know of it.

    Attributes
    ----------
    name : str
        Name in results, targets and timings.
    label : str
        Name for people.
    help : str
        What the stage does, in one sentence.
    scope : {"recording", "ball"}
        Whether it has one state for the recording, or one for each ball in flight, begun anew with every shot.
    inputs : tuple of str
        What `step` takes: "packet", "ball" (the BallTrack, for stages of one ball) or names of earlier stages.
    parameters : type of ParameterGroup
        Its parameters; stages may share a group.
    reads : tuple of str
        Parameters of other groups (`group.field`) that it finds in its context. Together with `parameters` and the
        inputs they make the key of its results: a stage cannot read what is not in its key.
    start : callable
        `start(parameters, context) -> state`; raises ParameterError where values do not go together.
    step : callable
        `step(parameters, state, *inputs) -> result`: one tick. It may change the state in place, never its inputs,
        and its results never share memory with the state.
    absent : callable, optional
        `absent(parameters, reason) -> result` of a tick without a ball; for stages of one ball.
    is_slow : bool
        Whether it takes longer than all others: left for later while somebody drags a slider.
    """

    name: str
    label: str
    help: str
    inputs: tuple[str, ...]
    parameters: type[ParameterGroup]
    start: Callable[[Any, Context], Any]
    step: Callable[..., Any]
    absent: Callable[[Any, str], Any] | None = None
    scope: Literal["recording", "ball"] = "ball"
    reads: tuple[str, ...] = ()
    is_slow: bool = False

    @cached_property
    def group(self) -> str:
        """Name of its group of parameters."""
        return self.parameters.group_name()


def never_trusted(estimates: Mapping[str, SpinEstimate]) -> bool:
    """Trust rule of a method that has no doubts of its own."""
    return False


@dataclass(frozen=True, kw_only=True)
class SpinMethod(Stage):
    """A stage of one ball whose result carries a spin estimate (`result.estimate`).

    Attributes
    ----------
    colour : (int, int, int)
        Red, green and blue in every plot, 0..255.
    is_trusted : callable
        `is_trusted(estimates) -> bool`: whether the program itself trusts this method's estimate, given all methods'.
    is_last_resort : bool
        Whether its estimate is taken only where that of no other method is trusted.
    is_rival : bool
        Whether it is another publication's method, run for comparison: only when it is named, and never trusted.
    """

    colour: tuple[int, int, int]
    is_trusted: Callable[[Mapping[str, SpinEstimate]], bool] = never_trusted
    is_last_resort: bool = False
    is_rival: bool = False
