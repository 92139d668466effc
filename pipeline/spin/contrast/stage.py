"""Contrast: the spin whose turning back makes the logo sharpest on the ball, with its uncertainty.

Not in the paper; it takes the place of the averaged flow of section 3.3. Every event is a point on the ball
(`logo`: exact ray-sphere intersection with the track at the event's own time). The method is contrast maximisation
(Gallego et al., CVPR 2018) on the sphere, scored as a likelihood ratio (`score`), searched in magnitude and
direction, started from `normal_flow` where that has an answer, else from a search over all spins, and over a stretch
of time that grows with the shot.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from ...kernels.arrays import Floats
from ...parameters import ParameterGroup, switch, tunable
from ...results import MethodResult, Packet, SpinEstimate
from ...spin_terms import vector_words
from ...stage import Context, SpinMethod
from ...stages.logo import LogoResult
from ...stages.rate import RateResult
from ...stages.rate_period import FEWEST_SIGMAS
from ...stages.track_result import BallTrack
from .estimate import PARTS, estimate_spin, estimates_of_ends, follow_spin, score_map
from .events import (
    LATENCY_SPREAD_S,
    BallUncertainty,
    ContrastEstimate,
    ContrastResult,
    ContrastSettings,
    Pattern,
    ScoreMap,
    SphereEvents,
)
from .search import LEAST_LINKED, last_of_grid_rps

METHOD, FLOW_METHOD = "contrast", "normal_flow"
# Full estimates when the shot is so old, then each time it is half as old again; in between the last answer is
# followed, which costs a tenth.
STAGES_US = (5000, 10_000, 20_000, 50_000)
LATER = 1.5
# After a refusal it is worth trying again with so many more events.
MORE = 1.5
# Visits that do not fit together may do so as soon as the logo comes back: some events of another visit tell.
MORE_OF_VISIT = 1.05
# The normal flow's spin, some 1 rps off, serves as a start to this: where its parameters move it by less, all that
# follows is the same to the last bit, and known already.
START_STEP_RPS = 0.5
# A search over all spins is repeated with so many times the events of the last one.
SEARCH_MORE = 2.0
# An answer scanned over so many turns that beats its rivals so many times as clearly as asked for is not scanned for
# others again: the logo has come back to where the spin brings it.
SETTLED_TURNS, SETTLED = 2.0, 3.0
# A spin that is off by one turn between the logo's visits fits those seen, not the next one: where following loses so
# much of the contrast that it had, a full estimate is due at once, with a scan.
LOST = 0.85
UNLINKED = "the logo's visits do not fit together: no spin found brings them to one place on the ball"
# Before the logo has come back for the first time the magnitude rests on how far it moved.
RETURNED_TURNS = 1.2
# Edges that come and go give both polarities; what pixels of a slow sensor still report of the ball's outline when it
# is far ahead has one: ON of a bright ball, whose trailing outline is reported behind it. Nearly all OFF is a dark
# print that came: five of five such flights of weak sensors less than a turn long are right (seeds 93033-93187), and
# the one with nearly all ON is 163 degrees off. Of 134 right answers none has less than a tenth of the rarer polarity.
LEAST_OF_POLARITY = 0.05
# The rhythm of the logo's visits follows the spin to this share, and the line of sight's own turn while the ball passes
# (0.7 rps at 9 m/s and 2 m); farther off than so many of these is another spin.
RHYTHM_SHARE, SIGHT_RPS, RHYTHM_SIGMAS = 0.015, 0.7, 3.0
OUTLINE = "nearly all logo events have one polarity and have not come back: a slow sensor's outline does that too"
RHYTHM_EXCLUDED = -8.0  # log likelihood below which, four sigma, a magnitude is no rhythm's


@dataclass(frozen=True, kw_only=True)
class ContrastParameters(ParameterGroup):
    """Kernel, window, and what is trusted."""

    renamed: ClassVar[dict[str, str]] = {"weakest": "min_gain"}

    kernel_rad: float = tunable(
        0.04, 0.01, 0.3, 0.005, "rad", "how near on the ball events must come to count as one (1 sigma)"
    )
    floor_events: float = tunable(1.5, 0.1, 100.0, 0.1, "events", "density below which differences mean little")
    window_us: int = tunable(500_000, 5000, 10_000_000, 5000, "us", "how far back in time events may lie")
    fewest_events: int = tunable(40, 10, 10_000, 10, "events", "logo events needed for an answer")
    min_gain: float = tunable(
        0.25, 0.0, 5.0, 0.05, "", "contrast that an event must gain over permuted times (natural log), on average"
    )
    rival_sigmas: float = tunable(1.2, 0.0, 20.0, 0.1, "sigma", "lead that the best spin must have over any other")
    # On 110 simulated flights that contrast answers rightly one in a hundred is farther away than 5.7.
    flow_sigmas: float = tunable(
        6.0,
        0.0,
        100.0,
        0.5,
        "sigma",
        "distance from the normal flow's spin that puts it in doubt, unless it is settled",
    )
    # In 122 flights of our simulator without a contact they are 3.1 apart at most, right after a hit 5.4.
    change_sigmas: float = tunable(
        8.0,
        0.0,
        100.0,
        0.5,
        "sigma",
        "distance between the spins of the flight's first and last third that shows a missed contact",
    )
    smallest_patch_rad: float = tunable(
        0.18, 0.0, 1.5, 0.01, "rad", "spread of the logo's events over the ball (rms) below which it is not seen"
    )
    axis_std_deg: float = tunable(12.0, 0.1, 180.0, 0.5, "deg", "largest stated error of the axis (1 sigma)")
    magnitude_std_rps: float = tunable(
        3.0, 0.01, 1000.0, 0.1, "rps", "largest stated error of the magnitude (1 sigma); a tenth of it if that is more"
    )
    curves: bool = switch(True, "score over magnitude and over axis directions, for the viewer")


@dataclass(slots=True)
class ContrastState:
    """The shot's logo events, tick by tick, and the last answers.

    Attributes
    ----------
    is_bright : list of bool
        See `LogoResult`, tick by tick.
    start_us : int, optional
        Start of the shot; None before its first tick.
    full_us : float
        Age of the shot, us, at which the next full estimate is due.
    tried, searched : int
        Number of events at the last full estimate and at the last search over all spins.
    scanned_turns, followed_contrast : float
        Turns that the last alias scan saw, and the best contrast of following since the last full estimate.
    changes : bool
        Whether the last full estimate saw the spin change within the flight.
    """

    context: Context
    start_us: int | None = None
    parts: list[tuple[int, SphereEvents]] = field(default_factory=list)
    ball_stds: list[tuple[float, float, float, float]] = field(default_factory=list)
    is_bright: list[bool] = field(default_factory=list)
    full_us: float = STAGES_US[0]
    tried: int = 0
    searched: int = 0
    scanned_turns: float = 0.0
    followed_contrast: float = 0.0
    answer: ContrastEstimate | None = None
    reason: str | None = None
    changes: bool = False
    score_map: ScoreMap = field(default_factory=ScoreMap.empty)


def start(parameters: ContrastParameters, context: Context) -> ContrastState:
    """No events yet."""
    return ContrastState(context)


def absent(parameters: ContrastParameters, reason: str) -> ContrastResult:
    """Refusal, because there is no ball."""
    return ContrastResult.nothing(SpinEstimate.refused(METHOD, reason))


def step(
    parameters: ContrastParameters,
    state: ContrastState,
    packet: Packet,
    ball: BallTrack,
    rate: RateResult,
    logo: LogoResult,
    normal_flow: MethodResult,
) -> ContrastResult:
    """The estimate from the shot up to the end of this tick."""
    age_us = take(parameters, state, packet, ball, logo)
    count = sum(len(part) for _, part in state.parts)
    if count < parameters.fewest_events:
        state.answer = None
        reason = f"the logo was not seen: {count} logo events, {parameters.fewest_events} are needed"
        return ContrastResult.nothing(SpinEstimate.refused(METHOD, reason, count))
    full = _due(state, age_us, count)
    settings = ContrastSettings(
        fastest_rps=last_of_grid_rps(state.context["spin.max_spin_rps"]),
        sigma_rad=parameters.kernel_rad,
        floor=parameters.floor_events,
        min_events=parameters.fewest_events,
    )
    events, calls = _joined(state), state.context.calls
    if not full and state.answer is not None and state.reason is None:
        state.answer = calls.result(follow_spin, events, _uncertainty(state.ball_stds), settings, state.answer)
        state.reason = doubt(parameters, state.answer)
        full = state.answer.contrast < LOST * state.followed_contrast or state.answer.linked_share < LEAST_LINKED
        full = full or state.scanned_turns < RETURNED_TURNS <= state.answer.turns
        full = full or (count >= MORE * state.tried and misses_rhythm(rate, state.answer))
        state.followed_contrast = max(state.followed_contrast, state.answer.contrast)
    if full:
        _estimate(parameters, state, events, settings, rate.period_spins_rps, normal_flow.estimate)
        state.tried, state.followed_contrast = count, 0.0
        empty = not parameters.curves
        state.score_map = ScoreMap.empty() if empty else calls.result(score_map, events, state.answer, settings)
    return _result(parameters, state, count, full, rate, normal_flow.estimate)


def take(
    parameters: ContrastParameters, state: ContrastState, packet: Packet, ball: BallTrack, logo: LogoResult
) -> int:
    """Keep the tick's events that turn with the ball, and what is known of the ball's place; `step` begins with it.

    Returns the age of the shot, us.
    """
    if state.start_us is None:
        state.start_us = packet.start_us
    turning = logo.turning
    rays = state.context.camera.rays(turning.centre_x_px, turning.centre_y_px)
    part = SphereEvents(
        (turning.t_us * 1e-6).astype(np.float64),
        np.ascontiguousarray(turning.normals.T),
        turning.on.astype(np.int64),
        np.ascontiguousarray((rays / np.linalg.norm(rays, axis=1)[:, None]).T),
        np.full(len(turning), logo.radius_px),
    )
    state.parts.append((packet.end_us, part))
    speed_px_s = math.hypot(ball.mean[2], ball.mean[3])
    state.ball_stds.append((logo.position_std_px, logo.radius_std_px, logo.velocity_std_px_s, speed_px_s))
    state.is_bright.append(logo.is_bright)
    while state.parts[0][0] <= packet.end_us - parameters.window_us:
        del state.parts[0], state.ball_stds[0], state.is_bright[0]
    return packet.end_us - state.start_us


def _joined(state: ContrastState) -> SphereEvents:
    names = SphereEvents.__slots__
    return SphereEvents(*(np.concatenate([getattr(p, name) for _, p in state.parts], axis=-1) for name in names))


def _uncertainty(ball_stds: Sequence[tuple[float, float, float, float]]) -> BallUncertainty:
    """Uncertainty of the ball's place over some ticks: their medians."""
    position, radius, velocity, speed = (float(value) for value in np.median(np.array(ball_stds), axis=0))
    return BallUncertainty(
        centre_std_px=max(math.hypot(position, speed * LATENCY_SPREAD_S), 0.01),
        radius_std_px=max(radius, 0.01),
        track_std_px=position,
        drift_std_px_s=velocity,
        speed_px_s=speed,
    )


