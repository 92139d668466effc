"""A recording in the place of a camera: the same events whatever the batches, at its pace, with a camera's faults."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from spinscope.pipeline.cameras import CameraPacket, ReplayCamera
from spinscope.pipeline.cameras.replay import FAULT_US, FAULTS
from spinscope.pipeline.errors import CameraError, ParameterError
from spinscope.pipeline.events import EventBatch

SIZE = (128, 96)


def recorded(seconds: float, rate_hz: float = 20_000, seed: int = 5) -> EventBatch:
    """Random events, several at the same time among them."""
    random, count = np.random.default_rng(seed), int(seconds * rate_hz)
    t_us = np.sort(random.integers(12_345, 12_345 + int(seconds * 1e6), count))
    x_px, y_px = (random.integers(0, size, count, np.uint16) for size in SIZE)
    return EventBatch(t_us, x_px, y_px, random.random(count) < 0.5)


def played(events: EventBatch, batch: int = 1 << 20, **options: object) -> list[CameraPacket]:
    camera = ReplayCamera(
        lambda: [events[n : n + batch] for n in range(0, len(events), batch)],
        *SIZE,
        **{"speed": float("inf"), **options},  # type: ignore[arg-type]
    )
    return list(itertools.takewhile(lambda packet: packet is not None, iter(camera.read, object())))  # type: ignore[arg-type]


@pytest.mark.parametrize("batch", [1 << 20, 997, 3])
def test_all_events_come_once_and_never_after_the_time_up_to_which_all_had_come(batch: int) -> None:
    events = recorded(0.2)
    given = played(events, batch)
    together = EventBatch.concatenate(packet.events for packet in given)
    for column, expected in zip(together.columns, events.columns, strict=True):
        assert np.array_equal(column, expected)
    known_us = [packet.end_us for packet in given]
    assert known_us == sorted(known_us)
    for packet, before_us in zip(given[1:], known_us, strict=False):
        assert not len(packet.events) or packet.events.t_us[0] >= before_us


def test_a_loop_goes_on_behind_its_end() -> None:
    events = recorded(0.05)
    camera = ReplayCamera(lambda: [events], *SIZE, speed=float("inf"), loops=True)
    parts = []
    while sum(map(len, parts)) < 3 * len(events):
        packet = camera.read()
        assert packet is not None
        parts.append(packet.events)
    t_us = np.concatenate([part.t_us for part in parts])
    shifts = t_us[len(events) : 2 * len(events)] - events.t_us
    assert np.all(np.diff(t_us) >= 0) and np.unique(shifts).size == 1
    assert shifts[0] % 100_000 == 0 and shifts[0] > 150_000


def test_it_takes_as_long_as_the_recording_at_its_speed(monkeypatch: pytest.MonkeyPatch) -> None:
    slept: list[float] = []
    monkeypatch.setattr("spinscope.pipeline.cameras.clock.time.sleep", slept.append)
    monkeypatch.setattr("spinscope.pipeline.cameras.clock.now_s", lambda: sum(slept))
    played(recorded(0.4), speed=2.0)
    assert sum(slept) == pytest.approx(0.2, abs=0.01)


def test_one_that_is_late_does_not_sleep(monkeypatch: pytest.MonkeyPatch) -> None:
    """Not even for 0 s: other threads would take Python's lock for many times the length of a packet."""
    slept: list[float] = []
    times = itertools.chain([0.0], itertools.repeat(100.0))
    monkeypatch.setattr("spinscope.pipeline.cameras.clock.time.sleep", slept.append)
    monkeypatch.setattr("spinscope.pipeline.cameras.clock.now_s", lambda: next(times))
    assert sum(len(packet.events) for packet in played(recorded(0.1), speed=1.0)) == 2000 and not slept


def test_a_stall_comes_every_second(monkeypatch: pytest.MonkeyPatch) -> None:
    slept: list[float] = []
    monkeypatch.setattr("spinscope.pipeline.cameras.clock.time.sleep", slept.append)
    played(recorded(2.5), fault="stall")
    assert slept == [0.5, 0.5]


def test_a_burst_is_50_mev_s() -> None:
    events = recorded(1.1)
    given = played(events, fault="burst")
    counts = np.array([len(packet.events) for packet in given])
    assert counts.max() == pytest.approx(50_000, rel=0.01)  # in a packet of a millisecond
    assert counts.sum() - len(events) == pytest.approx(1_000_000, rel=0.06)  # for 20 ms
    t_us = np.concatenate([packet.events.t_us for packet in given])
    assert np.all(np.diff(t_us) >= 0)


def test_a_disconnected_camera_goes_on_with_a_new_clock() -> None:
    camera = ReplayCamera(lambda: [recorded(1.2)], *SIZE, speed=float("inf"), fault="disconnect")
    with pytest.raises(CameraError, match="unplugged"):
        while camera.read() is not None:
            pass
    packet = camera.read()
    assert packet is not None and 0 <= packet.end_us <= 1000


def test_wrong_sizes_and_clock_resets() -> None:
    assert sum(packet.outside for packet in played(recorded(1.2), fault="wrong-size")) > 0
    given = played(recorded(1.2), fault="clock-reset")
    assert min(np.diff([packet.end_us for packet in given])) < -FAULT_US // 2
    assert all(packet.events.t_us[-1] <= packet.end_us for packet in given if len(packet.events))


def test_nonsense_is_refused() -> None:
    with pytest.raises(ParameterError, match="speed = 0 is no speed"):
        ReplayCamera(list, *SIZE, speed=0.0)
    with pytest.raises(ParameterError, match="there are stall, burst, disconnect, wrong-size, clock-reset"):
        ReplayCamera(list, *SIZE, fault="fire")
    assert len(FAULTS) == 5
