"""The spinner's ball from its logo's path: near the truth within its 1 sigma, or refused with the reason."""

from __future__ import annotations

import math
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from spinscope.pipeline.api import estimate
from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.recordings import open_recording
from spinscope.pipeline.stages.fixed_ball import CLOSED_SHORT, _limb, find_fixed_ball
from tests.track_runs import HEIGHT, WIDTH, merged, sample, setting


def turning_dot(path_px: float, dot_px: float, rps: float, duration_us: int = 200_000) -> EventBatch:
    """A dark dot on a turning disc: each pixel answers when the dot reaches it, once a turn, and when it leaves."""
    columns, rows = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    dx, dy = columns - 640.3, rows - 350.6
    away = np.hypot(dx, dy)
    with np.errstate(divide="ignore", invalid="ignore"):
        half_rad = np.arccos((away**2 + path_px**2 - dot_px**2) / (2 * away * path_px))
    touched = np.isfinite(half_rad)
    parts = []
    for sign, on in ((-1, False), (1, True)):
        turn_rad = (np.arctan2(dy, dx)[touched] + sign * half_rad[touched]) % (2 * math.pi)
        for turn in range(int(duration_us * 1e-6 * rps) + 1):
            t_us = ((turn_rad / (2 * math.pi) + turn) / rps * 1e6).astype(np.int64)
            seen = t_us < duration_us
            parts.append((t_us[seen], columns[touched][seen], rows[touched][seen], np.full(np.count_nonzero(seen), on)))
    t_us, x, y, on_column = (np.concatenate(column) for column in zip(*parts, strict=True))
    order = np.argsort(t_us, kind="stable")
    return EventBatch(t_us[order], x[order].astype(np.uint16), y[order].astype(np.uint16), on_column[order])


@pytest.mark.parametrize(("path_px", "dot_px", "rps"), [(107.0, 10.0, 19.4), (131.0, 8.0, 25.0), (60.0, 12.0, -50.0)])
def test_a_dot_on_a_turning_disc_is_a_ball(path_px: float, dot_px: float, rps: float) -> None:
    """Larger than any ball in flight: found without a stated radius, its spin to 0.4 rps."""
    events = turning_dot(path_px, dot_px, abs(rps))
    if rps < 0:  # seen in a mirror it turns the other way
        events = EventBatch(events.t_us, events.x_px, (HEIGHT - 1 - events.y_px).astype(np.uint16), events.on)
    circle, std_px = find_fixed_ball(merged(events, noise(20_000, 4)), setting().camera)
    assert math.hypot(circle.x_px - 640.3, circle.y_px - (350.6 if rps > 0 else HEIGHT - 1 - 350.6)) < 1
    assert abs(circle.radius_px - (path_px + dot_px)) < std_px
    result = estimate(events, sensor_px=(WIDTH, HEIGHT), fixed_ball="auto", method="contrast")
    (shot,) = result.shots
    assert shot.best == "contrast"
    assert shot.estimates["contrast"].vector_rps == pytest.approx([0, 0, rps], abs=0.4)


def test_a_disc_as_large_as_the_image_is_found_in_bounded_memory() -> None:
    angle = np.linspace(0, 2 * math.pi, 20_000)
    x, y = np.round(640.3 + 350 * np.cos(angle)), np.round(360.6 + 350 * np.sin(angle))
    tracemalloc.start()
    found = _limb(x, y, 3.0, 360.0)
    peak_bytes = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert found is not None and peak_bytes < 400e6
    circle, _ = found
    assert (circle.x_px, circle.y_px) == (pytest.approx(640.3, abs=0.3), pytest.approx(360.6, abs=0.3))
    assert circle.radius_px == pytest.approx(350 * (1 + CLOSED_SHORT[0]), abs=1)


@pytest.mark.parametrize("name", ["flight_back", "flight_slow_top", "flight_two_balls", "flight_side"])
def test_a_flight_is_no_fixed_ball(name: str) -> None:
    with pytest.raises(RecordingError, match="passes by once"):
        find_fixed_ball(sample(name)[0], setting().camera)


def test_a_rally_holds_no_fixed_ball(samples: Path) -> None:
    with pytest.raises(RecordingError, match="no ball found"):
        find_fixed_ball(open_recording(samples / "own" / "rally.h5").read(), setting().camera)


