"""Sweep of a running camera's bias, on a camera whose noise depends on its biases."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from spinscope.app.cli import cli
from spinscope.app.live import headless
from spinscope.app.live.camera_sweep import CameraSweep, proposal_words, proposed_value
from spinscope.app.live.event_rates import MARGIN_US, EventRateMeter, EventRates
from spinscope.app.tuning.bias_sweep import BiasSweep, BiasSweepPoint
from spinscope.pipeline.cameras import CameraPacket, EventCamera, ReplayCamera
from spinscope.pipeline.errors import CameraError, ParameterError
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.live import session_of
from spinscope.pipeline.results import Packet
from spinscope.pipeline.session import Choices


class NoisyCamera(EventCamera):
    """A still scene: ON and OFF noise fall by e every 20 steps of their threshold, to 100 kev/s each at 0."""

    can_wait = True
    name, serial, width_px, height_px = "noisy", "1", 160, 120

    def __init__(self) -> None:
        self.bias_limits = {"diff_on": (0, 100), "diff_off": (0, 100), "refr": (0, 5)}
        self.biases = {"diff_on": 20, "diff_off": 30, "refr": 1}
        self.applied: list[dict[str, int]] = []
        self._random, self._end_us = np.random.default_rng(3), 0

    def read(self) -> CameraPacket:
        begin_us, self._end_us = self._end_us, self._end_us + 5000
        parts = [(int(500 * math.exp(-self.biases[name] / 20)), name == "diff_on") for name in ("diff_on", "diff_off")]
        on = np.concatenate([np.full(count, is_on) for count, is_on in parts])
        x_px, y_px = (self._random.integers(0, size, len(on), np.uint16) for size in (160, 120))
        t_us = np.sort(self._random.integers(begin_us, self._end_us, len(on)))
        return CameraPacket(EventBatch(t_us, x_px, y_px, on), self._end_us)

    def close(self) -> None:
        pass

    def _apply_biases(self, biases: Mapping[str, int]) -> None:
        self.applied.append(dict(biases))


def with_limits(**limits: tuple[int, int]) -> NoisyCamera:
    """A camera with these biases."""
    camera = NoisyCamera()
    camera.bias_limits = limits
    return camera


def point(value: int, noise: float, on: float | None = None, off: float | None = None) -> BiasSweepPoint:
    return BiasSweepPoint(value=value, noise_on_hz=noise / 2, noise_off_hz=noise / 2, ball_on_hz=on, ball_off_hz=off)


@pytest.mark.parametrize(
    ("points", "value"),
    [
        ([point(0, 1e6), point(40, 9e4), point(80, 1e4)], 40),  # no ball: as sensitive as the noise allows
        ([point(0, 1e6, 9e5, 9e5), point(40, 9e4, 5e5, 4e5), point(80, 1e4, 1e5, 1e5)], 40),
        ([point(0, 1e4, 9e5, 1e5), point(40, 1e4, 5e5, 4e5)], 40),  # ON and OFF part
        ([point(0, 1e6), point(40, 5e5)], None),
        ([BiasSweepPoint(value=0), point(40, 9e4), point(80, 1e4)], 40),  # of 0 nothing is known
    ],
)
def test_the_supplement_s_trade_off(points: list[BiasSweepPoint], value: int | None) -> None:
    sweep = BiasSweep("diff_on", len(points), points)
    assert proposed_value(sweep) == value
    assert (f"= {value}" if value is not None else "no value") in proposal_words(sweep)


def test_the_sweep_waits_for_the_camera_and_begins_a_value_anew_with_another_clock() -> None:
    asked: list[tuple[int, int]] = []
    clock_us = 0

    def set_biases(biases: Mapping[str, int]) -> int:
        (value,) = biases.values()
        asked.append((value, clock_us))
        return clock_us

    sweep = CameraSweep("refr", with_limits(refr=(0, 4)), {"refr": 2}, set_biases, points=2, measured_s=0.05)
    for start_us in [*range(0, 340_000, 5000), *range(0, 1_000_000, 5000)]:
        clock_us = start_us + 5000
        t_us = np.full(10, start_us)
        events = EventBatch(t_us, np.zeros(10, np.uint16), np.zeros(10, np.uint16), np.arange(10) < 3)
        sweep.add(Packet(start_us // 5000, start_us, start_us + 5000, events), ())
    assert asked == [(0, 5000), (0, 5000), (4, 410_000), (2, 810_000)]
    assert sweep.done.is_set()
    assert [one.value for one in sweep.sweep.points] == [0, 4]
    for one in sweep.sweep.points:
        assert one.noise_on_hz == pytest.approx(600.0) and one.noise_off_hz == pytest.approx(1400.0)


@pytest.mark.parametrize(
    ("options", "error", "said"),
    [
        ({"name": "fo"}, CameraError, "it has refr"),
        ({"points": 1}, ParameterError, "2 to 25"),
        ({"measured_s": 0.0}, ParameterError, "above 0"),
        ({"camera": ReplayCamera(list, 8, 6)}, CameraError, "do not change"),
    ],
)
def test_what_is_no_sweep(options: dict[str, Any], error: type[Exception], said: str) -> None:
    given = {"name": "refr", "camera": with_limits(refr=(0, 4)), "present": {"refr": 2}, "set_biases": lambda biases: 0}
    with pytest.raises(error, match=said):
        CameraSweep(**{**given, "points": 2, **options})


def ball(shot: int = 0, x_px: float = 80.0, began_by: str = "entered") -> Any:
    """A ball of 8 px at rest."""
    mean = [x_px, 60.0, 0.0, 0.0, 8.0]
    return SimpleNamespace(
        shot=shot, mean=mean, began_by=began_by, centre_px=lambda t_us: (np.full(len(t_us), x_px), 60.0)
    )


def tick(index: int, *, noise: int = 0, first: int = 0, second: int = 0) -> Packet:
    """A tick with OFF events at the border, and ON events of two balls."""
    x_px = np.repeat([1, 80, 120], [noise, first, second]).astype(np.uint16)
    t_us, y_px = np.full(len(x_px), 5000 * index), np.where(x_px > 1, 60, 1).astype(np.uint16)
    return Packet(index, 5000 * index, 5000 * (index + 1), EventBatch(t_us, x_px, y_px, x_px > 1))


def test_rates_of_ball_and_noise() -> None:
    meter = EventRateMeter()
    assert meter.take() is None
    events = EventBatch.checked([0, 1, 2], [1, 2, 3], [1, 1, 1], [True, False, False], width_px=4, height_px=4)
    meter.add(Packet(0, 0, 5000, events), ())
    meter.add(Packet(1, 5000, 10_000, EventBatch.empty()), ())
    assert meter.take() is None  # a ball may be found yet in the next ticks
    meter.add(Packet(2, 10_000, 10_000 + MARGIN_US, EventBatch.empty()), ())
    assert meter.take() == EventRates(100.0, 200.0)


def test_events_of_a_ball_that_is_not_tracked_yet_or_any_more_are_no_noise() -> None:
    """It is in view in ticks 40 to 79, and tracked in 46 to 74; the noise is two events a tick throughout."""
    meter = EventRateMeter()
    for index in range(120):
        balls = (ball(),) if 46 <= index < 75 else ()
        meter.add(tick(index, noise=2, first=30 if 40 <= index < 80 else 0), balls)
    assert meter.take() == EventRates(0.0, 400.0, 6000.0, 0.0)


def test_a_second_ball_leaves_out_ticks_around_its_own_track() -> None:
    """Its events before it is tracked are no noise beside the first one's; and another clock has no earlier tick."""
    meter = EventRateMeter()
    for index in range(160):
        balls = (ball(), ball(1, 120.0)) if 80 <= index < 120 else (ball(),)
        meter.add(tick(index, noise=2, first=1, second=9 if 76 <= index < 125 else 0), balls)
    meter.add(tick(0, noise=500), (ball(2),))
    alone, both = 70 + 20, 40  # ticks that are counted
    assert meter.take() == EventRates(0.0, 400.0, pytest.approx((alone + 10 * both) / (alone + both) * 200.0), 0.0)


