"""The page's JavaScript: formatted, linted, and type-checked against the messages of the server, by Deno's wheel."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from .message_types import TARGET, declarations

WEB = Path(__file__).parents[3] / "app/web"
DENO = Path(sys.executable).parent / "deno"


def deno(command: str, folder: Path, cache: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a command of Deno over a web folder, without any request to the network."""
    offline = {
        "DENO_NO_UPDATE_CHECK": "1",
        "DENO_DIR": str(cache),
        "NO_COLOR": "1",
        "HTTPS_PROXY": "http://127.0.0.1:9",
    }
    sources = [str(path) for path in sorted((folder / "static").rglob("*.js"))] if command == "check" else []
    return subprocess.run(
        [DENO, command, "--config", "deno.json", *arguments, *sources],
        cwd=folder,
        env={**os.environ, **offline},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.parametrize("command", ["check", "lint", "fmt"])
def test_tool_has_nothing_to_say(command: str, tmp_path: Path) -> None:
    done = deno(command, WEB, tmp_path, *(["--check"] if command == "fmt" else []))
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_types_of_the_messages_are_up_to_date() -> None:
    assert TARGET.read_text(encoding="utf-8") == declarations(), "run `python -m tests.app.web.message_types`"


def test_messages_that_the_server_does_not_know_are_found(tmp_path: Path) -> None:
    shutil.copytree(WEB, tmp_path / "web", ignore=shutil.ignore_patterns("*.py", "__pycache__"))
    for file, right, wrong in (
        ("bar.js", "total_ms", "total"),
        ("results.js", "differences", "differs"),
        ("optimization.js", "objective: this.objective.value", "goal: this.objective.value"),
        ("sweep.js", 'connection.on("sweep"', 'connection.on("curve"'),
        ("biases.js", "point.recording", "point.file"),
    ):
        path = tmp_path / "web/static" / file
        text = path.read_text(encoding="utf-8")
        assert right in text
        path.write_text(text.replace(right, wrong), encoding="utf-8")
    done = deno("check", tmp_path / "web", tmp_path / "cache")
    found = set(re.findall(r"/static/([a-z]+\.js):", done.stderr))
    assert done.returncode != 0
    assert found == {"bar.js", "results.js", "optimization.js", "sweep.js", "biases.js"}, done.stderr
