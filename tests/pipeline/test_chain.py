"""The chain's bookkeeping, with toy stages that count: what is re-run, kept, forgotten and resumed."""

from __future__ import annotations

import dataclasses
import itertools
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from spinscope.pipeline import chain as chain_module
from spinscope.pipeline.chain import Chain
from spinscope.pipeline.errors import ParameterError
from spinscope.pipeline.event_source import EventsInMemory
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.registry import STAGES, Parameters
from spinscope.pipeline.stage import Stage
from spinscope.pipeline.tick import Tick

INPUTS = {
    "filter": ("packet",),
    "surface": ("packet", "filter"),
    "track": ("packet", "filter", "surface"),
    "logo": ("packet", "filter", "ball"),
    "rate": ("packet", "logo"),
    "flow": ("packet", "ball", "logo", "rate"),
    "triplet": ("packet", "flow", "rate"),
    "normal_flow": ("packet", "logo", "flow", "rate"),
    "contrast": ("packet", "ball", "logo", "normal_flow"),
    "trajectory": ("packet", "ball"),
    "combined": ("packet", "rate", "normal_flow", "contrast", "trajectory"),
}
OF_RECORDING = ("filter", "surface", "track")
BELOW_LOGO = {"logo", "rate", "flow", "triplet", "normal_flow", "contrast", "combined"}
ALL_BUT_CONTRAST = tuple(name for name in INPUTS if name not in ("contrast", "combined"))


@dataclass(frozen=True)
class ToyBall:
    """One ball of the toy tracker."""

    shot: int
    t_us: float = 0.0
    start_us: int = 0
    earlier: tuple[ToyBall, ...] = ()
    mean: NDArray[np.float64] = field(default_factory=lambda: np.ones(5), compare=False)
    measured: None = None
    doubt: None = None


@dataclass(frozen=True)
class ToyTrack:
    """Result of the toy tracker: the balls in flight, and everything seen so far."""

    balls: tuple[ToyBall, ...]
    seen: tuple[Any, ...]
    reason: str = "no ball"


