"""The event sensor: its pixels, noise and readout.

Model after the published ones (Lichtsteiner 2008; v2e, Hu 2021; IEBCS, Joubert 2021; Graca 2021): log
intensity, first-order low-pass whose cut-off falls with darkness, two contrast thresholds with mismatch, a
dead time during which the reference follows the signal, a slower OFF after ON, noise, delay and jitter.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..biases import CURVES, PAPER, BiasCurve, BiasParameters
from ..errors import ParameterError
from ..events import EventBatch
from .kernels_pixel import NOBODY

NOISE, EDGE, LOGO, OTHER, HOT = range(5)  # labels of the truth


@dataclass(frozen=True)
class Lens:
    """Sharpness of the optics.

    Attributes
    ----------
    blur_px : float
        Sigma of the point spread in focus (diffraction, aberration, micro lenses); 0.5 px is usual.
    aperture_mm : float
        Diameter of the aperture (8 mm at f/4 = 2 mm), on which the defocus depends.
    focus_m : float
        Distance of the plane in focus.
    """

    blur_px: float = 0.5
    aperture_mm: float = 2.0
    focus_m: float = 1.85

    def __post_init__(self) -> None:
        if not (0 < self.blur_px <= 50 and self.aperture_mm >= 0 and self.focus_m > 0):
            raise ParameterError(
                f"lens blur {self.blur_px:g} px, aperture {self.aperture_mm:g} mm, focus {self.focus_m:g} m "
                "is out of range: blur more than 0 and at most 50 px, aperture 0 mm or more, focus more than 0 m"
            )

    def sigma_px(self, distance_m: NDArray[np.float64], focal_px: float) -> NDArray[np.float64]:
        """Sigma of the blur at these distances: a disc of diameter b has b / 4 along each axis."""
        disc = focal_px * self.aperture_mm * 1e-3 * np.abs(1 / distance_m - 1 / self.focus_m)
        return np.hypot(self.blur_px, disc / 4)


@dataclass(frozen=True)
class SensorModel:
    """A pixel array in physical units. Intensities are relative to white at 1,930 lx.

    Attributes
    ----------
    threshold_on, threshold_off : float
        Contrast thresholds, log intensity.
    mismatch : float
        Relative sigma of the thresholds over pixels.
    cutoff_hz : float
        Of the low-pass in bright light.
    dark_tau_us : float
        Time constant added at intensity 1, growing as 1 / intensity.
    highpass_hz : float
        Rate at which the reference decays to the signal.
    refractory_us : float
        Dead time after an event.
    reset_settling : float
        Time constants of the low-pass for which a reset lasts at least, see `dead_us`.
    off_after_on_us : float
        An OFF event waits until this long after an ON event of its pixel (the paper's limitation).
    contrast_noise : float
        Sigma of the temporal noise in log intensity at intensity 1; grows as intensity ** -0.5.
    delay_us, jitter_us : float
        Constant part of the latency and its sigma; the rest comes from low-pass and noise.
    noise_hz, noise_on_share : float
        Rate of uniform noise per pixel at intensity 1, and the share of ON events in it.
    hot_share, hot_median_hz, hot_sigma : float
        Share and log-normal rates of the hot pixels, which make most of the noise.
    timestamp_us : int
        Step of the readout's clock.
    rate_limit_hz : float
        Events a second let through, 0 = no limit.
    gaps_hz, gap_us : float
        How often the readout loses all events for a time, at random, and for how long.
    pattern_seed : int or None
        Of mismatch and hot pixels (one camera = one pattern); None = drawn from the recording's seed.
    """

    threshold_on: float = 0.27
    threshold_off: float = 0.27
    mismatch: float = 0.03
    cutoff_hz: float = 8000.0
    dark_tau_us: float = 5.0
    highpass_hz: float = 0.0
    refractory_us: float = 150.0
    reset_settling: float = 2.5
    off_after_on_us: float = 350.0
    contrast_noise: float = 0.015
    delay_us: float = 20.0
    jitter_us: float = 8.0
    noise_hz: float = 0.004
    noise_on_share: float = 0.5
    hot_share: float = 0.01
    hot_median_hz: float = 0.5
    hot_sigma: float = 1.5
    timestamp_us: int = 1
    rate_limit_hz: float = 0.0
    gaps_hz: float = 0.0
    gap_us: float = 1000.0
    pattern_seed: int | None = None

    def __post_init__(self) -> None:
        positive = ("threshold_on", "threshold_off", "cutoff_hz", "timestamp_us")
        for name in positive:
            if not getattr(self, name) > 0:
                raise ParameterError(f"sensor {name} = {getattr(self, name):g} is out of range: more than 0")
        for name in self.__dataclass_fields__:
            value = getattr(self, name)
            if name not in positive and value is not None and not value >= 0:
                raise ParameterError(f"sensor {name} = {value:g} is out of range: 0 or more")
        if not (self.noise_on_share <= 1 and self.hot_share <= 1 and self.mismatch <= 0.3):
            raise ParameterError("sensor noise_on_share and hot_share are at most 1, mismatch at most 0.3")

    @property
    def tau_us(self) -> float:
        """Time constant of the low-pass in bright light."""
        return 1e6 / (2 * math.pi * self.cutoff_hz)

    @property
    def dead_us(self) -> float:
        """Time after an event during which the reference follows the signal.

        After a reset the follower that makes the low-pass charges the capacitor of the difference again
        (Lichtsteiner 2008), so a pixel slower than its refractory period is free only when that has settled. Without
        it a slow pixel would hand out an edge piece by piece, each in a dead time of its own, and give more events
        than a fast one; the supplement sees fewer below bias_fo 0, and no difference above.
        """
        return max(self.refractory_us, self.reset_settling * self.tau_us)

    @classmethod
    def of(cls, biases: BiasParameters = PAPER, curves: Mapping[str, BiasCurve] = CURVES) -> SensorModel:
        """The sensor at these biases; `curves` may hold one's own measurements."""
        value = {name: curve.at(getattr(biases, curve.bias)) for name, curve in curves.items()}
        common = value["noise_bandwidth_factor"] * value["noise_highpass_factor"]
        refractory = value["noise_refractory_factor"]
        noise_on = value["noise_on_factor"] * common * refractory
        noise = 0.5 * (noise_on + value["noise_off_factor"] * common * np.sqrt(refractory))
        return cls(
            threshold_on=value["threshold_on"],
            threshold_off=value["threshold_off"],
            cutoff_hz=value["cutoff_hz"],
            highpass_hz=value["highpass_hz"],
            refractory_us=value["refractory_us"],
            noise_hz=cls.noise_hz * noise,
            noise_on_share=0.5 * noise_on / noise,
            hot_median_hz=cls.hot_median_hz * noise,
        )

    @classmethod
    def ideal(cls, threshold: float = 0.27) -> SensorModel:
        """Equal pixels that answer at once and without noise."""
        absent = ("mismatch", "dark_tau_us", "refractory_us", "reset_settling", "off_after_on_us", "contrast_noise")
        zero: dict[str, Any] = dict.fromkeys((*absent, "delay_us", "jitter_us", "noise_hz", "hot_share"), 0.0)
        return cls(threshold_on=threshold, threshold_off=threshold, cutoff_hz=1e7, **zero)


@dataclass(frozen=True, eq=False)
class LabelledEvents:
    """Events and one label each (see `pipeline.results.Truth`)."""

    events: EventBatch
    label: NDArray[np.uint8]
    logo_of: NDArray[np.uint8]  # number of the ball that the logo's events belong to, NOBODY for others


def thresholds(sensor: SensorModel, pixels: int, random: np.random.Generator) -> tuple[NDArray[np.float32], ...]:
    """(pixels,) float32 ON and OFF thresholds with mismatch, kept above a quarter of the nominal."""
    factors = (1 + sensor.mismatch * random.standard_normal(pixels, dtype=np.float32) for _ in range(2))
    nominal = (sensor.threshold_on, sensor.threshold_off)
    return tuple((n * np.maximum(f, 0.25)).astype(np.float32) for n, f in zip(nominal, factors, strict=True))


def hot_rates_hz(
    sensor: SensorModel, pixels: int, random: np.random.Generator
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Flat indices of the hot pixels, rising, and their rates."""
    count = int(random.binomial(pixels, sensor.hot_share))
    where = np.sort(random.choice(pixels, count, replace=False)).astype(np.int64)
    return where, sensor.hot_median_hz * np.exp(sensor.hot_sigma * random.standard_normal(count))


def noise(
    sensor: SensorModel,
    intensity: NDArray[np.float64],
    duration_us: int,
    width_px: int,
    pattern: np.random.Generator,
    random: np.random.Generator,
) -> LabelledEvents:
    """Background noise: uniform Poisson noise, more of it in the dark, and hot pixels; not sorted.

    `intensity` (pixels,) is that of the background, relative to white; `pattern` draws the hot pixels, `random` the
    events.
    """
    pixels = intensity.size
    # Shot noise in log intensity falls with the root of the photocurrent, and so does the noise rate (v2e's law).
    weight = 1 / np.sqrt(np.maximum(intensity, 1e-3))
    total = np.cumsum(weight)
    count = int(random.poisson(sensor.noise_hz * total[-1] * duration_us * 1e-6))
    where = np.minimum(np.searchsorted(total, random.random(count) * total[-1]), pixels - 1)
    time = random.integers(0, duration_us, count)

    hot, rate = hot_rates_hz(sensor, pixels, pattern)
    dead_s = max(sensor.dead_us, 1.0) * 1e-6
    counts = random.poisson(rate / (1 + rate * dead_s) * duration_us * 1e-6)
    where_hot = np.repeat(hot, counts)
    time_hot = random.integers(0, duration_us, where_hot.size)

    where, time = np.concatenate([where, where_hot]), np.concatenate([time, time_hot])
    on = random.random(where.size) < sensor.noise_on_share
    label = np.repeat(np.array([NOISE, HOT], np.uint8), [count, where_hot.size])
    y, x = np.divmod(where, width_px)
    nobody = np.full(where.size, NOBODY, np.uint8)
    return LabelledEvents(
        EventBatch(time.astype(np.int64), x.astype(np.uint16), y.astype(np.uint16), on), label, nobody
    )


def read_out(
    parts: list[LabelledEvents], sensor: SensorModel, duration_us: int, random: np.random.Generator
) -> LabelledEvents:
    """Put events in order of time, on the readout's clock and under its rate limit.

    The limit counts in windows of 1 ms; what exceeds it in a window is lost, later events first (as the
    camera's own rate control drops them). Gaps of the readout come at random times.
    """
    time = np.concatenate([part.events.t_us for part in parts])
    keep = np.flatnonzero((time >= 0) & (time < duration_us))
    time = time[keep] // sensor.timestamp_us * sensor.timestamp_us
    keep = keep[np.argsort(time, kind="stable")]
    time = np.sort(time, kind="stable")
    if sensor.rate_limit_hz > 0 and time.size:
        window = time // 1000
        first = np.searchsorted(window, window)
        allowed = np.arange(time.size) - first < sensor.rate_limit_hz * 1e-3
        time, keep = time[allowed], keep[allowed]
    if sensor.gaps_hz > 0:
        gap = np.sort(random.uniform(0, duration_us, random.poisson(sensor.gaps_hz * duration_us * 1e-6)))
        ended = np.searchsorted(gap + sensor.gap_us, time, side="right")
        passed = np.searchsorted(gap, time, side="right") == ended
        time, keep = time[passed], keep[passed]
    x, y, on = (np.concatenate([getattr(part.events, name) for part in parts])[keep] for name in ("x_px", "y_px", "on"))
    label, logo_of = (np.concatenate([getattr(part, name) for part in parts])[keep] for name in ("label", "logo_of"))
    return LabelledEvents(EventBatch(time, x, y, on), label, logo_of)