def test_a_short_flight_is_counted_whole_also_with_a_contact() -> None:
    """60 ms, of which the last 30 follow a bounce."""
    meter = EventRateMeter()
    for index in range(60):
        balls = (ball(),) if 20 <= index < 26 else (ball(1, began_by="bounce"),) if 26 <= index < 32 else ()
        meter.add(tick(index, noise=2, first=30 + index if balls else 0), balls)
    of_ball = sum(30 + index for index in range(20, 32))
    assert meter.take() == EventRates(0.0, 400.0, pytest.approx(of_ball / (12 * 5e-3)), 0.0)


def test_a_sweep_without_a_page(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    camera = NoisyCamera()
    monkeypatch.setattr(headless, "warm_up", lambda: None)
    monkeypatch.setattr("spinscope.pipeline.cameras.event_stream.MOST_WAITING_US", 20_000)
    monkeypatch.setattr("spinscope.app.live.camera_sweep.SETTLE_US", 50_000)
    monkeypatch.setattr(headless, "open_live", lambda chosen, choices: (camera, session_of(camera, Choices())))
    lines, figure = tmp_path / "out.jsonl", tmp_path / "rates.png"
    sweep = ["--sweep", "diff_on_off", "--sweep-points", "3", "--sweep-s", "0.05", "--sweep-figure", str(figure)]
    result = CliRunner().invoke(
        cli, ["live", "--headless", "--method", "triplet", "--jsonl", str(lines), *sweep], catch_exceptions=False
    )
    assert result.exit_code == 0, result.output
    written = list(map(json.loads, lines.read_text().splitlines()))
    points = [one["bias"] for one in written if "bias" in one]
    assert [one["value"] for one in points] == [0, 50, 100]
    for one in points:
        expected_hz = 1e5 * math.exp(-one["value"] / 20)
        assert one["noise_on_hz"] == pytest.approx(expected_hz, abs=200.0)  # whole events a packet
        assert one["noise_off_hz"] == pytest.approx(expected_hz, abs=200.0)
    (proposed,) = [one["proposed"] for one in written if "proposed" in one]
    assert proposed["value"] == 50 and "= 50" in result.stderr
    assert figure.read_bytes().startswith(b"\x89PNG")
    assert camera.applied[-1] == {"diff_on": 20, "diff_off": 30, "refr": 1}  # as it was before


def test_a_sweep_belongs_to_a_run_without_a_page() -> None:
    result = CliRunner().invoke(cli, ["live", "--sweep", "fo"])
    assert result.exit_code == 2 and "--headless" in result.output
