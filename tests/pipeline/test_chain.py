"""The chain's bookkeeping, with toy stages that count: what is re-run, kept, forgotten and resumed."""

from __future__ import annotations

import dataclasses
import threading
import time
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from spinscope.pipeline import chain as chain_module
from spinscope.pipeline.chain import Chain, EventSource, Parameters
from spinscope.pipeline.errors import ParameterError
from spinscope.pipeline.events import EventBatch

INPUTS = {
    "filter": ("packet",),
    "surface": ("packet", "filter"),
    "track": ("packet", "filter", "surface"),
    "logo": ("packet", "filter", "track"),
    "rate": ("packet", "track", "logo"),
    "flow": ("packet", "track", "logo", "rate"),
    "spin": ("packet", "track", "logo", "rate", "flow"),
    "contrast": ("packet", "track", "logo", "spin"),
}


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> dict[str, int]:
    """Replace the stages by toys whose result names everything seen so far; returns how often each stepped."""
    counts = dict.fromkeys(INPUTS, 0)

    def toy(name: str) -> SimpleNamespace:
        def start(parameters: Any, setting: Any) -> list[str]:
            return []

        def step(parameters: Any, state: list[str], packet: Any, *inputs: Any) -> tuple[Any, ...]:
            counts[name] += 1
            state.append(f"{packet.index}:{len(packet.events)}")
            return name, parameters, tuple(state), inputs

        also = (("spin", "max_spin_rps"),) if name == "flow" else ()
        return SimpleNamespace(INPUTS=INPUTS[name], ALSO=also, start=start, step=step)

    monkeypatch.setattr(chain_module, "STAGES", {name: toy(name) for name in INPUTS})
    return counts


def source(count: int = 100, step_us: int = 1000, first_us: int = 0) -> EventSource:
    t = first_us + np.arange(count, dtype=np.int64) * step_us
    zeros = np.zeros(count, np.uint16)
    events = EventBatch(t, zeros, zeros, zeros.astype(bool))
    return EventSource("toy", events, 8, 8, int(t[0]), int(t[-1]) + 1)


DEFAULT = Parameters()


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
        ("logo.pad_px=3", {"logo", "rate", "flow", "spin", "contrast"}),
        ("surface.k_px=5", {"surface", "track", "logo", "rate", "flow", "spin", "contrast"}),
        ("spin.triplet_solve=least_squares", {"spin", "contrast"}),
        ("spin.max_spin_rps=90", {"flow", "spin", "contrast"}),
        ("rate.bin_us=1000", {"rate", "flow", "spin", "contrast"}),
        ("contrast.kernel_rad=0.05", {"contrast"}),
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


def test_a_stage_left_out_is_not_run_and_what_was_known_of_it_stays(calls: dict[str, int]) -> None:
    chain = Chain(source())
    whole = [tick.contrast for tick in Chain(source()).run(DEFAULT)]
    calls.update(dict.fromkeys(calls, 0))
    assert len(list(chain.run(DEFAULT, ticks=7))) == 7
    assert all(tick.contrast is None for tick in chain.run(DEFAULT, without=("contrast",)))
    assert calls == {**dict.fromkeys(INPUTS, 20), "contrast": 7}
    assert [tick.contrast for tick in chain.run(DEFAULT)] == whole
    assert calls == dict.fromkeys(INPUTS, 20)


def test_a_stage_that_raises_leaves_no_half_column(calls: dict[str, int]) -> None:
    chain = Chain(source())
    stage = chain_module.STAGES["rate"]
    sound = stage.step

    def broken(parameters: Any, state: list[str], packet: Any, *inputs: Any) -> Any:
        result = sound(parameters, state, packet, *inputs)
        if packet.index == 3:
            raise ValueError("broken")
        return result

    stage.step = broken
    with pytest.raises(ValueError, match="broken"):
        list(chain.run(DEFAULT))
    stage.step = sound
    assert [tick.contrast for tick in chain.run(DEFAULT)] == [tick.contrast for tick in Chain(source()).run(DEFAULT)]


@pytest.mark.parametrize("limit", [{"budget_bytes": 8 * 20 * 1000 + 5 * 20 * 1000}, {"most_columns": 8 + 5}])
def test_the_budget_drops_what_was_not_used_for_longest(
    calls: dict[str, int], monkeypatch: pytest.MonkeyPatch, limit: dict[str, int]
) -> None:
    monkeypatch.setattr(chain_module, "nbytes", lambda result: 1000)
    chain = Chain(source(), **limit)  # one whole run and one from logo on
    for pad in (1, 2, 3):
        list(chain.run(DEFAULT.with_assignments([f"logo.pad_px={pad}"])))
    before = dict(calls)
    list(chain.run(DEFAULT.with_assignments(["logo.pad_px=2"])))
    assert calls == before
    list(chain.run(DEFAULT.with_assignments(["logo.pad_px=1"])))
    assert {name for name in calls if calls[name] > before[name]} == {"logo", "rate", "flow", "spin", "contrast"}


def test_a_damaged_clock_is_refused_instead_of_running_forever(calls: dict[str, int]) -> None:
    events = EventBatch.checked([0, 10**15], [0, 0], [0, 0], [0, 0], width_px=8, height_px=8)
    with pytest.raises(ParameterError, match="--window"):
        list(Chain(EventSource("long", events, 8, 8, 0, 10**15 + 1)).run(DEFAULT))


def test_threads_share_the_work_and_get_the_same(calls: dict[str, int], monkeypatch: pytest.MonkeyPatch) -> None:
    """Two runs at once, one of them without the last stage: every result is made once, whoever wants it first."""
    whole = [tick.contrast for tick in Chain(source()).run(DEFAULT)]
    for stage in chain_module.STAGES.values():
        step = stage.step
        monkeypatch.setattr(stage, "step", lambda *inputs, step=step: (time.sleep(2e-4), step(*inputs))[1])
    calls.update(dict.fromkeys(calls, 0))
    chain = Chain(source(), clock=time.perf_counter)
    took = [dict.fromkeys(INPUTS, 0.0) for _ in range(3)]
    found: dict[int, list[Any]] = {}

    def run(number: int, without: tuple[str, ...]) -> None:
        found[number] = [tick.contrast for tick in chain.run(DEFAULT, without=without, seconds=took[number])]

    threads = [threading.Thread(target=run, args=(n, ("contrast",) if n == 0 else ())) for n in range(3)]
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


def test_no_run_goes_on_from_a_state_that_another_one_left_half_way(calls: dict[str, int]) -> None:
    chain = Chain(source())
    stage = chain_module.STAGES["rate"]
    sound = stage.step

    def broken(parameters: Any, state: list[str], packet: Any, *inputs: Any) -> Any:
        state.append("half way")
        raise ValueError("broken")

    first, second = chain.run(DEFAULT), chain.run(DEFAULT)
    next(first)
    next(second)  # both hold the same columns now
    stage.step = broken
    with pytest.raises(ValueError, match="broken"):
        next(first)
    stage.step = sound
    with pytest.raises(ValueError, match="broken"):
        next(second)
    assert [tick.contrast for tick in chain.run(DEFAULT)] == [tick.contrast for tick in Chain(source()).run(DEFAULT)]
