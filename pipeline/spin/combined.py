"""Combined: one spin from the logo's pattern, its motion, the rhythm of its visits and the bend of the flight.

Not in the paper. Contrast names the spins that explain the logo; where it names none, the rhythm's magnitudes about the
flight's axis stand in. Each of these candidates is weighed by the likelihoods of all other witnesses, which also narrow
its error. A witness that may be wrong altogether says so in its likelihood: a mixture of what it measures and of a
blunder, so that none of them alone can exclude what all others say.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..kernels.arrays import Floats, Integers
from ..parameters import ParameterGroup, tunable
from ..results import MethodResult, ReadOnlyArrays, SpinEstimate
from ..spin_terms import vector_words
from ..stage import Context, SpinMethod
from ..stages.rate import RateResult
from .contrast.estimate import LOG_ODDS_PER_SIGMA
from .contrast.result import ContrastResult
from .trajectory.stage import TrajectoryResult

METHOD = "combined"

# Probability that a witness is wrong altogether: normal flow that saw the outline, a period of something else than the
# logo's visits, a flight of another ball or other air.
BLUNDER = {"normal_flow": 0.2, "rate": 0.1, "trajectory": 0.03}
# The line of sight's own turn while the ball passes (0.7 rps at 9 m/s and 2 m), and the share to which the visits'
# rhythm follows the spin: both are in the difference between the rhythm and the spin.
SIGHT_RPS, RHYTHM_SHARE = 0.7, 0.01
# A spin less likely than this is excluded by the flight (3 sigma).
EXCLUDED = -4.5
# Candidates this near to each other, as a part of the spin, are one spin.
NEAR = 0.1
# Beyond this spread (1 sigma) the flight names no axis; axes are drawn so many times as widely as it states.
WIDEST_RAD, WIDER = math.radians(30.0), 1.5
LABELS = {"rate": "the rhythm", "normal_flow": "the normal flow", "contrast": "the pattern", "trajectory": "the flight"}
# Without a pattern nothing tells how many marks the ball has: a seam, or stamps on both sides, come back twice a turn.
# Few balls show these alone.
TWO_SIDED = 0.05
# People's shots: median 46 rps, 95 % below 120 (4,024 real shots). Counts where only rhythm and flight speak.
HUMAN_RPS, HUMAN_SPREAD = 46.0, math.log(120.0 / 46.0) / 1.645
# A witness that makes one spin three times as likely as the next speaks for it.
SPEAKS = math.log(3.0)
# Standard normal deviates by which every candidate's spread is sampled.
SAMPLES: Floats = np.random.default_rng(0).standard_normal((256, 3))


@dataclass(frozen=True, kw_only=True)
class CombinedParameters(ParameterGroup):
    """Limits of the combined answer."""

    odds: float = tunable(
        100.0, 1.0, 1e6, 1.0, "", "how many times more likely the spin must be than all others together"
    )
    rhythm_odds: float = tunable(20.0, 1.0, 1e6, 1.0, "", "the same where only rhythm and flight speak")
    axis_std_deg: float = tunable(12.0, 0.1, 180.0, 0.5, "deg", "largest stated error of an axis by the logo (1 sigma)")
    flight_axis_std_deg: float = tunable(
        20.0, 0.1, 180.0, 0.5, "deg", "largest stated error of an axis by the flight alone (1 sigma)"
    )
    magnitude_std_rps: float = tunable(
        3.0, 0.01, 1000.0, 0.1, "rps", "largest stated error of the magnitude (1 sigma); a tenth of it if that is more"
    )


@dataclass(frozen=True, slots=True, eq=False)
class Witness(ReadOnlyArrays):
    """One source of evidence by itself, and what it says of the combined answer.

    Attributes
    ----------
    name : str
        Stage that it comes from.
    spin_rps, covariance_rps2 : (3,) and (3, 3) float64, optional
        Its own spin; None where it tells no axis.
    magnitude_rps, magnitude_std_rps : float, optional
        Its own magnitude; None where it tells none.
    log_odds : float
        Natural logarithm of how much more likely it makes the combined spin than the next best candidate.
    """

    name: str
    spin_rps: Floats | None
    covariance_rps2: Floats | None
    magnitude_rps: float | None
    magnitude_std_rps: float | None
    log_odds: float = 0.0

    def to_dict(self) -> dict[str, Any]:
        """The witness as `spinscope analyze` writes it, ready for JSON."""
        axis = None
        if self.spin_rps is not None and self.magnitude_rps:
            axis = (self.spin_rps / self.magnitude_rps).tolist()
        return {
            "witness": self.name,
            "magnitude_rps": self.magnitude_rps,
            "magnitude_std_rps": self.magnitude_std_rps,
            "axis": axis,
            "log_odds": self.log_odds,
        }


@dataclass(frozen=True, slots=True, eq=False)
class CombinedResult:
    """The combined estimate, and what each witness contributed.

    Attributes
    ----------
    estimate : SpinEstimate
        From the present shot so far.
    witnesses : tuple of Witness
        Those that say something, in the order of the chain.
    summary : str
        Who told what, in words; empty without an answer.
    """

    estimate: SpinEstimate
    witnesses: tuple[Witness, ...] = ()
    summary: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class _Candidate:
    """A spin as samples of its spread, and its logarithmic likelihood by the witness that named it.

    `log_weights` (n,) make up for samples that were not drawn from that witness's likelihood.
    """

    spins_rps: Floats
    log_weights: Floats
    log_likelihood: float


def start(parameters: CombinedParameters, context: Context) -> Context:
    """The state is the context alone: the witnesses remember."""
    return context


def absent(parameters: CombinedParameters, reason: str) -> CombinedResult:
    """Refusal, because there is no ball."""
    return CombinedResult(SpinEstimate.refused(METHOD, reason))


def step(
    parameters: CombinedParameters,
    state: Context,
    rate: RateResult,
    normal_flow: MethodResult,
    contrast: ContrastResult,
    trajectory: TrajectoryResult,
) -> CombinedResult:
    """The estimate that all witnesses together give at the end of this tick."""
    by_logo = contrast.turns_seen
    candidates = _by_pattern(contrast) if by_logo else _by_rhythm(rate, trajectory, state["trajectory.gyro_std_deg"])
    witnesses = _witnesses(rate, normal_flow.estimate, contrast, trajectory)
    if not candidates:
        reason = contrast.estimate.reason or "the logo is not seen"
        return CombinedResult(SpinEstimate.refused(METHOD, reason), witnesses)
    spins_rps = np.stack([candidate.spins_rps for candidate in candidates])
    by_flight = _by_flight(trajectory, spins_rps)
    logs = {"trajectory": by_flight}
    if by_logo:
        logs = {"trajectory": _fallible(by_flight, BLUNDER["trajectory"])}
        logs |= {"normal_flow": _by_flow(normal_flow.estimate, spins_rps), "rate": _by_rate(rate, spins_rps)}
    own = np.array([candidate.log_likelihood for candidate in candidates])
    drawn = np.stack([candidate.log_weights for candidate in candidates])
    evidence = own + _log_mean(sum(logs.values(), drawn))
    best = int(np.argmax(evidence))
    # Flow and rhythm are of the same events as the pattern: they choose among its spins, but make none more certain.
    # Neither does a flight that excludes them all.
    weights = drawn + np.where(by_flight.max(axis=1) > EXCLUDED, by_flight.T, 0.0).T
    estimate, rivals = _estimate(parameters, spins_rps, weights, evidence, best, by_logo, contrast.estimate.events)
    if not by_logo and _log_mean(by_flight)[0] <= EXCLUDED:
        # The rhythm's spin is partly along the flight, or comes back more than once a turn.
        reason = f"no spin of {np.linalg.norm(spins_rps[0][0]):.0f} rps across the flight bends it like this one"
        estimate = SpinEstimate.refused(METHOD, reason, contrast.estimate.events)
    by_witness = {name: _log_mean(values) for name, values in logs.items()}
    by_witness["contrast" if by_logo else "rate"] = own
    rival = max(rivals, key=lambda k: evidence[k], default=best)
    witnesses = tuple(
        replace(one, log_odds=float(by_witness[one.name][best] - by_witness[one.name][rival]))
        for one in witnesses
        if one.name in by_witness
    )
    return CombinedResult(estimate, witnesses, _summary(by_logo, witnesses) if estimate.status == "ok" else "")


def _by_pattern(contrast: ContrastResult) -> list[_Candidate]:
    """The spins that explain the logo's pattern: the best one and its rivals."""
    spins_rps = np.concatenate([contrast.best_rps[None], contrast.rivals_rps])
    covariances = np.concatenate([contrast.covariance_rps2[None], contrast.rival_covariances_rps2])
    logs = -LOG_ODDS_PER_SIGMA * np.append(0.0, contrast.rival_sigmas)
    nothing = np.zeros(len(SAMPLES))
    return [
        _Candidate(_spread(spin, covariance), nothing, float(log))
        for spin, covariance, log in zip(spins_rps, covariances, logs, strict=True)
    ]


