"""Rate: spin magnitude and t_acc from the period of the logo's event rate (section 3.3)."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..kernels.rate import autocorrelation, falling_crossings, low_passed, moving_average, shortest_period
from ..parameters import ParameterGroup, choice, tunable
from ..results import Packet, ReadOnlyArrays
from ..stage import Context, Stage
from .logo import LogoResult
from .rate_disc import DiscPattern
from .rate_period import EXCLUDED, FEWEST_SIGMAS, LogoPattern, PatternPeriod
from .track_result import BallTrack

# Fewer logo events than this in the window have no period that could be told from chance.
FEWEST_EVENTS = 100
# A period must repeat the curve to this correlation, and be within this share of the best of its multiples.
REPEATS, SHARE_OF_BEST = 0.5, 0.8
# Intervals between crossings that spread more than this (1 sigma / mean) belong to no steady spin.
IRREGULAR = 0.15
# Crossings wander with the view of the logo, by 2 % (rms) of the magnitude of 114 simulated shots.
WANDER = 0.015
# A spin a little above the highest looked for must not be taken for an alias below.
BEYOND = 1.1


# The choices of low_pass_from: whether the cut-off follows the period found by autocorrelation.
LOW_PASS_FOLLOWS = {"rhythm": True, "fixed": False}


@dataclass(frozen=True, kw_only=True)
class RateParameters(ParameterGroup):
    """Histogram, moving average and low-pass."""

    bin_us: int = tunable(500, 50, 20_000, 50, "us", "width of the histogram's bins")
    ema_us: int = tunable(2000, 100, 100_000, 100, "us", "time constant of the exponential moving average")
    low_pass_from: str = choice(
        "rhythm", tuple(LOW_PASS_FOLLOWS), "cut-off: twice the rotation found by autocorrelation, or low_pass_hz"
    )
    low_pass_hz: float = tunable(200.0, 5.0, 2000.0, 5.0, "Hz", "cut-off of the low-pass filter; its upper limit")
    window_us: int = tunable(500_000, 10_000, 5_000_000, 10_000, "us", "how far back in time it looks")


@dataclass(frozen=True, slots=True, eq=False)
class RateResult(ReadOnlyArrays):
    """The event rate of the present shot so far (the last window of it).

    Attributes
    ----------
    t_us : (n,) int64
        The bins' starts; only bins that lie wholly in the shot and have ended.
    rate_hz, ema_hz, smooth_hz : (n,) float64
        Histogram, its moving average, and that less its mean and low-passed.
    low_pass_hz : float
        The cut-off used for smooth_hz.
    crossings_us : (m,) float64
        Times at which smooth_hz falls through zero.
    spin_rps : float, optional
        Magnitude from the crossings; None with its reason when there is no period.
    spin_std_rps : float, optional
        Its 1 sigma; None with spin_rps.
    reason : str, optional
        Why spin_rps is None.
    period_spins_rps, period_log_likelihoods : (k,) float64
        Not in the paper: magnitudes by which the logo's pattern on the ball comes back, best first, and their log
        likelihoods less that of the first; also when refused. Of the logo's events, or of all events around the ball
        where only these tell a period.
    period_std_rps : float
        1 sigma of the first; NaN without one.
    period_reason : str, optional
        Why the first is not to be trusted; None if it is.
    period_sigmas : float
        By how many standard deviations of chance the first comes back.
    """

    t_us: NDArray[np.int64]
    rate_hz: NDArray[np.float64]
    ema_hz: NDArray[np.float64]
    smooth_hz: NDArray[np.float64]
    low_pass_hz: float
    crossings_us: NDArray[np.float64]
    spin_rps: float | None
    spin_std_rps: float | None
    reason: str | None
    period_spins_rps: NDArray[np.float64]
    period_log_likelihoods: NDArray[np.float64]
    period_std_rps: float
    period_reason: str | None
    period_sigmas: float = 0.0


@dataclass(slots=True)
class RateState:
    """Counts and patterns of the shot, bin by bin, from bin number `first_bin` of the file's time on.

    `first_bin` is None before the first tick.
    """

    max_spin_rps: float
    first_bin: int | None = None
    counts: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))
    pattern: LogoPattern = field(default_factory=LogoPattern)
    disc: DiscPattern = field(default_factory=DiscPattern)


def start(parameters: RateParameters, context: Context) -> RateState:
    """No events yet."""
    return RateState(context["spin.max_spin_rps"])


def absent(parameters: RateParameters, reason: str) -> RateResult:
    """No rate, because there is no ball."""
    return _without_period(parameters, np.empty(0, np.int64), np.empty(0), "no ball", PatternPeriod.nothing("no ball"))


def step(parameters: RateParameters, state: RateState, packet: Packet, ball: BallTrack, logo: LogoResult) -> RateResult:
    """The event rate up to the end of the tick and, once it is periodic, the spin magnitude behind it.

    The magnitude is the rate of the logo's reappearance, seen from the camera: while the ball flies past, the line
    of sight turns too, which adds or takes up to speed / (2 pi distance), about 0.7 rps at 9 m/s and 2 m.
    """
    first_bin = _count(parameters, state, packet, ball, logo)
    ended = packet.end_us // parameters.bin_us - first_bin
    counts = state.counts[: max(ended, 0)]
    t_us = (first_bin + np.arange(counts.size)) * parameters.bin_us
    bin_s = parameters.bin_us * 1e-6
    rate_hz, period = counts / bin_s, _period(state, counts.size, bin_s)
    if counts.sum() < FEWEST_EVENTS:
        reason = f"{counts.sum()} logo events, {FEWEST_EVENTS} are needed"
        return _without_period(parameters, t_us, rate_hz, reason, period)
    return _with_period(parameters, state.max_spin_rps, t_us, rate_hz, period)


def _period(state: RateState, bins: int, bin_s: float) -> PatternPeriod:
    """Period of the logo's events; where these show none, of all events of the disc if that is to be trusted."""
    fastest_rps = BEYOND * state.max_spin_rps
    period = state.pattern.period(bins, bin_s, fastest_rps)
    if period.sigmas < FEWEST_SIGMAS:
        of_disc = state.disc.period(bins, bin_s, fastest_rps)
        period = period if of_disc.reason is not None else of_disc
    return period


