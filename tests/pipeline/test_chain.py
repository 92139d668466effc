"""The chain's bookkeeping, with toy stages that count: what is re-run, kept, forgotten and resumed."""

from __future__ import annotations

import dataclasses
import itertools
import threading
import time
from typing import Any

import pytest

from spinscope.pipeline import column_cache
from spinscope.pipeline.chain import Chain
from spinscope.pipeline.errors import ParameterError
from spinscope.pipeline.event_source import EventsInMemory
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.registry import STAGES, Parameters
from tests.pipeline.toy_stages import ALL_BUT_CONTRAST, BELOW_LOGO, DEFAULT, INPUTS, OF_RECORDING, Toys, source


def test_the_grid_is_anchored_at_file_time_zero(calls: dict[str, int]) -> None:
    ticks = list(Chain(source(7, 2000, first_us=12_000)).run(DEFAULT))
    assert [tick.packet.index for tick in ticks] == [2, 3, 4]
    assert [(tick.packet.start_us, tick.packet.end_us) for tick in ticks] == [
        (10_000, 15_000),
        (15_000, 20_000),
        (20_000, 24_001),
    ]
    assert [len(tick.packet.events) for tick in ticks] == [2, 2, 3]


def test_an_unchanged_run_computes_nothing_again(calls: dict[str, int]) -> None:
    chain = Chain(source())
    first = list(chain.run(DEFAULT))
    counted = dict(calls)
    again = list(chain.run(DEFAULT))
    assert calls == counted == dict.fromkeys(INPUTS, 20)
    assert all(a.contrast is b.contrast for a, b in zip(first, again, strict=True))


@pytest.mark.parametrize(
    ("assignment", "rerun"),
    [
        ("logo.pad_px=3", BELOW_LOGO),
        ("surface.k_px=5", set(INPUTS) - {"filter"}),
        ("spin.triplet_solve=least_squares", {"triplet", "normal_flow", "contrast", "combined"}),
        ("spin.max_spin_rps=90", BELOW_LOGO - {"logo"} | {"trajectory"}),
        ("rate.bin_us=1000", BELOW_LOGO - {"logo"}),
        ("contrast.kernel_rad=0.05", {"contrast", "combined"}),
        ("filter.mode=off", set(INPUTS)),
    ],
)
def test_a_change_runs_its_stage_and_those_below(calls: dict[str, int], assignment: str, rerun: set[str]) -> None:
    chain = Chain(source())
    list(chain.run(DEFAULT))
    before = dict(calls)
    list(chain.run(DEFAULT.with_assignments([assignment])))
    assert {name for name in calls if calls[name] > before[name]} == rerun
    after = dict(calls)
    list(chain.run(DEFAULT))
    assert calls == after, "going back to earlier values is free"


def test_equal_values_share_a_column_however_they_were_made(calls: dict[str, int]) -> None:
    chain = Chain(source())
    list(chain.run(DEFAULT.with_assignments(["logo.pad_px=3"])))
    before = dict(calls)
    list(chain.run(Parameters().with_values({"logo": {"pad_px": 3.0}})))
    assert calls == before


def test_an_abandoned_run_goes_on_where_it_stopped(calls: dict[str, int]) -> None:
    whole = [tick.contrast for tick in Chain(source()).run(DEFAULT)]
    calls.update(dict.fromkeys(calls, 0))
    chain = Chain(source())
    assert len(list(chain.run(DEFAULT, ticks=7))) == 7
    run = chain.run(DEFAULT)
    for _ in range(9):
        next(run)
    run.close()
    assert [tick.contrast for tick in chain.run(DEFAULT)] == whole
    assert calls == dict.fromkeys(INPUTS, 20)


def test_a_growing_source_gives_the_same_as_a_finished_one(calls: dict[str, int]) -> None:
    whole = source()
    expected = [tick.contrast for tick in Chain(whole).run(DEFAULT)]
    chain = Chain(dataclasses.replace(whole, growing=True, end_us=0))
    for end_us in range(0, whole.end_us, 3700):
        chain.source = dataclasses.replace(whole, growing=True, end_us=end_us)
        assert len(list(chain.run(DEFAULT))) == end_us // 5000
    chain.source = whole
    assert [tick.contrast for tick in chain.run(DEFAULT)] == expected
    assert calls["contrast"] == 40, "every tick once for the batch and once for the growing source"


