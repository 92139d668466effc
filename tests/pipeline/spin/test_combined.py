"""The combined answer: witnesses choose among the pattern's spins, narrow its axis, and answer where it is hidden."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.registry import Parameters, trusted_method
from spinscope.pipeline.results import MethodResult, Packet, SpinEstimate
from spinscope.pipeline.spin.combined import stage as combined
from spinscope.pipeline.spin.combined.result import CombinedResult
from spinscope.pipeline.spin.contrast import ContrastResult
from spinscope.pipeline.spin.trajectory.stage import TrajectoryResult
from spinscope.pipeline.stages import logo, rate
from spinscope.pipeline.stages.logo import TurningEvents
from tests.flown_circles import CAMERA, ball_at, context

TOP, SLOW, OTHER = np.array([60.0, 5.0, 0.0]), np.array([1.0, 0.0, 1.0]), np.array([0.0, 45.0, 40.0])
PARAMETERS = Parameters().group("combined")
READS = {"trajectory.gyro_std_deg": 11.0, "contrast.window_us": 500_000}
REFUSED = SpinEstimate.refused("contrast", "another spin explains the logo about as well")


def pattern(
    best: np.ndarray, rivals: list[np.ndarray], sigmas: list[float], axis_std_deg: float = 2.0
) -> ContrastResult:
    """Contrast that was refused, with its candidates."""
    nothing = ContrastResult.nothing(REFUSED)
    covariances = np.array([covariance(spin, axis_std_deg) for spin in (best, *rivals)])
    return replace(
        nothing,
        best_rps=best,
        covariance_rps2=covariances[0],
        rivals_rps=np.array(rivals).reshape(-1, 3),
        rival_covariances_rps2=covariances[1:],
        rival_sigmas=np.array(sigmas),
        pattern="turning",
        contrast=0.5,
    )


def covariance(spin: np.ndarray, axis_std_deg: float, magnitude_std: float = 0.1) -> np.ndarray:
    squared = float(spin @ spin)
    along = np.outer(spin, spin) / squared
    return magnitude_std**2 * along + (math.radians(axis_std_deg)) ** 2 * squared * (np.eye(3) - along)


class _Flight:
    """Flight that tells the axis of `spin` to some degrees and nothing of its magnitude."""

    def __init__(self, spin: np.ndarray, std_deg: float) -> None:
        self.axis, self.std = spin / np.linalg.norm(spin), math.radians(std_deg)
        self.along = np.array([0.0, 0.0, 1.0])
        self.magnitude_rps, self.magnitude_std_rps, self.axis_std_rad = 60.0, 30.0, self.std

    def log_likelihood(self, spins: np.ndarray) -> np.ndarray:
        spins = np.asarray(spins, float).reshape(-1, 3)
        cosine = spins @ self.axis / np.maximum(np.linalg.norm(spins, axis=1), 1e-9)
        return -0.5 * (np.arccos(np.clip(cosine, -1, 1)) / self.std) ** 2


def flight(spin: np.ndarray | None, std_deg: float = 8.0) -> TrajectoryResult:
    refused = TrajectoryResult(SpinEstimate.refused("trajectory", "too short"))
    if spin is None:
        return refused
    made = _Flight(spin, std_deg)
    estimate = SpinEstimate("trajectory", spin, covariance(spin, std_deg, 30.0), None)
    return replace(refused, estimate=estimate, likelihood=made, across=made)  # type: ignore[arg-type]


def rhythm(spins: list[float], logs: list[float] | None = None, reason: str | None = None) -> rate.RateResult:
    result = rate.absent(Parameters().rate, "no ball")
    logs = [0.0] * len(spins) if logs is None else logs
    return replace(
        result,
        period_spins_rps=np.array(spins),
        period_log_likelihoods=np.array(logs),
        period_std_rps=0.2 if spins else math.nan,
        period_reason=None if spins and reason is None else reason or "no period",
    )


def flow(spin: np.ndarray | None) -> MethodResult:
    if spin is None:
        return MethodResult(SpinEstimate.refused("normal_flow", "hardly seen"))
    return MethodResult(SpinEstimate("normal_flow", spin, covariance(spin, 4.0, 2.0), None))


def answered(
    contrast: ContrastResult,
    trajectory: TrajectoryResult | None = None,
    period: rate.RateResult | None = None,
    normal_flow: MethodResult | None = None,
    seen_ms: Sequence[int] = (),
) -> CombinedResult:
    """The answer at the end of a shot of 100 ms in the image's middle, in which the logo is seen in some ms."""
    state = combined.start(PARAMETERS, context(**READS))
    ball = ball_at(100_000.0, np.array([CAMERA.principal_x_px, CAMERA.principal_y_px, 17.0]))
    events = TurningEvents.empty()
    if seen_ms:
        t_us = np.repeat(1000 * np.array(seen_ms) + 500, 20)
        nothing = np.zeros(t_us.size)
        events = TurningEvents(t_us, nothing > 0, np.zeros((t_us.size, 3)), nothing, nothing)
    seen = replace(logo.absent(Parameters().logo, "no ball"), turning=events)
    packet = Packet(0, 0, 100_000, EventBatch.empty())
    return combined.step(
        PARAMETERS,
        state,
        packet,
        ball,
        seen,
        period or rhythm([]),
        normal_flow or flow(None),
        contrast,
        trajectory or flight(None),
    )


