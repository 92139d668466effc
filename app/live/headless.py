"""Live run without a page: lines of JSON as shots end, and once a second."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from spinscope.pipeline.cameras import ArrivedTick, EventCamera, EventStream, Notice, RecentEvents
from spinscope.pipeline.cameras.event_stream import Sink
from spinscope.pipeline.errors import RecordingError
from spinscope.pipeline.live import LiveRun, load_kernels
from spinscope.pipeline.live_outputs import LiveBall, LiveNotice, LiveOutput, LiveShot, LiveSpin, LiveStatus
from spinscope.pipeline.result_rows import ResultRow
from spinscope.pipeline.session import Choices, Session
from spinscope.pipeline.tick import Tick

from ..table_files import check_table_name
from ..terminal import ends_on_signals, note
from ..tuning.bias_sweep import BiasSweep
from .camera_sweep import MEASURED_S, CameraSweep, proposal_words, proposed_value
from .json_lines import JsonLines, JsonServer
from .opening import CameraChoice, open_live, opened_anew
from .recording import CameraRecording, RecordChoice, take_markers
from .shot_table import ShotTable
from .sweep_figure import write_sweep_figure


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepChoice:
    """Options of a sweep of one of the camera's biases.

    Attributes
    ----------
    name : str
        The bias.
    points : int
        Number of its values.
    measured_s : float
        Time for each of them.
    figure : Path, optional
        Where the event rates are drawn.
    """

    name: str
    points: int = 9
    measured_s: float = MEASURED_S
    figure: Path | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Outputs:
    """Destinations of the results of a run without a page.

    Attributes
    ----------
    lines : str, optional
        File or pipe of lines of JSON, "-" for standard output.
    port : int, optional
        Port on which robots get these lines and those of every tick.
    table : Path, optional
        Table to which shots are appended.
    record : RecordChoice, optional
        Recording of the camera.
    sweep : SweepChoice, optional
        Sweep of a bias, with which the run ends.
    """

    lines: str | None = None
    port: int | None = None
    table: Path | None = None
    record: RecordChoice | None = None
    sweep: SweepChoice | None = None


@dataclass(frozen=True, slots=True)
class OpenLive:
    """A live run that begins.

    Attributes
    ----------
    session, run
        Parameters and run.
    recent : RecentEvents
        Its last events.
    recording : CameraRecording
        Its recording, which can begin and end.
    """

    session: Session
    run: LiveRun
    recent: RecentEvents
    recording: CameraRecording

    @property
    def camera(self) -> EventCamera:
        """The camera that is there."""
        return self.run.stream.camera

    def set_biases(self, biases: Mapping[str, int]) -> int:
        """Change biases as `EventStream.set_biases` does, noted beside a recording under way."""
        before = self.camera.biases
        changed = [f"{name} = {value}" for name, value in biases.items() if before.get(name) != value]
        upto_us = self.run.stream.set_biases(biases)
        if changed and self.recording.present is not None:
            try:
                self.recording.mark(f"biases: {', '.join(changed)}")
            except RecordingError as error:
                note(str(error))
        return upto_us


class LiveObserver(Protocol):
    """Onlooker of a live run."""

    kept_us: int  # length of the events that it wants to see again

    def begin(self, live: OpenLive) -> None:
        """Take the run before it starts."""

    def add_tick(self, arrived: ArrivedTick, tick: Tick) -> None:
        """Take a tick, in the tracker's thread: it must not wait."""

    def add_output(self, output: LiveOutput, row: ResultRow | None) -> None:
        """Take a result, and its row of the table where it has one."""


