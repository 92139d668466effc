"""A clip run to its end with one setting."""

from __future__ import annotations

from collections.abc import Callable

from spinscope.pipeline.registry import Parameters
from spinscope.pipeline.session import Result

from .bench import Clip


def finish(clip: Clip, parameters: Parameters, check: Callable[[], None]) -> Result:
    """Run a clip to its end; `check` is called between two ticks and may raise to abandon the run."""
    ticks = []
    for step in clip.run(parameters):
        check()
        ticks.append(step.tick)
    return Result.of(clip.with_parameters(parameters), ticks)