def angle_deg(one: np.ndarray, other: np.ndarray) -> float:
    cosine = one @ other / np.linalg.norm(one) / np.linalg.norm(other)
    return math.degrees(math.acos(min(max(float(cosine), -1.0), 1.0)))


def test_two_spins_that_explain_the_logo_are_left_open_by_the_pattern_alone() -> None:
    result = answered(pattern(SLOW, [TOP], [0.5]))
    assert result.estimate.status == "refused"
    assert "two spins open" in (result.estimate.reason or "")


def turned(spin: np.ndarray, angle: float) -> np.ndarray:
    """The spin with its axis turned by an angle in degrees."""
    across = np.cross(spin, (0.0, 0.0, 1.0))
    across *= np.linalg.norm(spin) / np.linalg.norm(across)
    turn: np.ndarray = math.cos(math.radians(angle)) * spin + math.sin(math.radians(angle)) * across
    return turn


def test_a_near_rival_is_part_of_the_error_and_a_far_one_must_be_beaten() -> None:
    estimate = answered(pattern(TOP, [turned(TOP, 15.0)], [0.0])).estimate
    assert estimate.vector_rps is not None and estimate.axis_std_deg is not None
    assert angle_deg(estimate.vector_rps, TOP) == pytest.approx(7.5, abs=0.5), "both are as likely"
    assert estimate.axis_std_deg == pytest.approx(math.hypot(7.5, 2.0 * math.sqrt(2.0)), abs=0.5)
    assert estimate.magnitude_rps == pytest.approx(float(np.linalg.norm(TOP)), abs=0.3)
    clear = answered(pattern(TOP, [turned(TOP, 15.0)], [2.5])).estimate
    assert clear.axis_std_deg is not None and clear.axis_std_deg < 5.0
    for rival in (turned(TOP, 20.0), 1.15 * TOP):
        assert "two spins open" in (answered(pattern(TOP, [rival], [0.5])).estimate.reason or "")
    wide = answered(pattern(TOP, [turned(TOP, 16.0)], [0.0], axis_std_deg=7.0)).estimate
    assert "the axis is too uncertain" in (wide.reason or "")


def test_the_flight_does_not_answer_alone_where_the_logo_is_seen() -> None:
    """Of a hidden logo it does; one that is seen and leaves the spin open tells more than the flight."""
    of_flight = {"trajectory": SpinEstimate("trajectory", TOP, covariance(TOP, 5.0, 15.0), None)}
    seen = answered(pattern(SLOW, [TOP], [0.5])).estimate
    hidden = answered(ContrastResult.nothing(REFUSED), flight(TOP)).estimate
    assert seen.status == hidden.status == "refused"
    assert trusted_method(of_flight | {"contrast": REFUSED, "combined": seen}) is None
    assert trusted_method(of_flight | {"contrast": REFUSED, "combined": hidden}) == "trajectory"


def test_a_spin_that_changes_is_trusted_to_no_witness() -> None:
    clear = pattern(TOP, [OTHER], [6.0])
    of_flight = {"trajectory": SpinEstimate("trajectory", TOP, covariance(TOP, 5.0, 3.0), None)}
    assert answered(clear).estimate.status == "ok" and trusted_method(of_flight) == "trajectory"
    changed = answered(replace(clear, changes=True), flight(TOP), rhythm([60.2])).estimate
    assert changed.reason == REFUSED.reason
    assert trusted_method(of_flight | {"contrast": REFUSED, "combined": changed}) is None


