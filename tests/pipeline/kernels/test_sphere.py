"""Rays that meet the ball, and how a spin moves its surface in the image."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from spinscope.pipeline.kernels.sphere import intersect_ball, spin_rows, surface_velocity
from tests.reference.sphere import image_velocity
from tests.spinning_ball import CAMERA, turns

RADIUS_M = 0.02
seeds = st.integers(0, 10_000)


def on_the_ball(seed: int, count: int = 50) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A centre somewhere in view, and points and normals of its visible side."""
    rng = np.random.default_rng(seed)
    centre = np.array([*rng.uniform(-0.5, 0.5, 2), rng.uniform(1.0, 3.0)])
    e = rng.normal(size=(count, 3))
    e /= np.linalg.norm(e, axis=1, keepdims=True)
    e[e @ centre > 0] *= -1
    return centre, centre + RADIUS_M * e, e


@given(seed=seeds)
def test_a_ray_meets_the_point_it_was_aimed_at(seed: int) -> None:
    centre, points, e = on_the_ball(seed)
    visible = np.sum(e * points, axis=1) < -1e-3  # the side towards the camera, not just towards its half space
    rays = points / points[:, 2:]
    met, normals = intersect_ball(rays, np.zeros(len(rays), np.int64), 0.0, 1.0, centre[None], RADIUS_M)
    np.testing.assert_allclose(met[visible], points[visible], atol=1e-7)
    np.testing.assert_allclose(normals[visible], e[visible], atol=1e-5)
    assert np.all(normals @ centre < 0)


def test_a_ray_that_misses_gives_the_outline_nearest_to_it() -> None:
    ray = np.array([[0.5, 0.0, 1.0]])
    point, normal = intersect_ball(ray, np.zeros(1, np.int64), 0.0, 1.0, np.array([[0.0, 0.0, 2.0]]), RADIUS_M)
    assert abs(float(normal[0] @ ray[0])) < 1e-12
    np.testing.assert_allclose(np.linalg.norm(point[0] - [0, 0, 2]), RADIUS_M)


def test_the_centre_moves_evenly_between_its_knots() -> None:
    knots = np.array([[0.0, 0.0, 2.0], [0.02, 0.0, 2.0], [0.02, 0.02, 1.9]])
    t_us = np.array([0, 250, 500, 750, 1000], np.int64)
    expected = np.array([[0, 0, 2], [0.01, 0, 2], [0.02, 0, 2], [0.02, 0.01, 1.95], [0.02, 0.02, 1.9]])
    points, normals = intersect_ball(expected / expected[:, 2:], t_us, 0.0, 1000.0, knots, RADIUS_M)
    np.testing.assert_allclose(points - RADIUS_M * normals, expected, atol=1e-12)


@given(seed=seeds, spin=st.tuples(*[st.floats(-900, 900)] * 3))
def test_image_velocity_is_how_projected_points_move(seed: int, spin: tuple[float, float, float]) -> None:
    centre, points, e = on_the_ball(seed)
    omega, dt_s = np.array(spin), 1e-7
    if np.linalg.norm(omega) < 1.0:
        return
    turn = turns(omega, np.array([-dt_s, dt_s]))
    before, after = (CAMERA.project(centre + RADIUS_M * e @ rotation.T) for rotation in turn)
    moved = image_velocity(points, e, omega, CAMERA.focal_px, RADIUS_M)
    np.testing.assert_allclose(moved, (after - before) / (2 * dt_s), rtol=1e-4, atol=0.05)


@given(seed=seeds, spin=st.tuples(*[st.floats(-900, 900)] * 3))
def test_tangency_gives_the_surface_velocity_back(seed: int, spin: tuple[float, float, float]) -> None:
    """Equation v_flow in perspective: V is exactly spin x R e, and e . V = 0 whatever the flow."""
    _, points, e = on_the_ball(seed)
    keep = np.sum(e * points, axis=1) < -0.1  # off the outline
    points, e, omega = points[keep], e[keep], np.array(spin)
    u = image_velocity(points, e, omega, CAMERA.focal_px, RADIUS_M)
    velocity = surface_velocity(points, e, u[:, 0].copy(), u[:, 1].copy(), CAMERA.focal_px)
    np.testing.assert_allclose(velocity, RADIUS_M * np.cross(omega, e), atol=1e-8)
    any_flow = np.random.default_rng(seed).normal(0, 5000, (2, len(e)))
    anywhere = surface_velocity(points, e, any_flow[0], any_flow[1], CAMERA.focal_px)
    np.testing.assert_allclose(np.sum(e * anywhere, axis=1), 0.0, atol=1e-9)


@given(seed=seeds, spin=st.tuples(*[st.floats(-900, 900)] * 3))
def test_a_row_gives_the_velocity_along_its_direction(seed: int, spin: tuple[float, float, float]) -> None:
    _, points, e = on_the_ball(seed)
    angle = np.random.default_rng(seed).uniform(0, 2 * np.pi, len(e))
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    rows = spin_rows(points, e, direction, CAMERA.focal_px, RADIUS_M)
    u = image_velocity(points, e, np.array(spin), CAMERA.focal_px, RADIUS_M)
    np.testing.assert_allclose(rows @ np.array(spin), np.sum(u * direction, axis=1), atol=1e-6)
