"""A clip run to its end with one setting."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from spinscope.app.session import Session
from spinscope.app.viewer.run import Run
from spinscope.pipeline.chain import Parameters, Tick
from spinscope.pipeline.shots import Shot, ShotLog

from .bench import Clip


@dataclass(frozen=True, slots=True, eq=False)
class Finished:
    """All ticks of a clip with one setting, or the first ones."""

    session: Session
    ticks: list[Tick]
    shots: list[Shot]
    no_shot_reason: str | None

    @classmethod
    def of(cls, session: Session, ticks: list[Tick]) -> Finished:
        """With the shots found in the ticks."""
        log = ShotLog()
        for tick in ticks:
            log.add(tick)
        log.close()
        return cls(session, list(ticks), log.shots, log.no_shot_reason)

    @property
    def run(self) -> Run:
        """As the viewer takes it."""
        return Run.of(self.session, self.ticks, self.shots, self.no_shot_reason)


def finish(clip: Clip, parameters: Parameters, check: Callable[[], None]) -> Finished:
    """Run a clip to its end; `check` is called between two ticks and may raise to abandon the run."""
    ticks = []
    for step in clip.run(parameters):
        check()
        ticks.append(step.tick)
    return Finished.of(clip.with_parameters(parameters), ticks)
