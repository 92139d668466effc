"""Contrast against the samples' truth, fed by the chain's track, logo and spin stages."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from spinscope.pipeline.events import EventBatch
from spinscope.pipeline.registry import trusted_method
from spinscope.pipeline.results import MethodResult, SpinEstimate
from spinscope.pipeline.session import Choices, Session
from spinscope.pipeline.spin.contrast import ContrastParameters, ContrastResult
from spinscope.pipeline.spin.contrast import stage as contrast
from spinscope.pipeline.stages.logo import LogoResult
from tests.spinning_ball import CONTEXT, after_track, known_track, packets

BALLS = {"spinner_ball2_side": (528.43, 426.87, 16.49), "spinner_ball5_back_no_logo": (606.67, 302.79, 16.47)}


def results(
    samples: Path, name: str, logo_of: Callable[[LogoResult], LogoResult] = lambda logo: logo
) -> tuple[list[ContrastResult], np.ndarray]:
    """The results of the ticks with a ball in view, and the true spin in rps."""
    session = Session.open(samples / f"{name}.h5", Choices(fixed_ball=BALLS.get(name)))
    parameters = ContrastParameters()
    state = session.chain.start(session.parameters, contrast.STAGE)
    found = []
    for tick in session.ticks(("logo", "rate", "normal_flow"), forget=("surface",)):
        if tick.track.ball is not None:
            given = tick.packet, tick.track.ball, tick.rate, logo_of(tick.logo), tick.normal_flow
            found.append(contrast.step(parameters, state, *given))
    assert session.truth is not None
    return found, session.truth.spin_rps[0]


def some_of(rows: Callable[[int], np.ndarray]) -> Callable[[LogoResult], LogoResult]:
    """The turning events' places in another order, or fewer of the events."""

    def changed(logo: LogoResult) -> LogoResult:
        given = logo.turning
        pick = rows(len(given))
        places = {name: getattr(given, name)[pick] for name in ("centre_x_px", "centre_y_px", "normals")}
        when = {name: getattr(given, name)[np.sort(pick)] for name in ("t_us", "on")}
        return replace(logo, turning=replace(given, **when, **places))

    return changed


@pytest.mark.parametrize("name", ["spinner_ball2_side", "flight_fast_top", "flight_back"])
def test_a_visible_logo_gives_the_spin(samples: Path, name: str) -> None:
    found, truth = results(samples, name)
    estimate = found[-1].estimate
    assert estimate.vector_rps is not None
    assert estimate.magnitude_rps == pytest.approx(np.linalg.norm(truth), abs=0.3)
    assert np.linalg.norm(np.cross(estimate.vector_rps, truth)) < np.sin(np.radians(5)) * truth @ truth
    assert estimate.vector_rps @ truth > 0


def test_the_error_is_stated_and_shrinks_while_the_ball_flies(samples: Path) -> None:
    found, truth = results(samples, "flight_back")
    answers = [result.estimate for result in found if result.estimate.status == "ok"]
    first, last = answers[0], answers[-1]
    assert last.magnitude_std_rps < 0.5 * first.magnitude_std_rps
    for answer in answers:
        assert abs(answer.magnitude_rps - np.linalg.norm(truth)) < 5 * answer.magnitude_std_rps
    full = [result.full for result in found]
    assert 1 <= sum(full) < len(full) / 2


def test_earlier_results_do_not_change_and_runs_repeat(samples: Path) -> None:
    (one, _), (two, _) = results(samples, "flight_back"), results(samples, "flight_back")
    for a, b in zip(one, two, strict=True):
        for name in ContrastResult.__dataclass_fields__:
            value = getattr(a, name)
            if isinstance(value, np.ndarray):
                assert not value.flags.writeable
                np.testing.assert_array_equal(value, getattr(b, name))
    spins = [result.best_rps for result in one if np.isfinite(result.best_rps).all()]
    assert len({tuple(spin) for spin in spins}) > 2  # they are not all the last one's memory


def test_a_hidden_logo_is_refused(samples: Path) -> None:
    found, _ = results(samples, "flight_side")
    assert all(result.estimate.status == "refused" for result in found)
    assert "seen" in str(found[-1].estimate.reason)


def test_a_logo_that_hardly_shows_at_the_rim_is_right_or_refused(samples: Path) -> None:
    """200 events in 100 ms, all within two pixels of the outline."""
    found, truth = results(samples, "spinner_ball5_back_no_logo")
    assert found[0].estimate.status == "refused" and "seen" in str(found[0].estimate.reason)
    for result in found:
        if (spin := result.estimate.vector_rps) is not None:
            assert np.linalg.norm(spin) == pytest.approx(np.linalg.norm(truth), abs=1.0)
            assert spin @ truth > np.cos(np.radians(8)) * np.linalg.norm(spin) * np.linalg.norm(truth)


def test_noise_is_refused(samples: Path) -> None:
    """The flight's own events, each at the place of another of its tick."""
    random = np.random.default_rng(0)
    found, _ = results(samples, "flight_back", some_of(random.permutation))
    assert all(result.estimate.status == "refused" for result in found)


def test_too_few_events_are_refused(samples: Path) -> None:
    found, _ = results(samples, "flight_back", some_of(lambda count: np.arange(0, count, 20)))
    assert all(result.estimate.status == "refused" for result in found)
    assert "are needed" in str(found[-1].estimate.reason)


def test_a_sure_normal_flow_that_says_otherwise_is_heard_until_the_logo_has_come_back_twice(samples: Path) -> None:
    session = Session.open(samples / "spinner_ball2_side.h5", Choices(fixed_ball=BALLS["spinner_ball2_side"]))
    parameters = ContrastParameters()
    state = session.chain.start(session.parameters, contrast.STAGE)
    other = SpinEstimate("normal_flow", np.array([0.0, 0.0, 70.0]), np.eye(3), None)
    ticks = list(session.ticks(forget=("surface",)))
    for tick in ticks:
        assert tick.track.ball is not None
        given = tick.packet, tick.track.ball, tick.rate, tick.logo, MethodResult(other)
        estimate = contrast.step(parameters, state, *given).estimate
        if tick.packet.end_us == 20_000:  # one turn
            assert estimate.status == "refused" and estimate.against == "normal_flow"
            assert "normal flow says (0, 0, 70) rps" in str(estimate.reason)
    assert estimate.magnitude_rps == pytest.approx(50.0, abs=0.2)  # five turns: no pattern comes back with 70 rps


@pytest.mark.parametrize("seed", range(6))
def test_noise_on_a_ball_is_no_spin_for_any_trusted_method(seed: int) -> None:
    """Normal flow alone is sure of a slow spin in some ticks of one such scene out of five."""
    random = np.random.default_rng(seed)
    t = np.sort(random.integers(0, 50_000, 3000))
    x, y = random.integers(628, 652, 3000), random.integers(348, 372, 3000)
    events = EventBatch.checked(t, x, y, random.random(3000) < 0.5, width_px=1280, height_px=720)
    ticks = [(packet, known_track(packet.end_us)) for packet in packets(events)]
    parameters = ContrastParameters()
    state = contrast.start(parameters, CONTEXT)
    for (packet, track), (logo, rhythm, _, spin) in zip(ticks, after_track(ticks), strict=True):
        assert track.ball is not None
        result = contrast.step(parameters, state, packet, track.ball, rhythm, logo, MethodResult(spin["normal_flow"]))
        assert trusted_method({**spin, "contrast": result.estimate}) is None
