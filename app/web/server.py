"""Server of the web application: on this machine alone, until Ctrl-C."""

from __future__ import annotations

import gc
import os
import secrets
import shutil
import socket
import sys
import threading
import webbrowser
from collections.abc import Callable, Collection, Generator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import uvicorn
from fastapi import FastAPI

from spinscope.app.terminal import ProgressBar, ends_on_signals, note
from spinscope.pipeline.errors import ParameterError
from spinscope.pipeline.session import Choices

from .app_state import AppState
from .application import application
from .live_schemas import LiveSource
from .open_recording import OpenRecording

if TYPE_CHECKING:
    from .coach_application import CoachState

HOST = "127.0.0.1"
PORT = 8377  # free of well-known services; another one is taken when it is busy


class _Server(uvicorn.Server):
    """Announces its address once it answers, and ends all work before it waits for the connections to end."""

    def __init__(self, config: uvicorn.Config, close: Callable[[], None], announce: Callable[[], None]) -> None:
        super().__init__(config)
        self._close, self._announce = close, announce

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        self._announce()

    @contextmanager
    def capture_signals(self) -> Generator[None, None, None]:
        """End on the first signal; its own handlers raise it again at the end, and a second one as an error."""
        with ends_on_signals(self._stop):
            yield

    def _stop(self) -> None:
        self.should_exit = True

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        self._close()
        await super().shutdown(sockets)


def serve(
    path: Path,
    choices: Choices,
    port: int | None = None,
    *,
    open_browser: bool = True,
    hosts: Collection[str] = (),
    folders: Sequence[Path] = (),
    tools: bool = True,
    layout: str = "all",
    followed: int | None = None,
    live: LiveSource | None = None,
    labels: Path | None = None,
) -> None:
    """Open a recording and serve its page until Ctrl-C.

    Parameters
    ----------
    port : int or None
        Port asked for; another free one is taken when it is busy. None for the usual one.
    open_browser : bool
        Whether to open the page where there is a browser; the address is printed in any case.
    hosts : collection of str
        Names besides 127.0.0.1 and localhost by which the page may be reached.
    folders, tools, layout, followed, live, labels
        See AppState.

    Raises
    ------
    SpinscopeError
        For a recording or choices that cannot be used, or when no port can be opened.
    """
    shown: dict[str, Any] = {"tools": tools, "layout": layout, "followed": followed, "live": live, "labels": labels}
    with closing(AppState(path, choices, folders=folders, **shown)) as state:
        with ProgressBar() as bar:
            recording = state.recording(on_progress=bar)
        if not recording.are_kernels_loaded:
            # While the browser loads the page and the viewer, which takes longer.
            threading.Thread(target=_load_kernels, args=(recording,), name="kernels", daemon=True).start()
        token = _new_token()

        def announce(own_port: int) -> None:
            address = _address(own_port, token)
            tunnel = _tunnel(own_port)
            if tools:
                sys.stdout.write(f"{address}\n")
                sys.stdout.flush()
            is_open = open_browser and show_in_browser(address)
            if not tools:
                hint = "" if is_open else f" (no browser here: {tunnel}, `--save FILE.rrd` writes a file instead)"
                note(f"the viewer is at {address}{hint}; Ctrl-C stops it")
            elif not is_open:
                note(f"open the address in a browser; from elsewhere, {tunnel}")

        for warning in [] if tools else recording.session.warnings:
            note(f"warning: {warning}")
        run_application(application(state, token, hosts), port, state.close, announce)


def serve_coach(
    state: CoachState,
    port: int | None = None,
    *,
    open_browser: bool = True,
    hosts: Collection[str] = (),
    place: str = "shots",
) -> None:
    """Serve the coach's page, at first a place of it, until Ctrl-C; see `serve`."""
    from .coach_application import coach_application  # loads Matplotlib, for which no other page waits

    with closing(state):
        state.start()
        token = _new_token()

        def announce(own_port: int) -> None:
            address = f"{_address(own_port, token)}#{place}"
            sys.stdout.write(f"{address}\n")
            sys.stdout.flush()
            if not (open_browser and show_in_browser(address)):
                note(f"open the address in a browser; from elsewhere, {_tunnel(own_port)}")

        run_application(coach_application(state, token, hosts), port, state.close, announce)


def run_application(app: FastAPI, port: int | None, close: Callable[[], None], announce: Callable[[int], None]) -> None:
    """Run an application on this machine until Ctrl-C.

    Parameters
    ----------
    port : int or None
        See `serve`.
    close : callable
        Ends all work that connections wait for.
    announce : callable
        Called with the port once the application answers.
    """
    listening = listening_socket(PORT if port is None else port)
    config = uvicorn.Config(
        app, log_level="error", lifespan="on", access_log=False, server_header=False, timeout_graceful_shutdown=2
    )
    with listening:
        _Server(config, close, lambda: announce(listening.getsockname()[1])).run([listening])


def _new_token() -> str:
    """Secret of one start of the server, for the page's address."""
    return secrets.token_urlsafe(24)


def _address(port: int, token: str) -> str:
    return f"http://{HOST}:{port}/?token={token}"


def _tunnel(port: int) -> str:
    return f"`ssh -L {port}:{HOST}:{port} THIS_MACHINE` brings it to the same address of yours"


def show_in_browser(address: str) -> bool:
    """Open an address in a graphical browser; False where there is none (a text browser would take the terminal)."""
    if sys.platform.startswith("linux") and not shutil.which("wslview"):
        if not any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")):
            return False
    try:
        found = webbrowser.get()
    except webbrowser.Error:
        return False
    if isinstance(found, webbrowser.GenericBrowser) and not isinstance(found, webbrowser.BackgroundBrowser):
        return False
    return found.open(address)


def listening_socket(port: int) -> socket.socket:
    """A socket that listens on the port, or on a free one when that is busy; raises ParameterError."""
    if not 0 <= port <= 65535:
        raise ParameterError(f"port {port} is out of range: 1 to 65535")
    for candidate in (port, 0):
        listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listening.bind((HOST, candidate))
            listening.listen(128)
        except OSError as error:
            listening.close()
            if candidate == 0:
                raise ParameterError(f"no port can be opened on {HOST} ({error.strerror})") from None
            continue
        return listening
    raise AssertionError("unreachable")


def _load_kernels(recording: OpenRecording) -> None:
    """Load the kernels, and leave them and the libraries out of Python's search for garbage.

    They are a quarter of a million objects: looking through them took 0.15 s of every tenth picture.
    """
    recording.load_kernels()
    gc.collect()
    gc.freeze()
