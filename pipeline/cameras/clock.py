"""The clock of everything live, and the pace of what takes the place of a camera."""

from __future__ import annotations

import math
import time
from time import monotonic as now_s

from ..errors import ParameterError

__all__ = ["PACKET_US", "Pace", "now_s"]

PACKET_US = 1000  # as of USB packets at millions of events a second


class Pace:
    """Pace at which packets are handed over.

    Parameters
    ----------
    speed : float
        Times real time; infinity hands everything over as fast as it is taken. ParameterError for 0 and below.
    """

    def __init__(self, speed: float) -> None:
        if not speed > 0.0:
            raise ParameterError(f"speed = {speed:g} is no speed: give a number above 0, 1 is real time")
        self._speed = speed
        self._begun: tuple[float, int] | None = None  # when the packets' clock went on, and what it showed

    @property
    def is_unlimited(self) -> bool:
        """Whether nothing is waited for."""
        return math.isinf(self._speed)

    def pause(self) -> None:
        """Let the packets' clock stand still until the next packet is waited for."""
        self._begun = None

    def wait_for(self, start_us: int, end_us: int) -> None:
        """Wait until the end of a packet on the packets' clock, which begins at `start_us` where it stands still.

        Once late, it does not sleep at all: a sleep of 0 s waits for Python's lock, 5 ms for each thread that computes.
        """
        if self._begun is None:
            self._begun = now_s(), start_us
        begun_s, begun_us = self._begun
        wait_s = begun_s + (end_us - begun_us) * 1e-6 / self._speed - now_s()
        if wait_s > 0.0:
            time.sleep(wait_s)
