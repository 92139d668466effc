"""Packets of a camera become ticks: cut by time alone, with gaps, resets and unplugging told apart."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import pairwise

import numpy as np
import pytest

from spinscope.pipeline.cameras import ArrivedTick, CameraPacket, EventCamera, EventStream
from spinscope.pipeline.errors import CameraError
from spinscope.pipeline.events import EventBatch

TICK_US = 1000


class ListedPackets(EventCamera):
    """Camera that hands over what it is given: packets, errors to raise; then it ends."""

    name, serial, width_px, height_px = "toy", "1", 64, 48

    def __init__(self, given: list[CameraPacket | CameraError]) -> None:
        self.bias_limits, self.biases = {"diff_on": (-10, 10)}, {"diff_on": 0}
        self.given, self.closed, self.applied = iter(given), 0, []
        self.can_wait = False

    def read(self) -> CameraPacket | None:
        one = next(self.given, None)
        if isinstance(one, CameraError):
            raise one
        return one

    def close(self) -> None:
        self.closed += 1

    def _apply_biases(self, biases: Mapping[str, int]) -> None:
        self.applied.append(dict(biases))


def at(*times_us: int) -> EventBatch:
    """Events at these times, the x of each being its place in the list."""
    t_us = np.array(times_us, np.int64)
    return EventBatch(t_us, np.arange(t_us.size, dtype=np.uint16), np.zeros(t_us.size, np.uint16), t_us % 2 == 0)


def packets(events: EventBatch, *cuts_us: int) -> list[CameraPacket]:
    """The events, handed over at these times and at the end."""
    bounds = [0, *cuts_us, int(events.t_us[-1]) + 1]
    return [CameraPacket(events.between(a, b), min(b, int(events.t_us[-1]))) for a, b in pairwise(bounds)]


def ticks_of(camera: EventCamera, **options: object) -> tuple[list[ArrivedTick], EventStream]:
    camera.can_wait = True  # however late the ticks are taken
    stream = EventStream(camera, TICK_US, **options)  # type: ignore[arg-type]
    stream.start()
    return list(stream.ticks()), stream


EVENTS = at(300, 900, 1000, 1999, 2000, 2000, 4500, 7001)


@pytest.mark.parametrize("cuts_us", [(), (950,), (1000, 2000), (301, 2000, 2001, 7000), tuple(range(500, 7000, 250))])
def test_ticks_do_not_depend_on_how_the_driver_cuts(cuts_us: tuple[int, ...]) -> None:
    ticks, _ = ticks_of(ListedPackets(packets(EVENTS, *cuts_us)))
    assert [(one.packet.index, one.packet.start_us) for one in ticks] == [(n, n * TICK_US) for n in range(8)]
    assert [len(one.packet.events) for one in ticks] == [2, 2, 2, 0, 1, 0, 0, 1]
    assert ticks[-1].packet.end_us == 7002  # cut short after the last event, as a recording's is
    assert EventBatch.concatenate(one.packet.events for one in ticks).x_px.tolist() == list(range(8))


def test_a_tick_waits_for_events_of_its_last_microsecond() -> None:
    given = [CameraPacket(at(100, 999), 999), CameraPacket(at(999, 1000), 1000), CameraPacket(at(5000), 5000)]
    ticks, _ = ticks_of(ListedPackets(given))
    assert [len(one.packet.events) for one in ticks] == [3, 1, 0, 0, 0, 1]


def test_a_clock_that_steps_back_begins_another_segment() -> None:
    notices: list[str] = []
    given = [*packets(EVENTS), CameraPacket(at(10, 20), 20), CameraPacket(at(1500), 1500)]
    ticks, stream = ticks_of(ListedPackets(given), on_notice=lambda kind, text: notices.append(text))
    assert [one.segment for one in ticks] == [0] * 8 + [1, 1]
    assert [one.clock for one in ticks] == [0] * 8 + [1, 1]
    assert ticks[7].packet.end_us == 7002 and ticks[8].packet.index == 0
    assert len(notices) == 1 and "clock went from 7001 to 20 us" in notices[0]
    assert stream.counts.events == len(EVENTS) + 3


def test_an_unplugged_camera_is_waited_for() -> None:
    unplugged, notices = CameraError("toy 1: the camera was unplugged"), []
    first = ListedPackets([CameraPacket(at(100), 100), unplugged])
    second = ListedPackets([CameraPacket(at(50), 50)])
    ticks, _ = ticks_of(first, reopen=lambda _: second, on_notice=lambda kind, text: notices.append(text))
    assert [(one.clock, one.packet.events.t_us.tolist()) for one in ticks] == [(0, [100]), (1, [50])]
    assert first.closed == second.closed == 1
    assert "unplugged; waiting" in notices[0] and "is back" in notices[1]


def test_without_a_way_to_open_it_anew_the_error_comes_out_after_the_ticks() -> None:
    stream = EventStream(ListedPackets([CameraPacket(at(100), 100), CameraError("gone")]), TICK_US)
    stream.start()
    ticks: Iterator[ArrivedTick] = stream.ticks()
    assert len(next(ticks).packet.events) == 1
    with pytest.raises(CameraError, match="gone"):
        next(ticks)


def test_late_and_unordered_events_are_counted_and_sorted() -> None:
    given = [CameraPacket(at(500), 1100), CameraPacket(at(900, 1300, 1200), 1300, dropped=2, outside=5)]
    ticks, stream = ticks_of(ListedPackets(given))
    assert [one.packet.events.t_us.tolist() for one in ticks] == [[500], [1200, 1300]]
    assert (stream.counts.late, stream.counts.dropped, stream.counts.outside) == (1, 2, 5)


def test_a_camera_that_sends_nothing_is_said_with_when_it_sends_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """Read after read without even the time, or one long read; a scene in which nothing moves is none of it."""
    now_s, notices = [0.0], list[tuple[str, str]]()
    monkeypatch.setattr("spinscope.pipeline.cameras.event_stream.now_s", lambda: now_s[0])

    class Slow(ListedPackets):
        def read(self) -> CameraPacket | None:
            packet = super().read()
            now_s[0] += 0.6 if packet is not None and packet.end_us == 15_677_000 else 0.3
            return packet

    nothing = [CameraPacket(EventBatch.empty(), 500) for _ in range(19)]
    still = [CameraPacket(EventBatch.empty(), 400_000 * n) for n in range(1, 40)]
    late = [CameraPacket(at(15_676_000), 15_677_000), CameraPacket(at(15_677_500), 15_677_500)]
    ticks_of(
        Slow([CameraPacket(at(500), 500), *nothing, *still, *late]),
        on_notice=lambda kind, text: notices.append((kind, text)),
    )
    assert [kind for kind, _ in notices] == ["stall", "back"] * 2
    assert "for 0.6 s: look at its cable" in notices[0][1] and "after 6.0 s" in notices[1][1]
    assert "for 0.6 s" in notices[2][1] and "after 0.6 s" in notices[3][1]


def test_a_camera_that_falls_silent_again_is_said_as_long_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its clock stands still meanwhile. A short pause soon after another is not said."""
    now_s, notices = [0.0], list[tuple[str, str]]()
    monkeypatch.setattr("spinscope.pipeline.cameras.event_stream.now_s", lambda: now_s[0])

    class Dying(ListedPackets):
        def read(self) -> CameraPacket | None:
            now_s[0] += 0.5
            return super().read()

    given = [CameraPacket(at(100 * n), 100 * n) for n in range(1, 5)]
    dead = [CameraPacket(EventBatch.empty(), 400) for _ in range(43)]
    ticks_of(Dying([*given, *dead]), on_notice=lambda kind, text: notices.append((kind, text)))
    said = ["nothing came from the camera for 0.5 s", "the camera sends again, after 0.5 s"]
    said += [f"nothing came from the camera for {seconds} s" for seconds in ("9.0", "19.0")]
    assert [text.partition(":")[0] for _, text in notices] == said