def test_forgotten_results_are_made_again_when_asked_for(calls: dict[str, int]) -> None:
    chain = Chain(source())
    without = [tick.contrast for tick in chain.run(DEFAULT, forget=("surface",))]
    assert [tick.contrast for tick in chain.run(DEFAULT)] == without
    assert calls["surface"] == 40
    assert calls["track"] == 20


@pytest.mark.parametrize("forgotten", [*INPUTS, "all"])
def test_every_result_is_there_again_after_a_run_that_forgot_it(calls: dict[str, int], forgotten: str) -> None:
    """Of every stage, not of the last one alone; whatever comes in between."""
    expected = list(Chain(source()).run(DEFAULT))
    chain = Chain(source())
    forget = tuple(INPUTS) if forgotten == "all" else (forgotten,)
    assert len(list(chain.run(DEFAULT, forget=forget))) == 20
    assert not any(chain.knows(DEFAULT, name) for name in forget)
    calls.update(dict.fromkeys(calls, 0))
    found = list(chain.run(DEFAULT))
    for name in INPUTS:
        assert [tick.get(name) for tick in found] == [tick.get(name) for tick in expected], name
    assert calls == {name: 20 if name in forget else 0 for name in INPUTS}
    assert all(chain.knows(DEFAULT, name) for name in INPUTS)


def test_what_is_not_wanted_is_not_run_and_what_was_known_of_it_stays(calls: dict[str, int]) -> None:
    chain = Chain(source())
    whole = [tick.contrast for tick in Chain(source()).run(DEFAULT)]
    calls.update(dict.fromkeys(calls, 0))
    assert len(list(chain.run(DEFAULT, ticks=7))) == 7
    assert all(tick.get("contrast") is None for tick in chain.run(DEFAULT, ALL_BUT_CONTRAST))
    assert calls == {**dict.fromkeys(INPUTS, 20), "contrast": 7, "combined": 7}
    assert [tick.contrast for tick in chain.run(DEFAULT)] == whole
    assert calls == dict.fromkeys(INPUTS, 20)


@pytest.mark.parametrize("targets", [c for n in range(3) for c in itertools.combinations(INPUTS, n)])
def test_targets_run_with_what_they_need_and_nothing_else(calls: dict[str, int], targets: tuple[str, ...]) -> None:
    """Every single target and every pair: what they need is derived from the inputs."""

    def needed(name: str) -> set[str]:
        own = {"track" if other == "ball" else other for other in INPUTS[name]} - {"packet"}
        own |= {"track"} if name not in OF_RECORDING else set()
        return {name}.union(*(needed(other) for other in own))

    wanted = set().union(*(needed(name) for name in targets))
    ticks = list(Chain(source()).run(DEFAULT, targets))
    assert {name for name, count in calls.items() if count} == wanted
    assert len(ticks) == 20
    for tick in ticks:
        assert {name for name in INPUTS if tick.get(name) is not None} == wanted
        for name in set(INPUTS) - wanted:
            with pytest.raises(AttributeError, match="not among the targets"):
                getattr(tick, name)


def test_a_stage_of_one_ball_needs_the_tracker_whatever_its_inputs(toys: Toys) -> None:
    toys.flying = lambda index: (3,) if index > 4 else ()
    toy = dataclasses.replace(
        toys.stages["logo"], name="toy", inputs=("packet",), step=lambda parameters, state, packet: packet.index
    )
    with STAGES.registered(toy):
        ticks = list(Chain(source()).run(DEFAULT, ("toy",)))
    assert toys.counts == {name: 20 if name in OF_RECORDING else 0 for name in INPUTS}
    assert [tick.get("toy") for tick in ticks[4:7]] == [("logo", "no ball"), 5, 6]


def test_an_unknown_target_is_refused(calls: dict[str, int]) -> None:
    with pytest.raises(ParameterError, match="did you mean contrast"):
        list(Chain(source()).run(DEFAULT, ("contrats",)))


