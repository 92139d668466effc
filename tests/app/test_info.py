"""`spinscope info` from the command line."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from spinscope.pipeline.recordings import write_recording
from tests.command_line import spinscope
from tests.pipeline.recordings.test_recordings_raw import moving_edge


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


def test_a_folder_is_a_table_with_one_line_a_recording(tmp_path: Path) -> None:
    for name, events in (("a.raw", 300), ("sub/b.csv", 200)):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        write_recording(tmp_path / name, moving_edge(events), width_px=1280, height_px=720)
    (tmp_path / "c.npz").write_bytes(b"no zip at all")
    (tmp_path / "notes.txt").write_text("nothing", encoding="utf-8")
    done = spinscope("info", tmp_path, "--sensor", "1280x720")
    lines = done.stdout.splitlines()
    assert done.returncode == 2 and done.stderr == ""
    assert lines[0].split()[:2] == ["recording", "format"] and len(lines) == 5
    for line, words in zip(lines[1:], (["EVT3 RAW", "300"], ["unreadable"], ["text", "200"], []), strict=True):
        assert all(word in line for word in words)
    assert lines[4].startswith(f"error: {tmp_path / 'c.npz'}: file named .npz is no NPZ")
    found = [json.loads(line) for line in spinscope("info", tmp_path, "--json", "-").stdout.splitlines()]
    assert [one.get("events") for one in found] == [300, None, 200] and "error" in found[1]
