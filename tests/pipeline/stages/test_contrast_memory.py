"""What contrast keeps of a shot, what enters its stated error, and when normal flow is heard."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.results import MethodResult, Packet, SpinEstimate
from spinscope.pipeline.spin.contrast import ContrastParameters
from spinscope.pipeline.spin.contrast import stage as contrast
from spinscope.pipeline.spin.contrast.events import ContrastEstimate
from spinscope.pipeline.spin.contrast.search import even_span_s, without_strays
from spinscope.pipeline.spin.contrast.stage import doubt
from spinscope.pipeline.stages import logo, rate
from spinscope.pipeline.stages.filter import FilterResult
from tests.reference.contrast import dotted_ball
from tests.spinning_ball import CONTEXT, known_ball, packets, spinning_ball

SPIN_RPS = np.array([40.0, 0.0, 20.0])
SILENT = MethodResult(SpinEstimate.refused("normal_flow", "nothing yet"))
NO_RHYTHM = rate.absent(rate.RateParameters(), "nothing yet")


def seen(packet: Packet, **known: float) -> logo.LogoResult:
    """The logo of a ball that stays, with what is said of how well the ball is known."""
    parameters = logo.LogoParameters(delay_us=0.0)
    state, filtered = logo.start(parameters, CONTEXT), FilterResult(packet.events, packet.events, packet.events)
    return dataclasses.replace(logo.step(parameters, state, packet, filtered, known_ball(packet.end_us)), **known)


def ticks() -> list[Packet]:
    return list(packets(spinning_ball(SPIN_RPS, duration_us=40_000)))


@pytest.mark.parametrize("window_us", [5000, 15_000, 20_000, 500_000])
def test_events_and_places_older_than_the_window_are_forgotten_together(window_us: int) -> None:
    parameters = ContrastParameters(window_us=window_us, fewest_events=10_000)
    state = contrast.start(parameters, CONTEXT)
    for number, packet in enumerate(ticks(), start=1):
        known = {"position_std_px": float(number), "radius_std_px": 0.1 * number, "velocity_std_px_s": 10.0 * number}
        contrast.step(parameters, state, packet, known_ball(packet.end_us), NO_RHYTHM, seen(packet, **known), SILENT)
        kept = list(range(max(1, number - window_us // 5000 + 1), number + 1))
        assert [end_us for end_us, _ in state.parts] == [5000 * one for one in kept]
        assert [stds[0] for stds in state.ball_stds] == kept
        uncertainty = contrast._uncertainty(state.ball_stds)
        middle = float(np.median(kept))
        assert uncertainty.centre_std_px == pytest.approx(middle)
        assert uncertainty.track_std_px == pytest.approx(middle)
        assert uncertainty.radius_std_px == pytest.approx(0.1 * middle)
        assert uncertainty.drift_std_px_s == pytest.approx(10.0 * middle)


def test_a_ball_that_flies_on_while_pixels_wait_is_less_sure_of_its_place() -> None:
    """25 us at 8000 px/s are 0.2 px."""
    parameters = ContrastParameters()
    state = contrast.start(parameters, CONTEXT)
    (packet, *_) = ticks()
    ball = known_ball(packet.end_us)
    flying = dataclasses.replace(ball, mean=np.add(ball.mean, [0, 0, 4800.0, -6400.0, 0]))
    contrast.take(parameters, state, packet, flying, seen(packet, position_std_px=0.15))
    uncertainty = contrast._uncertainty(state.ball_stds)
    assert uncertainty.centre_std_px == pytest.approx(0.25)
    assert uncertainty.track_std_px == pytest.approx(0.15)
    assert uncertainty.latency_std_px == pytest.approx(0.2)


def stated(position_std_px: float, velocity_std_px_s: float, radius_std_px: float = 0.05) -> SpinEstimate:
    """The last estimate of the same ball, known so well."""
    parameters = ContrastParameters(axis_std_deg=180.0, magnitude_std_rps=1000.0)
    state = contrast.start(parameters, CONTEXT)
    for packet in ticks():
        known = {"position_std_px": position_std_px, "velocity_std_px_s": velocity_std_px_s}
        given = seen(packet, radius_std_px=radius_std_px, **known)
        result = contrast.step(parameters, state, packet, known_ball(packet.end_us), NO_RHYTHM, given, SILENT)
    assert result.estimate.status == "ok", result.estimate.reason
    return result.estimate


def test_place_and_drift_of_the_track_enter_the_stated_error() -> None:
    sure, drifting, unsure = stated(0.05, 0.0), stated(0.05, 500.0), stated(1.0, 0.0)
    np.testing.assert_allclose(drifting.vector_rps, sure.vector_rps)
    # A drift looks like a turn about an axis in the image: sqrt(12 / (span / 10 ms)) sigma over the events' span.
    state = contrast.start(ContrastParameters(), CONTEXT)
    for packet in ticks():
        contrast.take(ContrastParameters(), state, packet, known_ball(packet.end_us), seen(packet))
    span_s = even_span_s(without_strays(contrast._joined(state)))
    rate_rps = math.sqrt(12.0 / (span_s / 0.01)) * 0.05 / span_s / known_ball(5000).mean[4] / (2 * math.pi)
    across = np.eye(3) - np.outer(sure.axis, sure.axis)
    added = across @ (drifting.covariance_rps2 - sure.covariance_rps2) @ across
    in_image = rate_rps**2 * np.diag([1.0, 1.0, 0.0])
    np.testing.assert_allclose(added, across @ in_image @ across, rtol=0.1, atol=2e-2 * rate_rps**2)
    assert unsure.axis_std_deg > 1.2 * sure.axis_std_deg


def answered(**changes: Any) -> ContrastEstimate:
    """An answer beyond doubt: 50 rps about x, each component known to 1 rps."""
    sure = ContrastEstimate(np.array([50.0, 0.0, 0.0]), np.eye(3), 300, contrast=1.0, patch_rad=0.4, span_s=0.03)
    return dataclasses.replace(sure, **changes)


def judged(answer: ContrastEstimate, flow: SpinEstimate, **values: float) -> SpinEstimate:
    parameters = ContrastParameters(**values)
    state = contrast.start(parameters, CONTEXT)
    state.answer, state.reason = answer, doubt(parameters, answer)
    state.parts.append((0, dotted_ball(answer.spin_rps)))
    return contrast._result(parameters, state, 300, True, NO_RHYTHM, flow).estimate


@pytest.mark.parametrize(("flow_sigmas", "sigmas"), [(6.0, 5.9), (6.0, 6.1), (2.0, 1.9), (2.0, 2.1)])
@pytest.mark.parametrize("direction", [(1.0, 0.0, 0.0), (0.0, 0.6, -0.8)])
def test_normal_flow_is_heard_from_so_many_sigma_on(
    flow_sigmas: float, sigmas: float, direction: tuple[float, float, float]
) -> None:
    """Of both errors together: 1 rps of contrast, 2 rps of normal flow."""
    other = np.array([50.0, 0.0, 0.0]) + sigmas * math.sqrt(5.0) * np.array(direction)
    flow = SpinEstimate("normal_flow", other, 4.0 * np.eye(3), None)
    estimate = judged(answered(), flow, flow_sigmas=flow_sigmas)
    assert (estimate.status == "ok") == (sigmas < flow_sigmas)
    assert estimate.against == (None if sigmas < flow_sigmas else "normal_flow")
    assert judged(answered(), SILENT.estimate, flow_sigmas=flow_sigmas).status == "ok"


def test_only_where_nothing_turns_is_normal_flow_doubted_with_contrast() -> None:
    flow = SpinEstimate("normal_flow", np.array([50.0, 0.0, 0.0]), np.eye(3), None)
    assert judged(answered(contrast=0.24), flow).against == "normal_flow"
    unsure = judged(answered(covariance_rps2=400.0 * np.eye(3)), flow)
    assert unsure.status == "refused" and unsure.against is None


def test_a_spin_above_the_limit_leaves_no_normal_flow_below_it() -> None:
    flow = SpinEstimate("normal_flow", np.array([147.0, 0.0, 0.0]), 4.0 * np.eye(3), None)
    beyond = judged(answered(spin_rps=np.array([153.5, 0.0, 0.0])), flow)
    assert beyond.status == "refused" and "153.5 rps" in str(beyond.reason) and beyond.against == "normal_flow"


@pytest.mark.parametrize(("magnitude_rps", "against"), [(50.0, None), (25.0, None), (37.0, "normal_flow")])
def test_where_contrast_leaves_two_spins_open_normal_flow_must_be_one_of_them(
    magnitude_rps: float, against: str | None
) -> None:
    rivals = {"rivals_rps": np.array([[25.0, 0.0, 0.0]]), "rival_covariances_rps2": np.eye(3)[None]}
    flow = SpinEstimate("normal_flow", np.array([magnitude_rps, 0.0, 0.0]), np.eye(3), None)
    estimate = judged(answered(**rivals, margins=np.array([0.5])), flow)
    assert estimate.status == "refused" and estimate.against == against


@pytest.mark.parametrize(
    ("scanned_turns", "changes", "settled"),
    [
        (2.05, {}, True),
        (1.95, {}, False),
        (2.05, {"margins": np.array([9.0, 3.7])}, True),  # three times 1.2 sigma
        (2.05, {"margins": np.array([9.0, 3.5])}, False),
        (2.05, {"contrast": 0.86}, True),
        (2.05, {"contrast": 0.84}, False),  # following has lost more than 15 %
    ],
)
def test_an_answer_is_settled_by_a_scan_over_two_turns_with_a_clear_lead(
    scanned_turns: float, changes: dict[str, Any], settled: bool
) -> None:
    parameters = ContrastParameters()
    state = contrast.start(parameters, CONTEXT)
    assert not contrast.is_settled(parameters, state)
    rivals = {"rivals_rps": np.zeros((len(changes.get("margins", ())), 3))}
    state.answer, state.scanned_turns, state.followed_contrast = answered(**changes, **rivals), scanned_turns, 1.0
    assert contrast.is_settled(parameters, state) == settled
    state.reason = "in doubt"
    assert not contrast.is_settled(parameters, state)


def test_full_estimates_are_due_by_age_and_after_a_refusal_by_events() -> None:
    state = contrast.start(ContrastParameters(), CONTEXT)
    state.answer = answered()
    ages_us = [age_us for age_us in range(1000, 200_000, 1000) if contrast._due(state, age_us, 100)]
    assert ages_us == [5000, 10_000, 20_000, 50_000, 75_000, 113_000, 170_000]
    state.full_us, state.tried, state.reason = math.inf, 100, "in doubt"
    assert not contrast._due(state, 200_000, 149) and contrast._due(state, 200_000, 150)
    state.reason = contrast.UNLINKED  # another visit may fit
    assert not contrast._due(state, 200_000, 104) and contrast._due(state, 200_000, 105)
    state.reason = None
    assert not contrast._due(state, 200_000, 150)


def test_a_tick_without_events_keeps_what_is_known() -> None:
    parameters = ContrastParameters(fewest_events=10)
    state = contrast.start(parameters, CONTEXT)
    for packet in ticks():
        contrast.step(parameters, state, packet, known_ball(packet.end_us), NO_RHYTHM, seen(packet), SILENT)
    empty = Packet(8, 40_000, 45_000, EventBatch.empty())
    result = contrast.step(parameters, state, empty, known_ball(45_000), NO_RHYTHM, seen(empty), SILENT)
    assert result.estimate.status == "ok" and state.answer is not None
