"""Messages between the server and the page about a running camera, and the interface of the camera behind them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Protocol

from pydantic import Field

from spinscope.app.tuning.bias_sweep import BiasState, BiasSweep
from spinscope.pipeline.registry import Parameters

from .schemas import ParameterValues, Request, Response


class LiveParametersRequest(Request):
    """Have the running camera's stages go on with these parameters."""

    parameters: ParameterValues


class LiveWindowRequest(Request):
    """Save the last seconds as a recording of its own."""

    seconds: float = Field(gt=0.0, le=120.0, allow_inf_nan=False)


class LiveWindow(Response):
    """Recording of the last seconds: its name in the folder."""

    recording: str


class LiveSecond(Response):
    """State of one second, `t_s` after the start; latencies and rates are None where there is nothing to measure.

    Attributes
    ----------
    rate_mev_s : float
        Millions of events.
    p50_ms, p99_ms : float or None
        From a tick's first events to its track.
    announced_ms, final_ms : float or None
        From the last events of the second's last shot to its announced and to its final spin.
    dropped, outside, late, skipped : int
        Packets that driver or ring lost, events beyond the sensor and too late, and ticks left out of the work, all
        since the start.
    backlog_ms, spin_backlog_ms : float
        Events that wait for the tracker, and for their final spins.
    noise_on_hz, noise_off_hz, ball_on_hz, ball_off_hz : float or None
        Events beside the balls, and of the balls.
    """

    t_s: float
    rate_mev_s: float
    p50_ms: float | None
    p99_ms: float | None
    announced_ms: float | None
    final_ms: float | None
    dropped: int
    outside: int
    late: int
    skipped: int
    backlog_ms: float
    spin_backlog_ms: float
    noise_on_hz: float | None
    noise_off_hz: float | None
    ball_on_hz: float | None
    ball_off_hz: float | None


class LiveShotRow(Response):
    """A shot that has ended, in words; `recording` has its events as soon as its spin is final."""

    text: str
    is_final: bool
    recording: str | None


class LiveRecording(Response):
    """Recording of the camera under way: its present file, and numbers of events and markers."""

    file: str
    events: int
    markers: int


class LiveRecordingRequest(Request):
    """Begin a recording of the camera, or end the one under way."""

    is_on: bool


class LiveMarkerRequest(Request):
    """Note a text beside the recording, at the time of so many seconds ago."""

    text: str = Field(max_length=500)
    seconds_ago: float = Field(ge=0.0, le=3600.0, allow_inf_nan=False)


class NumberedNotice(Response):
    """Incident of a running camera in words, with its number from the start: the same may happen again."""

    number: int
    text: str


class LiveView(Response):
    """Running camera as the page shows it; `fault` is why no events come from it at present, in words."""

    camera: str
    is_running: bool
    fault: str | None
    kept_s: float
    seconds: list[LiveSecond]
    shots: list[LiveShotRow]
    notices: list[NumberedNotice]
    recording: LiveRecording | None


class LiveSource(Protocol):
    """A running camera behind the page; all of it may be called from any thread."""

    def view(self) -> LiveView:
        """The last two minutes."""

    def picture(self) -> bytes:
        """PNG of the newest events with the balls' circles."""

    def save_window(self, seconds: float) -> Path:
        """Save the last seconds as a recording; raises SpinscopeError."""

    def set_recording(self, is_on: bool) -> None:
        """Begin a recording, or end the one under way; raises SpinscopeError."""

    def mark(self, text: str, seconds_ago: float) -> None:
        """Note a text beside the recording; raises RecordingError."""

    def take_parameters(self, parameters: Parameters) -> None:
        """Go on with other parameters; raises ParameterError."""

    def bias_state(self) -> BiasState:
        """The camera's biases and their limits."""

    def set_biases(self, biases: Mapping[str, int]) -> None:
        """Change biases of the camera; raises CameraError."""

    def sweep_bias(
        self, name: str, points: int, report: Callable[[BiasSweep], None], check: Callable[[], None]
    ) -> BiasSweep:
        """Step the camera through the range of a bias; raises SpinscopeError."""
