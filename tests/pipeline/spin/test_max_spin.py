"""Highest spin: no method answers beyond it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from spinscope.pipeline.results import SpinEstimate
from spinscope.pipeline.session import Choices, Session

HIGHEST_RPS = 30.0


def test_no_method_answers_beyond_the_highest_spin(samples: Path) -> None:
    """A ball of 54 rps with the outline's flow among the logo's, which gives hundreds of rps."""
    choices = Choices(assignments=(f"spin.max_spin_rps={HIGHEST_RPS}", "logo.pad_px=0"))
    result = Session.open(samples / "flight_fast_top.h5", choices).estimate()
    estimates = [estimate for tick in result.ticks if tick.balls for estimate in tick.estimates.values()]
    assert all((estimate.magnitude_rps or 0.0) <= 1.02 * HIGHEST_RPS for estimate in estimates)
    refusing = {estimate.method for estimate in estimates if "above spin.max_spin_rps" in (estimate.reason or "")}
    assert refusing >= {"triplet", "contrast", "combined"}


@pytest.mark.parametrize(
    ("rps", "std_rps", "answered"), [(150.4, 0.5, True), (150.6, 0.5, False), (152.9, 50.0, True), (153.1, 50.0, False)]
)
def test_a_spin_may_be_above_the_highest_by_its_error_and_2_percent(rps: float, std_rps: float, answered: bool) -> None:
    estimate = SpinEstimate("contrast", np.array([0.0, -rps, 0.0]), std_rps**2 * np.eye(3), None).up_to(150.0)
    assert (estimate.status == "ok") == answered