class Toys:
    """Toy stages in place of the real ones, whose results name everything seen so far.

    counts : how often each stage stepped
    flying : the shots or balls in flight by tick number; one ball throughout by default
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.counts = dict.fromkeys(INPUTS, 0)
        self.flying: Callable[[int], tuple[int | ToyBall, ...]] = lambda index: (0,)
        self.steps: dict[str, Callable[..., Any]] = {}
        self.stages = {stage.name: self._toy(stage) for stage in STAGES if stage.name in INPUTS}
        monkeypatch.setattr(STAGES, "_entries", self.stages)

    def _toy(self, stage: Stage) -> Stage:
        def step(parameters: Any, state: list[str], packet: Any, *inputs: Any) -> Any:
            self.counts[stage.name] += 1
            state.append(f"{packet.index}:{len(packet.events)}")
            seen = (stage.name, parameters, tuple(state), inputs)
            if stage.name == "track":
                flying = self.flying(packet.index)
                return ToyTrack(tuple(ToyBall(one) if isinstance(one, int) else one for one in flying), seen)
            return seen

        self.steps[stage.name] = step
        absent = (lambda parameters, reason: (stage.name, reason)) if stage.scope == "ball" else None
        return dataclasses.replace(
            stage,
            inputs=INPUTS[stage.name],
            start=lambda parameters, context: [],
            step=lambda *given: self.steps[stage.name](*given),
            absent=absent,
        )


@pytest.fixture
def toys(monkeypatch: pytest.MonkeyPatch) -> Toys:
    """The stages replaced by toys."""
    return Toys(monkeypatch)


@pytest.fixture
def calls(toys: Toys) -> dict[str, int]:
    """How often each toy stepped."""
    return toys.counts


def source(count: int = 100, step_us: int = 1000, first_us: int = 0) -> EventsInMemory:
    t = first_us + np.arange(count, dtype=np.int64) * step_us
    zeros = np.zeros(count, np.uint16)
    events = EventBatch(t, zeros, zeros, zeros.astype(bool))
    return EventsInMemory("toy", events, 8, 8, int(t[0]), int(t[-1]) + 1)


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


def test_each_ball_has_states_of_its_own(toys: Toys) -> None:
    """Shot 5 flies in ticks 2 to 9, shot 6 in ticks 6 to 12, nobody before, shot 7 alone at the end."""
    toys.flying = lambda index: tuple(
        shot for shot, (first, last) in {5: (2, 9), 6: (6, 12), 7: (15, 19)}.items() if first <= index <= last
    )
    chain = Chain(source())
    ticks = list(chain.run(DEFAULT, together=4))
    for index, tick in enumerate(ticks):
        assert [ball.track.shot for ball in tick.balls] == list(toys.flying(index))
        for ball in tick.balls:
            first = {5: 2, 6: 6, 7: 15}[ball.track.shot]
            for name in BELOW_LOGO:
                _, _, state, inputs = ball.results[name]
                assert [int(entry.split(":")[0]) for entry in state] == list(range(first, index + 1)), name
                if name == "contrast":
                    assert inputs[0] == ball.track and inputs[1] == ball.results["logo"]
        assert tick.logo == (tick.balls[0].results["logo"] if tick.balls else ("logo", "no ball"))
    assert toys.counts["logo"] == 8 + 7 + 5
    assert chain.knows(DEFAULT, "contrast") and not chain.knows(DEFAULT.with_assignments(["logo.pad_px=1"]), "logo")
    again = list(chain.run(DEFAULT))
    assert toys.counts["logo"] == 20
    for one, other in zip(ticks, again, strict=True):
        assert [ball.results for ball in one.balls] == [ball.results for ball in other.balls]
    list(chain.run(DEFAULT.with_assignments(["logo.pad_px=1"]), ("logo",)))
    assert toys.counts["logo"] == 40 and toys.counts["rate"] == 20 == toys.counts["track"]


def test_a_column_of_a_shot_is_not_known_until_its_last_tick(toys: Toys) -> None:
    toys.flying = lambda index: (0,) if index < 10 else (1,) if index > 12 else ()
    chain = Chain(source())
    list(chain.run(DEFAULT, ("track",)))
    list(chain.run(DEFAULT, ticks=15))
    assert chain.knows(DEFAULT, "track") and not chain.knows(DEFAULT, "logo")
    list(chain.run(DEFAULT, ("rate",)))
    assert chain.knows(DEFAULT, "logo") and chain.knows(DEFAULT, "rate") and not chain.knows(DEFAULT, "flow")


def late_shots(index: int) -> tuple[int | ToyBall, ...]:
    """Shot 0 until tick 9; a contact at 36 ms, in tick 7, is known in tick 10: shot 1. Shot 2 flies throughout."""
    if index < 10:
        return (0, 2)
    earlier = tuple(ToyBall(1, float(number), 36_000) for number in (7, 8, 9)) if index == 10 else ()
    return (ToyBall(1, float(index), 36_000, earlier), 2)


def flown(ticks: list[Tick]) -> list[Any]:
    """Everything the ticks say of balls, those of earlier ticks among it."""
    return [
        [(one.track, one.results, one.packet.start_us, len(one.packet.events)) for one in (*ball.earlier, ball)]
        for tick in ticks
        for ball in tick.balls
    ]


def test_a_shot_that_is_announced_late_has_its_earlier_ticks_without_the_events_before_it(toys: Toys) -> None:
    toys.flying = late_shots
    chain = Chain(source())
    ticks = list(chain.run(DEFAULT))
    assert not any(ball.earlier for tick in ticks for ball in tick.balls if tick.packet.index != 10)
    late, other = ticks[10].balls
    assert [one.track.t_us for one in (*late.earlier, late)] == [7, 8, 9, 10]
    assert (late.earlier[0].packet.start_us, late.earlier[0].packet.end_us) == (36_000, 40_000)
    assert [one.packet.index for one in late.earlier] == [7, 8, 9]
    for name in BELOW_LOGO:
        _, _, seen, _ = late.results[name]
        assert seen == ("7:4", "8:5", "9:5", "10:5"), name
        assert late.earlier[1].results[name][2] == ("7:4", "8:5"), name
    assert late.earlier[1].results["logo"][3] == (ticks[8].filter, late.track.earlier[1])
    assert other.results["logo"][2] == tuple(f"{index}:5" for index in range(11)), "another ball's are its own"
    assert ticks[9].balls[0].results["logo"][2] == tuple(f"{index}:5" for index in range(10))
    assert toys.counts["logo"] == 10 + 13 + 20
    assert late.evidence.ticks == 4


@pytest.mark.parametrize("together", [1, 3, 4, 20])
@pytest.mark.parametrize("stop", [0, 8, 10, 11, 15])
def test_late_shots_are_the_same_in_batch_tick_by_tick_and_resumed(toys: Toys, together: int, stop: int) -> None:
    toys.flying = late_shots
    whole = flown(list(Chain(source()).run(DEFAULT)))
    counted = dict(toys.counts)
    toys.counts.update(dict.fromkeys(INPUTS, 0))
    chain = Chain(source())
    list(chain.run(DEFAULT, ALL_BUT_CONTRAST, ticks=stop, together=together))
    assert flown(list(chain.run(DEFAULT, together=together))) == whole
    assert toys.counts == counted, "nothing twice"
    assert all(chain.knows(DEFAULT, name) for name in INPUTS)
    growing = Chain(dataclasses.replace(source(), growing=True, end_us=0))
    for end_us in range(0, source().end_us, 3700):
        growing.source = dataclasses.replace(source(), growing=True, end_us=end_us)
        list(growing.run(DEFAULT))
    growing.source = source()
    assert flown(list(growing.run(DEFAULT))) == whole


def test_results_of_balls_that_another_run_has_made_are_taken(toys: Toys) -> None:
    toys.flying = late_shots
    whole = flown(list(Chain(source()).run(DEFAULT)))
    tracked = list(Chain(source()).run(DEFAULT, OF_RECORDING))
    quick = list(Chain(source()).answer(DEFAULT, tracked, ("logo", "rate")))
    before = dict(toys.counts)
    assert flown(list(Chain(source()).answer(DEFAULT, quick))) == whole
    assert {name for name, count in toys.counts.items() if count == before[name]} == {*OF_RECORDING, "logo", "rate"}


@pytest.mark.parametrize("forgotten", [*INPUTS, "all"])
def test_late_shots_are_made_again_where_they_were_forgotten(toys: Toys, forgotten: str) -> None:
    toys.flying = late_shots
    whole = flown(list(Chain(source()).run(DEFAULT)))
    chain = Chain(source())
    forget = tuple(INPUTS) if forgotten == "all" else (forgotten,)
    assert flown(list(chain.run(DEFAULT, forget=forget, together=4))) == whole
    assert not any(chain.knows(DEFAULT, name) for name in forget)
    assert flown(list(chain.run(DEFAULT))) == whole
    list(chain.run(DEFAULT.with_assignments(["contrast.kernel_rad=0.05"]), ticks=12))
    assert not chain.knows(DEFAULT.with_assignments(["contrast.kernel_rad=0.05"]), "contrast")


def test_threads_share_late_shots(toys: Toys) -> None:
    toys.flying = late_shots
    whole = flown(list(Chain(source()).run(DEFAULT)))
    counted = dict(toys.counts)
    for name, step in list(toys.steps.items()):
        toys.steps[name] = lambda *inputs, step=step: (time.sleep(2e-4), step(*inputs))[1]
    toys.counts.update(dict.fromkeys(INPUTS, 0))
    chain, found = Chain(source()), [[], []]
    threads = [
        threading.Thread(target=lambda number=number: found[number].extend(chain.run(DEFAULT))) for number in (0, 1)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(30)
    assert toys.counts == counted
    assert all(flown(ticks) == whole for ticks in found)


def test_a_shot_from_longer_ago_than_packets_are_kept_begins_with_the_oldest_that_are(toys: Toys) -> None:
    """Known after all 20 ticks of 5 ms and more: those within EARLIER_US are there."""
    earlier = tuple(ToyBall(0, float(number)) for number in range(39))
    toys.flying = lambda index: () if index < 39 else (ToyBall(0, float(index), 0, earlier if index == 39 else ()),)
    chain = Chain(source(205))
    (ball,) = list(chain.run(DEFAULT, ticks=40))[-1].balls
    assert ball.results["logo"][2] == tuple(f"{index}:5" for index in range(20, 40))


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
    monkeypatch.setattr(chain_module, "nbytes", lambda result: 1000)
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