def _count(parameters: RateParameters, state: RateState, packet: Packet, ball: BallTrack, logo: LogoResult) -> int:
    """Add the tick's events to the bins, forget those before the window, and return the number of the first bin."""
    first_bin = -(-packet.start_us // parameters.bin_us) if state.first_bin is None else state.first_bin
    bins = logo.events.t_us // parameters.bin_us - first_bin
    length = max(-(-packet.end_us // parameters.bin_us) - first_bin, 0)
    counts = np.bincount(bins[bins >= 0], minlength=length)
    counts[: state.counts.size] += state.counts
    forget = max(length - parameters.window_us // parameters.bin_us, 0)
    state.pattern.add(logo.turning, first_bin, length, parameters.bin_us)
    state.pattern.forget(forget)
    state.disc.add(packet, ball, first_bin, length, parameters.bin_us)
    state.disc.forget(forget)
    state.counts, state.first_bin = counts[forget:], first_bin + forget
    return state.first_bin


def _without_period(
    parameters: RateParameters,
    t_us: NDArray[np.int64],
    rate_hz: NDArray[np.float64],
    reason: str,
    period: PatternPeriod,
) -> RateResult:
    """A result without a period, with the curves as far as they go."""
    ema_hz = moving_average(rate_hz, _ema_weight(parameters))
    nothing = np.zeros(rate_hz.size)
    return RateResult(
        t_us, rate_hz, ema_hz, nothing, parameters.low_pass_hz, np.empty(0), None,
        None, reason, *_fields(period),
    )  # fmt: skip


def _fields(period: PatternPeriod) -> tuple[NDArray[np.float64], NDArray[np.float64], float, str | None, float]:
    return period.spins_rps, period.log_likelihoods, period.std_rps, period.reason, period.sigmas


def _ema_weight(parameters: RateParameters) -> float:
    """Share of a new bin in the average: the bin's part of an exponential decay with time constant ema_us."""
    return 1.0 - math.exp(-parameters.bin_us / parameters.ema_us)


def _with_period(
    parameters: RateParameters,
    max_spin_rps: float,
    t_us: NDArray[np.int64],
    rate_hz: NDArray[np.float64],
    period: PatternPeriod,
) -> RateResult:
    """Moving average, mean removed, low-pass, falling zero crossings, mean interval.

    The average is causal as in the paper; its lag is the same for every rotation and drops out of the intervals. The
    low-pass runs both ways over the window, so it moves no crossing. A logo has several strokes and hence several
    peaks a rotation: twice the rate of rotation as cut-off keeps the first two harmonics and merges the strokes.
    """
    bin_s = parameters.bin_us * 1e-6
    ema_hz = moving_average(rate_hz, _ema_weight(parameters))
    varying = ema_hz - ema_hz.mean()
    correlation = autocorrelation(varying, varying.size * 3 // 4)
    lag = shortest_period(correlation, int(0.8 / (max_spin_rps * bin_s)), SHARE_OF_BEST)
    repeats = lag > 0 and correlation[lag] >= REPEATS
    cutoff_hz = min(parameters.low_pass_hz, 0.45 / bin_s)  # below half the bins' rate, else there is nothing to pass
    if LOW_PASS_FOLLOWS[parameters.low_pass_from] and repeats:
        cutoff_hz = min(cutoff_hz, 2.0 / (lag * bin_s))
    smooth_hz = low_passed(varying, cutoff_hz * bin_s)
    crossings_us = t_us[0] + (falling_crossings(smooth_hz) + 0.5) * parameters.bin_us
    spin_rps, spin_std_rps, reason = _spin(crossings_us, repeats, parameters, max_spin_rps)
    if spin_rps is not None and spin_std_rps is not None:
        # The paper states no error; ours has to hold other magnitudes by which the pattern comes back.
        spin_std_rps = math.hypot(spin_std_rps, WANDER * spin_rps)
        off_rps = np.abs(period.spins_rps[period.log_likelihoods > EXCLUDED] - spin_rps)
        spin_std_rps = max(spin_std_rps, *off_rps[off_rps > 3.0 * spin_std_rps].tolist(), 0.0)
    return RateResult(
        t_us, rate_hz, ema_hz, smooth_hz, cutoff_hz, crossings_us, spin_rps,
        spin_std_rps, reason, *_fields(period),
    )  # fmt: skip


def _spin(
    crossings_us: NDArray[np.float64], repeats: bool, parameters: RateParameters, max_spin_rps: float
) -> tuple[float | None, float | None, str | None]:
    """(magnitude, its 1 sigma, reason): 1 / the mean interval, unless the crossings are irregular."""
    if crossings_us.size < 2:
        return None, None, f"{crossings_us.size} falling crossings, two are needed"
    intervals_s = np.diff(crossings_us) * 1e-6
    mean_s, spread_s = float(intervals_s.mean()), float(intervals_s.std())
    if spread_s > IRREGULAR * mean_s:
        return None, None, f"intervals of {mean_s * 1e3:.1f} ms spread by {spread_s * 1e3:.1f} ms"
    if not repeats:
        return None, None, "the event rate does not repeat itself"
    if 1.0 / mean_s > 1.25 * max_spin_rps:
        return None, None, f"{1.0 / mean_s:.0f} rps is above spin.max_spin_rps"
    # One interval has no spread of its own: then a crossing counts as sure to a bin and the spread allowed.
    spread_s = max(spread_s, parameters.bin_us * 1e-6 / math.sqrt(6.0))
    if intervals_s.size == 1:
        spread_s = max(spread_s, 0.5 * IRREGULAR * mean_s)
    return 1.0 / mean_s, spread_s / mean_s**2 / math.sqrt(intervals_s.size), None


STAGE = Stage(
    name="rate",
    label="Event rate",
    help="Rate of the logo's events, its moving average, and the rotation that its zero crossings tell.",
    inputs=("packet", "ball", "logo"),
    reads=("spin.max_spin_rps",),
    parameters=RateParameters,
    start=start,
    step=step,
    absent=absent,
)
