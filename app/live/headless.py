"""Live run without a page: lines of JSON as shots end, and once a second."""

from __future__ import annotations

import gc
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager

from spinscope.pipeline.cameras import EventStream
from spinscope.pipeline.live import LiveBall, LiveNotice, LiveRun, LiveShot, LiveSpin, load_kernels
from spinscope.pipeline.session import Choices

from ..terminal import note
from .json_lines import JsonLines, JsonServer
from .opening import CameraChoice, open_live

# Python lets a thread run for 5 ms while another waits; with the tick's work in three threads that is a whole tick.
SWITCH_S = 0.0005


def run_headless(chosen: CameraChoice, choices: Choices, method: str, output: str, *, port: int | None = None) -> None:
    """Run until the camera ends or Ctrl-C, writing a line for each shot and one a second; raises SpinscopeError.

    Parameters
    ----------
    output : str
        File or pipe to append to, "-" for standard output.
    port : int, optional
        Port on which robots get these lines and those of every tick; none by default.
    """
    camera, session, reopen = open_live(chosen, choices)
    warm_up()
    with ExitStack() as open_outputs:
        lines = open_outputs.enter_context(JsonLines(output))
        server = None if port is None else open_outputs.enter_context(JsonServer(port))
        if server is not None:
            note(f"lines of JSON at 127.0.0.1 port {server.port}")
        run = LiveRun(
            lambda tick_us, on_notice: EventStream(camera, tick_us, reopen=reopen, on_notice=on_notice),
            session.parameters,
            method,
            with_balls=server is not None,
        )
        note(f"live: {camera.name} {camera.serial}, {camera.width_px} x {camera.height_px} px; Ctrl-C ends it")
        with ends_on_signals(run.stop):
            for one in run.outputs():
                of_shot = (session.camera, session.ball_radius_m) if isinstance(one, LiveShot) else ()
                line = one.to_dict(*of_shot)
                if isinstance(one, LiveNotice):
                    note(one.text)
                if server is not None:
                    server.send(line)
                if not isinstance(one, LiveBall | LiveSpin):
                    lines.write(line)


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