def _spread(spin_rps: Floats, covariance_rps2: Floats) -> Floats:
    """Samples (n, 3) of a spin with its covariance; across the axis they turn it, without a change of magnitude."""
    values, vectors = np.linalg.eigh(covariance_rps2)
    samples = spin_rps + SAMPLES @ (vectors * np.sqrt(np.maximum(values, 0.0))).T
    magnitudes = samples @ spin_rps / max(float(np.linalg.norm(spin_rps)), 1e-9)
    spread: Floats = samples * (magnitudes / np.linalg.norm(samples, axis=1))[:, None]
    return spread


def _by_rhythm(rate: RateResult, trajectory: TrajectoryResult, gyro_std_deg: float) -> list[_Candidate]:
    """The rhythm's magnitudes about the axis that the flight tells; none where either says nothing."""
    across = trajectory.across
    if across is None or across.axis_std_rad > WIDEST_RAD:
        return []
    side, gyro = np.cross(across.along, across.axis), math.tan(math.radians(gyro_std_deg))
    # Drawn wider than the flight's own likelihood, which then weighs them.
    directions = (
        across.axis
        + WIDER * across.axis_std_rad * SAMPLES[:, 1, None] * side
        + gyro * SAMPLES[:, 2, None] * across.along
    )
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    log_weights = 0.5 * SAMPLES[:, 1] ** 2
    return [
        _Candidate(
            ((magnitude + std * SAMPLES[:, 0]) / marks)[:, None] * directions,
            log_weights,
            log + math.log(share) + _log_prior(magnitude / marks),
        )
        for magnitude, std, log in _rhythms(rate)
        for marks, share in ((1, 1.0 - TWO_SIDED), (2, TWO_SIDED))
    ]


