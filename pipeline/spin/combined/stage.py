"""Combined answer: the most likely of the candidates by all witnesses together, and whether it is to be trusted."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from ...kernels.arrays import Floats, Integers
from ...parameters import ParameterGroup, tunable
from ...results import MethodResult, Packet, SpinEstimate
from ...spin_terms import vector_words
from ...stage import Context, SpinMethod
from ...stages.logo import LogoResult
from ...stages.rate import RateResult
from ...stages.track_result import BallTrack
from ..contrast import ContrastResult
from ..contrast.search import NEAR
from ..trajectory.stage import TRUSTED_AXIS_DEG, TRUSTED_SHARE, TrajectoryResult
from .candidates import Candidate, flight_candidates, pattern_candidates, rhythm_candidates
from .likelihoods import BLUNDER, by_flight, by_flow, by_rate, by_sightings, fallible, log_mean, rhythms_of
from .result import SPEAKS, Basis, CombinedResult, Witness
from .sightings import Sightings

METHOD = "combined"

# A spin less likely than this is excluded by the flight (3 sigma).
EXCLUDED = -4.5
# Candidates whose magnitudes differ by more than this share are other spins, also of one axis: a turn more or less
# between the logo's visits.
SAME_MAGNITUDE = 0.1
LABELS = {
    "logo": "the times at which the logo was seen",
    "rate": "the rhythm",
    "normal_flow": "the normal flow",
    "contrast": "the pattern",
    "trajectory": "the flight",
}
# The witness whose own likelihoods the candidates carry.
NAMED_BY: dict[Basis, str] = {"pattern": "contrast", "rhythm": "rate"}
CONTRIBUTIONS: dict[Basis, str] = {
    "pattern": "magnitude and axis from the logo's pattern",
    "rhythm": "magnitude from the rhythm of the logo's visits, axis from the flight",
    "flight": "magnitude and axis from the bend of the flight",
}


@dataclass(frozen=True, kw_only=True)
class CombinedParameters(ParameterGroup):
    """Limits of the combined answer."""

    odds: float = tunable(
        20.0, 1.0, 1e6, 1.0, "", "how many times more likely the spin must be than all others together"
    )
    axis_std_deg: float = tunable(12.0, 0.1, 180.0, 0.5, "deg", "largest stated error of an axis by the logo (1 sigma)")
    flight_axis_std_deg: float = tunable(
        TRUSTED_AXIS_DEG, 0.1, 180.0, 0.5, "deg", "largest stated error of an axis by the flight alone (1 sigma)"
    )
    # Lift is known to 12 % and saturates: a flight tells the magnitude of most shots no better.
    flight_share: float = tunable(
        TRUSTED_SHARE, 0.01, 1.0, 0.01, "", "largest stated error (1 sigma) of a magnitude by the flight alone, over it"
    )
    magnitude_std_rps: float = tunable(
        3.0, 0.01, 1000.0, 0.1, "rps", "largest stated error of the magnitude (1 sigma); a tenth of it if that is more"
    )


@dataclass(slots=True)
class CombinedState:
    """Sightings of the logo in the shot so far; the other witnesses remember by themselves."""

    context: Context
    sightings: Sightings = field(default_factory=Sightings)


def start(parameters: CombinedParameters, context: Context) -> CombinedState:
    """No sightings yet."""
    return CombinedState(context)


def absent(parameters: CombinedParameters, reason: str) -> CombinedResult:
    """Refusal, because there is no ball."""
    return CombinedResult(SpinEstimate.refused(METHOD, reason))


def step(
    parameters: CombinedParameters,
    state: CombinedState,
    packet: Packet,
    ball: BallTrack,
    logo: LogoResult,
    rate: RateResult,
    normal_flow: MethodResult,
    contrast: ContrastResult,
    trajectory: TrajectoryResult,
) -> CombinedResult:
    """The estimate that all witnesses together give at the end of this tick."""
    state.sightings.add(packet, ball, logo, state.context.camera, state.context["contrast.window_us"])
    basis, candidates = _candidates(state.context, rate, contrast, trajectory)
    witnesses = _witnesses(rate, normal_flow.estimate, contrast, trajectory)
    if basis is None or contrast.changes:
        reason = contrast.estimate.reason or "the logo is not seen"
        # The flight is of two flights as well, or tells to a third what a logo in view would tell to a hundredth.
        against = "trajectory" if contrast.changes or contrast.pattern != "none" else None
        return CombinedResult(SpinEstimate.refused(METHOD, reason, against=against), witnesses)
    spins_rps = np.stack([candidate.spins_rps for candidate in candidates])
    bend = by_flight(trajectory, spins_rps)
    logs = {"trajectory": bend}
    if basis != "flight":
        logs["normal_flow"] = by_flow(normal_flow.estimate, spins_rps)
    if basis == "pattern":
        logs |= {"trajectory": fallible(bend, BLUNDER["trajectory"]), "rate": by_rate(rate, spins_rps)}
    own = np.array([candidate.log_likelihood for candidate in candidates])
    drawn = np.stack([candidate.log_weights for candidate in candidates])
    # Flow, rhythm and sightings are of the same events as the pattern: they choose among its spins, but make none more
    # certain. Neither does a flight that excludes them all.
    weights = drawn + np.where(bend.max(axis=1) > EXCLUDED, bend.T, 0.0).T
    if basis == "flight":
        logs["logo"] = by_sightings(state.sightings, spins_rps)
        weights += logs["logo"]
    else:
        logs["logo"] = by_sightings(state.sightings, spins_rps.mean(axis=1, keepdims=True))
    evidence = own + log_mean(sum(logs.values(), drawn))
    best = int(np.argmax(evidence))
    estimate, rivals = _estimate(parameters, spins_rps, weights, evidence, best, basis, contrast.estimate.events)
    if basis == "rhythm" and log_mean(bend)[0] <= EXCLUDED:
        # The rhythm's spin is partly along the flight, or comes back more than once a turn.
        reason = f"no spin of {np.linalg.norm(spins_rps[0][0]):.0f} rps across the flight bends it like this one"
        estimate = SpinEstimate.refused(METHOD, reason, contrast.estimate.events)
    estimate = estimate.up_to(state.context["spin.max_spin_rps"])
    if estimate.status != "ok" and basis != "flight":
        # The logo is seen but leaves the spin open: the flight alone would tell its magnitude to a third at best.
        estimate = replace(estimate, against="trajectory")
    by_witness = {name: log_mean(values) for name, values in logs.items()}
    if basis in NAMED_BY:
        by_witness[NAMED_BY[basis]] = own
    rival = max(rivals, key=lambda k: evidence[k], default=best)
    witnesses = tuple(
        replace(one, log_odds=float(by_witness[one.name][best] - by_witness[one.name][rival]))
        for one in (*witnesses, Witness("logo", None, None, None, None))
        if one.name in by_witness
    )
    summary = _summary(basis, witnesses) if estimate.status == "ok" else ""
    return CombinedResult(estimate, witnesses, summary, basis)


def _candidates(
    context: Context, rate: RateResult, contrast: ContrastResult, trajectory: TrajectoryResult
) -> tuple[Basis | None, list[Candidate]]:
    """The spins to choose from by the most precise witness that names any, and which it is."""
    gyro_std_deg = context["trajectory.gyro_std_deg"]
    if contrast.pattern == "turning":
        return "pattern", pattern_candidates(contrast)
    # Of 17 rhythms that contradict a sharp pattern none is right: they are twice the spin (docs/contrast.md).
    if contrast.pattern == "off_rhythm":
        return None, []
    if candidates := rhythm_candidates(rate, trajectory, gyro_std_deg):
        return "rhythm", candidates
    if contrast.pattern == "unclear":
        return None, []
    candidates = flight_candidates(trajectory, gyro_std_deg, context["spin.max_spin_rps"])
    return ("flight" if candidates else None), candidates


def _estimate(
    parameters: CombinedParameters,
    spins_rps: Floats,
    weights: Floats,
    evidence: Floats,
    best: int,
    basis: Basis,
    events: int,
) -> tuple[SpinEstimate, list[int]]:
    """The most likely spin with its covariance, or a refusal; and the candidates that are other spins.

    As in `contrast`, candidates nearer than NEAR are part of its error, and only the others must be beaten.
    """
    shares = np.exp(weights - np.max(weights, axis=1)[:, None])
    shares /= shares.sum(axis=1)[:, None]
    means = np.einsum("ks,ksi->ki", shares, spins_rps)
    sizes = np.einsum("ks,ks->k", shares, np.linalg.norm(spins_rps, axis=2))
    is_near = np.linalg.norm(means - means[best], axis=1) <= NEAR * np.linalg.norm(means[best])
    is_near &= np.abs(sizes - sizes[best]) <= SAME_MAGNITUDE * sizes[best]
    near, others = np.flatnonzero(is_near), np.flatnonzero(~is_near)
    probabilities = np.exp(evidence - np.logaddexp.reduce(evidence))
    share = probabilities[near, None] * shares[near] / probabilities[near].sum()
    mean = np.einsum("ks,ksi->i", share, spins_rps[near])
    axis, magnitudes = mean / np.linalg.norm(mean), np.linalg.norm(spins_rps[near], axis=2)
    # Scattered axes have a mean that is shorter than they are; a magnitude known to a share has no symmetric error.
    logs = np.log(magnitudes)
    log_magnitude = float(np.sum(share * logs))
    magnitude = math.exp(log_magnitude)
    mean = magnitude * axis
    across = (spins_rps[near] - mean) @ (np.eye(3) - np.outer(axis, axis))
    covariance = np.einsum("ks,ksi,ksj->ij", share, across, across)
    covariance += float(np.sum(share * (logs - log_magnitude) ** 2)) * np.outer(mean, mean)
    # Few samples that count make the spread look too small.
    covariance *= 1.0 + 3.0 * float(np.sum(share**2))
    estimate = SpinEstimate(METHOD, mean, covariance, None, events)
    odds = probabilities[near].sum() / max(probabilities[others].sum(), 1e-300)
    reason = _doubt(parameters, estimate, float(odds), means, evidence, others, basis)
    return (SpinEstimate.refused(METHOD, reason, events) if reason else estimate), others.tolist()


def _doubt(
    parameters: CombinedParameters,
    estimate: SpinEstimate,
    odds: float,
    means: Floats,
    evidence: Floats,
    others: Integers,
    basis: Basis,
) -> str | None:
    """Reason why the combined spin is not to be trusted; None if it is."""
    magnitude, std, axis_std = estimate.magnitude_rps, estimate.magnitude_std_rps, estimate.axis_std_deg
    if magnitude is None or std is None or axis_std is None:
        return "the ball does not turn"
    if odds < parameters.odds:
        rival = means[others[np.argmax(evidence[others])]]
        return (
            f"all witnesses together leave two spins open: {vector_words(estimate.vector_rps)} is only "
            f"{odds:.0f} times as likely as {vector_words(rival)}"
        )
    widest_rps = max(parameters.magnitude_std_rps, 0.1 * magnitude)
    if std > (parameters.flight_share * magnitude if basis == "flight" else widest_rps):
        return f"the magnitude is too uncertain: {magnitude:.1f} +- {std:.1f} rps"
    if axis_std > (parameters.axis_std_deg if basis == "pattern" else parameters.flight_axis_std_deg):
        return f"the axis is too uncertain: +- {axis_std:.0f} degrees"
    return None


def _witnesses(
    rate: RateResult, flow: SpinEstimate, contrast: ContrastResult, trajectory: TrajectoryResult
) -> tuple[Witness, ...]:
    """Evidence of each witness by itself, of those that have any."""
    said = []
    for magnitude, std, _ in rhythms_of(rate)[:1]:
        said.append(Witness("rate", None, None, float(magnitude), std))
    spins = {"normal_flow": (flow.vector_rps, flow.covariance_rps2)}
    if not math.isnan(contrast.best_rps[0]):
        spins["contrast"] = contrast.best_rps, contrast.covariance_rps2
    spins["trajectory"] = trajectory.estimate.vector_rps, trajectory.estimate.covariance_rps2
    for name, (spin_rps, covariance_rps2) in spins.items():
        if spin_rps is not None:
            one = SpinEstimate(name, spin_rps, covariance_rps2, None)
            said.append(Witness(name, spin_rps, covariance_rps2, one.magnitude_rps, one.magnitude_std_rps))
    return tuple(said)


def _summary(basis: Basis, witnesses: tuple[Witness, ...]) -> str:
    """Contributions of the witnesses, in words."""
    words = [CONTRIBUTIONS[basis]]
    if basis != "pattern":
        return words[0]
    deciding = [LABELS[one.name] for one in witnesses if one.name != "contrast" and one.log_odds > SPEAKS]
    against = [LABELS[one.name] for one in witnesses if one.log_odds < -SPEAKS]
    if deciding:
        words.append(f"chosen among several spins by {' and '.join(deciding)}")
    if against:
        words.append(f"against {' and '.join(against)}")
    return "; ".join(words)


def is_trusted(estimates: Mapping[str, SpinEstimate]) -> bool:
    """Whether the witnesses answer together where the pattern alone is not enough, or tells another spin."""
    estimate, alone = estimates[METHOD], estimates["contrast"]
    if estimate.vector_rps is None or alone.vector_rps is None:
        return estimate.vector_rps is not None
    apart = estimate.vector_rps - alone.vector_rps
    return bool(apart @ apart > (NEAR * np.linalg.norm(alone.vector_rps)) ** 2)


STAGE = SpinMethod(
    name=METHOD,
    label="Combined",
    help="One spin from the logo's pattern and motion, the rhythm and times of its visits and the bend of the flight.",
    inputs=("packet", "ball", "logo", "rate", "normal_flow", "contrast", "trajectory"),
    parameters=CombinedParameters,
    reads=("spin.max_spin_rps", "trajectory.gyro_std_deg", "contrast.window_us"),
    start=start,
    step=step,
    absent=absent,
    is_slow=True,
    colour=(255, 255, 255),
    is_trusted=is_trusted,
)
