"""The command line's way to the tuner."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import httpx
import pytest
from click.testing import CliRunner

from spinscope.app.cli import cli
from spinscope.pipeline.session import DEFAULT_SAMPLE, Choices


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Any, ...]]:
    """What the command line asks the tuner to serve, instead of serving it."""
    found: list[tuple[Any, ...]] = []
    monkeypatch.setattr(
        "spinscope.app.web.serve", lambda *given, **named: found.append((*given, named["open_browser"]))
    )
    return found


def test_without_a_command_the_default_sample_is_tuned(asked: list[tuple[Any, ...]]) -> None:
    assert CliRunner().invoke(cli, []).exit_code == 0
    assert asked == [(DEFAULT_SAMPLE, Choices(), None, True)]
    assert DEFAULT_SAMPLE.is_file()


def test_the_options_of_tune_are_handed_on(asked: list[tuple[Any, ...]]) -> None:
    arguments = ["tune", "shot.h5", "--port", "0", "--no-browser", "--set", "logo.pad_px=3", "--window", "5", "9"]
    assert CliRunner().invoke(cli, arguments).exit_code == 0
    path, choices, port, open_browser = asked[0]
    assert (path, port, open_browser) == (Path("shot.h5"), 0, False)
    assert choices == Choices(assignments=("logo.pad_px=3",), window_us=(5, 9))


def test_the_address_is_one_line_and_ctrl_c_leaves_nothing_running(samples: Path) -> None:
    command = [
        sys.executable,
        "-m",
        "app",
        "tune",
        str(samples / "spinner_ball2_side.h5"),
        "--no-browser",
        "--port",
        "0",
    ]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    address = process.stdout.readline().strip()
    answer = httpx.get(address, timeout=30)
    assert answer.status_code == 200 and address.startswith("http://127.0.0.1:")
    process.send_signal(signal.SIGINT)
    rest, errors = process.communicate(timeout=60)
    assert process.returncode == 0 and rest == "" and "Traceback" not in errors
    with pytest.raises(httpx.ConnectError):
        httpx.get(address, timeout=5)
