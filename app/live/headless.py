"""Live run without a page: lines of JSON as shots end, and once a second."""

from __future__ import annotations

import gc
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path

from spinscope.pipeline.cameras import EventStream, RecentEvents
from spinscope.pipeline.cameras.event_stream import Sink
from spinscope.pipeline.live import LiveBall, LiveNotice, LiveRun, LiveShot, LiveSpin, load_kernels
from spinscope.pipeline.result_rows import ResultRow
from spinscope.pipeline.session import Choices

from ..terminal import note
from .json_lines import JsonLines, JsonServer
from .opening import CameraChoice, open_live
from .recording import RecordChoice, recorder, take_markers
from .shot_table import ShotTable

# Python lets a thread run for 5 ms while another waits; with the tick's work in three threads that is a whole tick.
SWITCH_S = 0.0005


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
    """

    lines: str | None = None
    port: int | None = None
    table: Path | None = None
    record: RecordChoice | None = None


Begun = Callable[[Callable[[], None]], None]


def run_headless(
    chosen: CameraChoice, choices: Choices, method: str, to: Outputs, on_start: Begun | None = None
) -> None:
    """Run until the camera ends or is told to, writing each shot as it ends and the state once a second.

    Parameters
    ----------
    on_start : callable, optional
        `on_start(stop)` gets what ends the run; Ctrl-C does by default, in the main thread alone.

    Raises
    ------
    SpinscopeError
        For what cannot be opened or written.
    """
    table = None if to.table is None else ShotTable(to.table)
    camera, session, reopen = open_live(chosen, choices)
    warm_up()
    with ExitStack() as at_end:
        lines = None if to.lines is None else at_end.enter_context(JsonLines(to.lines))
        server = None if to.port is None else at_end.enter_context(JsonServer(to.port))
        if server is not None:
            note(f"lines of JSON at 127.0.0.1 port {server.port}")
        recent = RecentEvents()

        def stream(tick_us: int, on_notice: Callable[[str], None]) -> EventStream:
            sinks: list[Sink] = [] if table is None else [recent]
            if to.record is not None:
                recording = recorder(to.record, camera, session, on_notice)
                at_end.callback(recording.close)
                take_markers(recording)
                sinks.append(recording)
            return EventStream(camera, tick_us, reopen=reopen, sinks=tuple(sinks), on_notice=on_notice)

        run = LiveRun(stream, session.parameters, method, with_balls=server is not None)
        note(f"live: {camera.name} {camera.serial}, {camera.width_px} x {camera.height_px} px; Ctrl-C ends it")
        if on_start is not None:
            on_start(run.stop)
        if table is not None:
            at_end.callback(table.close)
        with ends_on_signals(run.stop) if on_start is None else nullcontext():
            for one in run.outputs():
                of_shot = (session.camera, session.ball_radius_m) if isinstance(one, LiveShot) else ()
                line = one.to_dict(*of_shot)
                if isinstance(one, LiveNotice):
                    note(one.text)
                if server is not None:
                    server.send(line)
                if lines is not None and not isinstance(one, LiveBall | LiveSpin):
                    lines.write(line)
                if table is not None and isinstance(one, LiveShot):
                    row = table.append(one, session, recent)
                    note(_in_words(row))
    if table is not None:
        note(f"{table.count} shots in {table.path}, {table.disk_bytes / 1e6:.1f} MB with their events")


def _in_words(row: ResultRow) -> str:
    """A row of the table for people."""
    if row["best"] is None:
        return f"shot {row['number']}: no spin: {row['best_reason']}"
    speed = "" if row["speed_m_s"] is None else f"{row['speed_m_s']:.1f} m/s, "
    return f"shot {row['number']}: {speed}{row['magnitude_rps']:.1f} rps, {row['kind']} ({row['best']})"


def warm_up() -> None:
    """Have everything in memory before the first event: kernels loaded, Python's garbage search rid of them."""
    note("loading the kernels ...")
    load_kernels()
    gc.collect()
    gc.freeze()
    sys.setswitchinterval(SWITCH_S)


@contextmanager
def ends_on_signals(stop: Callable[[], None]) -> Iterator[None]:
    """Let Ctrl-C and the end asked for by the system stop the run, which then writes what it has."""
    before = {number: signal.signal(number, lambda *_: stop()) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
