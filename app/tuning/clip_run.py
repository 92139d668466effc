"""Run of a clip with one set of parameters."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

from spinscope.pipeline.registry import Parameters
from spinscope.pipeline.session import Result, Session

MOST_FRAMES_BYTES = 600_000_000  # a short tick on a long clip: what a run may hold whatever else is kept


def run_clip(clip: Session, parameters: Parameters, check: Callable[[], None]) -> Result:
    """Run a clip to its end, keeping the ticks.

    Parameters
    ----------
    clip : Session
        The clip with its chain, which keeps the results of the stages.
    parameters : Parameters
        Parameters of the run in place of the clip's.
    check : callable
        Called between two ticks; may raise to abandon the run.
    """
    ticks = []
    for tick in clip.chain.run(parameters):
        check()
        ticks.append(tick)
    return Result.of(dataclasses.replace(clip, parameters=parameters), ticks)