def test_wrong_sizes_and_lost_packets_are_said_once_in_a_while() -> None:
    notices: list[tuple[str, str]] = []
    given = [CameraPacket(at(n * 100_000), n * 100_000, dropped=1, outside=7) for n in range(1, 151)]
    ticks_of(ListedPackets(given), on_notice=lambda kind, text: notices.append((kind, text)))
    assert [kind for kind, _ in notices] == ["lost", "size"] * 2
    assert "64 x 48 px, left out: 7 so far" in notices[1][1] and f"left out: {7 * 101} so far" in notices[3][1]
    assert "lost: 1 so far" in notices[0][1] and "lost: 101 so far" in notices[2][1]


def test_the_camera_that_is_there_can_be_looked_at() -> None:
    first = ListedPackets([CameraPacket(at(100), 100), CameraError("unplugged")])
    second = ListedPackets([CameraPacket(at(50), 50)])
    asked: list[EventCamera] = []
    stream = EventStream(first, TICK_US, reopen=lambda camera: asked.append(camera) or second)  # type: ignore[func-returns-value]
    stream.set_biases({"diff_on": 7})
    stream.start()
    stream.join()
    assert asked == [first] and first.biases == {"diff_on": 7} and stream.camera is second


def test_work_that_cannot_keep_up_misses_ticks_but_sinks_do_not() -> None:
    recorded: list[int] = []
    notices: list[str] = []
    given = [CameraPacket(at(n * TICK_US), n * TICK_US) for n in range(5000)]
    stream = EventStream(
        ListedPackets(given),
        TICK_US,
        sinks=(lambda clock, events: recorded.extend(events.t_us),),
        on_notice=lambda kind, text: notices.append(text),
    )
    stream.start()
    stream.join()  # nobody takes a tick meanwhile
    ticks = list(stream.ticks())
    assert recorded == [n * TICK_US for n in range(5000)]
    assert stream.counts.skipped > 0 and len(ticks) + stream.counts.skipped == 5000
    assert len(notices) == 1 and "cannot keep up" in notices[0]