def test_an_arc_is_no_fixed_ball() -> None:
    """A band that bends as an arm does, and that swings to and fro."""
    angle = np.linspace(0, 0.8, 2000)
    x, y = 600 + 300 * np.cos(angle), 100 + 300 * np.sin(angle)
    pixels = np.round(np.tile(np.concatenate([x, x[::-1]]), 4)), np.round(np.tile(np.concatenate([y, y[::-1]]), 4))
    offset = np.random.default_rng(6).integers(-6, 7, (2, pixels[0].size))
    count = pixels[0].size
    events = EventBatch(
        np.linspace(0, 200_000, count).astype(np.int64),
        (pixels[0] + offset[0]).astype(np.uint16),
        (pixels[1] + offset[1]).astype(np.uint16),
        np.arange(count) % 2 == 0,
    )
    with pytest.raises(RecordingError, match="no ball found"):
        find_fixed_ball(events, setting().camera)


def noise(count: int, seed: int) -> EventBatch:
    rng = np.random.default_rng(seed)
    return EventBatch(
        np.sort(rng.integers(0, 100_000, count)),
        rng.integers(0, WIDTH, count).astype(np.uint16),
        rng.integers(0, HEIGHT, count).astype(np.uint16),
        rng.random(count) < 0.5,
    )


@pytest.mark.parametrize("name", ["spinner_ball2_side", "spinner_ball3_back"])
@pytest.mark.parametrize("extra", [0, 30_000])
def test_samples_are_found_within_two_sigma(name: str, extra: int) -> None:
    """Also under ten times the noise."""
    events, truth = sample(name)
    circle, std_px = find_fixed_ball(merged(events, noise(extra, 1)), setting().camera, 5.0, 40.0)
    off = math.hypot(circle.x_px - truth.x_px[0], circle.y_px - truth.y_px[0])
    assert off < 2 * std_px
    assert abs(circle.radius_px - truth.radius_px[0]) < 2 * std_px
    assert 0.5 <= std_px < 0.15 * circle.radius_px


def test_a_path_that_fits_many_circles_is_refused() -> None:
    """Ball 1: a narrow band across the disc, which could be any chord of it."""
    with pytest.raises(RecordingError, match=r"fits many circles.*--fixed-ball"):
        find_fixed_ball(sample("spinner_ball1_top")[0], setting().camera, 5.0, 40.0)


def test_a_logo_that_hardly_shows_is_refused() -> None:
    with pytest.raises(RecordingError, match=r"194 events, fewer than the 300"):
        find_fixed_ball(sample("spinner_ball5_back_no_logo")[0], setting().camera, 5.0, 40.0)


def test_radii_out_of_range_are_refused() -> None:
    for low, high in ((20.0, 40.0), (5.0, 10.0)):
        with pytest.raises(RecordingError, match="no ball found"):
            find_fixed_ball(sample("spinner_ball2_side")[0], setting().camera, low, high)


def test_noise_hot_pixels_and_silence_are_refused() -> None:
    rng = np.random.default_rng(2)
    hot = rng.integers(0, WIDTH * HEIGHT, 10)[rng.integers(0, 10, 50_000)]
    pixels = EventBatch(
        np.arange(50_000),
        (hot % WIDTH).astype(np.uint16),
        (hot // WIDTH).astype(np.uint16),
        np.ones(50_000, np.bool_),
    )
    row = EventBatch(
        np.arange(5000), (600 + np.arange(5000) % 20).astype(np.uint16), np.full(5000, 300, np.uint16), hot[:5000] > 0
    )
    for events in (noise(200_000, 3), pixels, row, EventBatch.empty()):
        with pytest.raises(RecordingError, match="no ball found"):
            find_fixed_ball(events, setting().camera, 5.0, 40.0)


def test_a_path_all_around_is_taken_as_short_of_the_limb() -> None:
    """A path that closes is the logo's own circle, a little inside the ball's outline."""
    angle = np.linspace(0, 2 * math.pi, 100, endpoint=False)
    found = _limb(np.round(300 + 15 * np.cos(angle)), np.round(200 + 15 * np.sin(angle)), 5.0, 40.0)
    assert found is not None
    circle, std_px = found
    assert (circle.x_px, circle.y_px) == (pytest.approx(300, abs=0.5), pytest.approx(200, abs=0.5))
    assert circle.radius_px == pytest.approx(15 * (1 + CLOSED_SHORT[0]), abs=0.4)
    assert std_px >= CLOSED_SHORT[1] * circle.radius_px
