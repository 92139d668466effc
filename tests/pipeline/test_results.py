"""Spin estimates: stated errors against independent formulas; and the report of a shot, column by column."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spinscope.pipeline.camera import Camera, CameraParameters
from spinscope.pipeline.results import SpinEstimate
from spinscope.pipeline.shots import Shot

CAMERA = Camera.of(CameraParameters(), 1280, 720)


def covariance(seed: int, std_rps: float) -> np.ndarray:
    """A full (3, 3) covariance with standard deviations about this large."""
    mixing = np.random.default_rng(seed).normal(size=(3, 3))
    return std_rps**2 * mixing @ mixing.T / 3


@given(seed=st.integers(0, 1000), spin=st.tuples(*[st.floats(-80, 80)] * 3).filter(lambda s: np.linalg.norm(s) > 20))
def test_stated_errors_are_the_spread_of_spins_drawn_with_the_covariance(
    seed: int, spin: tuple[float, float, float]
) -> None:
    """To first order, as 1 sigma: small errors, many draws."""
    vector, spread = np.array(spin), covariance(seed, 0.02)
    estimate = SpinEstimate("toy", vector, spread, None)
    drawn = vector + np.random.default_rng(seed).multivariate_normal(np.zeros(3), spread, 4000)
    lengths = np.linalg.norm(drawn, axis=1)
    assert estimate.magnitude_rps == pytest.approx(np.linalg.norm(vector))
    assert estimate.magnitude_std_rps == pytest.approx(lengths.std(), rel=0.1)
    off_rad = np.linalg.norm(drawn / lengths[:, None] - vector / np.linalg.norm(vector), axis=1)
    assert estimate.axis_std_deg == pytest.approx(math.degrees(np.sqrt(np.mean(off_rad**2))), rel=0.1)


def test_the_errors_of_an_axis_that_is_open_end_at_180_degrees() -> None:
    assert SpinEstimate("toy", np.array([1.0, 0, 0]), np.eye(3) * 100.0, None).axis_std_deg == 180.0
    assert SpinEstimate("toy", np.array([40.0, 0, 0]), np.eye(3) * 100.0, None).axis_std_deg < 180.0


def test_without_a_spin_there_is_no_error_to_state() -> None:
    refused, still = SpinEstimate.refused("toy", "dark", 3, "other"), SpinEstimate("toy", np.zeros(3), np.eye(3), None)
    assert refused.to_dict() == {
        "status": "refused", "reason": "dark", "vector_rps": None, "magnitude_rps": None, "magnitude_std_rps": None,
        "axis": None, "axis_std_deg": None,
    }  # fmt: skip
    assert (refused.events, refused.against) == (3, "other")
    assert still.to_dict()["status"] == "ok" and still.magnitude_rps == 0.0
    assert still.axis is still.magnitude_std_rps is still.axis_std_deg is None


def test_the_report_of_a_shot_has_every_number_in_its_own_column() -> None:
    """All columns differ, so that none can stand for another."""
    count = 4
    state = np.array([[300.0, 200.0, 4000.0, -1500.0, 17.0]]) + np.arange(count)[:, None] * [20.0, -7.5, 3.0, 2.0, 0.1]
    std = np.array([[0.1, 0.2, 30.0, 40.0, 0.5]]) + np.arange(count)[:, None] * 0.01
    estimates = {
        "normal_flow": SpinEstimate("normal_flow", np.array([3.0, 0.0, -4.0]), np.diag([0.04, 0.0, 0.09]), None, 700),
        "contrast": SpinEstimate.refused("contrast", "too dark"),
    }
    t_us = 12_345.0 + 5000.0 * np.arange(count)
    measured = np.array([True, False, True, True])
    shot = Shot(
        10_000, 30_000, t_us, state, std, measured, 812, estimates, "normal_flow",
        best_reason="dusk", began_by="bounce", ended_by="hit",
    )  # fmt: skip
    report = shot.to_dict(CAMERA, 0.02)
    assert json.loads(json.dumps(report)) == report
    columns = report.pop("track")
    assert columns.pop("t_us") == t_us.tolist()
    assert columns.pop("measured") == [1, 0, 1, 1]
    for index, name in enumerate(("x_px", "y_px", "vx_px_s", "vy_px_s", "radius_px")):
        assert columns.pop(name) == state[:, index].tolist(), name
    for index, name in ((0, "x_std_px"), (1, "y_std_px"), (4, "radius_std_px")):
        assert columns.pop(name) == std[:, index].tolist(), name
    assert columns == {}
    places_m = np.array([_place_m(*row[[0, 1, 4]]) for row in state])
    speed_m_s = np.linalg.norm(np.polyfit((t_us - t_us[0]) * 1e-6, places_m, 1)[0])
    assert report.pop("speed_m_s") == pytest.approx(speed_m_s, rel=1e-3)
    spin = report.pop("spin")
    assert spin["contrast"]["reason"] == "too dark" and spin["normal_flow"]["reason"] is None
    assert spin["normal_flow"]["vector_rps"] == [3.0, 0.0, -4.0]
    assert spin["normal_flow"]["axis"] == pytest.approx([0.6, 0.0, -0.8])
    assert spin["normal_flow"]["magnitude_rps"] == pytest.approx(5.0)
    assert spin["normal_flow"]["magnitude_std_rps"] == pytest.approx(math.sqrt(0.36 * 0.04 + 0.64 * 0.09))
    across_rps = math.sqrt(0.64 * 0.04 + 0.36 * 0.09)
    assert spin["normal_flow"]["axis_std_deg"] == pytest.approx(math.degrees(across_rps / 5.0))
    how = {"began_by": "bounce", "ended_by": "hit", "best": "normal_flow", "best_reason": "dusk", "witnesses": []}
    assert report == {"start_us": 10_000, "end_us": 30_000, "logo_events": 812, **how}


def _place_m(x_px: float, y_px: float, radius_px: float) -> np.ndarray:
    """Centre of a small ball with this silhouette: an ellipse, 1 + rho^2 longer along rho than its distance says."""
    ray = np.array([(x_px - 639.5) / 1646.09, (y_px - 359.5) / 1646.09, 1.0])
    return ray * (ray @ ray) ** 0.25 * 0.02 * 1646.09 / radius_px


def test_a_single_tick_has_no_speed() -> None:
    one = np.array([[300.0, 200.0, 4000.0, 0.0, 17.0]])
    shot = Shot(0, 5000, np.array([5000.0]), one, one, np.array([True]), None, {}, None)
    assert shot.to_dict(CAMERA, 0.02)["speed_m_s"] is None