def test_when_the_work_has_caught_up_another_segment_begins() -> None:
    stream = EventStream(ListedPackets([]), TICK_US)
    packets = [CameraPacket(at(n * TICK_US), n * TICK_US) for n in range(5003)]
    for packet in packets[:5000]:
        stream._take(packet)
    before = [stream._ticks.get() for _ in range(stream.waiting - 1)]
    stream._take(packets[5000])
    assert stream.waiting == 1, "one is still to be worked on"
    before.append(stream._ticks.get())
    for packet in packets[5001:]:
        stream._take(packet)
    after = [stream._ticks.get() for _ in range(stream.waiting)]
    assert {tick.segment for tick in before if tick} == {0} and [tick.segment for tick in after if tick] == [1, 1]


def test_biases_are_set_by_the_reading_thread() -> None:
    notices: list[str] = []
    camera = ListedPackets([CameraPacket(at(100), 100)])
    stream = EventStream(camera, TICK_US, on_notice=lambda kind, text: notices.append(text))
    stream.set_biases({"diff_on": 5})
    stream.set_biases({"diff_on": 11})
    stream.set_biases({"diff": 0})
    stream.start()
    stream.join()
    assert camera.applied == [{"diff_on": 5}]
    assert "diff_on = 11 is out of range for toy: -10 to 10" in notices[0] and "no bias 'diff'" in notices[1]


def test_biases_asked_for_before_the_end_are_set() -> None:
    """A sweep gives its former ones back and the run is stopped, while the reading thread waits for events."""

    class Stopped(ListedPackets):
        def read(self) -> CameraPacket | None:
            stream.set_biases({"diff_on": 7})
            stream.stop()
            return super().read()

    camera = Stopped([CameraPacket(at(100), 100)])
    stream = EventStream(camera, TICK_US)
    stream.start()
    stream.join()
    assert camera.applied == [{"diff_on": 7}] and camera.closed == 1
