"""Replay: a recording in the place of a camera, in real time, looped, and with the faults of real cameras."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from itertools import chain as joined
from typing import NamedTuple

import numpy as np

from ..errors import CameraError, ParameterError
from ..events import EventBatch
from .clock import PACKET_US, Pace
from .event_camera import CameraPacket, EventCamera

FAULT_US = 1_000_000  # a fault comes so long after the start, and again after each such time
STALL_S = 0.5
BURST_RATE_HZ, BURST_US = 50e6, 20_000  # about what USB 3 carries: a lamp switched on
LOOP_GAP_US = 100_000  # between two rounds: a ball that is in view at the end has left
FAULTS = ("stall", "burst", "disconnect", "wrong-size", "clock-reset")


class _Piece(NamedTuple):
    """Events of one packet on the replay's clock, and how far they reach."""

    events: EventBatch
    start_us: int
    end_us: int
    is_fault: bool


class ReplayCamera(EventCamera):
    """A recording that plays like a camera.

    Parameters
    ----------
    batches : callable
        `batches() -> iterable of EventBatch`: the recording's events from the start, in order of time.
    width_px, height_px : int
        Size of the sensor.
    name : str
        Name of the recording, for people.
    speed : float
        Times real time; infinity hands everything over as fast as it is taken.
    loops : bool
        Whether to begin anew at the end; the second round's times continue behind the first one's.
    fault : str, optional
        One of FAULTS, which comes every second of the recording.
    biases : mapping, optional
        Those with which it was recorded, where they are known.
    """

    is_replay = True

    def __init__(
        self,
        batches: Callable[[], Iterable[EventBatch]],
        width_px: int,
        height_px: int,
        *,
        name: str = "replay",
        speed: float = 1.0,
        loops: bool = False,
        fault: str | None = None,
        biases: Mapping[str, int] | None = None,
    ) -> None:
        if fault is not None and fault not in FAULTS:
            raise ParameterError(f"there is no fault {fault!r}: there are {', '.join(FAULTS)}")
        self.name, self.serial, self.width_px, self.height_px = name, "replay", width_px, height_px
        self.bias_limits, self.biases = {}, dict(biases or {})
        self._batches, self._pace, self._loops, self._fault = batches, Pace(speed), loops, fault
        self._random = np.random.default_rng(0)  # of bursts: the same every time
        self._start_us, self._played_us = 0, -(2**63)
        self._reset_us = 0  # what clock resets have taken off the recording's times
        self._burst_until_us = -1
        self.can_wait = self._pace.is_unlimited
        self._packet_us = PACKET_US if self.can_wait else max(PACKET_US, round(PACKET_US * speed))
        self._pieces = self._cut()

    @property
    def without_biases(self) -> str:
        """Reason for which no bias can be set."""
        return (
            "biases act in the camera while it records: the events of a recording do not change with them any more. "
            "`spinscope live --simulate` simulates a camera on which they act"
        )

    def read(self) -> CameraPacket | None:
        """The next packet at its time; None at the end of a recording that is not looped."""
        piece = next(self._pieces, None)
        if piece is None:
            return None
        self._played_us = piece.end_us
        self._pace.wait_for(self._start_us, piece.end_us)
        if piece.is_fault:
            self._misbehave(piece)
        events = piece.events
        if piece.end_us <= self._burst_until_us:
            events = self._with_burst(piece)
        if piece.is_fault and self._fault == "wrong-size":
            inside = events.x_px < self.width_px // 2
            return self._packet(events[inside], piece.end_us, int(np.count_nonzero(~inside)))
        return self._packet(events, piece.end_us)

    def close(self) -> None:
        """Close the recording; it goes on where it was when it is read again."""
        self._pieces.close()
        self._pieces = self._resumed()

    def _misbehave(self, piece: _Piece) -> None:
        """Begin the fault; raises CameraError for an unplugged camera, whose clock begins anew as well."""
        if self._fault == "stall":
            time.sleep(STALL_S)
        elif self._fault == "burst":
            self._burst_until_us = piece.end_us + BURST_US
        elif self._fault in ("disconnect", "clock-reset"):
            self._reset_us = piece.end_us
        if self._fault == "disconnect":
            raise CameraError(f"{self.name}: the camera was unplugged: plug it in again (replayed)")

    def _apply_biases(self, biases: Mapping[str, int]) -> None:
        """There are none that could be set."""

    def _packet(self, events: EventBatch, end_us: int, outside: int = 0) -> CameraPacket:
        if self._reset_us:
            events = EventBatch(np.maximum(events.t_us - self._reset_us, 0), *events.columns[1:])
        return CameraPacket(events, end_us - self._reset_us, outside=outside)

    def _cut(self) -> Generator[_Piece, None, None]:
        """Cut the recording into packets of PACKET_US of real time, round by round."""
        shift_us, begun, next_fault_us = 0, False, 0
        while True:
            last_us = None
            for events in self._of_round(shift_us):
                if not begun:
                    begun, self._start_us = True, int(events.t_us[0])
                    next_fault_us = self._start_us + FAULT_US
                for piece in self._split(events, last_us):
                    last_us = piece.end_us
                    if self._fault is not None and last_us >= next_fault_us:
                        next_fault_us += FAULT_US
                        piece = piece._replace(is_fault=True)
                    yield piece
            if not self._loops or last_us is None:
                return
            # Whole packets, so that a round is cut like the one before.
            shift_us += -(-(last_us - self._start_us - shift_us + LOOP_GAP_US) // LOOP_GAP_US) * LOOP_GAP_US

    def _resumed(self) -> Generator[_Piece, None, None]:
        """The packets that were not played yet."""
        for piece in self._cut():
            if piece.end_us > self._played_us:
                yield piece

    def _of_round(self, shift_us: int) -> Iterator[EventBatch]:
        for events in self._batches():
            if len(events):
                yield EventBatch(events.t_us + shift_us, *events.columns[1:]) if shift_us else events

    def _split(self, events: EventBatch, last_us: int | None) -> Iterator[_Piece]:
        """The packets of a batch; the last one ends with the batch, whose last time may go on in the next batch."""
        first_us, end_us, packet_us = int(events.t_us[0]), int(events.t_us[-1]) + 1, self._packet_us
        begin_us = first_us if last_us is None else min(last_us, first_us)
        ends = np.append(np.arange((begin_us // packet_us + 1) * packet_us, end_us, packet_us), end_us)
        starts = joined([0], rows := np.searchsorted(events.t_us, ends).tolist())
        for start, stop, upto_us in zip(starts, rows, ends.tolist(), strict=False):
            # Events of the batch's last time may follow: they are not known to be all.
            upto_us = min(upto_us, end_us - 1)
            yield _Piece(events[start:stop], begin_us, upto_us, False)
            begin_us = upto_us

    def _with_burst(self, piece: _Piece) -> EventBatch:
        """The packet's events among noise of BURST_RATE_HZ, as when the light is switched on."""
        count = int(BURST_RATE_HZ * (piece.end_us - piece.start_us) * 1e-6)
        random, events = self._random, piece.events
        t_us = np.concatenate(
            [events.t_us, random.integers(piece.start_us, max(piece.end_us, piece.start_us + 1), count)]
        )
        x_px = np.concatenate([events.x_px, random.integers(0, self.width_px, count, np.uint16)])
        y_px = np.concatenate([events.y_px, random.integers(0, self.height_px, count, np.uint16)])
        on = np.concatenate([events.on, random.random(count) < 0.5])
        order = np.argsort(t_us, kind="stable")
        return EventBatch(t_us[order], x_px[order], y_px[order], on[order])
