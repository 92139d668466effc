"""The chain of stages over packets: one mechanism for batch, live and tuning.

recording | camera | simulator -> packets of one tick
    -> filter -> surface -> track -> logo -> rate -> flow -> spin -> contrast

A column is one stage's results so far plus the state to go on. Its key is the source's identity and the chain of
(stage, parameter values) up to it, compared by value: a changed parameter re-runs its stage and those that read
it, nothing else, and going back to earlier values finds their columns still there.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Collection, Hashable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from types import ModuleType
from typing import Any, Protocol

from .camera import BallParameters, Camera, CameraParameters, Setting
from .errors import ParameterError
from .events import EventBatch
from .methods import best_of
from .parameters import ParameterSet
from .results import Packet, SpinEstimate, nbytes
from .stages import contrast, filter, flow, logo, rate, spin, surface, track

STAGES: dict[str, ModuleType] = {
    "filter": filter,
    "surface": surface,
    "track": track,
    "logo": logo,
    "rate": rate,
    "flow": flow,
    "spin": spin,
    "contrast": contrast,
}
CACHE_BYTES = 2 << 30
COLUMNS_MOST = 10_000
TICKS_MAX = 4_000_000  # 5.5 hours at 200 Hz; more is a damaged clock, not a recording


@dataclass(frozen=True, kw_only=True)
class Parameters(ParameterSet):
    """Everything that can be set, by stage; the defaults are ours."""

    camera: CameraParameters = CameraParameters()
    ball: BallParameters = BallParameters()
    filter: filter.FilterParameters = filter.FilterParameters()
    surface: surface.SurfaceParameters = surface.SurfaceParameters()
    track: track.TrackParameters = track.TrackParameters()
    logo: logo.LogoParameters = logo.LogoParameters()
    rate: rate.RateParameters = rate.RateParameters()
    flow: flow.FlowParameters = flow.FlowParameters()
    spin: spin.SpinParameters = spin.SpinParameters()
    contrast: contrast.ContrastParameters = contrast.ContrastParameters()


@dataclass(frozen=True, eq=False)
class Tick:
    """All stages' results of one tick; contrast is None where the run was told to leave it out."""

    packet: Packet
    filter: filter.FilterResult
    surface: surface.SurfaceResult
    track: track.TrackResult
    logo: logo.LogoResult
    rate: rate.RateResult
    flow: flow.FlowResult
    spin: spin.SpinResult
    contrast: contrast.ContrastResult | None

    @cached_property
    def estimates(self) -> dict[str, SpinEstimate]:
        """Every method's estimate from the present shot so far, by name."""
        own = {} if self.contrast is None else {contrast.METHOD: self.contrast.estimate}
        return {**self.spin.estimates, **own}

    @cached_property
    def best(self) -> str | None:
        """The method whose answer is trusted, None where none is."""
        return best_of(self.estimates)


class Source(Protocol):
    """Where events come from: a recording, a camera or a simulation."""

    @property
    def identity(self) -> Hashable:
        """What tells this source from any other, by content."""

    @property
    def width_px(self) -> int:
        """Width of the sensor."""

    @property
    def height_px(self) -> int:
        """Height of the sensor."""

    @property
    def start_us(self) -> int:
        """Time from which events exist (file time)."""

    @property
    def end_us(self) -> int:
        """Time up to which all events are known (file time, exclusive); grows while a camera is running."""

    @property
    def growing(self) -> bool:
        """Whether events may still come; then only whole ticks are run."""

    def between(self, start_us: int, end_us: int) -> EventBatch:
        """The events of [start_us, end_us). Asked for in rising order when `run` forgets packets."""


@dataclass(frozen=True)
class EventSource:
    """Events in memory."""

    identity: Hashable
    events: EventBatch
    width_px: int
    height_px: int
    start_us: int
    end_us: int
    growing: bool = False

    def between(self, start_us: int, end_us: int) -> EventBatch:
        """The events of [start_us, end_us)."""
        return self.events.between(max(start_us, self.start_us), min(end_us, self.end_us))


@dataclass(slots=True, eq=False)
class _Column:
    """One stage's results from the first tick on; `results` lacks what a run was told to forget.

    making : held while the next result is made: another thread that wants it waits for it
    is_kept : whether all results so far are there
    fault : what a step raised; the state may be half way into its tick, so that no other run may go on from it
    """

    state: Any
    making: threading.Lock = field(default_factory=threading.Lock)
    results: list[Any] = field(default_factory=list)
    is_kept: bool = True
    fault: BaseException | None = None
    bytes: int = 0
    last_use: int = 0


