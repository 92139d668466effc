"""The chain of stages over packets: one mechanism for batch, live and tuning.

recording | camera | simulator -> packets of one tick
    -> per recording: filter -> surface -> track
    -> per ball in flight: logo -> rate -> flow -> triplet, normal_flow -> contrast, trajectory -> combined

A column (`column_cache.py`) is one stage's results so far plus the state to go on. Its key is the source's identity and
the chain of (stage, parameter values) up to it, compared by value: a changed parameter re-runs its stage and those that
read it, nothing else, and going back to earlier values finds their columns still there. Where a stage's inputs turn out
to be the same all the same, its slow functions' results are known (`call_cache.py`). Stages of one ball have a column
for each shot. A shot whose start is known late, at a contact or where a ball must be seen more than once, gets
its results of the earlier ticks in the tick in which it is announced.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import islice
from typing import Any

from .call_cache import CallCache
from .camera import Camera
from .column_cache import CACHE_BYTES, MAX_COLUMNS, Column, ColumnCache, StageKey
from .errors import ParameterError
from .event_source import EventSource
from .registry import STAGES, Parameters, default_stages, needed_stages
from .results import Packet
from .stage import Context, Stage
from .tick import BallTick, Tick
from .track_evidence import NO_EVIDENCE, TrackEvidence

MAX_TICKS = 4_000_000  # 5.5 hours at 200 Hz; more is a damaged clock, not a recording
# How long packets are kept for shots that are announced late: five times what a contact takes to be seen at 200 Hz.
EARLIER_US = 100_000


@dataclass(frozen=True, slots=True, eq=False)
class _BallInputs:
    """Inputs of the stages of one ball in tick number `index`: by name, their own results so far among them."""

    index: int
    evidence: TrackEvidence
    values: dict[str, Any]


class Chain:
    """Runs the stages over one source and keeps every stage's columns.

    Several threads may run it at once: each stage's next result is made by whichever wants it first. Runs that forget
    have their chain to themselves.

    Parameters
    ----------
    source : EventSource
        The events.
    rivals : collection of str
        Methods of other publications that belong to all stages of a run; raises ParameterError for an unknown one.
    budget_bytes, max_columns : int
        The columns that were not used for longest are dropped when all together hold more bytes than this, or are
        more.
    clock : callable, optional
        Reads seconds; when given, `seconds` adds up what each stage took.
    """

    def __init__(
        self,
        source: EventSource,
        *,
        rivals: Collection[str] = (),
        budget_bytes: int = CACHE_BYTES,
        max_columns: int = MAX_COLUMNS,
        clock: Callable[[], float] | None = None,
    ) -> None:
        self.source = source
        self.rivals = tuple(rivals)
        self.stages = default_stages(rivals)
        self.seconds = dict.fromkeys(STAGES.names, 0.0)
        self._cache = ColumnCache(budget_bytes, max_columns)
        self._calls = CallCache()
        self._key = lru_cache(max_columns)(StageKey)  # equal keys are one object: nothing is compared with its inputs
        self._clock = clock

    def tick_count(self, parameters: Parameters) -> int:
        """Number of ticks that the source holds so far, the last one perhaps cut short by the source's end."""
        tick_us = parameters.track.tick_us
        first, last = self.source.start_us // tick_us, self.source.end_us // tick_us
        if not self.source.growing and self.source.end_us % tick_us:
            last += 1  # the last tick, cut short by the end of the recording
        if last - first > MAX_TICKS:
            raise ParameterError(
                f"the events span {(self.source.end_us - self.source.start_us) / 1e6:.0f} s, that is "
                f"{last - first} ticks of {tick_us} us: choose a part with --window START_US END_US"
            )
        return max(0, last - first)

    def camera(self, parameters: Parameters) -> Camera:
        """The camera of these parameters on the source's sensor."""
        return Camera.of(parameters.camera, self.source.width_px, self.source.height_px)

    def context(self, parameters: Parameters, stage: Stage) -> Context:
        """Context of a stage: camera, ball, and the parameters of other groups that it declares."""
        return Context(
            self.camera(parameters),
            parameters.ball.diameter_mm / 2000.0,
            {name: parameters.value(name) for name in stage.reads},
            self._calls,
        )

    def start(self, parameters: Parameters, stage: Stage) -> Any:
        """Fresh state of a stage; raises ParameterError where values do not go together."""
        return stage.start(parameters.group(stage.group), self.context(parameters, stage))

    def check(self, parameters: Parameters, max_frame_bytes: int | None = None) -> None:
        """Raise ParameterError where values do not go together, or one full frame for each tick takes more bytes."""
        for stage in STAGES:
            self.start(parameters, stage)
        ticks = self.tick_count(parameters)
        if max_frame_bytes is not None and ticks * self.source.width_px * self.source.height_px > max_frame_bytes:
            raise ParameterError(
                f"track.tick_us = {parameters.track.tick_us} makes {ticks} frames of this clip, more than fit in "
                "memory: choose a longer tick or a shorter clip"
            )

    def run(
        self,
        parameters: Parameters,
        targets: Collection[str] | None = None,
        *,
        ticks: int | None = None,
        forget: Collection[str] = (),
        together: int = 1,
        seconds: dict[str, float] | None = None,
    ) -> Iterator[Tick]:
        """Yield tick by tick, computing only what is wanted and not yet known.

        Stop iterating to abandon the run: everything computed so far stays.

        Parameters
        ----------
        parameters : Parameters
            Values of all stages.
        targets : collection of str, optional
            Names of the stages whose results are wanted; what they need runs, nothing else. By default
            `Chain.stages`: all but the rivals that the chain was not given.
        ticks : int, optional
            Number of ticks; all there are so far by default.
        forget : collection of str
            Stages whose results are not kept beyond their tick (full frames of a long recording would not fit).
        together : int
            Ticks that a stage works through before the next stage has them. One by one each tick comes as soon as it
            can; several at a time every stage finds its code and memory in the processor's caches.
        seconds : dict, optional
            Where to add up what each stage takes in this run, if not in the chain's own.

        Yields
        ------
        Tick

        Raises
        ------
        ParameterError
            For an unknown target, or values that do not go together.
        """
        count = self.tick_count(parameters)
        count = count if ticks is None else min(ticks, count)
        packets = (self._packet(parameters.track.tick_us, index) for index in range(count))
        return self.follow(parameters, packets, targets, forget=forget, together=together, seconds=seconds)

    def follow(
        self,
        parameters: Parameters,
        packets: Iterable[Packet],
        targets: Collection[str] | None = None,
        *,
        forget: Collection[str] = (),
        together: int = 1,
        seconds: dict[str, float] | None = None,
    ) -> Iterator[Tick]:
        """Yield tick by tick of packets that come one after the other, as from a running camera.

        Parameters
        ----------
        packets : iterable of Packet
            From the tick of the source's start on, without gaps.
        parameters, targets, forget, together, seconds
            As of `run`.
        """
        stages = needed_stages(self.stages if targets is None else targets)
        run = _Run(self, parameters, self.keys(parameters), set(forget), self.seconds if seconds is None else seconds)
        of_recording = [(stage, run.column(stage)) for stage in stages if stage.scope == "recording"]
        coming = enumerate(packets)
        while group := list(islice(coming, together)):
            rows: list[tuple[int, dict[str, Any]]] = [(index, {"packet": packet}) for index, packet in group]
            for stage, column in of_recording:
                for index, results in rows:
                    results[stage.name] = run.result(stage, column, index, results)
            yield from run.answered([stage for stage in stages if stage.scope == "ball"], rows)

    def answer(
        self,
        parameters: Parameters,
        tracked: Iterable[Tick],
        targets: Collection[str] | None = None,
        *,
        forget: Collection[str] = (),
    ) -> Iterator[Tick]:
        """Run the stages of one ball over ticks with a track, such as another thread's run makes.

        Parameters
        ----------
        tracked : iterable of Tick
            With the results of the recording that stages of one ball need; from the first tick on, without gaps. Where
            their balls have results already, those are taken.
        parameters, targets, forget
            As of `run`.
        """
        stages = needed_stages(self.stages if targets is None else targets)
        of_ball = [stage for stage in stages if stage.scope == "ball"]
        run = _Run(self, parameters, self.keys(parameters), set(forget), self.seconds)
        for index, tick in enumerate(tracked):
            of_recording = {name: made for name, made in tick.results.items() if STAGES[name].scope == "recording"}
            yield from run.answered(of_ball, [(index, {**of_recording, "packet": tick.packet})], [tick.balls])

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
        for stage in STAGES:
            read = tuple(parameters.value(name) for name in stage.reads)
            inputs = tuple(keys["track" if name == "ball" else name] for name in stage.inputs)
            keys[stage.name] = self._key(stage.name, parameters.group(stage.group), read, inputs)
        del keys["packet"]
        return keys

    def knows(self, parameters: Parameters, name: str) -> bool:
        """Whether a stage's results of every tick so far are kept."""
        keys, count = self.keys(parameters), self.tick_count(parameters)
        of_recording = keys["track" if STAGES[name].scope == "ball" else name]
        tracks = self._cache.results((of_recording, None), count)
        if tracks is None or STAGES[name].scope == "recording":
            return tracks is not None
        last = {ball.shot: index for index, track in enumerate(tracks) for ball in track.balls}
        return all(self._cache.reaches((keys[name], shot), index) for shot, index in last.items())