def test_a_stage_that_raises_leaves_no_half_column(toys: Toys) -> None:
    chain = Chain(source())
    sound = toys.steps["rate"]

    def broken(parameters: Any, state: list[str], packet: Any, *inputs: Any) -> Any:
        result = sound(parameters, state, packet, *inputs)
        if packet.index == 3:
            raise ValueError("broken")
        return result

    toys.steps["rate"] = broken
    with pytest.raises(ValueError, match="broken"):
        list(chain.run(DEFAULT))
    toys.steps["rate"] = sound
    assert [tick.contrast for tick in chain.run(DEFAULT)] == [tick.contrast for tick in Chain(source()).run(DEFAULT)]


COLUMNS = len(INPUTS) + len(BELOW_LOGO)  # of one whole run and one from logo on


@pytest.mark.parametrize("limit", [{"budget_bytes": COLUMNS * 20 * 1000}, {"max_columns": COLUMNS}])
def test_the_budget_drops_what_was_not_used_for_longest(
    calls: dict[str, int], monkeypatch: pytest.MonkeyPatch, limit: dict[str, int]
) -> None:
    monkeypatch.setattr(column_cache, "nbytes", lambda result: 1000)
    chain = Chain(source(), **limit)
    for pad in (1, 2, 3):
        list(chain.run(DEFAULT.with_assignments([f"logo.pad_px={pad}"])))
    before = dict(calls)
    list(chain.run(DEFAULT.with_assignments(["logo.pad_px=2"])))
    assert calls == before
    list(chain.run(DEFAULT.with_assignments(["logo.pad_px=1"])))
    assert {name for name in calls if calls[name] > before[name]} == BELOW_LOGO


def test_a_damaged_clock_is_refused_instead_of_running_forever(calls: dict[str, int]) -> None:
    events = EventBatch.checked([0, 10**15], [0, 0], [0, 0], [0, 0], width_px=8, height_px=8)
    with pytest.raises(ParameterError, match="--window"):
        list(Chain(EventsInMemory("long", events, 8, 8, 0, 10**15 + 1)).run(DEFAULT))


def test_threads_share_the_work_and_get_the_same(toys: Toys, calls: dict[str, int]) -> None:
    """Two runs at once, one of them without the last stage: every result is made once, whoever wants it first."""
    whole = [tick.contrast for tick in Chain(source()).run(DEFAULT)]
    for name, step in list(toys.steps.items()):
        toys.steps[name] = lambda *inputs, step=step: (time.sleep(2e-4), step(*inputs))[1]
    calls.update(dict.fromkeys(calls, 0))
    chain = Chain(source(), clock=time.perf_counter)
    took = [dict.fromkeys(INPUTS, 0.0) for _ in range(3)]
    found: dict[int, list[Any]] = {}

    def run(number: int, targets: tuple[str, ...]) -> None:
        found[number] = [tick.get("contrast") for tick in chain.run(DEFAULT, targets, seconds=took[number])]

    targets = (ALL_BUT_CONTRAST, tuple(INPUTS), tuple(INPUTS))
    threads = [threading.Thread(target=run, args=given) for given in enumerate(targets)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(30)
    assert calls == dict.fromkeys(INPUTS, 20)
    assert found[1] == found[2] == whole
    assert found[0] == [None] * 20
    for name in INPUTS:
        assert sum(seconds[name] for seconds in took) >= 20 * 2e-4
    assert not took[0]["contrast"]
    assert not any(chain.seconds.values()), "each run has its own account"


def test_no_run_goes_on_from_a_state_that_another_one_left_half_way(toys: Toys) -> None:
    chain = Chain(source())
    sound = toys.steps["rate"]

    def broken(parameters: Any, state: list[str], packet: Any, *inputs: Any) -> Any:
        state.append("half way")
        raise ValueError("broken")

    first, second = chain.run(DEFAULT), chain.run(DEFAULT)
    next(first)
    next(second)  # both hold the same columns now
    toys.steps["rate"] = broken
    with pytest.raises(ValueError, match="broken"):
        next(first)
    toys.steps["rate"] = sound
    with pytest.raises(ValueError, match="broken"):
        next(second)
    assert [tick.contrast for tick in chain.run(DEFAULT)] == [tick.contrast for tick in Chain(source()).run(DEFAULT)]
