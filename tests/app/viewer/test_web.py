"""The page and its server: to this machine alone, with everything it needs and nothing from elsewhere."""

from __future__ import annotations

import threading
import urllib.error
import urllib.request
from collections.abc import Iterator

import psutil
import pytest

from spinscope.app.viewer import show
from spinscope.app.viewer.native import show_native
from spinscope.app.viewer.rerun_api import playhead_request
from spinscope.app.viewer.run import ViewedRun
from spinscope.app.viewer.web import served
from spinscope.pipeline.errors import SpinscopeError


@pytest.fixture(scope="module")
def address(no_ball: ViewedRun) -> Iterator[str]:
    with served(no_ball, "all") as (server, address):
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        yield address
        server.shutdown()
        thread.join()


def fetched(url: str, **headers: str) -> tuple[bytes, dict[str, str]]:
    request = urllib.request.Request(url, headers=headers)
    with urllib.request.build_opener(urllib.request.ProxyHandler({})).open(request, timeout=10) as answer:
        return answer.read(), dict(answer.headers)


def test_it_listens_on_this_machine_only_and_leaves_no_helper(address: str) -> None:
    port = int(address.rstrip("/").rpartition(":")[2])
    own = psutil.Process()
    assert [c.laddr.ip for c in own.net_connections("tcp") if c.status == "LISTEN" and c.laddr.port == port] == [
        "127.0.0.1"
    ]
    assert not [child for child in own.children(recursive=True) if "rerun" in child.name()]


def test_the_page_loads_only_from_here(address: str) -> None:
    page, headers = fetched(address)
    assert b"://" not in page
    policy = dict(part.split(" ", 1) for part in headers["Content-Security-Policy"].split("; "))
    assert policy["default-src"] == "'self'"
    assert not any("http" in sources or "*" in sources for sources in policy.values())


@pytest.mark.parametrize(
    ("name", "kind", "start"),
    [
        ("start.js", "text/javascript", b"//"),
        ("page.css", "text/css", b"html"),
        ("re_viewer.js", "text/javascript", b""),
        ("re_viewer_bg.wasm", "application/wasm", b"\0asm"),
        ("recording.rrd", "application/octet-stream", b"RRF"),
        ("playhead", "application/octet-stream", b"\x32"),
    ],
)
def test_its_files(address: str, name: str, kind: str, start: bytes) -> None:
    content, headers = fetched(address + name)
    assert content.startswith(start)
    assert headers["Content-Type"].startswith(kind if name != "playhead" else "")
    assert int(headers["Content-Length"]) == len(content) > 0


@pytest.mark.parametrize(("path", "host"), [("etc/passwd", "127.0.0.1:1"), ("", "evil.example:80")])
def test_other_paths_and_other_names_are_turned_away(address: str, path: str, host: str) -> None:
    with pytest.raises(urllib.error.HTTPError, match="404"):
        fetched(address + path, Host=host)


def test_a_taken_port_gives_another(address: str, no_ball: ViewedRun) -> None:
    with served(no_ball, "all") as (_, second):
        assert second != address


def test_it_opens_where_a_spin_is_first_trusted(flight: ViewedRun, no_ball: ViewedRun) -> None:
    first = next(tick for tick in flight.ticks if tick.best is not None)
    assert flight.opening_us == first.packet.end_us > flight.first_sight_us
    assert no_ball.opening_us == no_ball.first_sight_us == no_ball.ticks[0].packet.end_us


def test_the_playhead_goes_where_the_run_opens(flight: ViewedRun) -> None:
    """Decoded as protobuf: {6: {2: {1: "t"}, 3: {1: nanoseconds}, 5: 1 (paused)}}."""
    cursor = fields(fields(playhead_request(flight.opening_us))[6])
    assert fields(cursor[2]) == {1: b"t"}
    assert fields(cursor[3]) == {1: flight.opening_us * 1000}
    assert cursor[5] == 1
    negative = fields(fields(fields(playhead_request(-1))[6])[3])[1]
    assert negative == 2**64 - 1000


def fields(message: bytes) -> dict[int, bytes | int]:
    """The fields of a protobuf message, by number."""
    found: dict[int, bytes | int] = {}
    at = 0

    def number() -> int:
        nonlocal at
        value = shift = 0
        while True:
            byte = message[at]
            at += 1
            value |= (byte & 0x7F) << shift
            shift += 7
            if byte < 0x80:
                return value

    while at < len(message):
        key = number()
        value = number()
        if key & 7 == 2:
            found[key >> 3] = message[at : at + value]
            at += value
        else:
            found[key >> 3] = value
    return found


def test_ctrl_c_ends_it(
    no_ball: ViewedRun, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("http.server.ThreadingHTTPServer.serve_forever", interrupted)
    monkeypatch.setattr("spinscope.app.viewer.web._open_browser", lambda _: False)
    from spinscope.app.viewer.web import show_web

    show_web(no_ball, "all")
    (line, _) = capsys.readouterr().err.split("\n", 1)
    assert "http://127.0.0.1:" in line
    assert "--save" in line


def test_no_display_no_window(no_ball: ViewedRun, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(SpinscopeError, match=r"no display.*--native.*--save"):
        show_native(no_ball, "all")
    assert callable(show)
