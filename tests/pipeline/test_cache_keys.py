"""Keys of the chain's columns: derived from the registry, so that no parameter of any stage can be left out."""

from __future__ import annotations

import dataclasses
from collections.abc import Hashable
from typing import Any

import numpy as np
import pytest

from spinscope.pipeline.chain import Chain
from spinscope.pipeline.event_source import EventsInMemory
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.parameters import Tunable
from spinscope.pipeline.registry import STAGES, Parameters
from spinscope.pipeline.stage import Stage

DEFAULT = Parameters()
# Groups and fields in the key of the packets, and by them in every stage's.
OF_EVERY_STAGE = ("camera", "ball", "track.tick_us")
NAMES = [f"{group}.{field}" for group, fields in DEFAULT.as_dict().items() for field in fields]


def source(**changes: Any) -> EventsInMemory:
    """Twenty ticks of 5 ms with one event each, at the corner of a small sensor."""
    t = np.arange(20, dtype=np.int64) * 5000
    corner = np.zeros(20, np.uint16)
    events = EventBatch(t, corner, corner, corner.astype(bool))
    return dataclasses.replace(EventsInMemory("one", events, 64, 48, 0, 100_000), **changes)


def another(declared: Tunable, value: Any) -> Any:
    """An allowed value that differs from this one."""
    if declared.kind == "choice":
        return next(choice for choice in declared.choices if choice != value)
    if declared.kind == "switch":
        return not value
    assert declared.step is not None and declared.high is not None
    if declared.kind == "numbers":
        return (*value[:-1], value[-1] + declared.step)
    if value is None:
        return declared.high
    return value + declared.step if value + declared.step <= declared.high else value - declared.step


def below(names: set[str]) -> set[str]:
    """These stages, and all that take a result of theirs, directly or through others."""
    found = set(names)
    for stage in STAGES:  # in the order of the chain
        inputs = {"track" if name == "ball" else name for name in stage.inputs}
        if inputs & found:
            found.add(stage.name)
    return found


def changed_keys(one: dict[str, Hashable], other: dict[str, Hashable]) -> set[str]:
    return {name for name in one if one[name] != other[name]}


@pytest.mark.parametrize("name", NAMES)
def test_a_changed_value_changes_the_keys_of_its_readers_and_of_all_below(name: str) -> None:
    group, _, field = name.partition(".")
    value = another(DEFAULT.group(group).tunables()[field], DEFAULT.value(name))
    changed = DEFAULT.with_values({group: {field: value}})
    assert changed.value(name) != DEFAULT.value(name)
    readers = {stage.name for stage in STAGES if stage.group == group or name in stage.reads}
    if group in OF_EVERY_STAGE or name in OF_EVERY_STAGE:
        readers = set(STAGES.names)
    chain = Chain(source())
    assert changed_keys(chain.keys(DEFAULT), chain.keys(changed)) == below(readers)
    assert below(readers), f"no stage reads {name}"


def test_equal_values_have_equal_keys_and_other_sources_others() -> None:
    keys = Chain(source()).keys(DEFAULT)
    assert changed_keys(keys, Chain(source()).keys(Parameters().with_values(DEFAULT.as_dict()))) == set()
    assert changed_keys(keys, Chain(source(identity="another")).keys(DEFAULT)) == set(STAGES.names)
    assert len(set(keys.values())) == len(keys), "no two stages share a column"


@pytest.mark.parametrize("stage", STAGES, ids=lambda stage: stage.name)
def test_a_stage_is_given_nothing_of_other_groups_but_what_it_declares(stage: Stage) -> None:
    context = Chain(source()).context(DEFAULT, stage)
    assert dict(context.values) == {name: DEFAULT.value(name) for name in stage.reads}
    for name in set(NAMES) - set(stage.reads):
        with pytest.raises(KeyError, match="must declare"):
            context[name]


def test_a_stage_that_reads_what_it_does_not_declare_is_stopped_at_its_start(monkeypatch: pytest.MonkeyPatch) -> None:
    """And one that declares it is run again when the value changes."""
    starts: list[float] = []

    def start(parameters: Any, context: Any) -> None:
        starts.append(context["logo.pad_px"])

    def step(parameters: Any, state: None, packet: Any) -> int:
        return packet.index

    toy = Stage(
        name="toy", label="Toy", help="A toy.", scope="recording", inputs=("packet",),
        parameters=type(DEFAULT.filter), start=start, step=step,
    )  # fmt: skip
    with STAGES.registered(toy), pytest.raises(KeyError, match="must declare"):
        list(Chain(source()).run(DEFAULT, ("toy",)))
    with STAGES.registered(dataclasses.replace(toy, reads=("logo.pad_px",))):
        chain = Chain(source())
        for pad_px in (1.0, 2.0, 1.0):
            assert len(list(chain.run(DEFAULT.with_values({"logo": {"pad_px": pad_px}}), ("toy",)))) == 20
    assert starts == [1.0, 2.0]


@pytest.mark.parametrize(
    "assignment", ["track.tick_us=10000", "ball.diameter_mm=38", "camera.focal_length_mm=16", "camera.up=0,1,0"]
)
def test_ticks_of_other_optics_balls_or_lengths_are_not_taken_from_the_cache(assignment: str) -> None:
    """Compared with a chain that has seen no other values."""
    changed = DEFAULT.with_assignments([assignment])
    used = Chain(source())
    list(used.run(DEFAULT))
    found = list(used.run(changed))
    fresh = list(Chain(source()).run(changed))
    assert [tick.packet.end_us for tick in found] == [tick.packet.end_us for tick in fresh]
    assert [tick.track.t_us for tick in found] == [tick.track.t_us for tick in fresh]
    assert not any(one.track is other.track for one, other in zip(found, used.run(DEFAULT), strict=False))
