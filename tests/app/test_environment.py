"""Surroundings of the command line: full disks, code pages without the letters, few open files."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from spinscope.app.terminal import ProgressBar

SAMPLE = "spinner_ball5_back_no_logo.h5"


def run(*arguments: str, **options: object) -> subprocess.CompletedProcess[bytes]:
    command = [sys.executable, "-m", "spinscope", *arguments]
    done = subprocess.run(command, stderr=subprocess.PIPE, check=False, **options)  # type: ignore[call-overload]
    # The first run on a machine, or beside another one, says that it compiles.
    done.stderr = b"".join(line for line in done.stderr.splitlines(True) if not line.startswith(b"compiling "))
    return done  # type: ignore[no-any-return]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full on this system")
def test_a_full_disk_behind_standard_output_is_one_line(samples: Path) -> None:
    with open("/dev/full", "wb") as full:
        done = run("info", str(samples / SAMPLE), stdout=full)
    assert done.returncode == 2
    assert done.stderr == b"spinscope: the output cannot be written (No space left on device): check free space\n"


def test_letters_that_the_code_page_lacks_appear_as_escapes(samples: Path, tmp_path: Path) -> None:
    path = tmp_path / "запись.h5"
    shutil.copy(samples / SAMPLE, path)
    environment = {**os.environ, "PYTHONIOENCODING": "cp1252"}
    done = run("info", str(path), stdout=subprocess.PIPE, env=environment)
    assert done.returncode == 0 and not done.stderr and rb"\u0437\u0430" in done.stdout
    path.unlink()
    done = run("info", str(path), stdout=subprocess.PIPE, env=environment)
    assert done.returncode == 2 and b"does not exist" in done.stderr and rb"\u0437\u0430" in done.stderr


@pytest.mark.slow
def test_64_open_files_are_enough(samples: Path) -> None:
    resource = pytest.importorskip("resource")

    def few() -> None:
        resource.setrlimit(resource.RLIMIT_NOFILE, (64, 64))

    ball = ["--fixed-ball", "606.67", "302.79", "16.47", "--method", "contrast"]
    done = run("analyze", str(samples / SAMPLE), *ball, stdout=subprocess.PIPE, preexec_fn=few)
    assert done.returncode == 0, done.stderr


def test_progress_in_a_log_is_a_line_now_and_then(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    seconds = iter(range(0, 1000, 10))
    clock = SimpleNamespace(perf_counter=lambda: float(next(seconds)))
    monkeypatch.setattr("spinscope.app.terminal.time", clock)
    with ProgressBar() as bar:
        for number in range(1, 10):
            bar(number / 9, f"{number} of 9 recordings")
    lines = capfd.readouterr().err
    assert lines == "3 of 9 recordings: 33%\n6 of 9 recordings: 67%\n9 of 9 recordings: 100%\n"
