"""Event rates of a running camera: of the balls and of all else, ON and OFF."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from spinscope.pipeline.results import Packet
from spinscope.pipeline.stages.track_result import BallTrack

from ..tuning.bias_sweep import BESIDE_PX


@dataclass(frozen=True, slots=True)
class EventRates:
    """Events a second of the whole sensor; those of the balls while one was in view, None where none was."""

    noise_on_hz: float
    noise_off_hz: float
    ball_on_hz: float | None = None
    ball_off_hz: float | None = None


class EventRateMeter:
    """Counts events of balls and of all else, tick by tick; from any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._reset()

    def _reset(self) -> None:
        # Rows: all else, balls. Columns: ON and OFF events, and the time in which there could be any.
        self._counts = np.zeros((2, 3))

    def add(self, packet: Packet, balls: Sequence[BallTrack]) -> None:
        """Count a tick's events."""
        events, seconds = packet.events, (packet.end_us - packet.start_us) * 1e-6
        counts, is_ball = np.zeros((2, 3)), np.zeros(len(events), np.bool_)
        for ball in balls:
            x_px, y_px = ball.centre_px(events.t_us)
            is_ball |= np.hypot(events.x_px - x_px, events.y_px - y_px) <= ball.mean[4] + BESIDE_PX
        for row, is_in_view in enumerate((True, bool(balls))):
            on = events.on[is_ball == bool(row)]
            counts[row] = np.count_nonzero(on), np.count_nonzero(~on), seconds * is_in_view
        with self._lock:
            self._counts += counts

    def take(self) -> EventRates | None:
        """Rates of the ticks since the last call; None without any."""
        with self._lock:
            counts = self._counts
            self._reset()
        (*noise, seconds), (*ball, ball_seconds) = counts.tolist()
        if not seconds:
            return None
        return EventRates(*(n / seconds for n in noise), *((n / ball_seconds for n in ball) if ball_seconds else ()))