class _Run:
    """One run of a chain: its columns, and how their next results are made."""

    def __init__(
        self,
        chain: Chain,
        parameters: Parameters,
        keys: dict[str, Hashable],
        forget: set[str],
        seconds: dict[str, float],
    ) -> None:
        self._chain, self._parameters, self._keys = chain, parameters, keys
        self._forget, self._seconds = forget, seconds
        self._columns: dict[tuple[str, int | None], Column] = {}
        self._inputs_of_ball = {name for stage in STAGES if stage.scope == "ball" for name in ("packet", *stage.inputs)}
        self._recent: deque[dict[str, Any]] = deque()  # those of the recent ticks that no ball has to itself
        self._evidence: dict[int, TrackEvidence] = {}  # of the shots in flight
        self._absent: dict[str, tuple[str, Any]] = {}  # by stage: reason and result of the last tick without a ball

    def column(self, stage: Stage, shot: int | None = None, first: int = 0) -> Column:
        """The stage's column, of a shot for stages of one ball; begun at tick number `first` when there is none."""
        column = self._columns.get((stage.name, shot))
        if column is None:
            key = (self._keys[stage.name], shot)
            column = self._chain._cache.begun(key, first, lambda: self._chain.start(self._parameters, stage))
            self._columns[stage.name, shot] = column
        return column

    def result(self, stage: Stage, column: Column, index: int, inputs: Mapping[str, Any]) -> Any:
        """The stage's result of tick number `index`, made from its inputs unless it is known."""
        return self._chain._cache.result(
            column,
            index,
            lambda: self._step(stage, column.state, inputs),
            is_kept=stage.name not in self._forget,
        )

    def _step(self, stage: Stage, state: Any, inputs: Mapping[str, Any]) -> Any:
        clock = self._chain._clock
        begin = clock() if clock else 0.0
        group = self._parameters.group(stage.group)
        result = stage.step(group, state, *[inputs[name] for name in stage.inputs])
        if clock:
            self._seconds[stage.name] = self._seconds.get(stage.name, 0.0) + clock() - begin
        return result

    def balls_of(self, index: int, results: Mapping[str, Any]) -> list[list[_BallInputs]]:
        """Inputs of the stages of one ball, by ball: in the ticks before its shot was announced, and in this one."""
        track = results.get("track")
        if track is None:
            return []
        packet = results["packet"]
        self._recent.append({name: results[name] for name in self._inputs_of_ball if name in results})
        while self._recent[0]["packet"].end_us <= packet.end_us - EARLIER_US:
            self._recent.popleft()
        balls: list[list[_BallInputs]] = []
        for ball in track.balls:
            evidence = self._evidence.get(ball.shot, NO_EVIDENCE)
            tracks = (*ball.earlier, ball)[-len(self._recent) :]
            first, rows = index + 1 - len(tracks), list(self._recent)[-len(tracks) :]
            balls.append([])
            for number, (state, row) in enumerate(zip(tracks, rows, strict=True), first):
                evidence = evidence.with_tick(state)
                values = {**row, "packet": _since(ball.start_us, row["packet"]), "ball": state}
                balls[-1].append(_BallInputs(number, evidence, values))
        self._evidence = {ball.shot: rows[-1].evidence for ball, rows in zip(track.balls, balls, strict=True)}
        return balls

    def answered(
        self,
        of_ball: list[Stage],
        rows: list[tuple[int, dict[str, Any]]],
        known: Sequence[tuple[BallTick, ...]] = (),
    ) -> Iterator[Tick]:
        """Ticks of rows (index, results of the recording), each with the results of its balls, `known` among them."""
        balls = [self.balls_of(index, results) for index, results in rows]
        for flying, made in zip(balls, known, strict=False):
            for ticks_of_ball, ball in zip(flying, made, strict=False):
                for one, done in zip(ticks_of_ball, (*ball.earlier, ball), strict=True):
                    one.values.update(done.results)
        for stage in of_ball:
            for one in (one for flying in balls for ticks_of_ball in flying for one in ticks_of_ball):
                if stage.name not in one.values:
                    column = self.column(stage, one.values["ball"].shot, one.index)
                    one.values[stage.name] = self.result(stage, column, one.index, one.values)
        for (_, results), flying in zip(rows, balls, strict=True):
            yield self.tick(of_ball, results, flying)
        self.let_go_of_ended_shots()
        self._chain._cache.keep_budget(self._columns.values())

    def let_go_of_ended_shots(self) -> None:
        """Let the budget have the columns of shots that are over, and drop those whose results are not kept."""
        ended = [name for name in self._columns if name[1] is not None and name[1] not in self._evidence]
        for name in ended:
            column = self._columns.pop(name)
            if not column.is_kept:
                self._chain._cache.drop(column)

    def tick(self, of_ball: list[Stage], results: dict[str, Any], balls: list[list[_BallInputs]]) -> Tick:
        """The tick with all results."""
        packet = results.pop("packet")
        names = [stage.name for stage in of_ball]
        flying = tuple(_ball_tick(names, rows) for rows in balls)
        if flying:
            results.update(flying[0].results)
        else:
            results.update({stage.name: self.absent(stage, results["track"].reason) for stage in of_ball})
        return Tick(results, packet, flying)

    def absent(self, stage: Stage, reason: str) -> Any:
        """The stage's result of a tick without a ball; the same one while the reason is, as making it takes 50 us."""
        known = self._absent.get(stage.name)
        if known is None or known[0] != reason:
            assert stage.absent is not None, stage.name
            known = self._absent[stage.name] = reason, stage.absent(self._parameters.group(stage.group), reason)
        return known[1]


def _since(start_us: int, packet: Packet) -> Packet:
    """The packet without the events before a shot."""
    if start_us <= packet.start_us:
        return packet
    return Packet(packet.index, start_us, packet.end_us, packet.events.between(start_us, packet.end_us))


def _ball_tick(names: list[str], rows: list[_BallInputs]) -> BallTick:
    """One ball in the last of these ticks, with those before it as its earlier ones."""
    *earlier, last = rows
    results = {name: last.values[name] for name in names}
    before = tuple(_ball_tick(names, [row]) for row in earlier)
    return BallTick(results, last.values["packet"], last.values["ball"], last.evidence, before)
