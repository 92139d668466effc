"""Latency of the pixels by a turning disc: found as it was simulated, at any angle of the trigger and either way."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from spinscope.app.cli import cli
from spinscope.pipeline.calibration.pixel_latency import TurningDisc, pixel_latency
from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.presets import preset
from spinscope.pipeline.recordings import Triggers, write_recording

CIRCLE = (160.0, 120.0, 90.0)
LAG_PX = 0.4  # the part of the lag that does not depend on the speed


def turning_disc(speed_rps: float, latency_us: float, seed: int, way: int = 1, turns: int = 24) -> TurningDisc:
    """Events of a dark sector of 40 degrees: OFF at its front edge, ON at its back edge, with jitter and noise."""
    random = np.random.default_rng(seed)
    count = 12_000
    radius = random.uniform(5.0, 85.0, count)
    edge = random.integers(0, 2, count)
    turn = random.uniform(-1, turns + 1, count)  # of the disc, when the edge really passes
    angle = 2 * math.pi * (way * (turn + 0.15) + np.where(edge == 1, -way * 40 / 360, 0.0)) - way * LAG_PX / radius
    t_us = 1e6 * (turn + 1) / speed_rps + latency_us + 15.0 * random.standard_normal(count)
    x, y = CIRCLE[0] + radius * np.cos(angle), CIRCLE[1] + radius * np.sin(angle)
    noisy = 2000
    t_us = np.concatenate([t_us, random.uniform(0, 1e6 * turns / speed_rps, noisy)])
    x = np.concatenate([x, random.uniform(60, 260, noisy)])
    y = np.concatenate([y, random.uniform(20, 220, noisy)])
    on = np.concatenate([edge == 1, random.random(noisy) < 0.5])
    order = np.argsort(t_us)
    x_px, y_px = (np.rint(column[order]).astype(np.uint16) for column in (x, y))
    events = EventBatch(np.rint(t_us[order]).astype(np.int64), x_px, y_px, on[order])
    return TurningDisc(events, np.rint(1e6 * (np.arange(turns + 1) + 1) / speed_rps).astype(np.int64))


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("latency_us", [0.0, 60.0, 300.0])
def test_the_latency_is_found(latency_us: float, way: int) -> None:
    discs = [turning_disc(speed, latency_us, 77_300 + number, way) for number, speed in enumerate((15.0, 40.0, 90.0))]
    found = pixel_latency(discs, CIRCLE)
    assert found.std_us < 4.0 and found.latency_us == pytest.approx(latency_us, abs=4 * found.std_us + 1.0)


def test_what_tells_no_latency_is_refused_in_words() -> None:
    slow, fast, back = (turning_disc(speed, 40.0, 77_310, way) for speed, way in ((20.0, 1), (50.0, 1), (50.0, -1)))
    few = TurningDisc(fast.events, fast.triggers_us[:3])
    intervals_us = np.random.default_rng(77_311).uniform(25_000, 75_000, slow.triggers_us.size)
    uneven = TurningDisc(slow.events, np.cumsum(intervals_us).astype(np.int64))
    for discs, words in (
        ([slow], "two speeds or more"),
        ([slow, slow], "two speeds or more"),
        ([slow, back], "the same way"),
        ([slow, few], "3 rising trigger edges are too few"),
        ([uneven, fast], "nothing turns evenly with the triggers"),
    ):
        with pytest.raises(RecordingError, match=words):
            pixel_latency(discs, CIRCLE)


def test_command_writes_a_preset(tmp_path: Path) -> None:
    for number, speed in enumerate((20.0, 80.0)):
        disc = turning_disc(speed, 120.0, 77_320 + number)
        edges = np.column_stack([disc.triggers_us, disc.triggers_us + 500]).ravel()
        levels = np.tile(np.array([1, 0], np.uint8), disc.triggers_us.size)
        triggers = Triggers(edges, levels, np.zeros(edges.size, np.uint8))
        write_recording(tmp_path / f"{number}.raw", disc.events, width_px=320, height_px=240, triggers=triggers)
    out = tmp_path / "latency.toml"
    arguments = [str(tmp_path / "0.raw"), str(tmp_path / "1.raw"), "--disc", "160", "120", "90", "--out", str(out)]
    done = CliRunner().invoke(cli, ["calibrate", "latency", *arguments])
    assert done.exit_code == 0, done.output
    assert preset(out).track.latency_us == pytest.approx(120.0, abs=10.0)