def test_one_witness_that_may_be_wrong_is_not_enough_and_two_choose_the_rival() -> None:
    two = pattern(SLOW, [TOP], [0.5])
    by_flight = answered(two, flight(TOP))
    assert by_flight.estimate.status == "refused", "a flight may be another ball's"
    result = answered(two, flight(TOP), rhythm([60.2]))
    assert result.estimate.vector_rps is not None
    assert np.linalg.norm(result.estimate.vector_rps - TOP) < 3.0
    assert "the flight" in result.summary and "the rhythm" in result.summary
    assert {one.name for one in result.witnesses if one.log_odds > 1.0} == {"rate", "trajectory"}


def test_witnesses_against_a_clear_pattern_do_not_turn_it_over() -> None:
    result = answered(pattern(TOP, [OTHER], [6.0]), flight(OTHER), rhythm([60.2]), flow(OTHER))
    assert result.estimate.vector_rps is not None
    assert np.linalg.norm(result.estimate.vector_rps - TOP) < 3.0
    assert "against" in result.summary


def test_the_flight_narrows_an_axis_and_flow_of_the_same_events_does_not() -> None:
    wide = pattern(TOP, [], [], axis_std_deg=14.0)
    alone, with_flow = answered(wide), answered(wide, None, None, flow(TOP))
    assert "axis is too uncertain" in (alone.estimate.reason or "")
    assert "axis is too uncertain" in (with_flow.estimate.reason or "")
    truth = TOP + np.array([0.0, 8.0, 0.0])
    narrowed = answered(wide, flight(truth, 6.0)).estimate
    assert narrowed.axis_std_deg is not None and narrowed.axis_std_deg < 10.0
    assert narrowed.vector_rps is not None and angle_deg(narrowed.vector_rps, truth) < angle_deg(TOP, truth)


def test_a_hidden_logo_is_answered_by_rhythm_and_flight_together_only() -> None:
    hidden = ContrastResult.nothing(SpinEstimate.refused("contrast", "the logo was not seen"))
    assert answered(hidden, flight(TOP)).estimate.status == "refused"
    assert answered(hidden, None, rhythm([60.2])).estimate.status == "refused"
    result = answered(hidden, flight(TOP), rhythm([60.2]))
    assert result.estimate.vector_rps is not None and result.estimate.axis_std_deg is not None
    assert result.estimate.magnitude_rps == pytest.approx(60.2, abs=1.0)
    assert angle_deg(result.estimate.vector_rps, TOP) < 3.0
    assert 8.0 < result.estimate.axis_std_deg < 20.0
    assert result.summary == "magnitude from the rhythm of the logo's visits, axis from the flight"
    halves = answered(hidden, flight(TOP), rhythm([60.2, 30.1], [0.0, -2.0]))
    assert halves.estimate.status == "refused", "half the rate is not excluded"
    assert answered(hidden, flight(TOP), rhythm([60.2]), flow(TOP)).estimate.status == "ok"
    doubted = answered(hidden, flight(TOP), rhythm([60.2]), flow(TOP / 2))
    assert doubted.estimate.status == "refused", "the normal flow tells of two stamps that come back in turn"


def test_it_is_trusted_where_contrast_alone_is_not_or_tells_another_spin() -> None:
    together = SpinEstimate("combined", TOP, np.eye(3), None)
    alone = SpinEstimate("contrast", TOP + 0.5, np.eye(3), None)
    assert trusted_method({"combined": together, "contrast": alone}) == "contrast"
    open_ = SpinEstimate.refused("combined", "two spins open")
    assert trusted_method({"combined": open_, "contrast": alone}) is None, "one limit of the odds for both"
    assert trusted_method({"combined": together, "contrast": REFUSED}) == "combined"
    assert trusted_method({"combined": together, "contrast": replace(alone, vector_rps=OTHER)}) == "combined"


class _StraightFlight(_Flight):
    """Flight that is bent as by a slow spin, by three sigma and more less than by a fast one across it."""

    def log_likelihood(self, spins: np.ndarray) -> np.ndarray:
        fast = np.linalg.norm(np.asarray(spins, float).reshape(-1, 3), axis=1) > 30.0
        return super().log_likelihood(spins) - 8.0 * fast


def test_a_rhythm_faster_than_the_flight_is_bent_has_no_axis() -> None:
    """The spin lies partly along the flight, which does not bend it: the flight's axis is not the spin's."""
    hidden = ContrastResult.nothing(SpinEstimate.refused("contrast", "the logo was not seen"))
    straight = _StraightFlight(TOP, 8.0)
    straight.magnitude_rps = 16.0
    bent = replace(flight(TOP), likelihood=straight, across=straight)  # type: ignore[arg-type]
    assert "across the flight" in (answered(hidden, bent, rhythm([60.2])).estimate.reason or "")
    assert answered(hidden, bent, rhythm([16.2])).estimate.status == "ok"


