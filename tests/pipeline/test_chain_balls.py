"""The chain's bookkeeping of several balls and of shots that are announced late, with toy stages."""

from __future__ import annotations

import dataclasses
import threading
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from spinscope.pipeline.chain import Chain
from spinscope.pipeline.event_source import EventsInMemory
from spinscope.pipeline.session import Session
from spinscope.pipeline.tick import Tick
from tests.pipeline.toy_stages import ALL_BUT_CONTRAST, BELOW_LOGO, DEFAULT, INPUTS, OF_RECORDING, ToyBall, Toys, source


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


def test_ticks_without_a_ball_say_why_and_share_their_results(samples: Path) -> None:
    """With a reason of its own after a shot; made anew for each tick they take longer than tracking in noise."""
    session = Session.open(samples / "own/bounce.h5")
    flown_us = max(shot.end_us for shot in session.estimate("triplet").shots)
    source = EventsInMemory("bounce", session.source.between(0, 10**9), 1280, 720, 0, flown_us + 60_000)
    nobody = [tick for tick in Chain(source).run(session.parameters, ("triplet",)) if not tick.balls]
    assert all(tick.results["triplet"].estimate.reason == tick.track.reason for tick in nobody)
    for one, other in pairwise(nobody):
        assert (one.logo is other.logo) == (one.track.reason == other.track.reason)
    assert len({tick.track.reason for tick in nobody}) > 1


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


def test_late_shots_are_the_same_while_the_source_grows(toys: Toys) -> None:
    toys.flying = late_shots
    whole = flown(list(Chain(source()).run(DEFAULT)))
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