def _log_prior(magnitude_rps: float) -> float:
    """Logarithmic density of a magnitude among people's shots, per logarithm of the magnitude, less the highest."""
    return -0.5 * (math.log(magnitude_rps / HUMAN_RPS) / HUMAN_SPREAD) ** 2


def _rhythms(rate: RateResult) -> list[tuple[float, float, float]]:
    """Magnitudes by which the logo's pattern comes back, rps: each with its 1 sigma and logarithmic likelihood."""
    if rate.period_reason is not None:
        return []
    share = rate.period_std_rps / rate.period_spins_rps[0]
    return [
        (magnitude, math.hypot(share * magnitude, RHYTHM_SHARE * magnitude, SIGHT_RPS), log)
        for magnitude, log in zip(rate.period_spins_rps, rate.period_log_likelihoods, strict=True)
    ]


def _by_rate(rate: RateResult, spins_rps: Floats) -> Floats:
    """(candidates, samples) logarithmic likelihood of the logo's rhythm; zeros where there is none."""
    rhythms = _rhythms(rate)
    if not rhythms:
        return np.zeros(spins_rps.shape[:2])
    magnitudes = np.linalg.norm(spins_rps, axis=2)
    parts = [log - 0.5 * ((magnitudes - magnitude) / std) ** 2 for magnitude, std, log in rhythms]
    return _fallible(np.logaddexp.reduce(parts), BLUNDER["rate"])


def _by_flow(estimate: SpinEstimate, spins_rps: Floats) -> Floats:
    """(candidates, samples) logarithmic likelihood of the normal flow; zeros where it refused."""
    if estimate.vector_rps is None or estimate.covariance_rps2 is None:
        return np.zeros(spins_rps.shape[:2])
    off = spins_rps - estimate.vector_rps
    squares = np.einsum("ksi,ij,ksj->ks", off, np.linalg.inv(estimate.covariance_rps2), off)
    return _fallible(-0.5 * squares, BLUNDER["normal_flow"])


def _by_flight(trajectory: TrajectoryResult, spins_rps: Floats) -> Floats:
    """(candidates, samples) logarithmic likelihood of the flight's bend, less that of the likeliest spin; or zeros."""
    across = trajectory.across
    if across is None:
        return np.zeros(spins_rps.shape[:2])
    logs = trajectory.log_likelihood(spins_rps.reshape(-1, 3)).reshape(spins_rps.shape[:2])
    highest = float(trajectory.log_likelihood(across.magnitude_rps * across.axis)[0])
    relative: Floats = logs - max(highest, float(logs.max()))
    return relative


def _fallible(logs: Floats, blunder: float) -> Floats:
    """Logarithmic likelihoods, 0 at most, of a witness that is wrong altogether with this probability."""
    mixed: Floats = np.logaddexp(math.log(1.0 - blunder) + logs, math.log(blunder))
    return mixed


