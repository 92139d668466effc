"""Flow as colours."""

from __future__ import annotations

import colorsys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spinscope.pipeline.kernels.hsv import flow_colours, hsv_image, hsv_wheel


@given(vx=st.floats(-2000, 2000), vy=st.floats(-2000, 2000))
def test_colours_are_those_of_the_hsv_cone(vx: float, vy: float) -> None:
    hue = (np.arctan2(vy, vx) / (2 * np.pi)) % 1.0
    expected = colorsys.hsv_to_rgb(hue, min(np.hypot(vx, vy) / 1000.0, 1.0), 1.0)
    colour = flow_colours(np.array([vx]), np.array([vy]), 1000.0)[0]
    assert colour.astype(float) == pytest.approx(255 * np.array(expected), abs=0.51)


def test_the_wheel_is_red_to_the_right_white_in_the_middle_and_black_outside() -> None:
    wheel = hsv_wheel(101)
    assert wheel.shape == (101, 101, 3)
    assert wheel[50, 50].tolist() == [255, 255, 255]
    assert wheel[50, 100, 0] == 255 and wheel[50, 100, 1:].max() < 5
    assert not wheel[0, 0].any()


def test_the_image_shows_the_mean_flow_where_there_is_flow() -> None:
    x, y = np.array([-9.9, -9.9, 5.0, 40.0]), np.array([-9.9, -9.9, 0.1, 0.0])
    vx, vy = np.array([100.0, 300.0, 0.0, 500.0]), np.array([0.0, 0.0, 400.0, 0.0])
    image = hsv_image(x, y, vx, vy, bound_px_s=400.0, radius_px=10.0, size_px=20)
    assert np.count_nonzero(image.any(axis=2)) == 2
    assert image[0, 0].tolist() == flow_colours(np.array([200.0]), np.array([0.0]), 400.0)[0].tolist()
    assert image[10, 15].tolist() == flow_colours(np.array([0.0]), np.array([400.0]), 400.0)[0].tolist()
    nothing = np.empty(0)
    assert not hsv_image(nothing, nothing, nothing, nothing, bound_px_s=1.0, radius_px=1.0, size_px=4).any()
