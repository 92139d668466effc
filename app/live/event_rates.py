"""Event rates of a running camera: of the balls and of all else, ON and OFF."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spinscope.pipeline.results import Packet
from spinscope.pipeline.stages.track_extension import EXTENDED_US
from spinscope.pipeline.stages.track_result import BallTrack

from ..tuning.bias_sweep import BESIDE_PX

# Before a track's first tick and after its last one its ball is partly in view, or not told from noise yet: for no
# longer than the tracker itself looks back. Events of that time are neither noise nor of a ball whose circle is known.
MARGIN_US = EXTENDED_US


@dataclass(frozen=True, slots=True)
class EventRates:
    """Events a second of the whole sensor; those of the balls while one was in view, None where none was."""

    noise_on_hz: float
    noise_off_hz: float
    ball_on_hz: float | None = None
    ball_off_hz: float | None = None


class _CountedTick(NamedTuple):
    """Counts of a tick: rows are all else and balls; columns ON and OFF events, and the us in which there could be."""

    end_us: int
    counts: NDArray[np.int64]


class EventRateMeter:
    """Counts events of balls and of all else, tick by tick; from any thread.

    Ticks less than MARGIN_US before the first or after the last one of a track are left out. A contact ends no track
    here: the ball stays in view.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._shots = frozenset[int]()  # of the newest tick
        self._left_out_us = self._end_us = 0  # end of the ticks to be left out, and of the newest tick
        self._restart()

    def _restart(self) -> None:
        self._counts = np.zeros((2, 3), np.int64)
        self._held = deque[_CountedTick]()  # before which a track may begin or end

    def restart(self) -> None:
        """Forget the counts, but not when a track began or ended."""
        with self._lock:
            self._restart()

    def add(self, packet: Packet, balls: Sequence[BallTrack]) -> None:
        """Count a tick's events."""
        tick, shots = _counted(packet, balls), frozenset(ball.shot for ball in balls)
        with self._lock:
            if packet.start_us < self._end_us:  # another clock
                self._shots, self._left_out_us = shots, 0
                self._held.clear()
            new = [ball.began_by for ball in balls if ball.shot not in self._shots]
            contacts = sum(began_by in ("bounce", "hit") for began_by in new)
            if len(new) > contacts:
                self._held.clear()
            if len(self._shots - shots) > contacts:
                self._left_out_us = packet.start_us + MARGIN_US
            self._shots, self._end_us = shots, packet.end_us
            if packet.start_us >= self._left_out_us:
                self._held.append(tick)
            while self._held and self._held[0].end_us <= packet.end_us - MARGIN_US:
                self._counts += self._held.popleft().counts

    def take(self) -> EventRates | None:
        """Rates of the ticks since the last call up to MARGIN_US before the newest one; None without any."""
        with self._lock:
            counts, self._counts = self._counts, np.zeros((2, 3), np.int64)
        (*noise, length_us), (*ball, ball_us) = counts.tolist()
        if not length_us:
            return None
        return EventRates(
            *(n * 1e6 / length_us for n in noise), *((n * 1e6 / ball_us for n in ball) if ball_us else ())
        )


def _counted(packet: Packet, balls: Sequence[BallTrack]) -> _CountedTick:
    events, length_us = packet.events, packet.end_us - packet.start_us
    counts, is_ball = np.zeros((2, 3), np.int64), np.zeros(len(events), np.bool_)
    for ball in balls:
        x_px, y_px = ball.centre_px(events.t_us)
        is_ball |= np.hypot(events.x_px - x_px, events.y_px - y_px) <= ball.mean[4] + BESIDE_PX
    for row, is_in_view in enumerate((True, bool(balls))):
        on = events.on[is_ball == bool(row)]
        counts[row] = np.count_nonzero(on), np.count_nonzero(~on), length_us * is_in_view
    return _CountedTick(packet.end_us, counts)
