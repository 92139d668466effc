"""Latency of the pixels from recordings of a turning disc with a trigger a turn, at two speeds or more.

An event of an edge on the disc comes late by the latency, so that the edge seems to lag behind its place at the
trigger by an angle that grows with the speed. The angle at which the trigger comes is not known, nor is the part of the
lag that does not depend on the speed (`track.lag_px`): both are the same at every speed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import RecordingError
from ..events import EventBatch

Floats = NDArray[np.float64]

BINS = 3600  # of a turn
SMOOTH_BINS = 8.0  # 1 sigma: 0.8 degrees, less than a pixel 50 px from the axis
INNER_SHARE = 0.3  # of the radius: nearer the axis a pixel is too large an angle
LEAST_TURNS = 4
LEAST_RATIO = 1.5  # between the fastest and the slowest speed
# Squares of the profile the right way round over those the wrong way, of which noise gives 1; and 1 sigma of a latency
# that is of use, beside the 40 us that are usual. Marks that do not turn with the triggers miss one of them.
LEAST_SHARPNESS, MOST_STD_US = 2.0, 20.0
BLOCKS = 4  # parts of each recording, by whose spread the error is stated


NOTHING_TURNS = (
    "nothing turns evenly with the triggers: give one rising edge a turn, a steady speed, and the disc's axis in --disc"
)


@dataclass(frozen=True, eq=False)
class TurningDisc:
    """A recording of the disc.

    Attributes
    ----------
    events : EventBatch
    triggers_us : (n,) int64
        One a turn, in order, file time.
    """

    events: EventBatch
    triggers_us: NDArray[np.int64]

    @property
    def speed_rps(self) -> float:
        """Turns a second."""
        return (self.triggers_us.size - 1) / float(self.triggers_us[-1] - self.triggers_us[0]) * 1e6


@dataclass(frozen=True, eq=False)
class PixelLatency:
    """Delay with which the pixels report an edge, and 1 sigma of it."""

    latency_us: float
    std_us: float


def pixel_latency(discs: Sequence[TurningDisc], circle: tuple[float, float, float]) -> PixelLatency:
    """Find the latency of the pixels.

    Parameters
    ----------
    discs : sequence of TurningDisc
        Two or more speeds, turning the same way: an edge that turns dark one way turns bright the other.
    circle : (x_px, y_px, radius_px)
        Axis of the disc in the image, and how far its marks reach.

    Raises
    ------
    RecordingError
        For too few turns or speeds, or where nothing turns with the triggers.
    """
    speeds = np.array([_checked(disc).speed_rps for disc in discs])
    if speeds.size < 2 or speeds.max() < LEAST_RATIO * speeds.min():
        raise RecordingError(
            f"the disc turns at {', '.join(f'{speed:.1f}' for speed in speeds)} rps: record it at two speeds or more, "
            f"the fastest {LEAST_RATIO:g} times the slowest"
        )
    ways = [_way(disc, circle) for disc in discs]
    if len(set(ways)) > 1:
        raise RecordingError(
            "the disc does not turn the same way in all recordings: an edge is ON one way, OFF the other"
        )
    found = [_latency_us(discs, speeds, circle, ways[0], block) for block in range(BLOCKS)]
    std_us = float(np.std(found, ddof=1)) / math.sqrt(BLOCKS)
    if std_us > MOST_STD_US:
        raise RecordingError(NOTHING_TURNS)
    return PixelLatency(float(np.mean(found)), std_us)


def _checked(disc: TurningDisc) -> TurningDisc:
    if disc.triggers_us.size <= LEAST_TURNS:
        raise RecordingError(
            f"{disc.triggers_us.size} rising trigger edges are too few: give one a turn of the disc, {LEAST_TURNS + 1} "
            "or more"
        )
    return disc


def _latency_us(
    discs: Sequence[TurningDisc], speeds_rps: Floats, circle: tuple[float, float, float], way: int, block: int
) -> float:
    """The latency by one part of each recording."""
    profiles = [_profile(disc, circle, way, slice(block, None, BLOCKS)) for disc in discs]
    lags = np.array([_shift_turns(profile, profiles[0]) for profile in profiles])
    return -way * float(np.polyfit(speeds_rps, lags, 1)[0]) * 1e6


def _way(disc: TurningDisc, circle: tuple[float, float, float]) -> int:
    """1 where angles (x to y, clockwise in the image) grow, -1 where they fall: that way the marks stand still."""
    sharp = {way: float(np.sum(_profile(disc, circle, way, slice(None)) ** 2)) for way in (1, -1)}
    way = max(sharp, key=lambda one: sharp[one])
    if sharp[way] < LEAST_SHARPNESS * sharp[-way]:
        raise RecordingError(NOTHING_TURNS)
    return way


def _profile(disc: TurningDisc, circle: tuple[float, float, float], way: int, turns: slice) -> Floats:
    """(2, BINS) OFF and ON events over the angle from where the disc stands at a trigger, in some turns, mean 0."""
    x, y, radius = circle
    events, triggers = disc.events, disc.triggers_us
    dx, dy = events.x_px - x, events.y_px - y
    away = np.hypot(dx, dy)
    turned = np.interp(events.t_us, triggers, np.arange(triggers.size))
    number = np.floor(turned).astype(np.int64)
    chosen = np.zeros(triggers.size, bool)
    chosen[turns] = True
    inside = (events.t_us >= triggers[0]) & (events.t_us < triggers[-1]) & chosen[number]
    inside &= (away > INNER_SHARE * radius) & (away < radius)
    angle = np.arctan2(dy[inside], dx[inside]) / (2 * math.pi) - way * turned[inside]
    bins = np.floor(angle % 1.0 * BINS).astype(np.int64) % BINS
    counts = np.bincount(bins + BINS * events.on[inside], minlength=2 * BINS).reshape(2, BINS).astype(np.float64)
    frequency = np.fft.rfftfreq(BINS)
    smooth = np.fft.irfft(np.fft.rfft(counts) * np.exp(-2 * (math.pi * SMOOTH_BINS * frequency) ** 2), BINS)
    return np.asarray(smooth - smooth.mean(axis=1, keepdims=True), np.float64)


def _shift_turns(profile: Floats, reference: Floats) -> float:
    """By how much of a turn, -0.5 to 0.5, a profile lies after the reference, by their correlation."""
    product = np.fft.rfft(profile) * np.conj(np.fft.rfft(reference))
    match = np.fft.irfft(product.sum(axis=0), BINS)
    best = int(np.argmax(match))
    before, at, after = match[best - 1], match[best], match[(best + 1) % BINS]
    finer = 0.5 * (before - after) / min(before - 2 * at + after, -1e-12)
    return float(((best + finer) / BINS + 0.5) % 1.0 - 0.5)
