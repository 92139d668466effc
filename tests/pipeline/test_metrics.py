"""Metrics of a run: jitter, errors against the truth, and the sentence for a coach."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from spinscope.pipeline.metrics import RunMetrics, _jitter_px, coach_sentence
from spinscope.pipeline.results import Circle, SpinEstimate
from spinscope.pipeline.session import Session
from spinscope.pipeline.spin_terms import kind_of_spin


def test_the_jitter_of_a_smooth_track_is_the_noise_put_on_it() -> None:
    random = np.random.default_rng(3)
    sigma = 0.2
    places = np.stack([np.linspace(0, 800, 400), np.linspace(0, 300, 400)], axis=1) + sigma * random.standard_normal(
        (400, 2)
    )
    ticks: list[Any] = [
        SimpleNamespace(track=SimpleNamespace(measured=Circle(x, y, 20.0, 1.0), shot=0)) for x, y in places
    ]
    assert _jitter_px(ticks) == pytest.approx(sigma, rel=0.1)
    assert _jitter_px(ticks[:2]) is None


def test_metrics_agree_with_the_ticks_and_the_truth(samples: Path) -> None:
    finished = Session.open(samples / "flight_fast_top.h5").estimate_keeping_ticks()
    found = RunMetrics.of(finished)
    assert found.ticks == len(finished.ticks)
    assert found.logo_events == sum(len(tick.logo.events) for tick in finished.ticks)
    estimate, own = found.shots[0].spin["triplet"], finished.shots[0].estimates["triplet"]
    assert estimate.magnitude_rps == own.magnitude_rps
    # By the cosine rule from what else is told: |spin - truth| / |truth|.
    truth = finished.session.truth
    assert truth is not None and own.magnitude_rps is not None and estimate.error_deg is not None
    size = float(np.linalg.norm(truth.spin_rps[len(truth.t_us) // 2]))
    angle = np.radians(estimate.error_deg)
    gap = np.sqrt(size**2 + own.magnitude_rps**2 - 2 * size * own.magnitude_rps * np.cos(angle))
    assert estimate.error_share == pytest.approx(gap / size, rel=0.02)


def test_flights_that_fall_otherwise_are_a_doubt(samples: Path) -> None:
    for up, is_doubted in (((0.0, 0.0, -1.0), False), ((0.0, -0.6, -0.8), True)):
        session = Session.open(samples / "own" / "shot_slow_top.h5")
        session.parameters = session.parameters.with_values({"camera": {"up": up}})
        doubt = RunMetrics.of(session.estimate_keeping_ticks()).up_doubt
        assert (doubt is not None) == is_doubted
        assert doubt is None or "do not fall against camera.up = 0,-0.6,-0.8" in doubt


def test_the_coach_is_told_in_one_sentence() -> None:
    up, forward = (0.0, 0.0, -1.0), np.array([8.9, 0.0, 0.0])
    spin = 54.0 * np.array([0.0, -np.cos(np.radians(12)), np.sin(np.radians(12))])
    estimate = SpinEstimate("contrast", spin, 4.0 * np.eye(3), None)
    said = coach_sentence(estimate, kind_of_spin(spin, forward, up), forward)
    assert said == "Topspin 54 ± 2 rps (3240 rpm), 32 km/h, axis tilted 12° from pure topspin"
    in_place = coach_sentence(estimate, kind_of_spin(spin, None, up), None)
    assert in_place == "Spin 54 ± 2 rps (3240 rpm), axis up the image, tilted by 12°"
    sure = SpinEstimate("contrast", spin, 0.01 * np.eye(3), None)
    assert coach_sentence(sure, kind_of_spin(spin, None, up), None).startswith("Spin 54.0 ± 0.1 rps")
    assert coach_sentence(None, None, forward) == "Spin not known, 32 km/h"
