"""A spin that changes within a flight is seen in its ends, and no estimate from both is trusted."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

import spinscope
from spinscope.pipeline.kernels.arrays import Floats
from spinscope.pipeline.spin.contrast import ContrastParameters
from spinscope.pipeline.spin.contrast.estimate import estimates_of_ends
from spinscope.pipeline.spin.contrast.events import BallUncertainty, ContrastEstimate, ContrastSettings, SphereEvents
from spinscope.pipeline.spin.contrast.stage import change_doubt
from spinscope.pipeline.stages import track
from tests.reference.contrast import dotted_ball

BALL = BallUncertainty(centre_std_px=0.2, radius_std_px=0.2)
SPIN, NEAR, FAR = np.array([40.0, -25.0, 20.0]), np.array([48.0, -20.0, 26.0]), np.array([25.0, 25.0, -30.0])


def ends_of(before: Floats, after: Floats, settings: ContrastSettings) -> tuple[ContrastEstimate, ...] | None:
    """Estimates of the ends of 60 ms, in whose middle the spin changes; that of the whole is the first one."""
    first, last = (dotted_ball(spin, duration_s=0.06, events=1200) for spin in (before, after))
    parts = first.at(first.t_s < 0.0), last.at(last.t_s >= 0.0)
    columns = (np.concatenate([getattr(part, name) for part in parts], axis=-1) for name in SphereEvents.__slots__)
    whole = ContrastEstimate(before, np.eye(3), 1200, contrast=1.0, patch_rad=0.3)
    return estimates_of_ends(SphereEvents(*columns), (BALL, BALL), settings, whole)


@pytest.mark.parametrize(("after", "changes"), [(SPIN, False), (NEAR, True), (FAR, True)])
def test_each_end_has_its_own_spin(after: Floats, changes: bool) -> None:
    ends = ends_of(SPIN, after, ContrastSettings())
    assert ends is not None
    for end, spin in zip(ends, (SPIN, after), strict=True):
        assert end.spin_rps is not None and np.linalg.norm(end.spin_rps - spin) < 0.04 * np.linalg.norm(spin)
    assert (change_doubt(ContrastParameters(), *ends) is not None) == changes


def test_an_end_with_too_few_events_shows_nothing() -> None:
    assert ends_of(SPIN, FAR, ContrastSettings(min_events=2000)) is None


@pytest.mark.parametrize(("sigmas", "best"), [({}, None), ({"change_sigmas": 100.0}, "contrast")])
def test_a_flight_with_a_missed_bounce_is_refused(
    samples: Path, monkeypatch: pytest.MonkeyPatch, sigmas: Mapping[str, float], best: str | None
) -> None:
    """The ball bounces at 63 ms; without the rule one spin is trusted for both flights."""
    monkeypatch.setattr(track, "find_contact", lambda *_: None)
    result = spinscope.estimate(samples / "own/bounce.h5", {"contrast": sigmas}, window_us=(0, 85_000))
    (shot,) = result.shots
    assert shot.best == best
    assert ("a contact may have been missed" in (shot.best_reason or "")) == (best is None)
