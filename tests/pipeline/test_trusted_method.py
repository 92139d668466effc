"""Which method is trusted."""

from __future__ import annotations

import numpy as np
import pytest

from spinscope.pipeline.registry import trusted_method
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


def test_methods_that_were_not_run_are_not_missed() -> None:
    assert trusted_method({"normal_flow": estimate("normal_flow", 1.0)}) == "normal_flow"
    assert trusted_method({"triplet": estimate("triplet", 0.1)}) is None
    assert trusted_method({}) is None
