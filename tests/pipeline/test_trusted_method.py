"""Which method is trusted."""

from __future__ import annotations

import numpy as np
import pytest

from spinscope.pipeline.registry import distrust_reason, trusted_method
from spinscope.pipeline.results import SpinEstimate


def estimate(method: str, std_rps: float | None) -> SpinEstimate:
    """50 rps around x with this uncertainty in all directions; refused for None."""
    if std_rps is None:
        return SpinEstimate.refused(method, "no logo")
    return SpinEstimate(method, np.array([50.0, 0.0, 0.0]), np.eye(3) * std_rps**2, None)


@pytest.mark.parametrize(
    ("contrast_rps", "normal_flow_rps", "best"),
    [
        (1.0, 1.0, "contrast"),
        (8.0, 1.0, "contrast"),  # it has refused by itself what it does not stand for
        (None, 1.0, "normal_flow"),
        (None, 6.0, None),  # 10 degrees across, 6 rps along: unsure
        (None, None, None),
    ],
)
def test_contrast_comes_first_then_normal_flow_where_it_is_sure(
    contrast_rps: float | None, normal_flow_rps: float | None, best: str | None
) -> None:
    estimates = {
        "triplet": estimate("triplet", 0.1),
        "normal_flow": estimate("normal_flow", normal_flow_rps),
        "contrast": estimate("contrast", contrast_rps),
    }
    assert trusted_method(estimates) == best


def test_what_contrast_speaks_against_is_not_trusted() -> None:
    against = SpinEstimate.refused("contrast", "the normal flow says otherwise", against="normal_flow")
    assert trusted_method({"normal_flow": estimate("normal_flow", 1.0), "contrast": against}) is None


def test_normal_flow_does_not_answer_where_contrast_does_and_all_witnesses_leave_another_spin_open() -> None:
    flow = {"normal_flow": estimate("normal_flow", 1.0)}
    open_ = {"combined": SpinEstimate.refused("combined", "two spins are left open")}
    assert trusted_method(flow | open_ | {"contrast": estimate("contrast", 8.0)}) is None
    assert trusted_method(flow | open_ | {"contrast": estimate("contrast", None)}) == "normal_flow"


def test_methods_that_were_not_run_are_not_missed() -> None:
    assert trusted_method({"normal_flow": estimate("normal_flow", 1.0)}) == "normal_flow"
    assert trusted_method({"triplet": estimate("triplet", 0.1)}) is None
    assert trusted_method({}) is None


def normal_flow(magnitude_rps: float, magnitude_std_rps: float, axis_std_deg: float) -> dict[str, SpinEstimate]:
    """Normal flow's estimate alone, around an axis off the camera's, with these stated errors."""
    axis = np.array([0.48, -0.64, 0.6])
    along = np.outer(axis, axis)
    each_rps2 = 0.5 * (np.radians(axis_std_deg) * magnitude_rps) ** 2
    estimate = SpinEstimate(
        "normal_flow", magnitude_rps * axis, magnitude_std_rps**2 * along + each_rps2 * (np.eye(3) - along), None
    )
    assert estimate.magnitude_std_rps == pytest.approx(magnitude_std_rps)
    assert estimate.axis_std_deg == pytest.approx(axis_std_deg)
    return {"normal_flow": estimate}


@pytest.mark.parametrize(
    ("magnitude_rps", "magnitude_std_rps", "axis_std_deg", "trusted"),
    [
        (50.0, 1.0, 6.9, True),
        (50.0, 1.0, 7.1, False),
        (10.0, 2.9, 1.0, True),  # 3 rps, however slow the spin
        (10.0, 3.1, 1.0, False),
        (100.0, 9.9, 1.0, True),  # a tenth, where that is more: neither their sum nor the smaller one
        (100.0, 10.1, 1.0, False),
        (31.0, 3.05, 1.0, True),
        (29.0, 3.05, 1.0, False),
        (100.0, 9.9, 6.9, True),
        (10.0, 0.1, 20.0, False),
    ],
)
def test_normal_flow_is_trusted_up_to_its_limits_and_no_further(
    magnitude_rps: float, magnitude_std_rps: float, axis_std_deg: float, trusted: bool
) -> None:
    estimates = normal_flow(magnitude_rps, magnitude_std_rps, axis_std_deg)
    assert trusted_method(estimates) == ("normal_flow" if trusted else None)


def test_a_refusal_against_another_method_leaves_normal_flow_trusted() -> None:
    refused = SpinEstimate.refused("contrast", "it says otherwise", against="triplet")
    assert trusted_method({**normal_flow(50.0, 1.0, 2.0), "contrast": refused}) == "normal_flow"
    assert trusted_method({"normal_flow": SpinEstimate("normal_flow", np.zeros(3), np.eye(3), None)}) is None


def test_the_trajectory_is_trusted_only_where_no_logo_tells_the_spin() -> None:
    sure = {"trajectory": estimate("trajectory", 1.0)}
    assert trusted_method(sure) == "trajectory"
    assert trusted_method({**sure, "contrast": estimate("contrast", 8.0)}) == "contrast"
    assert trusted_method({**sure, "normal_flow": estimate("normal_flow", 1.0)}) == "normal_flow"
    assert trusted_method({**sure, "normal_flow": estimate("normal_flow", 6.0)}) == "trajectory"
    assert trusted_method({**sure, "contrast": estimate("contrast", None)}) == "trajectory"
    assert trusted_method({"trajectory": estimate("trajectory", 13.0)}) is None, "an axis of 21 degrees is too wide"
    for std_rps, trusted in ((16.0, "trajectory"), (17.0, None)):
        wide = SpinEstimate("trajectory", np.array([50.0, 0.0, 0.0]), np.diag([std_rps**2, 1.0, 1.0]), None)
        assert trusted_method({"trajectory": wide}) == trusted, "a third of 50 rps"


def test_where_none_is_trusted_the_reason_is_the_tracks_or_the_methods_own() -> None:
    refused = {name: SpinEstimate.refused(name, f"{name} says no") for name in ("triplet", "normal_flow", "contrast")}
    assert distrust_reason(refused) == "Contrast maximisation: contrast says no"
    with_flight = {**refused, "trajectory": SpinEstimate.refused("trajectory", "too short")}
    assert distrust_reason(with_flight) == "Contrast maximisation: contrast says no; Trajectory: too short"
    assert distrust_reason({"triplet": estimate("triplet", 0.1)}) == (
        "the methods that were run answer, but are not sure enough to be trusted alone"
    )
    trusted = {"contrast": estimate("contrast", 1.0)}
    assert distrust_reason(trusted) is None
    assert trusted_method(trusted, "the ball stays") is None
    assert distrust_reason(trusted, "the ball stays") == "the ball stays"
