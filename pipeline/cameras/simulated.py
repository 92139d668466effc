"""Simulated camera: a scene that is simulated anew whenever a bias changes, for trying out what biases do."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from ..events import EventBatch
from .clock import PACKET_US, Pace
from .event_camera import CameraPacket, EventCamera, check_biases


class SimulatedCamera(EventCamera):
    """A camera in front of a simulated scene that begins anew again and again, and on which biases act.

    A change of biases takes as long as the simulation of one round. The camera's clock stands still meanwhile, so that
    all later events are those of the new biases.

    Parameters
    ----------
    simulate : callable
        `simulate(biases) -> EventBatch`: the events of one round, in order of time, from 0.
    round_us : int
        Length of a round, a multiple of PACKET_US.
    width_px, height_px : int
        Size of the sensor.
    bias_limits, biases : mapping
        Lowest and highest value of each bias, and the values to begin with; CameraError where they do not agree.
    speed : float
        Times real time; infinity hands everything over as fast as it is taken.
    """

    name, serial = "simulated camera", "simulated"

    def __init__(
        self,
        simulate: Callable[[Mapping[str, int]], EventBatch],
        round_us: int,
        width_px: int,
        height_px: int,
        *,
        bias_limits: Mapping[str, tuple[int, int]],
        biases: Mapping[str, int],
        speed: float = 1.0,
    ) -> None:
        self._pace = Pace(speed)
        self.width_px, self.height_px = width_px, height_px
        self.bias_limits, self.biases = dict(bias_limits), dict(biases)
        check_biases(self.biases, self)
        self.can_wait = self._pace.is_unlimited
        self._simulate, self._round_us = simulate, round_us
        self._end_us = 0
        self._apply_biases(self.biases)

    def read(self) -> CameraPacket:
        """The next packet at its time: a scene has no end."""
        self._pace.wait_for(self._end_us, self._end_us + PACKET_US)
        round_start_us, start_us = self._end_us - self._end_us % self._round_us, self._end_us % self._round_us
        events = self._events.between(start_us, start_us + PACKET_US)
        self._end_us += PACKET_US
        return CameraPacket(EventBatch(events.t_us + round_start_us, *events.columns[1:]), self._end_us)

    def close(self) -> None:
        """There is nothing to let go of."""

    def _apply_biases(self, biases: Mapping[str, int]) -> None:
        self._events = self._simulate(biases)
        self._pace.pause()
