"""Kinds of spin against the check in CONTRACTS and against what a spin does to the ball's surface."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spinscope.pipeline.results import SpinEstimate
from spinscope.pipeline.spin_terms import axis_words, kind_of_spin, km_h, rpm, speed_words, std_words

LOOKING_DOWN = (0.0, 0.0, -1.0)
angles = st.floats(-180, 180)


def turned(angle_deg: float, vector: tuple[float, float, float]) -> np.ndarray:
    """The vector turned about z."""
    cos, sin = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    return np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]]) @ np.array(vector, float)


def test_topspin_moves_the_surface_nearest_the_camera_forward():
    """The check of CONTRACTS: flying to +x under a camera that looks down."""
    flight, nearest = np.array([7.0, 0.0, 0.0]), np.array([0.0, 0.0, -1.0])
    for spin in np.array([[0, 50, 0], [0, -50, 0]], float):
        surface_velocity = np.cross(spin, nearest)
        name = kind_of_spin(spin, flight, LOOKING_DOWN).name
        assert name == ("topspin" if surface_velocity @ flight > 0 else "backspin")
    assert kind_of_spin(np.array([0.0, -50.0, 0.0]), flight, LOOKING_DOWN).name == "topspin"


@pytest.mark.parametrize(
    ("spin", "name"),
    [
        ((0, -1, 0), "topspin"),
        ((0, 1, 0), "backspin"),
        ((0, 0, -1), "left sidespin"),
        ((0, 0, 1), "right sidespin"),
        ((1, 0, 0), "corkscrew"),
        ((-1, 0, 0), "reverse corkscrew"),
    ],
)
@given(angle_deg=angles)
def test_turning_the_scene_changes_no_name(spin, name, angle_deg):
    kind = kind_of_spin(turned(angle_deg, spin) * 40, turned(angle_deg, (8, 0, 0)), LOOKING_DOWN)
    assert kind.name == name
    assert kind.off_deg == pytest.approx(0, abs=1e-4)


def test_left_sidespin_curves_to_the_left_seen_along_the_flight():
    """The Magnus force points along spin x velocity; left, seen from above along the flight, is up x velocity."""
    flight = np.array([8.0, 0.0, 0.0])
    spin = np.array([0.0, 0.0, -40.0])
    assert np.cross(spin, flight) @ np.cross(LOOKING_DOWN, flight) > 0
    assert kind_of_spin(spin, flight, LOOKING_DOWN).name == "left sidespin"


def test_a_mixture_is_named_by_its_largest_part_and_says_the_rest():
    kind = kind_of_spin(np.array([0.0, -40.0, 30.0]), np.array([8.0, 0.0, 0.0]), LOOKING_DOWN)
    assert kind.name == "topspin"
    assert kind.off_deg == pytest.approx(np.degrees(np.arctan2(30, 40)))
    assert kind.parts_rps == pytest.approx({"topspin": 40, "left sidespin": -30, "corkscrew": 0})
    assert kind.sentence == "topspin with right sidespin (axis tilted 37° from pure topspin)"


def test_a_mixture_of_opposites_says_both():
    """Backspin with right sidespin and reverse corkscrew: names of negative parts, by size; small ones unsaid."""
    kind = kind_of_spin(np.array([-25.0, 40.0, 30.0]), np.array([8.0, 0.0, 0.0]), LOOKING_DOWN)
    assert kind.name == "backspin"
    assert kind.off_deg == pytest.approx(np.degrees(np.arctan2(np.hypot(25, 30), 40)))
    assert kind.sentence == "backspin with right sidespin and reverse corkscrew (axis tilted 44° from pure backspin)"
    assert kind_of_spin(np.array([0.5, 40.0, 0.5]), np.array([8.0, 0.0, 0.0]), LOOKING_DOWN).sentence == (
        "backspin (axis tilted 1° from pure backspin)"
    )


def test_another_up_direction_names_another_kind():
    """A camera that looks at the table from the side, with y down: up is -y."""
    spin, flight = np.array([0.0, 0.0, 50.0]), np.array([8.0, 0.0, 0.0])
    assert kind_of_spin(spin, flight, LOOKING_DOWN).name == "right sidespin"
    assert kind_of_spin(spin, flight, (0.0, -1.0, 0.0)).name == "topspin"


def test_a_ball_in_place_has_only_an_axis():
    kind = kind_of_spin(np.array([49.5, -2.3, 6.7]), None, LOOKING_DOWN)
    assert kind.name == "axis to the right in the image"
    assert kind.parts_rps == {}
    assert kind.sentence == "axis to the right in the image, tilted by 8°"
    assert kind_of_spin(np.array([0.0, 0.0, -3.0]), None, LOOKING_DOWN).name == "axis towards the camera"


@pytest.mark.parametrize("flight", [(0, 0, 0), (0, 0, 5), (0.1, 0, -5)])
def test_no_flight_or_a_vertical_one_names_the_axis(flight):
    kind = kind_of_spin(np.array([0.0, 30.0, 0.0]), np.array(flight, float), LOOKING_DOWN)
    assert kind.name == "axis down the image"


def test_no_spin():
    kind = kind_of_spin(np.zeros(3), np.array([8.0, 0.0, 0.0]), LOOKING_DOWN)
    assert kind.name == kind.sentence == "no spin"


def test_units():
    assert rpm(50) == 3000
    assert km_h(10) == pytest.approx(36)
    assert speed_words(np.array([3.0, 4.0, 0.0])) == "5.0 m/s (18 km/h)"
    assert speed_words(None) == "in place"


def test_estimates_in_words():
    vector, covariance = np.array([50.0, 0.0, 0.0]), np.diag([0.25, 1.0, 1.0])
    estimate = SpinEstimate("triplet", vector, covariance, None, 100)
    assert axis_words(estimate) == "(+1.00, +0.00, +0.00) ± 1.6°"
    assert [std_words(std) for std in (0.5, 0.04)] == ["0.5", "0.04"]
    refused = SpinEstimate.refused("triplet", "no flow")
    assert axis_words(refused) == "–"
