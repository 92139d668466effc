"""Sweep of a running camera's bias: event rates of noise and balls over its range, and the value that they propose."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict

import numpy as np

from spinscope.pipeline.cameras import EventCamera
from spinscope.pipeline.errors import CameraError, ParameterError
from spinscope.pipeline.results import Packet
from spinscope.pipeline.stages.track_result import BallTrack

from ..tuning.bias_sweep import MOST_POINTS, BiasSweep, BiasSweepPoint, SweptBias
from .event_rates import MARGIN_US, EventRateMeter

SETTLE_US = 300_000  # after a change: pixels that are out of balance, and packets that were on their way
MEASURED_S = 2.0
# A still scene of more is too noisy (docs/live.md): the supplement's "acceptable level" has no number.
MOST_NOISE_HZ = 100_000.0
MOST_UNEQUAL = 2.0  # ON and OFF of a ball, of which the supplement wants equal numbers


def swept_biases(limits: Mapping[str, tuple[int, int]]) -> list[SweptBias]:
    """The biases of a device that can be swept: each one, and both thresholds at once where it has them."""
    thresholds = ["diff_on", "diff_off"]
    both = [SweptBias("diff_on_off", "diff_on = diff_off", thresholds)] if limits.keys() >= set(thresholds) else []
    return [*both, *(SweptBias(name, name, [name]) for name in limits)]


class CameraSweep:
    """Steps a running camera through the range of a bias, and measures event rates at each value.

    Times are those of the camera, so that a replay at any speed measures the same.

    Parameters
    ----------
    name : str
        Of one of `swept_biases`.
    camera : EventCamera
        Has the limits of each bias.
    present : Mapping
        Values to go back to.
    set_biases : callable
        `set_biases(values) -> int` changes biases of the camera; returns its time up to which events had come.
    points : int
        Number of values.
    measured_s : float
        Time for each value.
    on_point : callable, optional
        Gets the sweep so far after each value, in the thread that calls `add`.

    Attributes
    ----------
    done : threading.Event
        Set after the last value, when the camera has its former biases again.

    Raises
    ------
    CameraError, ParameterError
        For a bias that the device does not have or that cannot be set, and points or times that are no sweep.
    """

    def __init__(
        self,
        name: str,
        camera: EventCamera,
        present: Mapping[str, int],
        set_biases: Callable[[Mapping[str, int]], int],
        *,
        points: int,
        measured_s: float = MEASURED_S,
        on_point: Callable[[BiasSweep], None] = lambda sweep: None,
    ) -> None:
        if camera.without_biases:
            raise CameraError(camera.without_biases)
        limits, offered = camera.bias_limits, swept_biases(camera.bias_limits)
        swept = next((one for one in offered if one.name == name), None)
        if swept is None:
            raise CameraError(f"the camera has no bias {name!r}: it has {', '.join(one.name for one in offered)}")
        if not 2 <= points <= MOST_POINTS:
            raise ParameterError(f"{points} points are out of range: 2 to {MOST_POINTS}")
        if not measured_s > 0.0:
            raise ParameterError(f"{measured_s:g} s is no time to measure in: give a number above 0")
        low, high = max(limits[one][0] for one in swept.biases), min(limits[one][1] for one in swept.biases)
        values = sorted({int(value) for value in np.rint(np.linspace(low, high, points))})
        self.done = threading.Event()
        self._swept, self._present, self._set_biases, self._on_point = swept, present, set_biases, on_point
        self._measured_us = round(measured_s * 1e6)
        self._left, self._points, self._count = values, list[BiasSweepPoint](), len(values)
        self._meter = EventRateMeter()
        self._from_us: int | None = None  # from when on events are those of the present value
        self._last_us = 0

    @property
    def sweep(self) -> BiasSweep:
        """The points so far."""
        return BiasSweep(self._swept.name, self._count, list(self._points))

    def add(self, packet: Packet, balls: Sequence[BallTrack]) -> None:
        """Take the next tick of the camera."""
        if self.done.is_set():
            return
        if self._from_us is None or packet.end_us < self._last_us:  # another clock: the value is measured anew
            self._from_us = self._set(self._left[0]) + SETTLE_US
        self._last_us = packet.end_us
        self._meter.add(packet, balls)
        if packet.start_us < self._from_us:
            self._meter.restart()
        elif packet.end_us >= self._from_us + self._measured_us + MARGIN_US:
            self._end_value()

    def end(self) -> None:
        """Give the camera its former biases, also in the middle of the sweep."""
        if not self.done.is_set():
            self._set_biases({name: self._present[name] for name in self._swept.biases})
            self.done.set()

    def _end_value(self) -> None:
        rates = self._meter.take()
        known = {} if rates is None else asdict(rates)  # none where balls came and went all the time
        self._points.append(BiasSweepPoint(value=self._left.pop(0), **known))
        self._from_us = None
        self._on_point(self.sweep)
        if not self._left:
            self.end()

    def _set(self, value: int) -> int:
        return self._set_biases(dict.fromkeys(self._swept.biases, value))


def proposed_value(sweep: BiasSweep) -> int | None:
    """The value with most events of the ball, or where no ball was seen of all, that keeps the noise low.

    The supplement's trade-off: as sensitive as possible with noise at an acceptable level, and about as many ON as OFF
    events of the ball. None where no value does.
    """
    has_ball = any(point.ball_on_hz for point in sweep.points)
    best, most_hz = None, 0.0
    for point in sweep.points:
        if point.noise_on_hz is None or point.noise_off_hz is None:
            continue
        noise_hz = point.noise_on_hz + point.noise_off_hz
        on_hz, off_hz = point.ball_on_hz or 0.0, point.ball_off_hz or 0.0
        is_equal = not has_ball or max(on_hz, off_hz) <= MOST_UNEQUAL * min(on_hz, off_hz)
        gain_hz = on_hz + off_hz if has_ball else noise_hz
        if noise_hz <= MOST_NOISE_HZ and is_equal and gain_hz >= most_hz:
            best, most_hz = point.value, gain_hz
    return best


def proposal_words(sweep: BiasSweep) -> str:
    """The proposal for people, and what it rests on."""
    value, has_ball = proposed_value(sweep), any(point.ball_on_hz for point in sweep.points)
    if value is None:
        return (
            f"no value of {sweep.name} keeps the noise below {MOST_NOISE_HZ:g} events/s"
            f"{' with as many ON as OFF events of the ball' if has_ball else ''}: try another bias, or more light"
        )
    seen = "the most events of the ball" if has_ball else "the most sensitive value (no ball was seen)"
    return f"proposed: {sweep.name} = {value}, {seen} with noise below {MOST_NOISE_HZ:g} events/s"
