"""Commands that serve the page: `tune`, `view`, and none."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import webbrowser
from pathlib import Path
from typing import Any

import httpx
import pytest
from click.testing import CliRunner

from spinscope.app.cli import cli
from spinscope.app.web.server import listening_socket, show_in_browser
from spinscope.pipeline.errors import ParameterError, RecordingError
from spinscope.pipeline.session import DEFAULT_SAMPLE, Choices


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[tuple[tuple[Any, ...], dict[str, Any]]]:
    """What the command line asks the web application to serve, instead of serving it."""
    found: list[tuple[tuple[Any, ...], dict[str, Any]]] = []
    monkeypatch.setattr("spinscope.app.web.serve", lambda *given, **named: found.append((given, named)))
    return found


def test_without_a_command_the_default_sample_is_tuned(asked: list[Any]) -> None:
    assert CliRunner().invoke(cli, []).exit_code == 0
    assert asked == [((DEFAULT_SAMPLE, Choices()), {})]
    assert DEFAULT_SAMPLE.is_file()


def test_the_options_of_tune_are_handed_on(asked: list[Any], tmp_path: Path) -> None:
    shot = tmp_path / "shot.h5"
    shot.touch()
    arguments = ["tune", str(shot), "--port", "0", "--no-browser", "--set", "logo.pad_px=3", "--window", "5", "9"]
    arguments += ["--allow-host", "lab.example", "--allow-host", "proxy.example"]
    assert CliRunner().invoke(cli, arguments).exit_code == 0
    choices = Choices(assignments=("logo.pad_px=3",), window_us=(5, 9))
    page = {"port": 0, "open_browser": False, "hosts": ("lab.example", "proxy.example")}
    assert asked == [((shot, choices), {**page, "folders": [tmp_path]})]


def test_tune_takes_folders_and_opens_the_first_recording_that_can_be_read(
    asked: list[Any], samples: Path, tmp_path: Path
) -> None:
    (tmp_path / "day/early").mkdir(parents=True)
    (tmp_path / "day/a.h5").write_bytes(b"damaged")
    shutil.copy(samples / "flight_back.h5", tmp_path / "day/early/shot.h5")
    folders = [tmp_path / "day", samples]
    assert CliRunner().invoke(cli, ["tune", *map(str, folders)]).exit_code == 0
    (shown, _), options = asked[0]
    assert shown == tmp_path / "day/early/shot.h5" and options["folders"] == folders
    for wrong, said in ((tmp_path / "none", "there is no such"), (tmp_path / "empty", "no recording that can be read")):
        (tmp_path / "empty").mkdir(exist_ok=True)
        result = CliRunner().invoke(cli, ["tune", str(wrong)])
        assert isinstance(result.exception, RecordingError) and said in str(result.exception)


def test_view_serves_the_page_without_tools(asked: list[Any]) -> None:
    arguments = ["view", "shot.h5", "--layout", "spin", "--set", "logo.pad_px=3", "--port", "0"]
    assert CliRunner().invoke(cli, arguments).exit_code == 0
    page = {"port": 0, "open_browser": True, "hosts": ()}
    assert asked == [
        (
            (Path("shot.h5"), Choices(assignments=("logo.pad_px=3",))),
            {**page, "tools": False, "layout": "spin", "followed": None},
        )
    ]


def started(*arguments: str) -> subprocess.Popen[str]:
    no_window = {
        key: value for key, value in os.environ.items() if key not in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")
    }
    command = [sys.executable, "-m", "spinscope", *arguments]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=no_window)


def test_the_address_is_one_line_and_ctrl_c_leaves_nothing_running(samples: Path) -> None:
    process = started("tune", str(samples / "spinner_ball2_side.h5"), "--no-browser", "--port", "0")
    assert process.stdout is not None
    address = process.stdout.readline().strip()
    bare, _, token = address.partition("?token=")
    port = bare.rpartition(":")[2].strip("/")
    assert bare == f"http://127.0.0.1:{port}/" and len(token) >= 32
    assert httpx.get(address, timeout=240).status_code == 200
    assert httpx.get(bare, timeout=240).status_code == 401
    process.send_signal(signal.SIGINT)
    rest, errors = process.communicate(timeout=240)
    assert process.returncode == 0 and rest == "" and "Traceback" not in errors
    assert f"ssh -L {port}:127.0.0.1:{port}" in errors
    with pytest.raises(httpx.ConnectError):
        httpx.get(address, timeout=5)


def test_view_says_where_it_is_and_how_to_get_there_without_a_browser(samples: Path) -> None:
    process = started("view", str(samples / "spinner_ball2_side.h5"), "--layout", "coach")
    assert process.stderr is not None
    line = next(line for line in process.stderr if "http://" in line)
    found = re.fullmatch(
        r"the viewer is at (http://127\.0\.0\.1:(\d+)/)\?token=(\S+) \(no browser here: "
        r"`ssh -L \2:127\.0\.0\.1:\2 THIS_MACHINE` .*"
        r"`--save FILE\.rrd` .*\); Ctrl-C stops it\n",
        line,
    )
    assert found, line
    headers = {"authorization": f"token {found[3]}"}
    opening = httpx.post(f"{found[1]}api/sessions", json={}, headers=headers, timeout=240).json()
    assert opening["tools"] is False and opening["tab"] == "Coach"
    process.send_signal(signal.SIGINT)
    written, errors = process.communicate(timeout=240)
    assert process.returncode == 0 and written == "" and "Traceback" not in errors


class GraphicalBrowser(webbrowser.BackgroundBrowser):
    def open(self, url: str, new: int = 0, autoraise: bool = True) -> bool:
        return True


@pytest.mark.parametrize(
    ("variable", "found", "expected"),
    [
        (None, GraphicalBrowser("browser"), False),
        ("DISPLAY", GraphicalBrowser("browser"), True),
        ("DISPLAY", webbrowser.GenericBrowser("lynx"), False),  # a text browser would take the terminal
        ("DISPLAY", None, False),
    ],
)
def test_only_a_graphical_browser_is_opened(
    monkeypatch: pytest.MonkeyPatch, variable: str | None, found: Any, expected: bool
) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"):
        monkeypatch.delenv(name, raising=False)
    if variable:
        monkeypatch.setenv(variable, ":0")

    def get() -> Any:
        if found is None:
            raise webbrowser.Error("could not locate runnable browser")
        return found

    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.setattr("webbrowser.get", get)
    monkeypatch.setattr("shutil.which", lambda _: None)
    assert show_in_browser("http://127.0.0.1:1/") is expected


def test_a_busy_port_gives_another_and_an_impossible_one_is_refused() -> None:
    with listening_socket(0) as first, listening_socket(first.getsockname()[1]) as second:
        assert {first.getsockname()[0], second.getsockname()[0]} == {"127.0.0.1"}
        assert first.getsockname()[1] != second.getsockname()[1]
    with pytest.raises(ParameterError, match="out of range"):
        listening_socket(70_000)
