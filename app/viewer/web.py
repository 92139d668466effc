"""The viewer in the browser, served from this machine to this machine alone.

Rerun's program carries its web viewer. That viewer's own page fetches fonts, news and examples from the internet and
reports usage; our page loads the same viewer, and its content security policy lets it talk to nobody but us.
"""

from __future__ import annotations

import http.server
import os
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
import webbrowser
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from spinscope.pipeline.errors import SpinscopeError

from ..terminal import note
from .rerun_api import VERSION, playhead_request, program, quiet_environment
from .rrd import write_rrd
from .run import ViewedRun

HOST = "127.0.0.1"
PREFERRED_PORT = 9090
PAGE = Path(__file__).parent / "page"
START_S = 20.0  # patience with Rerun's program: 0.2 s warm, several seconds from a cold disk
POLICY = "default-src 'self'; script-src 'self' 'wasm-unsafe-eval'; img-src 'self' data: blob:; worker-src 'self' blob:"
TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css",
    ".js": "text/javascript",
    ".wasm": "application/wasm",
}


def show_web(run: ViewedRun, layout: str) -> None:
    """Serve the run until Ctrl-C, open a browser if there is one, and say in one line where it is."""
    with served(run, layout) as (server, address):
        opened = _open_browser(address)
        port = server.server_address[1]
        hint = (
            ""
            if opened
            else f" (no browser here: `ssh -L {port}:{HOST}:{port} THIS_MACHINE` brings it to yours, "
            "`--save FILE.rrd` writes a file instead)"
        )
        note(f"the viewer is at {address}{hint}; Ctrl-C stops it")
        try:
            server.serve_forever(poll_interval=0.2)
        except KeyboardInterrupt:
            note("")


@contextmanager
def served(run: ViewedRun, layout: str) -> Iterator[tuple[http.server.ThreadingHTTPServer, str]]:
    """A server ready to run (`serve_forever`) and its address; closed at the end."""
    files = {f"/{path.name}": path.read_bytes() for path in PAGE.iterdir()}
    files["/"] = files.pop("/index.html").replace(b"VERSION", VERSION.encode())
    files |= _rerun_files()
    files["/playhead"] = playhead_request(run.opening_us)
    with tempfile.TemporaryDirectory(prefix="spinscope-") as folder:
        path = Path(folder) / "recording.rrd"
        write_rrd(run, path, layout)
        files["/recording.rrd"] = path.read_bytes()
    server = _bound(files)
    try:
        yield server, f"http://{HOST}:{server.server_address[1]}/"
    finally:
        server.server_close()


def _bound(files: dict[str, bytes]) -> http.server.ThreadingHTTPServer:
    """A server on the usual port, or on a free one when that is taken."""

    class Handler(_Handler):
        served_files = files

    try:
        return http.server.ThreadingHTTPServer((HOST, PREFERRED_PORT), Handler)
    except OSError:
        return http.server.ThreadingHTTPServer((HOST, 0), Handler)


class _Handler(http.server.BaseHTTPRequestHandler):
    served_files: dict[str, bytes]

    def do_GET(self) -> None:
        """One of our files, or 404; other names than ours (DNS rebinding) are turned away."""
        host = self.headers.get("Host", "").rpartition(":")[0]
        content = self.served_files.get(self.path.partition("?")[0])
        if content is None or host not in (HOST, "localhost"):
            self.send_error(404)
            return
        suffix = Path(self.path.partition("?")[0]).suffix or ".html"
        self.send_response(200)
        self.send_header("Content-Type", TYPES.get(suffix, "application/octet-stream"))
        self.send_header("Content-Length", str(len(content)))
        self.send_header("Content-Security-Policy", POLICY)
        # Rerun's files carry its version in their address: the browser keeps them, compiled.
        lasting = self.path.endswith(f"?{VERSION}")
        self.send_header("Cache-Control", "max-age=31536000, immutable" if lasting else "no-store")
        self.end_headers()
        try:
            self.wfile.write(content)
        except (BrokenPipeError, ConnectionResetError):
            self.close_connection = True  # the tab was closed meanwhile

    def log_message(self, format: str, *args: object) -> None:
        """Keep the terminal quiet."""


def _rerun_files() -> dict[str, bytes]:
    """The web viewer's script and program, out of Rerun's own, which serves them for a moment."""
    web_port, other_port = free_ports(2)
    command = [program(), "--serve-web", "--bind", HOST, "--port", str(other_port), "--web-viewer-port", str(web_port)]
    process = subprocess.Popen(
        command,
        env=quiet_environment(),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,  # Ctrl-C in the terminal is for us
    )
    try:
        names = ("re_viewer.js", "re_viewer_bg.wasm")
        return {f"/{name}": _fetched(f"http://{HOST}:{web_port}/{name}", process) for name in names}
    finally:
        process.kill()
        process.wait()


def _fetched(url: str, process: subprocess.Popen[bytes]) -> bytes:
    """The file at this address as soon as the program answers."""
    deadline = time.monotonic() + START_S
    while process.poll() is None and time.monotonic() < deadline:
        try:
            with urllib.request.build_opener(urllib.request.ProxyHandler({})).open(url, timeout=START_S) as answer:
                content: bytes = answer.read()
                return content
        except urllib.error.URLError:
            time.sleep(0.05)
    raise SpinscopeError(
        "Rerun's web viewer does not start: `uv sync` installs it anew; `--save FILE.rrd` works without"
    )


def free_ports(count: int) -> list[int]:
    """Ports that nobody listens on at the moment."""
    sockets = [socket.create_server((HOST, 0)) for _ in range(count)]
    ports = [one.getsockname()[1] for one in sockets]
    for one in sockets:
        one.close()
    return ports


def _open_browser(address: str) -> bool:
    """Open the address in a browser with a window; False where there is none."""
    if sys.platform.startswith("linux"):
        windows = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY") or os.environ.get("BROWSER")
        if not windows and not shutil.which("wslview"):
            return False
    try:
        return webbrowser.open(address)
    except webbrowser.Error:
        return False
