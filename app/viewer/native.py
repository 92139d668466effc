"""Viewer in Rerun's own window."""

from __future__ import annotations

import socket
import subprocess
import tempfile
import time
from pathlib import Path

from spinscope.pipeline.errors import SpinscopeError

from ..terminal import until_interrupted
from .rerun_api import place_playhead, program, quiet_environment
from .rrd import write_rrd
from .run import ViewedRun

HOST = "127.0.0.1"
START_S = 30.0  # patience until the window has read the recording


def show_native(run: ViewedRun, layout: str, *, window: tuple[str, ...] = ()) -> None:
    """Show the run in a window and wait until it is closed or Ctrl-C is pressed.

    Parameters
    ----------
    run : ViewedRun
        The run.
    layout : str
        Name of the view in front.
    window : tuple of str
        More arguments for Rerun's program.

    Raises
    ------
    SpinscopeError
        Where no window can open.
    """
    with tempfile.TemporaryDirectory(prefix="spinscope-") as folder:
        path = Path(folder) / "recording.rrd"
        write_rrd(run, path, layout)
        with socket.create_server((HOST, 0)) as free:
            port = free.getsockname()[1]
        command = [program(), "--bind", HOST, "--port", str(port), "--hide-welcome-screen", *window, str(path)]
        process = subprocess.Popen(
            command,
            env=quiet_environment(),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C in the terminal is for us
        )
        status = 0
        try:
            with until_interrupted():
                _place_playhead(run, port, process)
                status = process.wait()
        finally:
            process.kill()
            process.wait()
    if status != 0:
        raise SpinscopeError(
            f"Rerun's window closed with status {status}, perhaps for want of a graphics driver: leave out --native "
            "to use the browser"
        )


def _place_playhead(run: ViewedRun, port: int, process: subprocess.Popen[bytes]) -> None:
    """Put the playhead where the run opens, as soon as the window has read the recording; give up quietly."""
    deadline = time.monotonic() + START_S
    while process.poll() is None and time.monotonic() < deadline:
        if place_playhead(HOST, port, run.opening_us):
            return
        time.sleep(0.2)
