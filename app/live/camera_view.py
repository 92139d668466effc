"""Running camera as the tuner's page shows it: its state, picture, biases and last seconds."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path

import cv2
import numpy as np

from spinscope.pipeline.biases import CURVES, BiasParameters
from spinscope.pipeline.cameras import ArrivedTick, SimulatedCamera
from spinscope.pipeline.cameras.event_camera import check_biases
from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.live_outputs import LiveNotice, LiveOutput, LiveShot, LiveSpin, LiveStatus
from spinscope.pipeline.live_spins import load_stages
from spinscope.pipeline.recordings import write_recording
from spinscope.pipeline.registry import Parameters
from spinscope.pipeline.result_rows import ResultRow
from spinscope.pipeline.spin_terms import vector_words
from spinscope.pipeline.tick import Tick

from ..tuning.bias_sweep import BiasRange, BiasState, BiasSweep
from ..viewer import entities
from ..web.live_schemas import LiveRecording, LiveSecond, LiveShotRow, LiveView, NumberedNotice
from ..web.open_recording import note_loaded_kernels
from .camera_sweep import CameraSweep, proposal_words, swept_biases
from .camera_thread import CameraObserver
from .event_rates import EventRateMeter
from .headless import OpenLive, row_words
from .recording import sidecar_tables, toml_text

SECONDS_SHOWN = 120
SHOTS_SHOWN, NOTICES_SHOWN = 20, 5
PICTURE_US = 20_000  # events of so long make a picture
PICTURE_SCALE = 2  # pixels of the sensor in one of the picture: a quarter of the work and of the bytes
WINDOWS_KEPT = 4  # recordings of the last seconds, of up to 100 MB each
FIRST_WINDOW_US = 500_000  # the page opens on so much
CHECK_S = 0.1


class CameraView(CameraObserver):
    """Observer of a live run behind the page.

    Parameters
    ----------
    folder : Path
        Where recordings of the last seconds go.
    kept_s : float
        Length of what is kept.

    Attributes
    ----------
    has_events : threading.Event
        Set when there is enough for a first recording.
    """

    def __init__(self, folder: Path, kept_s: float) -> None:
        super().__init__()
        self.kept_us = round(kept_s * 1e6)
        self.has_events = threading.Event()
        self._folder = folder
        self._is_running = True
        self._ticks: deque[tuple[ArrivedTick, Tick]] = deque()
        self._meter = EventRateMeter()
        self._seconds: deque[LiveSecond] = deque(maxlen=SECONDS_SHOWN)
        self._shots: dict[tuple[int, int], LiveShotRow] = {}  # by number and end: numbers begin anew after a gap
        self._notices: deque[NumberedNotice] = deque(maxlen=NOTICES_SHOWN)
        self._fault: str | None = None  # why no events come
        self._latencies_ms: dict[str, float] = {}
        self._sweep: CameraSweep | None = None
        self._windows: deque[Path] = deque()
        self._lock = threading.Lock()

    # Observer of the run.

    def begin(self, live: OpenLive) -> None:
        """Take the run before it starts."""
        self._biases = dict(live.camera.biases)
        load_stages()  # those of the page: beside the tracker their loading would hold it up
        note_loaded_kernels()
        super().begin(live)

    def add_tick(self, arrived: ArrivedTick, tick: Tick) -> None:
        """Take a tick."""
        self._meter.add(arrived.packet, tick.track.balls)
        if self._sweep is not None:
            self._sweep.add(arrived.packet, tick.track.balls)
        with self._lock:
            self._ticks.append((arrived, tick))
            while self._ticks[0][0].packet.end_us <= arrived.packet.end_us - PICTURE_US or (
                self._ticks[0][0].clock != arrived.clock
            ):
                self._ticks.popleft()
        if not self.has_events.is_set():
            span = self.opened.recent.span_us
            if span is not None and span[2] - span[1] >= FIRST_WINDOW_US:
                self.has_events.set()

    def add_output(self, output: LiveOutput, row: ResultRow | None) -> None:
        """Take a result."""
        with self._lock:
            if isinstance(output, LiveStatus):
                self._add_second(output)
            elif isinstance(output, LiveNotice):
                self._add_notice(output.text)
                if output.kind in ("unplugged", "stall"):
                    self._fault = output.text
                elif output.kind == "back":
                    self._fault = None
            elif isinstance(output, LiveSpin) and output.ended_by is not None:
                self._latencies_ms["announced"] = output.latency_ms
                key, text = (output.shot, output.t_us), _words(output)
                self._add_shot(key, LiveShotRow(text=text, is_final=False, recording=None))
            elif isinstance(output, LiveShot) and row is not None:
                self._latencies_ms["final"] = output.latency_ms
                text, file = row_words(row), row["events_file"]
                name = None if file is None else Path(str(file)).name
                key = output.shot.number, output.shot.end_us
                self._add_shot(key, LiveShotRow(text=text, is_final=True, recording=name))

    def end(self, error: Exception | None) -> None:
        """Take note that the camera has ended."""
        if error is not None:
            self._add_notice(str(error))
        self._is_running = False
        self.has_events.set()
        super().end(error)

    def _add_second(self, status: LiveStatus) -> None:
        rates = self._meter.take()
        latencies_ms, self._latencies_ms = self._latencies_ms, {}
        self._seconds.append(
            LiveSecond(
                t_s=self._seconds[-1].t_s + 1.0 if self._seconds else 0.0,
                rate_mev_s=status.rate_mev_s,
                p50_ms=status.p50_ms,
                p99_ms=status.p99_ms,
                announced_ms=latencies_ms.get("announced"),
                final_ms=latencies_ms.get("final"),
                dropped=status.dropped,
                outside=status.outside,
                late=status.late,
                skipped=status.skipped,
                backlog_ms=status.backlog_ms,
                spin_backlog_ms=status.spin_backlog_ms,
                noise_on_hz=None if rates is None else rates.noise_on_hz,
                noise_off_hz=None if rates is None else rates.noise_off_hz,
                ball_on_hz=None if rates is None else rates.ball_on_hz,
                ball_off_hz=None if rates is None else rates.ball_off_hz,
            )
        )

    def _add_notice(self, text: str) -> None:
        number = self._notices[-1].number + 1 if self._notices else 1
        self._notices.append(NumberedNotice(number=number, text=text))

    def _add_shot(self, key: tuple[int, int], row: LiveShotRow) -> None:
        known = self._shots.get(key)
        if known is None or not known.is_final:
            self._shots[key] = row
        while len(self._shots) > SHOTS_SHOWN:
            del self._shots[next(iter(self._shots))]

    # Source of the page.

    def view(self) -> LiveView:
        """The last two minutes."""
        camera, span, recorded = self.opened.camera, self.opened.recent.span_us, self.opened.recording.present
        recording = None
        if recorded is not None:
            recording = LiveRecording(file=str(recorded.files[-1]), events=recorded.events, markers=recorded.markers)
        with self._lock:
            return LiveView(
                camera=f"{camera.name} {camera.serial}",
                is_running=self._is_running,
                fault=self._fault,
                kept_s=0.0 if span is None else (span[2] - span[1]) * 1e-6,
                seconds=list(self._seconds),
                shots=list(self._shots.values())[::-1],
                notices=list(self._notices),
                recording=recording,
            )

    def picture(self) -> bytes:
        """PNG of the newest events, ON and OFF, with the balls' circles."""
        camera = self.opened.camera
        size = -(-camera.height_px // PICTURE_SCALE), -(-camera.width_px // PICTURE_SCALE)
        drawn = np.zeros((*size, 3), np.uint8)
        with self._lock:
            ticks = list(self._ticks)
        for arrived, _ in ticks:
            events = arrived.packet.events
            for chosen, colour in ((events.on, entities.ON), (~events.on, entities.OFF)):
                drawn[events.y_px[chosen] // PICTURE_SCALE, events.x_px[chosen] // PICTURE_SCALE] = colour
        for ball in ticks[-1][1].track.balls if ticks else ():
            x, y, radius = (round(float(ball.mean[index]) / PICTURE_SCALE) for index in (0, 1, 4))
            cv2.circle(drawn, (x, y), radius, entities.KALMAN_COLOUR, 1)
        bgr = cv2.cvtColor(drawn, cv2.COLOR_RGB2BGR)
        return bytes(cv2.imencode(".png", bgr, [cv2.IMWRITE_PNG_COMPRESSION, 1])[1])

    def save_window(self, seconds: float) -> Path:
        """Save the last seconds as a recording."""
        live, span = self.opened, self.opened.recent.span_us
        if span is None:
            raise RecordingError("no event has come yet: look at the camera's lens cap and biases")
        clock, start_us, end_us = span
        events = live.recent.between(clock, max(start_us, end_us - round(seconds * 1e6)), end_us)
        path = self._folder / f"last_{end_us // 1000:010d}_ms.raw"
        path.with_suffix(".toml").write_text(toml_text(sidecar_tables(live.run.parameters)), encoding="utf-8")
        write_recording(path, events, width_px=live.camera.width_px, height_px=live.camera.height_px)
        if path not in self._windows:
            self._windows.append(path)
        while len(self._windows) > WINDOWS_KEPT:
            oldest = self._windows.popleft()
            for file in (oldest, oldest.with_suffix(".toml")):
                with suppress(OSError):  # still open, where that keeps a file
                    file.unlink()
        return path

    def set_recording(self, is_on: bool) -> None:
        """Begin a recording of the camera named by date and time, or end the one under way."""
        if not is_on:
            self.opened.recording.end()
        elif self._is_running:
            self.opened.recording.begin()
        else:
            raise RecordingError("the camera has ended: there is nothing to record")

    def mark(self, text: str, seconds_ago: float) -> None:
        """Note a text beside the recording."""
        self.opened.recording.mark(text, seconds_ago)

    def take_parameters(self, parameters: Parameters) -> None:
        """Go on with other parameters, from the next tick on."""
        self.opened.run.take_parameters(parameters)
        self.opened.session.parameters = parameters

    def bias_state(self) -> BiasState:
        """The camera's biases within the device's limits."""
        camera, known = self.opened.camera, BiasParameters.tunables()
        shown = {name: (known[name].low or 0, known[name].high or 0) for name in self._biases if name in known}
        is_model = isinstance(camera, SimulatedCamera) and not all(curve.calibrated for curve in CURVES.values())
        return BiasState(
            values=dict(self._biases),
            known=bool(self._biases),
            locked=camera.without_biases or None,
            calibrated=not is_model,
            ranges={
                name: BiasRange(low, high, camera.biases[name], known[name].help if name in known else name)
                for name, (low, high) in (camera.bias_limits or shown).items()
            },
            swept=swept_biases(camera.bias_limits),
            of_camera=True,
        )

    def set_biases(self, biases: Mapping[str, int]) -> None:
        """Change biases, as soon as the camera's thread comes to it."""
        camera = self.opened.camera
        check_biases(biases, camera)
        self._biases |= biases
        self.opened.set_biases(biases)

    def sweep_bias(
        self, name: str, points: int, report: Callable[[BiasSweep], None], check: Callable[[], None]
    ) -> BiasSweep:
        """Step the camera through the range of a bias, and give it its former value again."""
        live = self.opened
        sweep = CameraSweep(name, live.camera, self._biases, live.set_biases, points=points, on_point=report)
        report(sweep.sweep)
        self._sweep = sweep
        try:
            while not sweep.done.wait(CHECK_S):
                check()
                if not self._is_running:
                    raise RecordingError("the camera has ended: the sweep has too")
        finally:
            self._sweep = None
            sweep.end()
        made = sweep.sweep
        return BiasSweep(made.name, made.total, made.points, proposal_words(made))


def _words(spin: LiveSpin) -> str:
    """An announced spin for people."""
    estimate = spin.spin.estimate
    if estimate.vector_rps is None:
        return f"no spin so far: {estimate.reason}"
    sigma = "" if estimate.magnitude_std_rps is None else f" +- {estimate.magnitude_std_rps:.1f}"
    return f"so far {estimate.magnitude_rps:.1f}{sigma} rps, {vector_words(estimate.vector_rps)} ({estimate.method})"
