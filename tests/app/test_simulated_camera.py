"""Bias tuning without any camera: the sweep of a simulated one, and what goes with it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from click.testing import CliRunner

from spinscope.app.cli import cli
from spinscope.app.live import camera_sweep, event_rates, opening
from spinscope.app.live.camera_sweep import CameraSweep, proposed_value
from spinscope.pipeline.biases import BiasParameters
from spinscope.pipeline.cameras import SimulatedCamera
from spinscope.pipeline.results import Packet
from spinscope.pipeline.session import Choices

ROUND_PACKETS = 100


@pytest.fixture
def camera(monkeypatch: pytest.MonkeyPatch) -> SimulatedCamera:
    """A camera of few pixels, before which a ball is thrown every tenth of a second."""
    monkeypatch.setattr(opening, "SIMULATED_SIZE_PX", (96, 72))
    monkeypatch.setattr(opening, "SIMULATED_ROUND_S", ROUND_PACKETS * 1e-3)
    monkeypatch.setattr(camera_sweep, "SETTLE_US", 0)
    for module in (camera_sweep, event_rates):
        monkeypatch.setattr(module, "MARGIN_US", 0)  # the ball here comes and goes with each packet
    return opening.simulated_camera(Choices(), BiasParameters(), float("inf"))


def test_higher_thresholds_have_fewer_events_of_ball_and_noise(camera: SimulatedCamera) -> None:
    noise, ball = list[int](), list[int]()
    for threshold in (-35, 40, 140):
        camera.set_biases({"diff_on": threshold, "diff_off": threshold})
        counts = [len(camera.read().events) for _ in range(ROUND_PACKETS)]
        noise.append(sum(counts[:20]))  # before the ball comes
        ball.append(sum(counts[20:]))
    assert noise[0] > 5 * noise[1] > 5 * noise[2] and ball[0] > 1.3 * ball[1] > 1.3 * 2 * ball[2] > 0


def test_the_sweep_proposes_a_value_and_gives_the_former_ones_back(
    camera: SimulatedCamera, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a ball in each packet of many events, as large as the image: the tracker has tests of its own."""
    monkeypatch.setattr(camera_sweep, "MOST_NOISE_HZ", 20_000.0)  # of few pixels
    ball: Any = SimpleNamespace(
        shot=0, began_by="entered", centre_px=lambda t_us: (48.0, 36.0), mean=[0.0, 0.0, 0.0, 0.0, 100.0]
    )
    end_us, before = 0, dict(camera.biases)

    def set_biases(biases: Mapping[str, int]) -> int:
        camera.set_biases(biases)
        return end_us

    sweep = CameraSweep("diff_on", camera, before, set_biases, points=3, measured_s=ROUND_PACKETS * 1e-3)
    while not sweep.done.is_set():
        packet = camera.read()
        balls = [ball] if len(packet.events) > 100 else []
        sweep.add(Packet(end_us // 1000, end_us, packet.end_us, packet.events), balls)
        end_us = packet.end_us
    points = sweep.sweep.points
    assert [point.value for point in points] == [-85, 28, 140] and camera.biases == before
    for rates in ([one.noise_on_hz for one in points], [one.ball_on_hz for one in points]):
        assert rates == sorted(rates, key=lambda hz: -(hz or 0.0)) and rates[2]
    assert proposed_value(sweep.sweep) == 28  # -85 has more noise than is allowed, 140 fewer events of the ball


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--simulate", "--replay", "x.raw"], "--replay and --simulate exclude each other"),
        (["--simulate", "--camera", "7"], "--camera and --simulate exclude each other"),
        (["--simulate", "--loop"], "give --replay FILE"),
        (["--simulate", "--most-mev-s", "3"], "are of a camera alone"),
        (["--replay", "x.raw", "--biases", "x.bias"], "--biases are of a camera"),
    ],
)
def test_what_does_not_go_together(
    options: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("x.raw", "x.bias"):
        Path(name).write_text("")
    result = CliRunner().invoke(cli, ["live", "--headless", *options])
    assert result.exit_code != 0 and said in f"{result.output} {result.exception}"
