"""Sidecars: found by name, between the command line and the file, wrong ones refused in words."""

from __future__ import annotations

import math
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from spinscope.pipeline.biases import FACTORY, PAPER, write_biases
from spinscope.pipeline.errors import ParameterError, RecordingError
from spinscope.pipeline.session import Choices, Session
from spinscope.pipeline.sidecar import Sidecar, StatedTruth, biases_beside


def beside(folder: Path, text: str | bytes) -> Sidecar:
    (folder / "shot.toml").write_bytes(text.encode() if isinstance(text, str) else text)
    return Sidecar.beside(folder / "shot.raw")


def test_all_tables_are_read(tmp_path: Path) -> None:
    sidecar = beside(
        tmp_path,
        "\ufeff[camera]\nfocal_length_mm = 16\nup = [0, -1, 0]\n[ball]\ndiameter_mm = 40.2\n"
        "[fixed_ball]\nx_px = 1\ny_px = 2.5\nradius_px = 20\n[biases]\nbias_fo = -5\ndiff_on = 7\n"
        '[truth]\naxis = [0, 3, 4]\nrps = 50\nspin_std_rps = 0.1\nball = 3\nspeed_m_s = 7\nsetting = "wheel 3"\n',
    )
    assert sidecar.parameters == {
        "camera.focal_length_mm": 16.0,
        "camera.up": (0.0, -1.0, 0.0),
        "ball.diameter_mm": 40.2,
    }
    assert sidecar.fixed_ball == (1.0, 2.5, 20.0)
    assert sidecar.biases == replace(PAPER, fo=-5, diff_on=7)
    truth = sidecar.truth
    assert truth is not None and truth.spin_rps == pytest.approx((0, 30, 40)) and truth.rps == 50
    assert (truth.spin_std_rps, truth.ball, truth.speed_m_s, truth.setting) == (0.1, 3, 7.0, "wheel 3")


def test_truth_is_a_vector_an_axis_with_a_magnitude_or_a_magnitude() -> None:
    assert StatedTruth.of({"spin_rps": [3, 4, 0]}).rps == 5
    assert StatedTruth.of({"rps": 51.5}).spin_rps is None
    spin = StatedTruth.of({"axis": [0, 0, -2], "rps": 10}).spin_rps
    assert spin is not None and math.isclose(spin[2], -10)


def test_without_a_file_there_is_nothing(tmp_path: Path) -> None:
    assert Sidecar.beside(tmp_path / "shot.raw") == Sidecar()
    assert biases_beside(tmp_path / "shot.raw") is None


@pytest.mark.parametrize(
    ("text", "error", "words"),
    [
        ("[camera]\nfocal = 16\n", ParameterError, "camera.focal is unknown.*focal_length_mm"),
        ("[camera]\nfocal_length_mm = 0\n", ParameterError, "camera.focal_length_mm"),
        ("[cam]\n", ParameterError, r"no table \[cam\].*camera"),
        ("camera = 3\n", ParameterError, "not a table"),
        ("[fixed_ball]\nx_px = 1\n", ParameterError, "give x_px, y_px, radius_px"),
        ("[fixed_ball]\nx_px = 1\ny_px = nan\nradius_px = 3\n", ParameterError, "fixed_ball.y_px = nan"),
        ("[truth]\nball = 3\n", ParameterError, "states no spin"),
        ("[truth]\naxis = [0, 0, 1]\n", ParameterError, "goes with truth.rps"),
        ("[truth]\naxis = [0, 0, 0]\nrps = 3\n", ParameterError, "goes with truth.rps"),
        ("[truth]\nspin_rps = [0, 0, 1]\nrps = 3\n", ParameterError, "give one of them"),
        ("[truth]\nspin_rps = [0, 1]\n", ParameterError, "three numbers"),
        ("[truth]\nrps = -3\n", ParameterError, "0 or more"),
        ("[truth]\nrps = 3\nball = 8\n", ParameterError, "1 to 7"),
        ("[truth]\nball = 0x1" + 4000 * "0" + "\nrps = 3\n", ParameterError, "too large"),
        ("[truth]\nrps = 0x1" + 400 * "0" + "\n", ParameterError, "too large"),
        ("[truth]\nrps = 3\nball = 8\n", ParameterError, "1 to 7"),
        ("[truth]\nball = 0x1" + 4000 * "0" + "\nrps = 3\n", ParameterError, "too large"),
        ("[truth]\nrps = 0x1" + 400 * "0" + "\n", ParameterError, "too large"),
        ('[truth]\nrps = "fast"\n', ParameterError, "give a number"),
        ("[truth]\nrp = 3\n", ParameterError, "truth.rp is unknown.*rps"),
        ("[biases]\nfoo = 3\n", ParameterError, "foo"),
        ("[truth\n", RecordingError, "no TOML"),
        (b"\xff\xfe\x00", RecordingError, "decode"),
        ("a = " + "[" * 50_000, RecordingError, "nested too deep"),
        ("a" + ".a" * 49_000 + " = 1", RecordingError, "49000 dots"),
        ("a = 1" + "0" * 5000, RecordingError, "an integer of thousands of digits"),
        ("#" * 2_000_000, RecordingError, "over 1.05 MB"),
    ],
)
def test_wrong_sidecars_are_refused_in_words(
    tmp_path: Path, text: str | bytes, error: type[Exception], words: str
) -> None:
    with pytest.raises(error, match=words) as caught:
        beside(tmp_path, text)
    assert str(caught.value).endswith("shot.toml") and "\n" not in str(caught.value)


def test_command_line_beats_sidecar_beats_file(tmp_path: Path, samples: Path) -> None:
    recording = tmp_path / "shot.h5"
    shutil.copy(samples / "own" / "spinner_top.h5", recording)
    stated = Session.open(recording)
    assert stated.parameters.track.ball != "fixed"
    (tmp_path / "shot.toml").write_text(
        "[camera]\nfocal_length_mm = 16\n[ball]\ndiameter_mm = 41\n"
        "[fixed_ball]\nx_px = 300\ny_px = 200\nradius_px = 20\n"
    )
    session = Session.open(recording)
    parameters = session.parameters
    assert (parameters.camera.focal_length_mm, parameters.ball.diameter_mm) == (16.0, 41.0)
    assert (parameters.track.ball, parameters.track.fixed_x_px) == ("fixed", 300.0)
    choices = Choices(assignments=["camera.focal_length_mm=12"], fixed_ball=(310.0, 200.0, 20.0))
    parameters = Session.open(recording, choices).parameters
    assert (parameters.camera.focal_length_mm, parameters.track.fixed_x_px) == (12.0, 310.0)


def test_a_bias_file_goes_before_the_table(tmp_path: Path) -> None:
    beside(tmp_path, "[biases]\nfo = 3\n")
    assert biases_beside(tmp_path / "shot.raw") == replace(PAPER, fo=3)
    write_biases(FACTORY, tmp_path / "shot.bias")
    assert biases_beside(tmp_path / "shot.raw") == FACTORY
