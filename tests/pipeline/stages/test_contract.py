"""What every stage must keep, tried on real stages with real events: the flight and the spinner of the samples."""

from __future__ import annotations

import copy
import dataclasses
import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from spinscope.pipeline.chain import Chain
from spinscope.pipeline.event_source import EventsInMemory
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.registry import STAGES, Parameters, default_stages
from spinscope.pipeline.session import Choices, Session
from spinscope.pipeline.stage import Stage
from spinscope.pipeline.stages.track_result import TrackResult
from spinscope.pipeline.tick import Tick

FIXED = Parameters().with_values(
    {"track": {"ball": "fixed", "fixed_x_px": 528.43, "fixed_y_px": 426.87, "fixed_radius_px": 16.49}}
)
CASES = {
    "flight": ("flight_fast_top", Parameters(), 20_000, 60_000),
    "flight at 1 kHz": ("flight_back", Parameters().with_assignments(["track.tick_us=1000"]), 30_000, 55_000),
    "spinner": ("spinner_ball2_side", FIXED, 0, 40_000),
}


def leaves(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Every array and plain value inside a nested result, with its path."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        for field in dataclasses.fields(value):
            yield from leaves(getattr(value, field.name), f"{path}.{field.name}")
    elif isinstance(value, dict):
        for key, item in value.items():
            yield from leaves(item, f"{path}[{key}]")
    elif isinstance(value, (list, tuple)):
        for number, item in enumerate(value):
            yield from leaves(item, f"{path}[{number}]")
    else:
        yield path, value


def assert_same(one: Any, other: Any) -> None:
    """Equal to the last bit, NaN equal to NaN."""
    pairs = list(zip(leaves(one), leaves(other), strict=True))
    assert pairs
    for (path, a), (_, b) in pairs:
        if isinstance(a, np.ndarray):
            assert a.dtype == b.dtype, path
            assert np.array_equal(a, b, equal_nan=a.dtype.kind == "f"), path
        else:
            assert a == b or (a != a and b != b), path


@pytest.fixture(scope="module", params=CASES)
def case(request: pytest.FixtureRequest, samples: Path) -> tuple[EventsInMemory, Parameters]:
    name, parameters, start_us, end_us = CASES[request.param]
    with h5py.File(samples / f"{name}.h5") as file:
        t, x, y, p = (file[f"events/{key}"][:] for key in "txyp")
    events = EventBatch.checked(t, x, y, p == 1, width_px=1280, height_px=720).between(start_us, end_us)
    return EventsInMemory(name, events, 1280, 720, start_us, end_us), parameters


@pytest.fixture(scope="module")
def ticks(case: tuple[EventsInMemory, Parameters]) -> list[Tick]:
    source, parameters = case
    return list(Chain(source).run(parameters))


def test_every_stage_says_something_in_the_end(ticks: list[Tick]) -> None:
    assert any(len(tick.logo.events) for tick in ticks)
    assert any(len(tick.flow.events) for tick in ticks)
    assert any(estimate.status == "ok" for tick in ticks for estimate in tick.estimates.values())
    contrasts = [tick.contrast for tick in ticks if tick.contrast is not None]
    assert len(contrasts) == len(ticks)
    assert any(one.full and len(one.magnitudes_rps) for one in contrasts), "a full estimate, whether or not trusted"
    assert any(not one.full and one.contrast for one in contrasts), "and one that follows it"


def test_a_second_run_is_equal_bit_for_bit(case: tuple[EventsInMemory, Parameters], ticks: list[Tick]) -> None:
    source, parameters = case
    for one, other in zip(ticks, Chain(source).run(parameters), strict=True):
        assert_same(one, other)


def test_several_ticks_together_give_the_same(case: tuple[EventsInMemory, Parameters], ticks: list[Tick]) -> None:
    source, parameters = case
    chain = Chain(source)
    for _ in zip(range(3), chain.run(parameters, together=7), strict=False):
        pass  # abandoned within the first seven
    for one, other in zip(ticks, chain.run(parameters, together=4), strict=True):
        assert_same(one, other)


def test_live_gives_the_same_as_batch(case: tuple[EventsInMemory, Parameters], ticks: list[Tick]) -> None:
    """The source grows by uneven bits, as a USB driver brings them."""
    source, parameters = case
    chain = Chain(dataclasses.replace(source, growing=True, end_us=source.start_us))
    for end_us in range(source.start_us, source.end_us, 7300):
        chain.source = dataclasses.replace(source, growing=True, end_us=end_us)
        for _ in chain.run(parameters):
            pass
    chain.source = source
    for one, other in zip(ticks, chain.run(parameters), strict=True):
        assert_same(one, other)


def inputs_of(stage: Stage, ticks: list[Tick]) -> tuple[int, list[list[Any]]]:
    """Number of the first tick in which the stage steps, and its inputs from there on; of one shot for one ball's."""
    flown = [tick for tick in ticks if stage.scope == "recording" or tick.track.shot == 0]
    columns = [
        [tick.track.ball if other == "ball" else getattr(tick, other) for other in stage.inputs] for tick in flown
    ]
    assert len(columns) > 2
    return ticks.index(flown[0]), columns


@pytest.mark.parametrize("name", default_stages())
def test_a_stage_leaves_inputs_and_earlier_results_alone(
    case: tuple[EventsInMemory, Parameters], ticks: list[Tick], name: str
) -> None:
    source, parameters = case
    stage, group = STAGES[name], parameters.group(STAGES[name].group)
    state = Chain(source).start(parameters, stage)
    first, inputs = inputs_of(stage, ticks)
    before = copy.deepcopy(inputs)
    results, stable = [], []
    for given in inputs:
        results.append(stage.step(group, state, *given))
        stable.append(copy.deepcopy(results[-1]))
    for given, kept in zip(inputs, before, strict=True):
        assert_same(given, kept)
    for number, (result, kept) in enumerate(zip(results, stable, strict=True)):
        assert_same(result, kept)
        assert_same(result, getattr(ticks[first + number], name))


@pytest.mark.parametrize("name", default_stages())
def test_stop_and_resume_gives_the_same(case: tuple[EventsInMemory, Parameters], ticks: list[Tick], name: str) -> None:
    """A deep copy of the state half way is as good as the state itself: nothing hides elsewhere."""
    source, parameters = case
    stage, group = STAGES[name], parameters.group(STAGES[name].group)
    state = Chain(source).start(parameters, stage)
    first, inputs = inputs_of(stage, ticks)
    for number, given in enumerate(inputs):
        if number == len(inputs) // 2:
            state = copy.deepcopy(state)
        assert_same(stage.step(group, state, *given), getattr(ticks[first + number], name))


def test_results_hold_no_state(ticks: list[Tick]) -> None:
    """No two ticks' results share memory that someone could still write to."""
    for one, other in itertools.pairwise(ticks):
        for name in default_stages():
            arrays = [a for _, a in leaves(getattr(one, name)) if isinstance(a, np.ndarray) and a.size]
            later = [a for _, a in leaves(getattr(other, name)) if isinstance(a, np.ndarray) and a.size]
            for a in arrays:
                for b in later:
                    if np.shares_memory(a, b):
                        assert not a.flags.writeable, name


def test_a_shot_knows_nothing_of_the_one_before_it(
    case: tuple[EventsInMemory, Parameters], ticks: list[Tick], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two shots without a gap: the second one's results are those of a recording in which there was no first."""
    source, parameters = case
    flown = [tick.packet.index for tick in ticks if tick.track.has_ball]
    cut, tracker = flown[len(flown) // 3], STAGES["track"]

    def chain_of(first_is_flown: bool) -> list[Tick]:
        def step(group: Any, state: Any, packet: Any, *inputs: Any) -> TrackResult:
            result = tracker.step(group, state, packet, *inputs)
            if packet.index < cut and not first_is_flown:
                return TrackResult("searching", "no ball", result.t_us, (), None)
            number = int(packet.index >= cut)
            return dataclasses.replace(result, balls=tuple(dataclasses.replace(b, shot=number) for b in result.balls))

        monkeypatch.setitem(STAGES._entries, "track", dataclasses.replace(tracker, step=step))
        return list(Chain(source).run(parameters))

    after, fresh = chain_of(True), chain_of(False)
    assert any(tick.balls for tick in after if tick.packet.index < cut)
    judged = [(one, other) for one, other in zip(after, fresh, strict=True) if one.packet.index >= cut and one.balls]
    assert len(judged) > 2
    for one, other in judged:
        assert_same(one.balls[0].results, other.balls[0].results)


CHOICES = [
    (group, field)
    for group in dict.fromkeys(stage.group for stage in STAGES)
    for field, declared in Parameters().group(group).tunables().items()
    if declared.kind == "choice"
]


@pytest.mark.parametrize(("group", "field"), CHOICES)
def test_a_choice_that_nothing_implements_fails_instead_of_running_as_another(
    samples: Path, group: str, field: str
) -> None:
    session = Session.open(samples / "flight_fast_top.h5", Choices(window_us=(0, 60_000)))
    changed = copy.copy(session.parameters.group(group))
    object.__setattr__(changed, field, "new")  # declared, as far as validation knows
    with pytest.raises(KeyError, match="new"):
        list(session.chain.run(session.parameters.with_groups(**{group: changed}), ("triplet", "normal_flow")))
