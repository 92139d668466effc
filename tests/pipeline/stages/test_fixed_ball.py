"""The spinner's ball from its logo's path: near the truth within its 1 sigma, or refused with the reason."""

from __future__ import annotations

import math

import numpy as np
import pytest

from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.stages.fixed_ball import CLOSED_SHORT, _limb, find_fixed_ball
from tests.track_runs import HEIGHT, WIDTH, merged, sample, setting


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
