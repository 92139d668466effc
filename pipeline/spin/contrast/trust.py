"""Trust in an answer of contrast: what speaks against it, in words for people."""

from __future__ import annotations

import math

import numpy as np

from ...results import SpinEstimate
from ...spin_terms import vector_words
from ...stages.rate import RateResult
from ...stages.rate_period import FEWEST_SIGMAS
from .events import ContrastEstimate
from .parameters import FLOW_METHOD, METHOD, ContrastParameters

# Before the logo has come back for the first time the magnitude rests on how far it moved.
RETURNED_TURNS = 1.2
# Edges that come and go give both polarities; what pixels of a slow sensor still report of the ball's outline when it
# is far ahead has one. Of 134 right answers on simulated shots none has less than a tenth of the rarer polarity.
LEAST_OF_POLARITY = 0.05
# The rhythm of the logo's visits follows the spin to this share, and the line of sight's own turn while the ball passes
# (0.7 rps at 9 m/s and 2 m); farther off than so many of these is another spin.
RHYTHM_SHARE, SIGHT_RPS, RHYTHM_SIGMAS = 0.015, 0.7, 3.0
RHYTHM_EXCLUDED = -8.0  # log likelihood below which, four sigma, a magnitude is no rhythm's


def doubt(parameters: ContrastParameters, answer: ContrastEstimate) -> str | None:
    """Reason why an answer is not to be trusted, in words; None if it is."""
    if answer.spin_rps is None:
        return f"the logo was not seen: {answer.events} logo events, {parameters.fewest_events} are needed"
    if answer.contrast < parameters.min_gain:
        return (
            f"no pattern turns with the ball: the best spin gains {answer.contrast:.2f} an event over chance, "
            f"{parameters.min_gain:g} are needed"
        )
    if answer.patch_rad < parameters.smallest_patch_rad:
        return (
            f"the logo is hardly seen: its events spread over {math.degrees(answer.patch_rad):.0f} degrees, "
            f"{math.degrees(parameters.smallest_patch_rad):.0f} are needed"
        )
    estimate = SpinEstimate(METHOD, answer.spin_rps, answer.covariance_rps2, None)
    magnitude, std, axis_std = estimate.magnitude_rps, estimate.magnitude_std_rps, estimate.axis_std_deg
    if magnitude is None or std is None or axis_std is None:
        return "the ball does not turn"
    if answer.margins.size and answer.margins.min() < parameters.rival_sigmas:
        rival = answer.rivals_rps[int(np.argmin(answer.margins))]
        return f"another spin explains the logo about as well: {vector_words(answer.spin_rps)} or {vector_words(rival)}"
    if std > max(parameters.magnitude_std_rps, 0.1 * magnitude):
        return f"the magnitude is too uncertain: {magnitude:.1f} +- {std:.1f} rps"
    if axis_std > parameters.axis_std_deg:
        return f"the axis is too uncertain: +- {axis_std:.0f} degrees"
    return None


def change_doubt(parameters: ContrastParameters, early: ContrastEstimate, late: ContrastEstimate) -> str | None:
    """Reason for doubt where a flight's ends have two spins, in words; None where one spin may explain both.

    Ends that give no answer to be trusted show nothing.
    """
    if doubt(parameters, early) is not None or doubt(parameters, late) is not None:
        return None
    before, after = (SpinEstimate(METHOD, one.spin_rps, one.covariance_rps2, None) for one in (early, late))
    if sigmas_apart(before, after) <= parameters.change_sigmas:
        return None
    words = f"from {vector_words(before.vector_rps)} to {vector_words(after.vector_rps)}"
    return f"the spin changes within the flight, {words}: a contact may have been missed"


def sigmas_apart(one: SpinEstimate, other: SpinEstimate) -> float:
    """By how many standard deviations two estimates differ; 0 where one says nothing."""
    if one.vector_rps is None or one.covariance_rps2 is None:
        return 0.0
    if other.vector_rps is None or other.covariance_rps2 is None:
        return 0.0
    off = one.vector_rps - other.vector_rps
    return math.sqrt(max(float(off @ np.linalg.solve(one.covariance_rps2 + other.covariance_rps2, off)), 0.0))


def misses_rhythm(rate: RateResult, answer: ContrastEstimate) -> bool:
    """Whether the logo's pattern comes back, but by none of its possible magnitudes with this answer's.

    A magnitude too slow to come back is not one of them: none of 134 right answers on simulated shots is refused for
    that, but one with half of the true spin about a wrong axis.
    """
    estimate = SpinEstimate(METHOD, answer.spin_rps, answer.covariance_rps2, None)
    magnitude, std = estimate.magnitude_rps, estimate.magnitude_std_rps
    if magnitude is None or std is None or rate.period_sigmas < FEWEST_SIGMAS:
        return False
    off_rps = np.abs(rate.period_spins_rps[rate.period_log_likelihoods > RHYTHM_EXCLUDED] - magnitude)
    return bool(np.all(off_rps > RHYTHM_SIGMAS * math.hypot(std, RHYTHM_SHARE * magnitude, SIGHT_RPS)))


def judged(
    parameters: ContrastParameters,
    answer: ContrastEstimate,
    reason: str | None,
    changes: bool,
    settled: bool,
    rarer_polarity: float,
    rate: RateResult,
    normal_flow: SpinEstimate,
    events: int,
) -> tuple[SpinEstimate, bool]:
    """Estimate of an answer or its refusal, and whether a pattern is seen to turn.

    Parameters
    ----------
    reason : str, optional
        The answer's own `doubt`, or that its spin changes.
    changes : bool
        Whether the spin changes within the flight: then the normal flow mixes two spins as well.
    settled : bool
        Whether the logo says so much that neither its rhythm nor its normal flow can put the answer in doubt.
    rarer_polarity : float
        Share of the polarity that fewer of the events have.
    events : int
        Number of events seen.
    """
    may_be_outline = answer.turns < RETURNED_TURNS and rarer_polarity < LEAST_OF_POLARITY
    off_rhythm = not settled and misses_rhythm(rate, answer)
    turns_seen = answer.contrast >= parameters.min_gain and not may_be_outline and not off_rhythm
    assert answer.spin_rps is not None and answer.covariance_rps2 is not None
    estimate = SpinEstimate(METHOD, answer.spin_rps.copy(), answer.covariance_rps2.copy(), None, events)
    against = None
    if reason is not None:
        # Where nothing turns, the normal flow has seen no pattern either, but noise.
        against = None if turns_seen and not changes else FLOW_METHOD
    elif may_be_outline:
        reason = (
            "nearly all logo events have one polarity and have not come back: a slow sensor's outline does that too"
        )
    elif not settled and (sigmas := sigmas_apart(estimate, normal_flow)) > parameters.flow_sigmas:
        best, other = vector_words(answer.spin_rps), vector_words(normal_flow.vector_rps)
        reason, against = f"the normal flow says {other}, {sigmas:.0f} sigma from {best}", FLOW_METHOD
    elif off_rhythm:
        reason = (
            f"the logo comes back with {rate.period_spins_rps[0]:.1f} rps, not with {vector_words(answer.spin_rps)}"
        )
    if reason is not None:
        return SpinEstimate.refused(METHOD, reason, events, against=against), turns_seen
    return estimate, turns_seen
