"""Contrast against the samples' truth, fed by the chain's logo and spin stages (it is not yet a stage of the chain)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from app.session import Choices, Session
from pipeline.results import SpinEstimate
from pipeline.stages import contrast

BALLS = {"spinner_ball2_side": (528.43, 426.87, 16.49), "spinner_ball5_back_no_logo": (606.67, 302.79, 16.47)}


def answer(samples: Path, name: str) -> tuple[SpinEstimate, np.ndarray]:
    """The last estimate with a ball in view, and the true spin in rps."""
    session = Session.open(samples / f"{name}.h5", Choices(fixed_ball=BALLS.get(name)))
    parameters = contrast.ContrastParameters()
    state = contrast.start(parameters, session.chain.setting(session.parameters))
    estimates = []
    for tick in session.ticks(forget=("surface",)):
        result = contrast.step(parameters, state, tick.packet, tick.track, tick.logo, tick.spin)
        if tick.track.has_ball:
            estimates.append(result.estimate)
    assert session.truth is not None
    return estimates[-1], session.truth.spin_rps[0]


@pytest.mark.parametrize("name", ["spinner_ball2_side", "flight_fast_top", "flight_back"])
def test_a_visible_logo_gives_the_spin(samples: Path, name: str) -> None:
    estimate, truth = answer(samples, name)
    assert estimate.vector_rps is not None
    assert estimate.magnitude_rps == pytest.approx(np.linalg.norm(truth), abs=0.3)
    assert np.linalg.norm(np.cross(estimate.vector_rps, truth)) < np.sin(np.radians(5)) * truth @ truth
    assert estimate.vector_rps @ truth > 0


@pytest.mark.parametrize("name", ["flight_side", "spinner_ball5_back_no_logo"])
def test_a_hidden_logo_is_refused(samples: Path, name: str) -> None:
    estimate, _ = answer(samples, name)
    assert estimate.status == "refused"
    assert "logo was not seen" in str(estimate.reason)