def _log_mean(logs: Floats) -> Floats:
    """Logarithm of the mean over samples (candidates,)."""
    mean: Floats = np.logaddexp.reduce(logs, axis=1) - math.log(logs.shape[1])
    return mean


def _estimate(
    parameters: CombinedParameters,
    spins_rps: Floats,
    weights: Floats,
    evidence: Floats,
    best: int,
    by_logo: bool,
    events: int,
) -> tuple[SpinEstimate, list[int]]:
    """The most likely spin with its covariance, or a refusal; and the candidates that are other spins."""
    shares = np.exp(weights - np.max(weights, axis=1)[:, None])
    shares /= shares.sum(axis=1)[:, None]
    means = np.einsum("ks,ksi->ki", shares, spins_rps)
    apart = np.linalg.norm(means - means[best], axis=1)
    others = np.flatnonzero(apart > NEAR * np.linalg.norm(means[best]))
    near = np.flatnonzero(apart <= NEAR * np.linalg.norm(means[best]))
    probabilities = np.exp(evidence - np.logaddexp.reduce(evidence))
    share = probabilities[near, None] * shares[near] / probabilities[near].sum()
    mean = np.einsum("ks,ksi->i", share, spins_rps[near])
    axis, magnitudes = mean / np.linalg.norm(mean), np.linalg.norm(spins_rps[near], axis=2)
    magnitude = float(np.sum(share * magnitudes))  # scattered axes have a mean that is shorter than they are
    mean = magnitude * axis
    across = (spins_rps[near] - mean) @ (np.eye(3) - np.outer(axis, axis))
    covariance = np.einsum("ks,ksi,ksj->ij", share, across, across)
    covariance += float(np.sum(share * (magnitudes - magnitude) ** 2)) * np.outer(axis, axis)
    # Few samples that count make the spread look too small.
    covariance *= 1.0 + 3.0 * float(np.sum(share**2))
    estimate = SpinEstimate(METHOD, mean, covariance, None, events)
    odds = probabilities[near].sum() / max(probabilities[others].sum(), 1e-300)
    reason = _doubt(parameters, estimate, float(odds), means, evidence, others, by_logo)
    return (SpinEstimate.refused(METHOD, reason, events) if reason else estimate), others.tolist()


def _doubt(
    parameters: CombinedParameters,
    estimate: SpinEstimate,
    odds: float,
    means: Floats,
    evidence: Floats,
    others: Integers,
    by_logo: bool,
) -> str | None:
    """Reason why the combined spin is not to be trusted; None if it is."""
    magnitude, std, axis_std = estimate.magnitude_rps, estimate.magnitude_std_rps, estimate.axis_std_deg
    if magnitude is None or std is None or axis_std is None:
        return "the ball does not turn"
    if odds < (parameters.odds if by_logo else parameters.rhythm_odds):
        rival = means[others[np.argmax(evidence[others])]]
        return (
            f"all witnesses together leave two spins open: {vector_words(estimate.vector_rps)} is only "
            f"{odds:.0f} times as likely as {vector_words(rival)}"
        )
    if std > max(parameters.magnitude_std_rps, 0.1 * magnitude):
        return f"the magnitude is too uncertain: {magnitude:.1f} +- {std:.1f} rps"
    if axis_std > (parameters.axis_std_deg if by_logo else parameters.flight_axis_std_deg):
        return f"the axis is too uncertain: +- {axis_std:.0f} degrees"
    return None


def _witnesses(
    rate: RateResult, flow: SpinEstimate, contrast: ContrastResult, trajectory: TrajectoryResult
) -> tuple[Witness, ...]:
    """Evidence of each witness by itself, of those that have any."""
    said = []
    for magnitude, std, _ in _rhythms(rate)[:1]:
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


def _summary(by_logo: bool, witnesses: tuple[Witness, ...]) -> str:
    """Contributions of the witnesses, in words."""
    if not by_logo:
        return "magnitude from the rhythm of the logo's visits, axis from the flight"
    words = ["magnitude and axis from the logo's pattern"]
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
    help="One spin from the logo's pattern and motion, the rhythm of its visits and the bend of the flight.",
    inputs=("rate", "normal_flow", "contrast", "trajectory"),
    parameters=CombinedParameters,
    reads=("trajectory.gyro_std_deg",),
    start=start,
    step=step,
    absent=absent,
    is_slow=True,
    colour=(255, 255, 255),
    is_trusted=is_trusted,
)
