"""Circles in single images and surfaces: drawn ones, and real balls."""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from spinscope.pipeline.kernels import hough
from spinscope.pipeline.recordings.opening import open_recording
from spinscope.pipeline.stages.surface import SurfaceResult
from spinscope.pipeline.stages.track_hough import candidates, empty_votes, hough_near
from tests.track_runs import inputs, run, sample, setting, true_ball

FRAMES = "tt_ball_frames_64x64_1ms.npz"


def real(name: str) -> Path:
    folder = os.environ.get("SPINSCOPE_REAL_RECORDINGS")
    if not folder:
        pytest.skip("SPINSCOPE_REAL_RECORDINGS does not name the folder of real recordings")
    path = Path(folder) / name
    if not path.exists():
        pytest.skip(f"{name} is not in the folder of real recordings")
    return path


def drawn(x_px: float, y_px: float, radius_px: float, size_px: int = 64) -> NDArray[np.bool_]:
    """The pixels within 0.7 px of a circle."""
    columns, rows = np.meshgrid(np.arange(size_px), np.arange(size_px))
    near: NDArray[np.bool_] = np.abs(np.hypot(columns - x_px, rows - y_px) - radius_px) < 0.7
    return near


def circle_in(image: NDArray[np.bool_] | NDArray[np.uint8]) -> tuple[float, float, float, float]:
    """Centre x and y, radius and share of the outline of the circle that the set pixels of an image draw best."""
    columns, rows = hough.bright_pixels(np.ascontiguousarray(image).view(np.uint8), 1, 4000)
    height, width = image.shape
    return hough.best_circle(columns, rows, -20, -20, max(width, height) + 40, 4, 20)


@given(
    x=st.floats(12, 51),
    y=st.floats(12, 51),
    radius=st.floats(6, 14),
    seed=st.integers(0, 2**32 - 1),
)
def test_a_drawn_circle_is_found_under_noise(x: float, y: float, radius: float, seed: int) -> None:
    """At least six tenths of its outline in the image, 1 % of the pixels noise."""
    image = drawn(x, y, radius)
    noise = np.random.default_rng(seed).random(image.shape) < 0.01
    found_x, found_y, found_radius, share = circle_in(image | noise)
    assert math.hypot(found_x - x, found_y - y) < 1.0
    assert abs(found_radius - radius) < 1.0
    assert share > 0.4


def test_no_circle_in_an_empty_or_noisy_image() -> None:
    assert circle_in(np.zeros((64, 64), np.bool_)) == (0.0, 0.0, 0.0, 0.0)
    noise = np.random.default_rng(1).random((64, 64)) < 0.005
    assert circle_in(noise)[3] < 0.4


def test_the_surface_shows_the_ball_to_two_pixels() -> None:
    """Near a prediction that is 3 px off, and anywhere."""
    events, truth = sample("flight_slow_top")
    packet, filtered, surface = inputs(events.between(40_000, 80_000))[-1]
    x, y, radius = true_ball(truth, np.array([packet.end_us]))[0]
    near = hough_near(surface, x + 3, y - 3, radius - 2, radius + 2)
    anywhere = next(candidates(surface, filtered.contour_events, 5.0, 40.0, 1, empty_votes(1280, 720)))
    for circle in (near, anywhere):
        assert circle is not None
        assert math.hypot(circle.x_px - x, circle.y_px - y) < 2
        assert abs(circle.radius_px - radius) < 2
        assert 0.2 < circle.score <= 1


def test_an_empty_surface_shows_nothing() -> None:
    surface = SurfaceResult(np.zeros((720, 1280), np.uint8), "isolated")
    events = sample("flight_back")[0].between(40_000, 45_000)
    assert hough_near(surface, 600.0, 300.0, 10.0, 20.0) is None
    assert hough_near(surface, -200.0, 300.0, 10.0, 20.0) is None
    assert list(candidates(surface, events, 5.0, 40.0, 4, empty_votes(1280, 720))) == []


def test_real_balls_are_found_in_single_frames() -> None:
    """4,000 frames of 1 ms from the paper's lab: 1.5 px on four fifths, apart from a constant offset."""
    with np.load(real(FRAMES)) as file:
        frames = np.unpackbits(file["frames"], axis=-1).reshape(-1, 64, 64)
        truth = file["gt"]
    circles = np.array([circle_in(frame) for frame in frames])
    off = circles[:, :2] - truth
    off -= np.median(off, axis=0)
    best = np.hypot(*off.T).argsort()[: int(0.8 * len(off))]
    assert (off[best].std(axis=0) < 1.5).all()
    assert 7.3 < np.median(circles[:, 2]) < 8.3


@pytest.mark.parametrize("name", ["gen31_cable_4157triggers_evt3.raw", "evk_1280x720_2triggers_evt3.raw"])
def test_no_ball_in_real_recordings_without_one(name: str) -> None:
    """A moving cable, and an almost static scene with a hot column."""
    recording = open_recording(real(name))
    place = setting(recording.width_px, recording.height_px)
    events = recording.read()
    events = events.between(int(events.t_us[0]), int(events.t_us[0]) + 700_000)
    results = run(inputs(events, place=place), place=place)
    assert len(results) > 100
    assert not any(result.has_ball for result in results)
