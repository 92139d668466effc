"""The camera: silhouettes against a slow outline of the sphere, and the way back."""

from __future__ import annotations

import dataclasses

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spinscope.pipeline.camera import Camera, CameraParameters
from spinscope.pipeline.errors import ParameterError

CAMERA = Camera.of(CameraParameters(), 1280, 720)
LENS = dataclasses.replace(CAMERA, distortion=(-0.12, 0.05, 0.001, -0.0005, 0.0))
RADIUS_M = 0.02


def outline(centre: np.ndarray, radius_m: float) -> np.ndarray:
    """(3600, 3) points where rays of the camera touch the sphere, by the tangent circle."""
    distance = np.linalg.norm(centre)
    towards = centre / distance
    side = np.cross(towards, [0.0, 1.0, 0.0])
    side /= np.linalg.norm(side)
    up = np.cross(side, towards)
    angle = np.linspace(0, 2 * np.pi, 3600, endpoint=False)[:, None]
    ring = np.cos(angle) * side + np.sin(angle) * up
    sine = radius_m / distance
    return centre * (1 - sine**2) + radius_m * np.sqrt(1 - sine**2) * ring


places = st.tuples(st.floats(-0.6, 0.6), st.floats(-0.35, 0.35), st.floats(0.3, 3.0))


@given(places)
def test_silhouette_is_the_image_of_the_outline(place: tuple[float, float, float]) -> None:
    x, y, radius = CAMERA.silhouette(place, RADIUS_M)
    points = CAMERA.project(outline(np.array(place), RADIUS_M))
    middle = (points.min(axis=0) + points.max(axis=0)) / 2  # of an ellipse: its centre
    shifted = points - middle
    area = 0.5 * abs(np.sum(shifted[:, 0] * np.roll(shifted[:, 1], -1) - shifted[:, 1] * np.roll(shifted[:, 0], -1)))
    assert np.allclose([x[0], y[0]], middle, atol=1e-3)
    assert radius[0] == pytest.approx(np.sqrt(area / np.pi), rel=1e-5)


@given(places)
def test_ball_centre_is_the_inverse_of_silhouette(place: tuple[float, float, float]) -> None:
    assert np.allclose(CAMERA.ball_centre_m(*CAMERA.silhouette(place, RADIUS_M), RADIUS_M), place, atol=1e-9)


def test_a_ball_beside_the_camera_has_no_radius_and_warns_of_nothing() -> None:
    """It reaches to both sides of the camera's plane; the next one is as wide, and before it."""
    radius = CAMERA.silhouette([[1.0, 0.0, 0.5 * RADIUS_M], [1.0, 0.0, 2.0 * RADIUS_M]], RADIUS_M)[2]
    assert np.isnan(radius[0])
    assert radius[1] > 0


def test_silhouettes_equal_the_independent_simulators(samples) -> None:
    with h5py.File(samples / "flight_mixed.h5") as file:
        truth = {name: file[f"truth/{name}"][:] for name in ("position_m", "x_px", "y_px", "radius_px")}
    x, y, radius = CAMERA.silhouette(truth["position_m"], RADIUS_M)
    assert np.allclose(x, truth["x_px"], atol=1e-6)
    assert np.allclose(y, truth["y_px"], atol=1e-6)
    assert np.allclose(radius, truth["radius_px"], atol=1e-6)


@given(st.floats(0, 1279), st.floats(0, 719))
def test_rays_undo_the_lens(x: float, y: float) -> None:
    assert np.allclose(LENS.project(LENS.rays(x, y)), [[x, y]], atol=1e-3)


def test_defaults_are_the_papers_camera() -> None:
    assert pytest.approx(1646.09, abs=0.01) == CAMERA.focal_px
    assert (CAMERA.principal_x_px, CAMERA.principal_y_px) == (639.5, 359.5)


def test_up_must_be_a_direction() -> None:
    with pytest.raises(ParameterError, match="up"):
        Camera.of(CameraParameters(up=(0.0, 0.0, 0.0)), 1280, 720)