def _due(state: ContrastState, age_us: int, count: int) -> bool:
    """Whether a full estimate is due: by the shot's age, or after a refusal as soon as there is much more to see."""
    if age_us >= state.full_us:
        later = [stage for stage in STAGES_US if stage > age_us]
        state.full_us = later[0] if later else LATER * age_us
        return True
    refused = state.answer is None or state.reason is not None
    return refused and count >= (MORE_OF_VISIT if state.reason == UNLINKED else MORE) * state.tried


def _estimate(
    parameters: ContrastParameters,
    state: ContrastState,
    events: SphereEvents,
    settings: ContrastSettings,
    rhythms_rps: Floats,
    normal_flow: SpinEstimate,
) -> None:
    """A full estimate: first from what is known already, and from a search where that does not convince."""
    starts, calls = [], state.context.calls
    if state.answer is not None and state.answer.spin_rps is not None:
        starts += [state.answer.spin_rps, *state.answer.rivals_rps]
    if normal_flow.vector_rps is not None:
        near_it = START_STEP_RPS * np.round(normal_flow.vector_rps / START_STEP_RPS)
        starts += [near_it] if np.any(near_it) else []
    starts_rps, ball = np.array(starts).reshape(-1, 3), _uncertainty(state.ball_stds)
    answer, scanning = None, not is_settled(parameters, state)
    if starts:
        answer = calls.result(
            estimate_spin,
            events,
            ball,
            settings,
            starts_rps=starts_rps,
            rhythms_rps=rhythms_rps,
            searching=False,
            scanning=scanning,
        )
    worth_it = len(events) >= SEARCH_MORE * state.searched
    if answer is None or (worth_it and not _convinces(parameters, answer, normal_flow)):
        state.searched, scanning = len(events), True
        answer = calls.result(estimate_spin, events, ball, settings, starts_rps=starts_rps, rhythms_rps=rhythms_rps)
    if scanning:
        state.scanned_turns = answer.turns
    state.answer, state.reason, state.changes = answer, doubt(parameters, answer), False
    # A ball that stays in place, on a spinner, touches nothing.
    if state.reason is None and ball.is_flying:
        ticks = max(1, len(state.ball_stds) // PARTS)
        balls = _uncertainty(state.ball_stds[:ticks]), _uncertainty(state.ball_stds[-ticks:])
        ends = calls.result(estimates_of_ends, events, balls, settings, answer)
        state.reason = change_doubt(parameters, *ends) if ends else None
        state.changes = state.reason is not None


def is_settled(parameters: ContrastParameters, state: ContrastState) -> bool:
    """Whether the last answer has no rival worth looking for, nor a normal flow that could outweigh it.

    Of 2,022 answers of the normal flow on 116 simulated shots 3 % are more than 6 of their sigma off: log odds of 3.5.
    A lead of SETTLED times the usual one over two turns has 6.
    """
    answer = state.answer
    if answer is None or answer.spin_rps is None or state.reason is not None:
        return False
    clear = not answer.margins.size or float(answer.margins.min()) >= SETTLED * parameters.rival_sigmas
    keeps = state.followed_contrast == 0.0 or answer.contrast >= LOST * state.followed_contrast
    return clear and keeps and state.scanned_turns >= SETTLED_TURNS


def _convinces(parameters: ContrastParameters, answer: ContrastEstimate, normal_flow: SpinEstimate) -> bool:
    """Whether nothing speaks against an answer, neither its own events nor the normal flow."""
    estimate = SpinEstimate(METHOD, answer.spin_rps, answer.covariance_rps2, None)
    return doubt(parameters, answer) is None and sigmas_apart(estimate, normal_flow) <= parameters.flow_sigmas


def doubt(parameters: ContrastParameters, answer: ContrastEstimate) -> str | None:
    """Reason why an answer is not to be trusted, in words; None if it is."""
    if answer.spin_rps is None:
        return f"the logo was not seen: {answer.events} logo events, {parameters.fewest_events} are needed"
    if answer.contrast < parameters.min_gain:
        return (
            f"no pattern turns with the ball: the best spin hardly sharpens the logo ({answer.contrast:.2f} in log "
            f"likelihood an event, {parameters.min_gain:g} are needed)"
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
    if answer.linked_share < LEAST_LINKED:
        return UNLINKED
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
    return rate.period_sigmas >= FEWEST_SIGMAS and not _is_one_of(_rhythms_rps(rate), answer)


def comes_back_twice(rate: RateResult, answer: ContrastEstimate, normal_flow: SpinEstimate) -> bool:
    """Whether the pattern comes back twice in a turn of this answer's: with a magnitude that the normal flow excludes.

    A long logo near the pole of the spin looks alike after half a turn, as do stamps on two sides. The normal flow does
    not rest on visits.
    """
    flow_rps, flow_std_rps = normal_flow.magnitude_rps, normal_flow.magnitude_std_rps
    if flow_rps is None or flow_std_rps is None:
        return False
    rhythms_rps = _rhythms_rps(rate)
    return _is_one_of(0.5 * rhythms_rps[rhythms_rps > flow_rps + RHYTHM_SIGMAS * flow_std_rps], answer)


def _rhythms_rps(rate: RateResult) -> Floats:
    """Magnitudes with which the pattern may come back."""
    rhythms_rps: Floats = rate.period_spins_rps[rate.period_log_likelihoods > RHYTHM_EXCLUDED]
    return rhythms_rps


def _is_one_of(magnitudes_rps: Floats, answer: ContrastEstimate) -> bool:
    """Whether the answer's magnitude is one of these, or has no error to compare it by."""
    estimate = SpinEstimate(METHOD, answer.spin_rps, answer.covariance_rps2, None)
    magnitude, std = estimate.magnitude_rps, estimate.magnitude_std_rps
    if magnitude is None or std is None:
        return True
    most_rps = RHYTHM_SIGMAS * math.hypot(std, RHYTHM_SHARE * magnitude, SIGHT_RPS)
    return bool(np.any(np.abs(magnitudes_rps - magnitude) <= most_rps))


def _may_be_one_of(parameters: ContrastParameters, answer: ContrastEstimate, normal_flow: SpinEstimate) -> bool:
    """Whether the normal flow's spin is one of those that make the pattern sharp: the best one or a rival.

    Stamps on two sides of a ball, whose edges move in opposite directions, can give it half of the spin.
    """
    assert answer.spin_rps is not None and answer.covariance_rps2 is not None
    spins_rps = (answer.spin_rps, *answer.rivals_rps)
    covariances_rps2 = (answer.covariance_rps2, *answer.rival_covariances_rps2)
    return any(
        sigmas_apart(SpinEstimate(METHOD, spin_rps, covariance_rps2, None), normal_flow) <= parameters.flow_sigmas
        for spin_rps, covariance_rps2 in zip(spins_rps, covariances_rps2, strict=True)
    )


def _are_one_polarity(state: ContrastState) -> bool:
    """Whether nearly all events have a polarity that the ball's leading outline has, too."""
    on = float(np.mean(np.concatenate([part.polarity for _, part in state.parts])))
    return on > 1.0 - LEAST_OF_POLARITY or (on < LEAST_OF_POLARITY and not all(state.is_bright))


def _judged(
    parameters: ContrastParameters,
    state: ContrastState,
    answer: ContrastEstimate,
    count: int,
    rate: RateResult,
    normal_flow: SpinEstimate,
) -> tuple[SpinEstimate, Pattern]:
    """Estimate of an answer from `count` events or its refusal, and what the events are.

    An answer is settled where the logo says so much that neither its rhythm nor its normal flow can put it in doubt.
    """
    assert answer.spin_rps is not None and answer.covariance_rps2 is not None
    settled = is_settled(parameters, state)
    may_be_outline = answer.turns < RETURNED_TURNS and _are_one_polarity(state)
    off_rhythm = not settled and misses_rhythm(rate, answer) and not comes_back_twice(rate, answer, normal_flow)
    pattern: Pattern = "turning"
    if answer.contrast < parameters.min_gain:
        pattern = "none"
    elif off_rhythm:
        pattern = "off_rhythm"
    elif may_be_outline or answer.linked_share < LEAST_LINKED:
        pattern = "unclear"
    estimate = SpinEstimate(METHOD, answer.spin_rps.copy(), answer.covariance_rps2.copy(), None, count)
    reason, against = state.reason, None
    if reason is not None:
        # Where nothing turns, the normal flow has seen no pattern either, but noise; of two spins it is a mixture.
        one_pattern = pattern == "turning" and not state.changes
        against = None if one_pattern and _may_be_one_of(parameters, answer, normal_flow) else FLOW_METHOD
    elif may_be_outline:
        reason, against = OUTLINE, FLOW_METHOD  # which sees the same events
    elif not settled and (sigmas := sigmas_apart(estimate, normal_flow)) > parameters.flow_sigmas:
        best, other = vector_words(answer.spin_rps), vector_words(normal_flow.vector_rps)
        reason, against = f"the normal flow says {other}, {sigmas:.0f} sigma from {best}", FLOW_METHOD
    elif off_rhythm:
        reason = (
            f"the logo comes back with {rate.period_spins_rps[0]:.1f} rps, not with {vector_words(answer.spin_rps)}"
        )
    if reason is not None:
        estimate = SpinEstimate.refused(METHOD, reason, count, against=against)
    return estimate, pattern


def _result(
    parameters: ContrastParameters, state: ContrastState, count: int, full: bool, rate: RateResult, flow: SpinEstimate
) -> ContrastResult:
    answer = state.answer
    if answer is None or answer.spin_rps is None or answer.covariance_rps2 is None:
        return ContrastResult.nothing(SpinEstimate.refused(METHOD, state.reason or "no estimate yet", count))
    estimate, pattern = _judged(parameters, state, answer, count, rate, flow)
    middle_us, half_us = answer.reference_s * 1e6, 0.5e6 * answer.span_s
    return ContrastResult(
        estimate=estimate.up_to(state.context["spin.max_spin_rps"], FLOW_METHOD),
        best_rps=answer.spin_rps.copy(),
        covariance_rps2=answer.covariance_rps2.copy(),
        rivals_rps=answer.rivals_rps.copy(),
        rival_covariances_rps2=answer.rival_covariances_rps2.copy(),
        rival_sigmas=answer.margins.copy(),
        start_us=round(middle_us - half_us),
        end_us=round(middle_us + half_us),
        reference_us=middle_us,
        offsets_px=answer.offsets_px.copy(),
        contrast=answer.contrast,
        pattern=pattern,
        changes=state.changes,
        full=full,
        **{name: column.copy() for name, column in state.score_map._asdict().items()},
    )


def is_trusted(estimates: Mapping[str, SpinEstimate]) -> bool:
    """Whether contrast answers, and no other witness leaves another spin open: one limit of the odds for both."""
    combined = estimates.get("combined")
    return estimates[METHOD].status == "ok" and (combined is None or combined.status == "ok")


STAGE = SpinMethod(
    name=METHOD,
    label="Contrast maximisation",
    help="The spin whose derotation makes the logo sharpest on the ball, with its uncertainty.",
    inputs=("packet", "ball", "rate", "logo", FLOW_METHOD),
    reads=("spin.max_spin_rps",),
    parameters=ContrastParameters,
    start=start,
    step=step,
    absent=absent,
    is_slow=True,
    colour=(236, 64, 122),
    is_trusted=is_trusted,
)
