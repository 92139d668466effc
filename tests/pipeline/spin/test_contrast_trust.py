"""Thresholds of the contrast estimate's trust rule, each on both sides."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from spinscope.pipeline.registry import trusted_method
from spinscope.pipeline.results import SpinEstimate
from spinscope.pipeline.spin.contrast import ContrastParameters, stage
from spinscope.pipeline.spin.contrast.events import ContrastEstimate
from spinscope.pipeline.stages import rate
from spinscope.pipeline.stages.rate import RateResult
from tests.reference.contrast import dotted_ball

PARAMETERS = ContrastParameters(
    min_gain=0.25,
    smallest_patch_rad=0.18,
    rival_sigmas=1.2,
    magnitude_std_rps=3.0,
    axis_std_deg=12.0,
)
SPIN = np.array([20.0, 0.0, 0.0])


def uncertain(magnitude_std_rps: float, axis_std_deg: float, spin_rps: np.ndarray = SPIN) -> ContrastEstimate:
    """A trusted estimate with these stated errors; those of the axis are the same in both directions."""
    across = float(np.linalg.norm(spin_rps)) * np.radians(axis_std_deg) / np.sqrt(2.0)
    covariance = np.diag([magnitude_std_rps, across, across]) ** 2
    return ContrastEstimate(spin_rps, covariance, 200, contrast=1.0, patch_rad=0.3)


SURE = uncertain(0.1, 2.0)
RIVALS = {"rivals_rps": np.array([[0.0, 30.0, 0.0], [0.0, 0.0, 9.0]])}


@pytest.mark.parametrize(
    ("trusted", "doubted", "reason"),
    [
        (SURE, replace(SURE, spin_rps=None, covariance_rps2=None), "200 logo events"),
        (replace(SURE, contrast=0.26), replace(SURE, contrast=0.24), r"sharpens the logo \(0.24 in log likelihood"),
        (replace(SURE, linked_share=0.41), replace(SURE, linked_share=0.39), "do not fit together"),
        (replace(SURE, patch_rad=0.19), replace(SURE, patch_rad=0.17), "spread over 10 degrees"),
        (
            replace(SURE, margins=np.array([9.0, 1.3]), **RIVALS),
            replace(SURE, margins=np.array([9.0, 1.1]), **RIVALS),
            r"or \(0, 0, 9\) rps",
        ),
        (uncertain(2.9, 2.0), uncertain(3.1, 2.0), r"20.0 \+- 3.1 rps"),
        (uncertain(8.9, 2.0, 4.5 * SPIN), uncertain(9.1, 2.0, 4.5 * SPIN), r"90.0 \+- 9.1 rps"),
        (uncertain(0.1, 11.8), uncertain(0.1, 12.2), r"axis is too uncertain: \+- 12 degrees"),
    ],
)
def test_each_threshold_is_where_its_parameter_says(
    trusted: ContrastEstimate, doubted: ContrastEstimate, reason: str
) -> None:
    assert stage.doubt(PARAMETERS, trusted) is None
    assert re.search(reason, stage.doubt(PARAMETERS, doubted) or "")


@pytest.mark.parametrize(("off_rps", "changes"), [(0.69, False), (0.72, True)])
def test_a_change_of_spin_is_seen_beyond_its_sigmas(off_rps: float, changes: bool) -> None:
    """5 sigma of two ends of 0.1 rps each: 0.71 rps. An end that is not to be trusted by itself shows nothing."""
    late = uncertain(0.1, 2.0, SPIN * (1.0 + off_rps / 20.0))
    reason = stage.change_doubt(replace(PARAMETERS, change_sigmas=5.0), SURE, late)
    assert (reason is not None) == changes
    assert stage.change_doubt(replace(PARAMETERS, change_sigmas=5.0), SURE, replace(late, contrast=0.2)) is None


def rhythm(*spins_rps: float, sigmas: float = 9.0) -> RateResult:
    """A result of the rate stage with these magnitudes by which the pattern comes back."""
    return replace(
        rate.absent(rate.RateParameters(), "none"),
        period_spins_rps=np.array(spins_rps),
        period_log_likelihoods=-7.0 * np.arange(len(spins_rps)),
        period_sigmas=sigmas,
    )


@pytest.mark.parametrize(
    ("told", "misses"),
    [
        (rhythm(sigmas=0.0), False),
        (rhythm(40.0, 20.0), False),  # one of them is enough
        (rhythm(40.0, 80.0), True),
        (rhythm(40.0, 80.0, 20.0), True),  # too unlikely
        (rhythm(40.0, 80.0, sigmas=4.9), False),
        (rhythm(22.2), False),  # 2.2 rps: three times 0.76
        (rhythm(22.4), True),
    ],
)
def test_an_answer_has_one_of_the_rhythms_magnitudes(told: RateResult, misses: bool) -> None:
    assert stage.misses_rhythm(told, SURE) == misses


@pytest.mark.parametrize("linked_share", [0.41, 0.39])
def test_visits_that_do_not_fit_together_tell_no_spin(linked_share: float) -> None:
    """Neither to contrast nor, by its likelihood, to all witnesses together; their flow is that of one visit."""
    state = stage.ContrastState({}, parts=[(0, dotted_ball(SPIN))], is_bright=[True])  # type: ignore[arg-type]
    flow = SpinEstimate("normal_flow", SPIN, np.eye(3), None)
    answer = replace(SURE, linked_share=linked_share)
    state.answer, state.reason = answer, stage.doubt(PARAMETERS, answer)
    estimate, pattern = stage._judged(PARAMETERS, state, answer, 600, rhythm(sigmas=0.0), flow)
    trusted = trusted_method({"normal_flow": flow, "contrast": estimate})
    assert (pattern, trusted) == (("turning", "contrast") if linked_share > 0.4 else ("unclear", None))


@pytest.mark.parametrize(
    ("rhythm_rps", "flow_rps", "flow_std_rps", "twice"),
    [
        (40.0, 17.0, 7.5, True),  # three times that below the rhythm
        (40.0, 17.0, 7.8, False),
        (44.2, 17.0, 2.0, True),  # half of it 2.1 rps off: three times 0.76
        (44.8, 17.0, 2.0, False),
        (60.0, 17.0, 2.0, False),  # a third of it is none
        (20.0, 17.0, 0.5, False),
    ],
)
def test_a_logo_comes_back_twice_a_turn_where_the_normal_flow_says_so(
    rhythm_rps: float, flow_rps: float, flow_std_rps: float, twice: bool
) -> None:
    flow = SpinEstimate("normal_flow", flow_rps * SPIN / 20.0, flow_std_rps**2 * np.eye(3), None)
    assert stage.comes_back_twice(rhythm(rhythm_rps), SURE, flow) == twice
    assert not stage.comes_back_twice(rhythm(40.0), SURE, SpinEstimate.refused("normal_flow", "no flow"))


def test_a_rhythm_that_contradicts_a_sharp_pattern_is_said_of_it() -> None:
    """So that neither of the two answers; a pattern that is not sharp is not contradicted."""
    ball = dotted_ball(SPIN, duration_s=0.1, events=600)
    state = stage.ContrastState({}, parts=[(0, ball)], is_bright=[True])  # type: ignore[arg-type]
    answer, flow = replace(SURE, span_s=0.1), SpinEstimate.refused("normal_flow", "no flow")
    estimate, pattern = stage._judged(PARAMETERS, state, answer, 600, rhythm(33.0), flow)
    assert pattern == "off_rhythm"
    assert "comes back with 33.0 rps, not with (20, 0, 0)" in (estimate.reason or "")
    assert stage._judged(PARAMETERS, state, answer, 600, rhythm(20.0), flow)[1] == "turning"
    flow = SpinEstimate("normal_flow", SPIN, np.eye(3), None)
    assert stage._judged(PARAMETERS, state, answer, 600, rhythm(40.0), flow)[0].status == "ok"
    dull = replace(answer, contrast=0.2)
    assert stage._judged(PARAMETERS, state, dull, 600, rhythm(33.0), flow)[1] == "none"


@pytest.mark.parametrize(
    ("off", "is_bright", "expected"),
    [
        (3, True, True),  # ON of a bright ball's leading outline
        (7, True, False),
        (97, True, False),  # OFF of a print that came: the trailing outline is reported behind the ball
        (97, False, True),  # or of a dark ball's leading outline
        (93, False, False),
        (3, False, True),
    ],
)
def test_one_polarity_may_be_a_leading_outline(off: int, is_bright: bool, expected: bool) -> None:
    ball = dotted_ball(SPIN, duration_s=0.02, events=100)
    parts = [(0, replace(ball, polarity=(np.arange(100) >= off).astype(np.int64)))]
    state = stage.ContrastState({}, parts=parts, is_bright=[True, is_bright])  # type: ignore[arg-type]
    assert stage._are_one_polarity(state) == expected


@pytest.mark.parametrize("events", ["on", "off"])
def test_what_may_be_outline_is_trusted_neither_to_the_pattern_nor_to_its_flow(events: str) -> None:
    """A pattern that turned by 0.4 turns, of one polarity."""
    ball = dotted_ball(SPIN, duration_s=0.02, events=600)
    polarity = np.full(600, int(events == "on"))
    state = stage.ContrastState({}, parts=[(0, replace(ball, polarity=polarity))], is_bright=[True])  # type: ignore[arg-type]
    flow = SpinEstimate("normal_flow", SPIN, np.eye(3), None)
    answer = replace(SURE, span_s=0.4 / float(np.linalg.norm(SPIN)))
    estimate, pattern = stage._judged(PARAMETERS, state, answer, 600, rhythm(sigmas=0.0), flow)
    if events == "on":
        assert (estimate.reason, estimate.against) == (stage.OUTLINE, "normal_flow")
        assert trusted_method({"normal_flow": flow, "contrast": estimate}) is None
    else:
        assert estimate.status == "ok"
    assert pattern == ("unclear" if events == "on" else "turning")
