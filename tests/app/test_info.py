"""`spinscope info` through the real command line."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np


def spinscope(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "spinscope", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)


def test_the_users_sensor_beats_the_guess(tmp_path: Path) -> None:
    """A recording without a stated size, whose events would fit on a smaller sensor."""
    path = tmp_path / "unstated.npz"
    np.savez(path, t=np.arange(5), x=np.arange(5, dtype=np.uint16), y=np.zeros(5, np.uint16), p=np.ones(5, np.uint8))
    guessed, stated = (
        spinscope("info", path, "--json", "-"),
        spinscope("info", path, "--sensor", "640x480", "--json", "-"),
    )
    assert json.loads(guessed.stdout)["width"] < 640
    report = json.loads(stated.stdout)
    assert (report["width"], report["height"], report["events"], report["duration_us"]) == (640, 480, 5, 4)
    assert report["on_share"] == 1.0 and report["format"] == "NPZ"


def test_the_table_for_people_has_the_same(samples: Path) -> None:
    done = spinscope("info", samples / "flight_back.h5")
    assert done.returncode == 0
    for text in ("1280 x 720 px", "Mev/s", "ON share", "damage"):
        assert text in done.stdout


def test_a_file_that_is_no_recording_is_one_line(samples: Path) -> None:
    done = spinscope("info", samples / "README.md")
    assert done.returncode == 2 and done.stdout == "" and done.stderr.count("\n") == 1
