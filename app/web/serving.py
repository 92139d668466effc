"""Runs the page's server on this machine alone, until Ctrl-C."""

from __future__ import annotations

import gc
import socket
import sys
import threading
import webbrowser
from pathlib import Path

import uvicorn

from spinscope.pipeline.errors import ParameterError
from spinscope.pipeline.session import Choices

from .bench import Bench
from .web import application
from .workshop import Workshop

HOST = "127.0.0.1"
PORT = 8377  # free of well-known services; another one is taken when it is busy


class _Server(uvicorn.Server):
    """Says its address once it answers, and ends the pages' connections before it waits for them to end."""

    def __init__(self, config: uvicorn.Config, workshop: Workshop, address: str, *, open_browser: bool) -> None:
        super().__init__(config)
        self._workshop, self._address, self._open_browser = workshop, address, open_browser

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        sys.stdout.write(f"{self._address}\n")
        sys.stdout.flush()
        if self._open_browser:
            _open(self._address)

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        self._workshop.close()
        await super().shutdown(sockets)


def serve(path: Path, choices: Choices, port: int | None, open_browser: bool) -> None:
    """Open a recording and serve its page on 127.0.0.1 until Ctrl-C; raises SpinscopeError.

    port : asked for; another free one is taken when it is busy. None for the usual one
    open_browser : whether to open the page where there is a browser; the address is printed in any case
    """
    workshop = Workshop(path, choices)
    bench = workshop.bench()
    # While the browser loads the page and the viewer, which takes longer.
    threading.Thread(target=_get_ready, args=(bench,), name="kernels", daemon=True).start()
    listening = _listening_socket(PORT if port is None else port)
    address = f"http://{HOST}:{listening.getsockname()[1]}/"
    config = uvicorn.Config(
        application(workshop),
        log_level="error",
        lifespan="on",
        access_log=False,
        server_header=False,
        timeout_graceful_shutdown=2,
    )
    try:
        _Server(config, workshop, address, open_browser=open_browser).run([listening])
    except KeyboardInterrupt:  # Ctrl-C is how it is meant to end
        return
    finally:
        listening.close()


def _get_ready(bench: Bench) -> None:
    """Load the kernels, and leave them and the libraries out of Python's search for garbage.

    They are a quarter of a million objects: looking through them took 0.15 s of every tenth picture.
    """
    bench.load_kernels()
    gc.collect()
    gc.freeze()


def _listening_socket(port: int) -> socket.socket:
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


def _open(address: str) -> None:
    """Open the page where there is a graphical browser; a text browser would take the terminal."""
    try:
        found = webbrowser.get()
    except webbrowser.Error:
        return
    if not isinstance(found, webbrowser.GenericBrowser) or isinstance(found, webbrowser.BackgroundBrowser):
        found.open(address)
