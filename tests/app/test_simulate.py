"""`spinscope simulate` on the command line."""

from __future__ import annotations

import json
from pathlib import Path

from click.testing import CliRunner

from spinscope.app.cli import cli
from spinscope.pipeline.biases import BiasParameters, write_biases
from spinscope.pipeline.errors import ParameterError, RecordingError
from spinscope.pipeline.recordings import open_recording
from spinscope.pipeline.simulated_recordings import BIASES, simulate_to_file

SENSITIVE = BiasParameters(diff_on=0, diff_off=0)  # lower thresholds: more events
SMALL = ["--width-px", "240", "--height-px", "160", "--seed", "5", "--duration-ms", "10"]


def test_options_reach_the_scene(tmp_path: Path) -> None:
    write_biases(SENSITIVE, tmp_path / "sensitive.bias")
    out, twin = tmp_path / "ball.h5", tmp_path / "twin.h5"
    call = ["simulate", "spinner", "--out", str(out), "--spin-rps", "10", "0", "-20", "--logo", "line_1.4mm", *SMALL]
    done = CliRunner().invoke(cli, [*call, "--biases", str(tmp_path / "sensitive.bias")])
    assert done.exit_code == 0, done.output
    simulate_to_file(
        "spinner",
        twin,
        spin_rps=(10.0, 0.0, -20.0),
        logo="line_1.4mm",
        biases=SENSITIVE,
        width_px=240,
        height_px=160,
        seed=5,
        duration_ms=10.0,
    )
    assert out.read_bytes() == twin.read_bytes()
    missing = CliRunner().invoke(cli, [*call, "--biases", str(tmp_path / "missing.bias")])
    assert isinstance(missing.exception, RecordingError | ParameterError)
    assert "bias file cannot be read" in str(missing.exception)


def test_scene_again_on_the_command_line(tmp_path: Path) -> None:
    first, again = tmp_path / "first.h5", tmp_path / "again.h5"
    simulate_to_file("spinner", first, duration_ms=10.0, width_px=240, height_px=160, seed=5)
    write_biases(SENSITIVE, tmp_path / "sensitive.bias")
    call = [
        "simulate",
        "again",
        "--scene",
        str(first),
        "--biases",
        str(tmp_path / "sensitive.bias"),
        "--out",
        str(again),
    ]
    done = CliRunner().invoke(cli, call)
    assert done.exit_code == 0, done.output
    assert json.loads(str(open_recording(again).attributes[BIASES])) == SENSITIVE.as_dict()
    for wrong, words in (
        (["simulate", "again", "--out", str(again)], "go together"),
        (["simulate", "flight", "--scene", str(first), "--out", str(again)], "go together"),
        ([*call, "--speed-m-s", "5"], "speed_m_s does not belong"),
    ):
        refused = CliRunner().invoke(cli, wrong)
        assert isinstance(refused.exception, ParameterError) and words in str(refused.exception)