def run_headless(
    chosen: CameraChoice, choices: Choices, method: str, to: Outputs, observer: LiveObserver | None = None
) -> None:
    """Run until the camera ends or is told to, writing each shot as it ends and the state once a second.

    Parameters
    ----------
    observer : LiveObserver, optional
        Gets all there is, and ends the run; without one Ctrl-C does, in the main thread alone.

    Raises
    ------
    SpinscopeError
        For what cannot be opened or written.
    """
    if to.table is not None:
        check_table_name(to.table)
    camera, session = open_live(chosen, choices)
    try:
        table = None if to.table is None else ShotTable(to.table, method)
    except BaseException:
        camera.close()
        raise
    with ExitStack() as at_end:
        lines = None if to.lines is None else at_end.enter_context(JsonLines(to.lines))
        server = None if to.port is None else at_end.enter_context(JsonServer(to.port))
        if server is not None:
            note(f"lines of JSON at 127.0.0.1 port {server.port}")
        recent = RecentEvents() if observer is None else RecentEvents(observer.kept_us)

        recording: CameraRecording
        sweep: CameraSweep | None = None
        run: LiveRun

        def stream(tick_us: int, on_notice: Notice) -> EventStream:
            nonlocal recording
            folder = Path.cwd() if to.record is None else to.record.path.parent
            recording = CameraRecording(lambda: run.stream.camera, session, folder, on_notice)
            sinks: list[Sink] = [recording] if table is None else [recent, recording]
            return EventStream(camera, tick_us, reopen=opened_anew, sinks=tuple(sinks), on_notice=on_notice)

        def on_tick(arrived: ArrivedTick, tick: Tick, latency_ms: float) -> None:
            if (since := run.needed_since) is not None:
                recent.keep_from(*since)
            if sweep is not None:
                sweep.add(arrived.packet, tick.track.balls)
            if observer is not None:
                observer.add_tick(arrived, tick)

        run = LiveRun(stream, session.parameters, method, with_balls=server is not None, on_tick=on_tick)
        live = OpenLive(session, run, recent, recording)
        at_end.callback(recording.end)
        if to.record is not None:
            recording.begin(to.record)
            assert recording.present is not None
            note(f"recording {recording.present.files[0]}")
            take_markers(recording)
        if to.sweep is not None:
            sweep = CameraSweep(
                to.sweep.name,
                camera,
                camera.biases,
                live.set_biases,
                points=to.sweep.points,
                measured_s=to.sweep.measured_s,
            )
        warm_up()
        note(f"live: {camera.name} {camera.serial}, {camera.width_px} x {camera.height_px} px; Ctrl-C ends it")
        if observer is not None:
            observer.begin(live)
        if table is not None:
            at_end.callback(table.close)
        said: str | None = None
        with ends_on_signals(run.end):
            for one in run.outputs():
                of_shot = (session.camera, session.ball_radius_m) if isinstance(one, LiveShot) else ()
                line = one.to_dict(*of_shot)
                if isinstance(one, LiveNotice):
                    note(one.text)
                words = _ending_words(run, one) if isinstance(one, LiveStatus) and run.is_ending else None
                if words is not None and words != said:
                    note(words)
                    said = words
                if server is not None:
                    server.send(line)
                if lines is not None and not _is_of_every_tick(one):
                    lines.write(line)
                row: ResultRow | None = None
                if table is not None and isinstance(one, LiveShot):
                    row = table.append(one, session, recent)
                    note(row_words(row))
                if observer is not None:
                    observer.add_output(one, row)
                if sweep is not None and sweep.done.is_set():
                    run.stop()
        if run.shots_waiting:
            note(f"ended without the spins of {_shots(run.shots_waiting)}")
        if sweep is not None and to.sweep is not None:
            _write_sweep(sweep.sweep, lines, to.sweep.figure)
    if table is not None:
        note(f"{table.count} shots in {table.path}, {table.disk_bytes / 1e6:.1f} MB with their events")


def _write_sweep(sweep: BiasSweep, lines: JsonLines | None, figure: Path | None) -> None:
    """Write the event rates at each value, the value that they propose, and their figure."""
    for point in sweep.points:
        rates = {name: getattr(point, name) for name in ("noise_on_hz", "noise_off_hz", "ball_on_hz", "ball_off_hz")}
        words = ", ".join(f"{name.removesuffix('_hz')} {hz:.0f}/s" for name, hz in rates.items() if hz is not None)
        note(f"{sweep.name} = {point.value}: {words}")
        if lines is not None:
            lines.write({"bias": {"name": sweep.name, "value": point.value, **rates}})
    words, value = proposal_words(sweep), proposed_value(sweep)
    note(words)
    if lines is not None:
        lines.write({"proposed": {"name": sweep.name, "value": value, "text": words}})
    if figure is not None:
        write_sweep_figure(sweep, value, figure)


def _ending_words(run: LiveRun, status: LiveStatus) -> str | None:
    """Work for which an end waits, in words; None where there is none left."""
    waited_for = [f"the spins of {_shots(run.shots_waiting)}"] if run.shots_waiting else []
    if status.backlog_ms:
        waited_for.insert(0, f"the tracker, which is {status.backlog_ms / 1e3:.1f} s behind")
    return f"ending: waits for {' and '.join(waited_for)}; Ctrl-C ends it at once" if waited_for else None


def _shots(count: int) -> str:
    return "a shot" if count == 1 else f"{count} shots"


def _is_of_every_tick(one: LiveOutput) -> bool:
    """Whether a result is one for robots alone."""
    return isinstance(one, LiveBall) or (isinstance(one, LiveSpin) and one.ended_by is None)


def row_words(row: ResultRow) -> str:
    """A row of the table for people."""
    if row["best"] is None:
        return f"shot {row['number']}: no spin: {row['best_reason']}"
    speed = "" if row["speed_m_s"] is None else f"{row['speed_m_s']:.1f} m/s, "
    return f"shot {row['number']}: {speed}{row['magnitude_rps']:.1f} rps, {row['kind']} ({row['best']})"


def warm_up() -> None:
    """Have the kernels in memory before the first event."""
    note("loading the kernels ...")
    load_kernels()