class Chain:
    """Runs the stages over one source and keeps every stage's column.

    Several threads may run it at once: each stage's next result is made by whichever wants it first. Runs that forget
    have their chain to themselves.

    budget_bytes, most_columns : the columns that were not used for longest are dropped when all together hold more
        bytes than this, or are more
    clock : reads seconds; when given, `seconds` adds up what each stage took
    """

    def __init__(
        self,
        source: Source,
        *,
        budget_bytes: int = CACHE_BYTES,
        most_columns: int = COLUMNS_MOST,
        clock: Callable[[], float] | None = None,
    ) -> None:
        self.source = source
        self.seconds = dict.fromkeys(STAGES, 0.0)
        self._budget_bytes, self._most_columns = budget_bytes, most_columns
        self._clock = clock
        self._columns: dict[Hashable, _Column] = {}
        self._uses = 0
        self._lock = threading.Lock()  # for the columns as a whole

    def tick_count(self, parameters: Parameters) -> int:
        """How many ticks the source holds so far, the last one perhaps cut short by the source's end."""
        tick_us = parameters.track.tick_us
        first, last = self.source.start_us // tick_us, self.source.end_us // tick_us
        if not self.source.growing and self.source.end_us % tick_us:
            last += 1  # the last tick, cut short by the end of the recording
        if last - first > TICKS_MAX:
            raise ParameterError(
                f"the events span {(self.source.end_us - self.source.start_us) / 1e6:.0f} s, that is "
                f"{last - first} ticks of {tick_us} us: choose a part with --window START_US END_US"
            )
        return max(0, last - first)

    def setting(self, parameters: Parameters) -> Setting:
        """The camera, the ball and the highest spin that these parameters mean on this sensor."""
        return Setting(
            Camera.of(parameters.camera, self.source.width_px, self.source.height_px),
            parameters.ball.diameter_mm / 2000.0,
            parameters.spin.max_spin_rps,
        )

    def run(
        self,
        parameters: Parameters,
        *,
        ticks: int | None = None,
        forget: Collection[str] = (),
        without: Collection[str] = (),
        together: int = 1,
        seconds: dict[str, float] | None = None,
    ) -> Iterator[Tick]:
        """Yield the first `ticks` ticks (all there are so far by default), computing only what is not yet known.

        Stop iterating to abandon the run: everything computed so far stays. Results of stages named in `forget`
        are not kept beyond their tick (full frames of a long recording would not fit). Stages named in `without`,
        which no other stage may read, are not run: their results are None, and what was known of them stays.

        together : how many ticks a stage works through before the next stage has them. One by one each tick comes as
            soon as it can; several at a time every stage finds its code and memory in the processor's caches.
        seconds : where to add up what each stage takes in this run, if not in the chain's own
        """
        setting = self.setting(parameters)
        keys = self.keys(parameters)
        columns = {name: self._column(keys[name], name, parameters, setting) for name in STAGES if name not in without}
        count = self.tick_count(parameters)
        count = count if ticks is None else min(ticks, count)
        for first in range(0, count, together):
            rows: list[dict[str, Any]] = [
                {"packet": self._packet(parameters.track.tick_us, index), **dict.fromkeys(without)}
                for index in range(first, min(first + together, count))
            ]
            for name, column in columns.items():
                for index, results in enumerate(rows, first):
                    with column.making:
                        if index < len(column.results):
                            results[name] = column.results[index]
                            continue
                        if column.fault is not None:
                            raise column.fault
                        try:
                            results[name] = self._step(name, parameters, column, results, seconds)
                        except BaseException as error:
                            column.fault = error
                            with self._lock:
                                self._columns.pop(keys[name], None)
                            raise
                        if name in forget:
                            column.is_kept = False
                        else:
                            column.bytes += nbytes(results[name])
                            column.results.append(results[name])
            yield from (Tick(**results) for results in rows)
            self._keep_budget(set(keys.values()))

    def _packet(self, tick_us: int, index: int) -> Packet:
        number = self.source.start_us // tick_us + index
        start_us, end_us = number * tick_us, min((number + 1) * tick_us, self.source.end_us)
        return Packet(number, start_us, end_us, self.source.between(start_us, end_us))

    def keys(self, parameters: Parameters) -> dict[str, Hashable]:
        """Each stage's key: its name, its parameters, what else it reads, and the keys of its inputs.

        Stages with the same key have the same results.
        """
        keys: dict[str, Hashable] = {
            "packet": (self.source.identity, parameters.track.tick_us, parameters.camera, parameters.ball)
        }
        for name, stage in STAGES.items():
            also = tuple(getattr(parameters.group(group), item) for group, item in getattr(stage, "ALSO", ()))
            keys[name] = (name, parameters.group(name), also, tuple(keys[other] for other in stage.INPUTS))
        del keys["packet"]
        return keys

    def knows(self, parameters: Parameters, name: str) -> bool:
        """Whether a stage's results of every tick so far are kept."""
        with self._lock:
            column = self._columns.get(self.keys(parameters)[name])
        return column is not None and len(column.results) >= self.tick_count(parameters)

    def _column(self, key: Hashable, name: str, parameters: Parameters, setting: Setting) -> _Column:
        with self._lock:
            column = self._columns.get(key)
            if column is None or not column.is_kept:
                column = self._columns[key] = _Column(STAGES[name].start(parameters.group(name), setting))
            self._uses += 1
            column.last_use = self._uses
            return column

    def _step(
        self,
        name: str,
        parameters: Parameters,
        column: _Column,
        results: dict[str, Any],
        seconds: dict[str, float] | None,
    ) -> Any:
        stage, seconds = STAGES[name], self.seconds if seconds is None else seconds
        begin = self._clock() if self._clock else 0.0
        result = stage.step(parameters.group(name), column.state, *(results[other] for other in stage.INPUTS))
        if self._clock:
            seconds[name] += self._clock() - begin
        return result

    def _keep_budget(self, in_use: set[Hashable]) -> None:
        with self._lock:
            total = sum(column.bytes for column in self._columns.values())
            if total <= self._budget_bytes and len(self._columns) <= self._most_columns:
                return  # comparing the keys of all columns would take longer than a quick tick
            for key in sorted(self._columns.keys() - in_use, key=lambda k: self._columns[k].last_use):
                if total <= self._budget_bytes and len(self._columns) <= self._most_columns:
                    break
                total -= self._columns.pop(key).bytes
