"""A simulated camera: rounds without a gap, at their pace, and biases that act from then on."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from spinscope.pipeline.cameras import SimulatedCamera
from spinscope.pipeline.errors import CameraError, ParameterError
from spinscope.pipeline.events import EventBatch

ROUND_US = 10_000


def scene(biases: Mapping[str, int]) -> EventBatch:
    """As many events at x = 3 as the threshold says, from the first microsecond of the round to its last."""
    t_us = np.linspace(0, ROUND_US - 1, biases["diff_on"]).astype(np.int64)
    ones = np.ones(len(t_us), np.uint16)
    return EventBatch(t_us, 3 * ones, ones, np.ones(len(t_us), np.bool_))


def camera(speed: float = float("inf"), diff_on: int = 50) -> SimulatedCamera:
    limits = {"diff_on": (1, 100), "refr": (0, 5)}
    return SimulatedCamera(
        scene, ROUND_US, 8, 6, bias_limits=limits, biases={"diff_on": diff_on, "refr": 2}, speed=speed
    )


def test_rounds_follow_each_other_without_a_gap() -> None:
    made = camera()
    packets = [made.read() for _ in range(25)]
    assert [packet.end_us for packet in packets] == list(range(1000, 26_000, 1000))
    for packet in packets:
        assert np.all((packet.events.t_us >= packet.end_us - 1000) & (packet.events.t_us < packet.end_us))
    t_us, own = EventBatch.concatenate(packet.events for packet in packets).t_us, scene(made.biases).t_us
    assert t_us.tolist() == [*own, *(own + ROUND_US), *(own[own < 5000] + 2 * ROUND_US)]


def test_biases_act_on_all_later_events_and_the_clock_stands_still_meanwhile() -> None:
    made = camera()
    before = [made.read() for _ in range(10)]
    made.set_biases({"diff_on": 20})
    after = [made.read() for _ in range(10)]
    assert [sum(len(packet.events) for packet in packets) for packets in (before, after)] == [50, 20]
    assert after[0].end_us == before[-1].end_us + 1000 and made.biases == {"diff_on": 20, "refr": 2}


def test_it_keeps_to_its_pace_and_does_not_hurry_after_a_simulation(monkeypatch: pytest.MonkeyPatch) -> None:
    slept: list[float] = []
    clock = [100.0]
    monkeypatch.setattr("spinscope.pipeline.cameras.clock.time.sleep", slept.append)
    monkeypatch.setattr("spinscope.pipeline.cameras.clock.now_s", lambda: clock[0] + sum(slept))
    made = camera(speed=0.5)
    for _ in range(3):
        made.read()
    clock[0] += 7.0
    made.set_biases({"diff_on": 20})
    for _ in range(2):
        made.read()
    assert slept == pytest.approx([0.002] * 5)
    clock[0] += 0.005  # late: it hurries, and sleeps no more until it has caught up
    for _ in range(3):
        made.read()
    assert slept[5:] == pytest.approx([0.001])


def test_what_it_cannot_do() -> None:
    with pytest.raises(CameraError, match="diff_on = 101 is out of range for simulated camera: 1 to 100"):
        camera(diff_on=101)
    with pytest.raises(CameraError, match="has no bias 'fo': it has diff_on, refr"):
        camera().set_biases({"fo": 1})
    with pytest.raises(ParameterError, match="is no speed"):
        camera(speed=0.0)