def test_a_seam_that_comes_back_twice_a_turn_is_not_taken_for_twice_the_spin() -> None:
    hidden = ContrastResult.nothing(SpinEstimate.refused("contrast", "the logo was not seen"))
    fast = answered(hidden, flight(TOP), rhythm([115.0])).estimate
    assert "two spins open" in (fast.reason or ""), "half of it is as usual as it is rare"


def test_the_bend_of_the_flight_alone_answers_where_it_tells_the_magnitude_to_a_third() -> None:
    hidden = ContrastResult.nothing(SpinEstimate.refused("contrast", "the logo was not seen"))
    wide = answered(hidden, flight(TOP))
    assert wide.basis == "flight" and "the magnitude is too uncertain" in (wide.estimate.reason or "")
    bent = _BentFlight(TOP, 8.0)
    narrow = answered(hidden, replace(flight(TOP), likelihood=bent, across=bent))  # type: ignore[arg-type]
    estimate = narrow.estimate
    assert estimate.vector_rps is not None and estimate.axis_std_deg is not None
    assert estimate.magnitude_rps == pytest.approx(60.0, rel=0.1) and 10.0 < (estimate.magnitude_std_rps or 0) < 20.0
    assert angle_deg(estimate.vector_rps, TOP) < 4.0 and 8.0 < estimate.axis_std_deg < 20.0
    assert narrow.summary == "magnitude and axis from the bend of the flight"
    assert trusted_method({"combined": estimate, "contrast": hidden.estimate}) == "combined"


def test_the_flight_does_not_answer_alone_where_the_logo_may_be_in_view() -> None:
    """What is seen may be a slow sensor's outline, or visits that do not fit together; their rhythm still counts."""
    unclear = replace(ContrastResult.nothing(REFUSED), pattern="unclear")
    bent = _BentFlight(TOP, 8.0)
    told = replace(flight(TOP), likelihood=bent, across=bent)  # type: ignore[arg-type]
    of_flight = {"trajectory": SpinEstimate("trajectory", TOP, covariance(TOP, 5.0, 15.0), None)}
    alone = answered(unclear, told).estimate
    assert alone.reason == REFUSED.reason
    assert trusted_method(of_flight | {"contrast": REFUSED, "combined": alone}) is None
    assert answered(replace(unclear, pattern="none"), told).estimate.status == "ok"
    assert answered(unclear, told, rhythm([60.2])).basis == "rhythm"


def test_nothing_answers_where_the_rhythm_contradicts_a_sharp_pattern() -> None:
    """Neither the rhythm nor the flight, which would tell to a third what a logo in view leaves open."""
    contradicted = replace(ContrastResult.nothing(REFUSED), pattern="off_rhythm")
    of_flight = {"trajectory": SpinEstimate("trajectory", TOP, covariance(TOP, 5.0, 15.0), None)}
    refused = answered(contradicted, flight(TOP), rhythm([60.2])).estimate
    assert refused.reason == REFUSED.reason
    assert trusted_method(of_flight | {"contrast": REFUSED, "combined": refused}) is None
    assert answered(replace(contradicted, pattern="unclear"), flight(TOP), rhythm([60.2])).basis == "rhythm"


class _BentFlight(_Flight):
    """Flight that tells the magnitude to a quarter as well."""

    def log_likelihood(self, spins: np.ndarray) -> np.ndarray:
        magnitudes = np.linalg.norm(np.asarray(spins, float).reshape(-1, 3), axis=1)
        return super().log_likelihood(spins) - 0.5 * (np.log(magnitudes / 60.0) / 0.25) ** 2


def test_a_logo_that_was_not_seen_when_a_spin_would_have_shown_it_speaks_against_the_spin() -> None:
    """Visits every 25 ms, of which each second one would be missing with twice the spin."""
    slow, fast = np.array([40.0, 0.0, 0.0]), np.array([80.0, 0.0, 0.0])
    visits = [ms for ms in range(100) if ms % 25 < 8]
    result = answered(pattern(fast, [slow], [0.2]), period=rhythm([40.0]), seen_ms=visits)
    (seen,) = (one for one in result.witnesses if one.name == "logo")
    assert 1.5 < seen.log_odds < 2.5, "dirt or a seam may have been seen instead"
    assert result.estimate.magnitude_rps == pytest.approx(40.0, abs=0.5)
    assert "the times at which the logo was seen" in result.summary
